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
Logical execution time: inputs as of the release, outputs at the deadline, whatever comes between.

Henzinger, Horowitz, Kirsch: Giotto, 2003. What a task reads and when others see what it wrote no
longer depend on how long it computes or on who preempts it: the robot behaves on a loaded machine
as it did on an idle one, at the price of one deadline of delay.

Two helpers above all priorities do it: at each instant first all outputs that are due are
published, then all inputs are fixed, then ordinary jobs run.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from rt_robot_os.kernel.task import Task
from rt_robot_os.kernel.task import TaskSpec

if TYPE_CHECKING:
    from rt_robot_os.kernel.scheduler import Scheduler


class Logical:
    """
    What belongs to a task with logical execution time.

    :ivar late: jobs that had not ended at their deadline; their outputs are not published.
    :ivar inputs: called at each release, before the job.
    :ivar outputs: called at each deadline with True to publish, with False to discard.
    """

    __slots__ = ('task', 'late', 'inputs', 'outputs', 'helpers', '_kernel', '_publisher',
                 '_overdue')

    def __init__(self, kernel: Scheduler, task: Task, levels: tuple[int, int]) -> None:
        self.task = task
        self.late = 0
        self._overdue = False
        self.inputs: list[Callable[[], None]] = []
        self.outputs: list[Callable[[bool], None]] = []
        self._kernel = kernel
        spec = task.spec
        grid = TaskSpec(f'{task.name}/inputs', 99, spec.period_ns, spec.phase_ns)
        releaser = Task(grid, self._release, task.index + 1)
        self._publisher = Task(TaskSpec(f'{task.name}/outputs', 99), self._publish,
                               task.index + 2)
        releaser.priority, self._publisher.priority = levels
        self.helpers = (releaser, self._publisher)

    def _release(self) -> None:
        """Fix the inputs and release the task, unless its job before is not finished."""
        kernel, task, releaser = self._kernel, self.task, self.helpers[0]
        releaser.period_ns = task.period_ns  # it may have been changed
        kernel.locked = True
        task.releases += 1
        if task.busy or task.pending:
            task.missed += 1
            task.overruns += 1
        else:
            if self._overdue:  # what its job published after the deadline
                self._overdue = False
                for output in self.outputs:
                    output(False)
            for fix in self.inputs:
                fix()
            release_ns = releaser.release_ns
            kernel._take_in(task.priority, release_ns)  # what came before
            kernel._queue(task, release_ns, task.period_ns)
            kernel._schedule(
                release_ns + task.deadline_ns, self._end, self._publisher.priority)
        kernel.locked = False

    def _end(self, now_ns: int) -> None:
        self._kernel._arrive(self._publisher, now_ns)

    def _publish(self) -> None:
        late = self.task.busy or self.task.pending
        self.late += late
        self._overdue = late
        for output in self.outputs:
            output(not late)
