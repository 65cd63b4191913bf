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

"""What a task took of the time, whatever a busy machine left to it."""

from __future__ import annotations

from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import Task


def took_little(kernel: Kernel, task: Task) -> bool:
    """
    Whether a task left most of a run to others, however slow the machine was.

    What its jobs waited in calls counts, what Linux took from them does not. Ask at the end of a
    run in which the task's statistics began.
    """
    return task.execution_total_ns * 4 < kernel.statistics().elapsed_ns
