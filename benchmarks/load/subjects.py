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

"""What a dispatch costs by the number of tasks."""

from __future__ import annotations

from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.subjects.operation_cost import job_costs_ns


def dispatch_curve(harness: Harness) -> Measurement:
    """Measure the CPU time of a job for several numbers of ``tasks`` released together."""
    a = harness.arguments
    harness.prepare(freeze=True)
    return Measurement({str(tasks): job_costs_ns(a, tasks) for tasks in a['tasks']})
