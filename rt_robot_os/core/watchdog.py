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
The watchdog: the reaction when a critical task stops, or the whole process does.

A task above all others checks the critical tasks. While they are healthy it feeds the watchdog of
the machine and the service manager. When a task stays unhealthy for the timeout, the configured
action follows. The watchdog task itself is supervised by a timer of Linux that it pushes ahead: if
no Python code runs, as in a native call that never returns, Linux ends the process.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence
from typing import Protocol

from rt_robot_os.base.reports import LogEntry
from rt_robot_os.base.reports import Reports
from rt_robot_os.base.reports import Severity
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.kernel import FailurePolicy
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import Task
from rt_robot_os.kernel import TaskState
from rt_robot_os.settings import WatchdogSettings


class Pulse:
    """
    The health of one critical task, from check to check.

    A job that meets its deadline ends at most a deadline after its release, and the job before
    ended no earlier than at its own release, a period before. So the time between the ends of two
    jobs is at most a period plus a deadline. A job that an event released may be outstanding for a
    deadline. Jobs that failed or were aborted do not count.

    :param start_ns: before this time the task is not checked.
    """

    def __init__(self, task: Task, start_ns: int = 0) -> None:
        self.task = task
        self._good = 0
        self._bad = 0
        self._alive_ns = start_ns + task.spec.phase_ns

    def check(self, now_ns: int) -> str:
        """Return why the task is not healthy; empty if it is. Safe in the real-time loop."""
        task = self.task
        task.account()
        if task.state is not TaskState.ACTIVE:
            self._alive_ns = now_ns  # restarts when the task is active again
            return f'task {task.name!r} is held ({task.state.value})'
        bad = task.failures + task.aborted
        good = task.runs - bad
        idle = not (task.period_ns or task.pending or task.busy)
        if good != self._good or (idle and bad == self._bad):
            self._alive_ns = max(self._alive_ns, now_ns)
        self._good, self._bad = good, bad
        # A changed rate is active from the next release on.
        allowed_ns = max(task.period_ns, task.interval_ns) + task.deadline_ns
        silent_ns = now_ns - self._alive_ns
        if silent_ns <= allowed_ns:
            return ''
        what = 'its period and deadline are' if task.period_ns else 'its deadline is'
        return (f'task {task.name!r} has ended no job well for {silent_ns / NS_PER_S:.3f} s; '
                f'{what} {allowed_ns / NS_PER_S:.3f} s')


PRIORITY = 99
CHECKS_PER_TIMEOUT = 8
TIMEOUTS_UNTIL_DEATH = 2
_SHORTEST_INTERVAL_NS = NS_PER_MS


class Handle(Protocol):
    """A dead-man timer, such as :class:`rt_robot_os.linux.dead_man_timer.DeadManTimer`."""

    def push(self, deadline_ns: int) -> None: ...

    def release(self) -> None: ...


