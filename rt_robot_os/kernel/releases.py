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
The lower layer of the kernel's core: its data, and the release of tasks.

Each priority is a level with its own timers. Timers that have fallen due at a level are served
when the dispatcher reaches that level (:meth:`Releases.release_due`), in the order of time, and
not before: while a higher level runs, due timers cost nothing, however many there are. Only one
bit is set earlier: the level may have something to run (``_ready``).

A periodic task whose job waits or runs has no timer there; ``task.next_ns`` is its next release.
When the job has ended, the releases that passed meanwhile are accounted for in one step, and the
timer is put back (:meth:`Releases.return_timer`).

So the cost of releasing is proportional to the jobs that run, not to the releases that fall due.
The alternative, an interrupt for each release, ends in a livelock as soon as the interrupts alone
need more than the CPU has (Mogul, Ramakrishnan: Eliminating receive livelock, 1997).
"""

from __future__ import annotations

from abc import ABC
from abc import abstractmethod
from collections import deque
from collections.abc import Callable
from collections.abc import Sequence
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.kernel.black_box import BlackBox
from rt_robot_os.kernel.black_box import OVERRUN
from rt_robot_os.kernel.black_box import Record
from rt_robot_os.kernel.clock import Clock
from rt_robot_os.kernel.clock import NEVER_NS
from rt_robot_os.kernel.spec import PRIORITY_MAXIMUM
from rt_robot_os.kernel.timers import insert
from rt_robot_os.kernel.timers import SENTINELS
from rt_robot_os.kernel.timers import Timer

IDLE_LEVEL: Final = 0
# Levels above every task, for actions at a point in time.
LEVEL_END: Final = PRIORITY_MAXIMUM + 3
LEVEL_OUTPUTS: Final = PRIORITY_MAXIMUM + 2
LEVEL_INPUTS: Final = PRIORITY_MAXIMUM + 1
LEVELS: Final = LEVEL_END + 1

# One-shot timers are served after the periodic tasks that are due at the same time.
_ONE_SHOT_ORDER: Final = 1 << 32
# A needless interrupt defers the levels that would cause the next one: at most this many, up to
# this far ahead. Deferring a level and indexing it again costs 1 us, an interrupt 20 to 40 us.
_DEFER_MAXIMUM: Final = 8
_DEFER_NS: Final = NS_PER_MS

Action = Callable[[int], None]


class Releases(ABC):
    """
    Timers and events that make tasks ready.

    Internal to the kernel; all methods but :meth:`lock` are called locked. A task is a
    :class:`~rt_robot_os.kernel.task_core.TaskCore`.

    :ivar locked: set inside a critical section of the kernel or of a topic.
    :ivar pending: an interrupt or a release came meanwhile: call ``settle`` after clearing
        ``locked``.
    :ivar interrupted: a descriptor may be readable: poll the sources.
    :ivar current: the task whose job runs; None between jobs.
    :ivar level: of the running job: its task's priority or the ceiling of a resource it is in.
    :ivar stolen_ns: the time since the job began that was not its own: of jobs above it, of the
        kernel, and steal time.
    :ivar stopping: ``run`` is to end; nothing is released or started any more.
    :ivar end_ns: releases at this time or later do not run.
    :ivar record: adds to the black box, and calls the observers; ``observed`` if there are any.

    Private attributes:

    - ``_timers``, of each level: sorted by due time;
    - ``_queues``, of each level: tasks whose job waits, in the order of their releases;
    - ``_ready``: bits of the levels at which a task waits, or may have fallen due;
    - ``_firsts``: sorted, (due, level) of the first timer of each level without such a bit;
    - ``_indexed_ns``, of each level: its time in ``_firsts``; NEVER_NS when it is not there.
    """

    # Slots are the fastest attributes; there are too many for an inline dictionary.
    __slots__ = (
        'clock', 'now_ns', 'running', 'stopping', 'end_ns', 'record', 'black_box', 'observed',
        # The critical section and the running job
        'locked', 'pending', 'interrupted', 'current', 'level', 'stolen_ns',
        # Timers and queues
        '_ready', '_queues', '_timers', '_firsts', '_indexed_ns', '_one_shots')

    def __init__(self, clock: Clock, black_box: BlackBox) -> None:
        self.clock = clock
        self.now_ns = clock.now_ns
        self.running = False
        self.stopping = False
        self.end_ns = NEVER_NS
        self.black_box = black_box
        self.record: Callable[[Record], None] = black_box.add
        self.observed = False
        self.locked = False
        self.pending = False
        self.interrupted = False
        self.current: Any = None
        self.level = IDLE_LEVEL
        self.stolen_ns = 0
        self._queues: list[deque[Any]] = [deque() for _ in range(LEVELS)]
        self._one_shots = 0
        self.clear_timers()

    # ---- provided by the other parts of the kernel --------------------------------------------

    @abstractmethod
    def settle(self, signum: int = 0, frame: object = None) -> None:
        """Serve what became pending while ``locked`` was set."""

    @abstractmethod
    def poll_sources(self, now_ns: int) -> None:
        """Release the tasks whose descriptors are readable."""

    @abstractmethod
    def account_missed_releases(self, task: Any, due_ns: int, now_ns: int) -> int:
        """
        Apply the overrun policy of a task to the points of its grid that passed.

        :param due_ns: the first of them.
        :return: the next release; 0 when the grid restarts at the end of the job.
        """

    # ---- critical sections -------------------------------------------------------------------

    def lock(self) -> bool:
        """
        Enter a critical section.

        :return: whether it is nested in another one; the argument of :meth:`unlock`.
        """
        before, self.locked = self.locked, True
        return before

    def unlock(self, before: bool) -> None:
        """Leave a critical section and settle what became pending meanwhile."""
        self.locked = before
        if not before and (self.pending or self.ready_above(self.level)):
            self.settle()

    def ready_above(self, level: int) -> bool:
        """Return whether a task waits, or may have fallen due, above a level."""
        return self._ready.bit_length() - 1 > level

    # ---- timers ------------------------------------------------------------------------------

    def clear_timers(self) -> None:
        """Remove all timers."""
        self._ready = 0
        self._timers: list[list[Timer]] = [SENTINELS.copy() for _ in range(LEVELS + 3)]
        self._firsts: list[tuple[int, int]] = [(NEVER_NS, LEVELS + n) for n in range(3)]
        self._indexed_ns = [NEVER_NS] * LEVELS

    def add_timer(self, task: Any, due_ns: int, period_ns: int) -> None:
        """
        Release a periodic task at a time.

        :param period_ns: the period before that release.
        """
        insert(self._timers[task.priority], (due_ns, task.index, task, period_ns))
        self._index_timer(task.priority)

    def schedule(self, at_ns: int, action: Action, level: int) -> int:
        """
        Call a function once at a time, or later, when nothing above a level runs any more.

        :param action: called locked with the time.
        :return: an identifier for :meth:`cancel`.
        """
        self._one_shots += 1
        order = _ONE_SHOT_ORDER + self._one_shots
        insert(self._timers[level], (at_ns, order, action, 0))
        self._index_timer(level)
        return order

    def cancel(self, order: int, level: int) -> None:
        """Undo :meth:`schedule`, unless the function was called already."""
        timers = self._timers[level]
        for index, timer in enumerate(timers):
            if timer[1] == order:
                del timers[index]
                break

    def _index_timer(self, level: int) -> None:
        """Update the index with the first timer of a level."""
        due_ns = self._timers[level][0][0]
        if level <= self.level:  # it cannot preempt: it is checked when the running job has ended
            self._ready |= 1 << level
        elif due_ns < self._indexed_ns[level]:
            self._put_first(level, due_ns)
            if self._firsts[0][0] == due_ns:
                self.pending = True  # the timer must be set again

    def _put_first(self, level: int, due_ns: int) -> None:
        firsts, before_ns = self._firsts, self._indexed_ns[level]
        if before_ns < NEVER_NS:
            firsts.remove((before_ns, level))
        self._indexed_ns[level] = due_ns
        insert(firsts, (due_ns, level))

    def _mark_first_ready(self) -> None:
        """Move the level that falls due first from the index to the ready levels."""
        _, level = self._firsts.pop(0)
        self._indexed_ns[level] = NEVER_NS
        self._ready |= 1 << level

    def collect_due(self, now_ns: int) -> None:
        """Mark the levels that have fallen due as ready; poll the sources after an interrupt."""
        while self._firsts[0][0] <= now_ns:
            self._mark_first_ready()
        if self.interrupted:
            self.poll_sources(now_ns)

    def _defer(self, level: int, now_ns: int) -> None:
        """Take levels that cannot preempt the running one out of the next interrupts."""
        for _ in range(_DEFER_MAXIMUM):
            due_ns, low = self._firsts[0]
            if low > level or due_ns > now_ns + _DEFER_NS:
                break
            self._mark_first_ready()

    def _clear_ready(self, level: int) -> None:
        """Mark a level as not ready; it is checked again when its first timer is due."""
        self._ready ^= 1 << level
        due_ns = self._timers[level][0][0]
        if due_ns < self._indexed_ns[level]:
            self._put_first(level, due_ns)

    # ---- releases ----------------------------------------------------------------------------

    def release_due(self, level: int, now_ns: int) -> bool:
        """
        Release what is due at a level, in the order of time.

        :return: whether anything was due.
        """
        timers = self._timers[level]
        found = False
        while timers[0][0] <= now_ns and not self.stopping:
            due_ns, _, task_or_action, period_ns = timers.pop(0)
            if period_ns:
                self._release(task_or_action, due_ns, period_ns)
            else:
                task_or_action(now_ns)
            found = True
        return found

    def release_unserved(self, now_ns: int) -> None:
        """Count the releases that are due and will not be served; at the end of a run."""
        for timers in self._timers:
            for due_ns, _, task, period_ns in timers.copy():
                if due_ns <= now_ns and period_ns:
                    self._release(task, due_ns, period_ns)

    def _release(self, task: Any, due_ns: int, period_ns: int) -> None:
        """Release a periodic task; while a job of it waits or runs, only store the release."""
        if task.pending or task.busy:
            task.next_ns, task.next_period_ns = due_ns, period_ns
            return
        task.releases += 1
        task.next_ns, task.next_period_ns = due_ns + task.period_ns, task.period_ns
        task.pending = True
        task.release_ns = due_ns
        task.interval_ns = period_ns
        self._queues[task.priority].append(task)
        self._ready |= 1 << task.priority

    def _pull_timer(self, task: Any, now_ns: int) -> None:
        """Remove the timer of the running task from its level, if it has fallen due."""
        timers = self._timers[task.priority]
        now_ns = min(now_ns, self.end_ns - 1)
        while not task.next_ns and timers[0][0] <= now_ns:
            due_ns, _, task_or_action, period_ns = timers.pop(0)
            if period_ns:
                self._release(task_or_action, due_ns, period_ns)
            else:
                task_or_action(now_ns)

    def return_timer(self, task: Any, now_ns: int) -> None:
        """Put back the timer of a task whose job has ended; account for releases that passed."""
        due_ns, period_ns = task.next_ns, task.next_period_ns
        task.next_ns = 0
        if due_ns <= now_ns and due_ns < self.end_ns:
            if task.skips and not task.held:  # inlined: the cheapest path under overload
                unserved = (min(now_ns, self.end_ns - 1) - due_ns) // task.period_ns + 1
                task.releases += unserved
                task.overruns += unserved
                task.missed += unserved
                self.record((OVERRUN, task, due_ns, unserved))
                due_ns += unserved * task.period_ns
            else:
                due_ns = self.account_missed_releases(task, due_ns, now_ns)
            period_ns = task.period_ns
        if due_ns:
            insert(self._timers[task.priority], (due_ns, task.index, task, period_ns))
            if not self._ready >> task.priority & 1:  # it is ready while its job ends
                self._index_timer(task.priority)

    # ---- events ------------------------------------------------------------------------------

    def wake(self, tasks: Sequence[Any], now_ns: int) -> None:
        """
        Record that an event released tasks, running ones included; ignored while not running.

        Topics call it in each publication.
        """
        if not self.running:
            return
        for task in tasks:
            level = task.priority
            if not task.pending:
                if self._timers[level][0][0] <= now_ns:  # an earlier release goes first
                    self.release_due(level, min(now_ns, self.end_ns - 1))
                if level > self.level:
                    self.pending = True
            self.arrive(task, now_ns)

    def arrive(self, task: Any, release_ns: int) -> None:
        """Record an event for a task, after all releases that are due at its level."""
        task.releases += 1
        if not task.pending:
            task.pending = True
            task.release_ns = release_ns
            self._queues[task.priority].append(task)
            self._ready |= 1 << task.priority
        elif task.held:
            task.missed += 1
        else:
            task.coalesced += 1

    def enqueue(self, task: Any, release_ns: int, period_ns: int) -> None:
        """Queue a job of a periodic task behind those that wait at its level."""
        task.pending = True
        task.release_ns = release_ns
        task.interval_ns = period_ns
        self._queues[task.priority].append(task)
        self._ready |= 1 << task.priority

    def withdraw(self, task: Any) -> None:
        """Drop the waiting job of a task and count it as missed."""
        queue = self._queues[task.priority]
        if task in queue:
            queue.remove(task)
            task.missed += 1
        task.pending = False
