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
The helper tasks of a task with logical execution time, see :mod:`rt_robot_os.kernel.logical`.

They are two tasks above all priorities: at each instant first all outputs that are due are
published, then all inputs are fixed, then ordinary jobs run.
"""

from __future__ import annotations

from rt_robot_os.kernel.logical import Logical
from rt_robot_os.kernel.releases import LEVEL_INPUTS
from rt_robot_os.kernel.releases import LEVEL_OUTPUTS
from rt_robot_os.kernel.releases import Releases
from rt_robot_os.kernel.spec import TaskSpec
from rt_robot_os.kernel.task import Task


class LogicalTasks:
    """
    The helper tasks of one task.

    :ivar tasks: the helper tasks, to be added after it.
    """

    __slots__ = ('tasks', '_kernel', '_task', '_logical', '_releaser', '_publisher')

    def __init__(self, kernel: Releases, task: Task, logical: Logical) -> None:
        self._kernel = kernel
        self._task = task
        self._logical = logical
        spec = task.spec
        grid = TaskSpec(f'{task.name}/inputs', 99, spec.period_ns, spec.phase_ns)
        self._releaser = Task(grid, self._release, task.index + 1)
        self._publisher = Task(TaskSpec(f'{task.name}/outputs', 99), self._publish,
                               task.index + 2)
        self._releaser.priority, self._publisher.priority = LEVEL_INPUTS, LEVEL_OUTPUTS
        self.tasks = (self._releaser, self._publisher)

    def _release(self) -> None:
        """Fix the inputs and release the task, unless its previous job is unfinished."""
        kernel, task, releaser = self._kernel, self._task, self._releaser
        releaser.period_ns = task.period_ns  # the rate may have been changed
        kernel.locked = True
        task.releases += 1
        if task.busy or task.pending:
            task.missed += 1
            task.overruns += 1
        else:
            self._logical.begin()
            release_ns = releaser.release_ns
            kernel.release_due(task.priority, release_ns)  # earlier releases go first
            kernel.enqueue(task, release_ns, task.period_ns)
            kernel.schedule(release_ns + task.deadline_ns, self._end, LEVEL_OUTPUTS)
        kernel.locked = False

    def _end(self, now_ns: int) -> None:
        self._kernel.arrive(self._publisher, now_ns)

    def _publish(self) -> None:
        self._logical.end(in_time=not (self._task.busy or self._task.pending))
