# Copyright 2026 The rt_robot_os authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""A periodic callback over one that computes, in rclpy's executors."""

from __future__ import annotations

import sys
import time

from rt_robot_os.tools.bench.cases.preemption.subjects import PreemptionWork
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.subjects.rclpy_graph import graph


def executor(harness: Harness) -> Measurement:
    """
    Run all as timers of one node.

    The real-time set-up comes first, so that the threads of the middleware inherit it.
    """
    a = harness.arguments
    work = PreemptionWork(a)
    harness.prepare()
    if a['switch_interval_s']:
        sys.setswitchinterval(a['switch_interval_s'])
    with graph(a['executor']) as tested:
        timer = tested.timer(a['period_ns'], work.fast)
        # The timer's grid; asked a few times, as something may come between the two clocks.
        phase_ns = min(time.monotonic_ns() + timer.time_until_next_call() for _ in range(5))
        if a['middle_period_ns']:
            tested.timer(a['middle_period_ns'], work.middle)
        tested.timer(a['busy_period_ns'], work.busy)
        tested.spin(work.total_ns)
    return work.measured(phase_ns)
