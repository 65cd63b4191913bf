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


"""The exception that ends a job which used up its budget, or does not end when all shall."""

from __future__ import annotations

from rt_robot_os.units import NS_PER_US


class TaskAborted(BaseException):
    """
    The job has used up its budget, or goes on while the kernel stops.

    Raised inside it, at its next preemption point. It is no :class:`Exception`, so that ``except
    Exception`` lets it through, as it does with KeyboardInterrupt. A job may clean up in
    ``finally``; one that goes on computing is struck again, and its task is stopped.

    :param why: when it is not the budget.
    :ivar used_ns: computing time of the job until then, what preempted it taken off.
    """

    def __init__(self, task: str, used_ns: int, budget_ns: int, why: str = '') -> None:
        self.used_ns = used_ns
        what = why or (f'used {used_ns // NS_PER_US} us of its budget of '
                       f'{budget_ns // NS_PER_US} us')
        super().__init__(f'task {task!r} {what}')
