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


"""How a job is ended that does not end by itself: TaskAborted is raised in it, from the alarm."""

from __future__ import annotations

from collections.abc import Callable
import sys

from rt_robot_os.kernel.abort import TaskAborted
from rt_robot_os.kernel.alarms import Alarms
from rt_robot_os.kernel.black_box import ABORT
from rt_robot_os.kernel.clock import NEVER_NS
from rt_robot_os.kernel.failure import describe
from rt_robot_os.kernel.failure import FailureReport
from rt_robot_os.kernel.task import FOLLOW
from rt_robot_os.kernel.task import Task
from rt_robot_os.linux.recursion import force_recursion_limit
from rt_robot_os.units import NS_PER_MS
from rt_robot_os.units import NS_PER_US

# Computing time for ``finally`` clauses between the first TaskAborted and the second, at least;
# after that the task is known to resist, and a strike between two of its handlers is a matter of
# tries.
GRACE_NS = 20 * NS_PER_MS
STRIKE_AGAIN_NS = 20 * NS_PER_US
# Computing time for describing an exception and for dropping it: both may run its author's code.
CONTAIN_NS = 10 * NS_PER_MS
# Python frames that each level of nesting adds to the limit: a task that recursed to its own must
# not leave too few for those that preempt it.
RECURSION_ROOM = 200
# Before Python 3.12 a job that comes so close to its limit is ended: where it is deeper still
# there is no room for the handler of the alarm, and it would hold up everybody.
_RECURSION_EDGE = 50


class Strikes(Alarms):
    """Budgets, and what else ends a job. All methods are called locked, unless they say so."""

    __slots__ = ()

    def _police(self, task: Task, used_ns: int) -> int:
        """
        Have the interrupted task struck if it has used what it may.

        :param used_ns: its computing time.
        :return: when to look again.
        """
        now_ns = self.now_ns()
        look_ns = now_ns + task.limit_ns - used_ns if task.limit_ns else NEVER_NS
        if self._stopping and not (task.strikes or task.over) and self._stop_ns < look_ns:
            look_ns = self._stop_ns
        if now_ns < look_ns:
            return look_ns
        if not task.struck:
            self._have_struck(task)
            if not task.over:
                self.record((ABORT, task, now_ns, used_ns))
        return NEVER_NS  # when it is delivered, the alarm is set anew

    def _have_struck(self, task: Task) -> None:
        """Let TaskAborted be raised in the task on the top of the stack as soon as it may be."""
        task.struck = True
        task.follow |= FOLLOW

    def _strike(self, task: Task) -> TaskAborted:
        """Give what is to be raised in the task on the top of the stack, at once."""
        now_ns = self.now_ns()
        used_ns = now_ns - task.start_ns - self._stolen_ns
        task.struck = False
        first = not task.strikes
        if not task.over:
            task.strikes += 1
        pause_ns = max(GRACE_NS, task.spec.budget_ns) if first else STRIKE_AGAIN_NS
        task.limit_ns = used_ns + pause_ns
        self._look_at(now_ns + pause_ns)
        why = ''
        if self._stopping and now_ns >= self._stop_ns:
            why = (f'was ended {(now_ns - self._stop_ns + self.stop_grace_ns) // NS_PER_MS} ms '
                   f'after the kernel was told to stop ({self._stop_reason})')
            if task.name not in self.ended:
                self.ended.append(task.name)
        elif not task.aborts or used_ns < task.budget_ns:
            why = f'was ended near the recursion limit, after {used_ns // NS_PER_US} us'
        return TaskAborted(task.name, used_ns, task.spec.budget_ns, why)

    def _contain(self, task: Task, error: BaseException, settle: Callable[[], None]
                 ) -> FailureReport:
        """
        Describe what came out of the job that runs, within a computing time of its own.

        Not locked: whatever the exception does when it is looked at is preemptible, and ended.
        """
        self.locked = True
        now_ns = self.now_ns()
        task.over = True
        task.struck = False  # too late
        task.limit_ns = now_ns - task.start_ns - self._stolen_ns + CONTAIN_NS
        self._look_at(now_ns + CONTAIN_NS)
        self.locked = False
        if self.pending:
            settle()
        return describe(task.name, now_ns, error)

    # ---- recursion ---------------------------------------------------------------------------

    def _narrow(self, limit: int) -> None:
        """Take back the room that the handler of a signal was given."""
        try:
            sys.setrecursionlimit(limit)
        except RecursionError:
            force_recursion_limit(limit)

    def _look_at_depth(self, task: Task, limit: int) -> None:
        """Have a job struck that is about to reach its recursion limit."""
        try:
            sys.setrecursionlimit(limit - _RECURSION_EDGE)
        except RecursionError:
            if not task.strikes:  # later its time counts
                self._have_struck(task)
        sys.setrecursionlimit(limit + RECURSION_ROOM)
