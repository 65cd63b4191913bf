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

"""
Schedulability: will every task of a robot end before its deadline.

The analysis (``PlannedTask``, ``analyse``, ``load_margins``, ``lowest_peak``) knows nothing of
settings. ``robot`` makes tasks of settings, ``measure`` measures execution times, ``program`` is
what `ros2 run rt_robot_os plan` runs. Nothing here is for the real-time loop.
"""

from rt_robot_os.tools.plan.analysis import analyse
from rt_robot_os.tools.plan.result import Analysis
from rt_robot_os.tools.plan.result import TaskResult
from rt_robot_os.tools.plan.result import Verdict
from rt_robot_os.tools.plan.task import Event
from rt_robot_os.tools.plan.task import Overhead
from rt_robot_os.tools.plan.task import PlannedTask

__all__ = ['analyse', 'Analysis', 'Event', 'Overhead', 'PlannedTask', 'TaskResult', 'Verdict']
