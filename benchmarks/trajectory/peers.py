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

"""The control loop of the second paper as a timer of a node, in rclpy's executors."""

from __future__ import annotations

import time

from benchmarks.trajectory.subjects import drive_of
from benchmarks.trajectory.subjects import made
from benchmarks.trajectory.subjects import measured
from benchmarks.trajectory.subjects import work
from benchmarks.trajectory.subjects import WORK_PERIOD_NS
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.subjects.rclpy_graph import graph


def executor(harness: Harness) -> Measurement:
    """Run the loop and ``inside`` workload timers in one node, the loop first."""
    a = harness.arguments
    loop = made(a)
    harness.prepare()
    with graph(a['executor']) as tested:
        loop.prepare(time.monotonic_ns())

        def control() -> None:
            loop.cycle()
            if loop.over:
                tested.end()

        tested.timer(drive_of(a).period_ns, control)
        for _ in range(a['inside']):
            tested.timer(WORK_PERIOD_NS, work)
        tested.spin(a['limit_ns'])
        return measured(loop)