class Watchdog:
    """
    Watch the critical tasks of a kernel; created after all other tasks.

    :param manager_ns: the watchdog time-out of a service manager; 0 for none.
    :ivar handle: ends a process that hangs; None in tests, and under a virtual clock.
    :ivar feeders: called after each check that finds all tasks healthy.
    :ivar on_fault: called with the reason of each action, for example to save the black box.
    :ivar reason: why the last check found an unhealthy task; empty if it found none.
    :ivar tripped: why the core must end with the exit code; empty otherwise.
    """

    def __init__(self, kernel: Kernel, settings: WatchdogSettings, reports: Reports,
                 manager_ns: int = 0) -> None:
        self.handle: Handle | None = None
        self.feeders: list[Callable[[], object]] = []
        self.on_fault: Callable[[str], object] | None = None
        self.reason = self.tripped = ''
        self._kernel = kernel
        self._settings = settings
        self._reports = reports
        self._timeout_ns = round(settings.timeout_s * NS_PER_S)
        interval_ns = self._timeout_ns // CHECKS_PER_TIMEOUT
        if manager_ns:
            interval_ns = min(interval_ns, manager_ns // 4)
        self.interval_ns = max(interval_ns, _SHORTEST_INTERVAL_NS)
        self._critical = [task for task in kernel.tasks if task.spec.critical]
        self._pulses: Sequence[Pulse] = ()
        self._since_ns = 0
        self._acted_ns = 0
        self.task = kernel.add_task('core/watchdog', self.check, priority=PRIORITY,
                                    rate_hz=NS_PER_S / self.interval_ns)

    @property
    def healthy(self) -> bool:
        """Whether the last check found no unhealthy task."""
        return not self.reason

    def check(self) -> None:
        """Check all critical tasks and react; the function of the task."""
        now_ns = self._kernel.now_ns()
        if not self._pulses:
            self._pulses = [Pulse(task, self._kernel.start_ns) for task in self._critical]
        reason = ''
        for pulse in self._pulses:
            reason = pulse.check(now_ns) or reason
        self.reason = reason
        if reason:
            self._unhealthy(reason, now_ns)
        else:
            self._recover()
        if self.healthy or self._is_safe():
            for feed in self.feeders:
                feed()
        ends = self.tripped or (reason and self._settings.action == 'exit')
        if self.handle is not None and not ends:
            self.handle.push(now_ns + TIMEOUTS_UNTIL_DEATH * self._timeout_ns)

    def leave(self) -> None:
        """Stop the dead-man timer of a process that ends in order; after a trip it continues."""
        if self.handle is not None and not self.tripped:
            self.handle.release()

    # ---- reactions ---------------------------------------------------------------------------

    def _recover(self) -> None:
        if self._acted_ns:
            self._note(Severity.INFO, 'all critical tasks are healthy again')
        self._since_ns = self._acted_ns = 0

    def _unhealthy(self, reason: str, now_ns: int) -> None:
        self._since_ns = self._since_ns or now_ns
        if self.tripped or now_ns - self._since_ns < self._timeout_ns:
            return
        if not self._acted_ns:
            self._acted_ns = now_ns
            self._act(reason, now_ns)
        elif (self._settings.action == 'safe_state' and not self._is_safe()
                and now_ns - self._acted_ns >= self._timeout_ns):
            names = ', '.join(t.name for t in self._with_safe_state() if not _rests(t))
            self._trip(f'{names} did not reach the safe state: a job does not end', now_ns)

    def _act(self, reason: str, now_ns: int) -> None:
        action = self._settings.action
        if action == 'exit':
            self._trip(reason, now_ns)
            return
        if self.on_fault is not None:
            self.on_fault(f'watchdog: {reason}')
        self._note(Severity.ERROR, reason)
        if action == 'safe_state':
            for task in self._with_safe_state():
                self._make_safe(task, f'the watchdog: {reason}')

    def _make_safe(self, task: Task, reason: str) -> None:
        if task.state is not TaskState.SAFE:
            self._kernel.hold(task, FailurePolicy.SAFE_STATE, reason)

    def _trip(self, reason: str, now_ns: int) -> None:
        """End the core: in order if that succeeds within the timeout, otherwise by the handle."""
        self.tripped = reason
        self._note(Severity.FATAL, f'{reason}: the core ends with exit code '
                   f'{self._settings.exit_code}')
        if self.handle is not None:
            self.handle.push(now_ns + self._timeout_ns)
        if self.on_fault is not None:
            self.on_fault(f'watchdog: {reason}')
        self._kernel.stop(f'watchdog: {reason}')

    def _with_safe_state(self) -> list[Task]:
        return [task for task in self._kernel.tasks if task.on_safe_state is not None]

    def _is_safe(self) -> bool:
        """Whether the action was taken and every task with a safe state is in it."""
        return (self._acted_ns > 0 and self._settings.action == 'safe_state'
                and all(_rests(task) for task in self._with_safe_state()))

    def _note(self, severity: Severity, text: str) -> None:
        self._reports.note(LogEntry(self._kernel.now_ns(), severity, 'watchdog', text))


def _rests(task: Task) -> bool:
    # Until the safe state was run, it replaces the function of the task.
    return task.state is TaskState.SAFE and task.function is task.body and not task.busy
