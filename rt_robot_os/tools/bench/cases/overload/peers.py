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
"""Twenty timers that ask for more and more of the CPU, in rclpy's executors."""

from __future__ import annotations

from rt_robot_os.tools.bench.cases.overload.subjects import figures
from rt_robot_os.tools.bench.cases.overload.subjects import OverloadCallbacks
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.subjects.rclpy_graph import graph


def executor(harness: Harness) -> Measurement:
    """Run all as timers of one node, the most important first."""
    a = harness.arguments
    harness.prepare()

    def run(crowd: OverloadCallbacks) -> None:
        with graph(a['executor']) as tested:
            crowd.over = tested.end
            for job in crowd.jobs:
                tested.timer(crowd.period_ns, job)
            tested.spin(crowd.measure_ns)

    return figures(a, run)
