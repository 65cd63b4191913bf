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


"""Whether a critical task keeps its declared period and deadline, judged from its counters."""

from __future__ import annotations

from rt_robot_os.kernel import Task
from rt_robot_os.kernel import TaskState
from rt_robot_os.units import NS_PER_S


class Pulse:
    """
    The judgement of one task, from look to look.

    A job that keeps its deadline ends at most a deadline after its release, and the one before
    ended no earlier than at its own release, a period before. So between the ends of two jobs lie
    at most a period and a deadline; nothing else is allowed for. Of a task that events release, a
    job may be outstanding for a deadline. Jobs that failed or were aborted do not count.

    :param start_ns: before that nothing is expected of the task.
    """

    def __init__(self, task: Task, start_ns: int = 0) -> None:
        self.task = task
        self._good = 0
        self._bad = 0
        self._alive_ns = start_ns + task.spec.phase_ns

    def look(self, now_ns: int) -> str:
        """Say why the task is not healthy; empty when it is. Safe in the real-time loop."""
        task = self.task
        task.account()
        if task.state is not TaskState.ACTIVE:
            self._alive_ns = now_ns  # it begins anew when it is active again
            return f'task {task.name!r} is held ({task.state.value})'
        bad = task.failures + task.aborted
        good = task.runs - bad
        idle = not (task.period_ns or task.pending or task.busy)
        if good != self._good or (idle and bad == self._bad):
            self._alive_ns = max(self._alive_ns, now_ns)
        self._good, self._bad = good, bad
        # A changed rate is in force from the next release on.
        allowed_ns = max(task.period_ns, task.interval_ns) + task.deadline_ns
        silent_ns = now_ns - self._alive_ns
        if silent_ns <= allowed_ns:
            return ''
        what = 'its period and deadline are' if task.period_ns else 'its deadline is'
        return (f'task {task.name!r} has ended no job well for {silent_ns / NS_PER_S:.3f} s; '
                f'{what} {allowed_ns / NS_PER_S:.3f} s')
