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
Releases: which tasks are due, in what order, and at no cost for what cannot run yet.

Each priority has its own timers. What has fallen due at a level is taken in when the dispatcher
comes to that level (:meth:`Releases._take_in`), in the order of time, and not before: as long as
something higher runs, a due timer costs nothing, however many there are. All that is done before
is to note that a level has to be looked at (:attr:`_ready`), once until it has been looked at.

A periodic task whose job waits or runs has no timer in the heap; the next is in ``task.timer``.
When the job has ended, the points of the grid that passed meanwhile are reckoned in one step
(``Consequences._reckon``), and the timer goes back.

So the work of releasing is in proportion to the jobs that run, not to the releases that fall due.
The alternative, an alarm for each release, ends in a livelock as soon as the alarms alone take
more than the CPU has (Mogul, Ramakrishnan: Eliminating receive livelock, 1997).
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence
import functools
import heapq

from rt_robot_os.kernel.black_box import INTERRUPT
from rt_robot_os.kernel.clock import NEVER_NS
from rt_robot_os.kernel.interrupts import Source
from rt_robot_os.kernel.policy import TaskState
from rt_robot_os.kernel.state import KernelState
from rt_robot_os.kernel.state import LEVELS
from rt_robot_os.kernel.state import Timer
from rt_robot_os.kernel.task import FOLLOW
from rt_robot_os.kernel.task import Task
from rt_robot_os.units import NS_PER_MS

_ONE_SHOT_ORDER = 1 << 32
# Spare the question whether there are as many.
_SENTINELS: list[Timer] = [(NEVER_NS, order, None, 0) for order in (-4, -3, -2)]
# Entries of _firsts that no longer count may not outgrow those that do.
_FIRSTS_MOST = 4 * LEVELS
# What an alarm that came in vain takes out of the way of the next: levels, and how far ahead.
# To take out one that was not due and put it back costs 1 us, an alarm in vain 20 to 40 us.
_ASIDE_MOST = 8
_ASIDE_NS = NS_PER_MS


class Releases(KernelState):
    """Timers, events and interrupts that make tasks ready. All methods are called locked."""

    __slots__ = ()

    # ---- timers ------------------------------------------------------------------------------

    def _clear_timers(self) -> None:
        """Forget all."""
        self._ready = 0
        self._timers = [_SENTINELS.copy() for _ in range(LEVELS + 3)]
        self._firsts = [(NEVER_NS, LEVELS + number) for number in range(3)]
        self._watched_ns = [NEVER_NS] * LEVELS

    def _expect(self, level: int) -> None:
        """See to it that the first timer of a level is not overlooked."""
        firsts, watched_ns = self._firsts, self._watched_ns
        due_ns = self._timers[level][0][0]
        if level <= self._level:  # an alarm would be in vain: look when that has ended
            self._ready |= self._bits[level]
        elif due_ns < watched_ns[level]:
            watched_ns[level] = due_ns
            heapq.heappush(firsts, (due_ns, level))
            if firsts[0][0] == due_ns:
                self.pending = True  # the alarm must be set anew
        if len(firsts) > _FIRSTS_MOST:
            firsts[:] = {entry for entry in firsts
                         if entry[1] >= LEVELS or watched_ns[entry[1]] == entry[0]}
            heapq.heapify(firsts)

    def _notice(self, now_ns: int) -> None:
        """Note which levels have something due, and hear the interrupts."""
        firsts, watched_ns = self._firsts, self._watched_ns
        while firsts[0][0] <= now_ns:
            due_ns, level = heapq.heappop(firsts)
            if watched_ns[level] == due_ns:
                watched_ns[level] = NEVER_NS
                self._ready |= self._bits[level]
        if self._interrupted:
            self._hear(now_ns)

    def _set_aside(self, level: int, now_ns: int) -> None:
        """Take what could not preempt a level out of the way of the next alarm."""
        firsts, watched_ns = self._firsts, self._watched_ns
        until_ns = now_ns + _ASIDE_NS
        for _ in range(_ASIDE_MOST):
            due_ns, low = firsts[0]
            if low > level or due_ns > until_ns:
                break
            heapq.heappop(firsts)
            if watched_ns[low] == due_ns:
                watched_ns[low] = NEVER_NS
                self._ready |= self._bits[low]

    def _take_in(self, level: int, now_ns: int) -> None:
        """Release what is due at a level, in the order of time."""
        timers = self._timers[level]
        while timers[0][0] <= now_ns and not self._stopping:
            timer = heapq.heappop(timers)
            if timer[3]:
                self._release(timer)
            else:
                timer[2](now_ns)

    def _release(self, timer: Timer) -> None:
        """Release a periodic task, or leave that to the end of the job that waits or runs."""
        due_ns, index, task, period_ns = timer
        if task.pending or task.busy:
            task.timer = timer
            return
        task.releases += 1
        task.timer = (due_ns + task.period_ns, index, task, task.period_ns)
        self._queue(task, due_ns, period_ns)

    def _schedule(self, at_ns: int, action: Callable[[int], None], level: int) -> Timer:
        """
        Call something once at a time, or later, when nothing above a level runs any more.

        :param action: gets the time; called locked.
        :return: what :meth:`_cancel` takes.
        """
        self._one_shots += 1
        timer = (at_ns, _ONE_SHOT_ORDER + self._one_shots, action, 0)
        heapq.heappush(self._timers[level], timer)
        self._expect(level)
        return timer

    def _cancel(self, timer: Timer, level: int) -> None:
        """Undo :meth:`_schedule`, unless it has happened."""
        timers = self._timers[level]
        if timer in timers:
            timers.remove(timer)
            heapq.heapify(timers)

    # ---- events ------------------------------------------------------------------------------

    def _make_ready(self, task: Task, now_ns: int) -> None:
        """Note that an event released a task, also one that is running."""
        level = task.priority
        if not task.pending and self._timers[level][0][0] <= now_ns:
            self._take_in(level, min(now_ns, self._end_ns - 1))  # it came before
        # What _arrive does, written out: this is a part of each publication.
        task.releases += 1
        if task.pending:
            if task.state is TaskState.ACTIVE:
                task.coalesced += 1
            else:
                task.missed += 1
            return
        task.pending = True
        task.release_ns = now_ns
        self._queues[level].append(task)
        self._ready |= self._bits[level]
        if level > self._level:
            self.pending = True

    def _arrive(self, task: Task, release_ns: int) -> None:
        """Note an event that came after all that is due at its level and not taken in."""
        task.releases += 1
        if task.pending:
            if task.state is TaskState.ACTIVE:
                task.coalesced += 1
            else:
                task.missed += 1
            return
        task.pending = True
        task.release_ns = release_ns
        self._queues[task.priority].append(task)
        self._ready |= self._bits[task.priority]

    def wake(self, tasks: Sequence[Task], now_ns: int) -> None:
        """Release tasks while ``locked`` is set; for topics. Ignored while not running."""
        if self.running:
            for task in tasks:
                self._make_ready(task, now_ns)

    def _queue(self, task: Task, release_ns: int, period_ns: int) -> None:
        """Let a job of a task wait, behind those that wait at its level."""
        task.pending = True
        task.release_ns = release_ns
        task.interval_ns = period_ns
        self._queues[task.priority].append(task)
        self._ready |= self._bits[task.priority]

    def _withdraw(self, task: Task) -> None:
        """Take back what would release a task, and count it as missed."""
        task.missed += len(task.backlog)
        task.backlog.clear()
        queue = self._queues[task.priority]
        if task in queue:
            queue.remove(task)
            task.missed += 1
        task.pending = False

    # ---- interrupts --------------------------------------------------------------------------

    def _hear(self, now_ns: int) -> None:
        """Release the tasks whose descriptors are readable."""
        self._interrupted = False
        sources = self._interrupts
        for source in sources.ready(now_ns):
            task = source.task
            self.record((INTERRUPT, task, now_ns, source.name))
            waits = task.pending
            if self._timers[task.priority][0][0] <= now_ns:
                self._take_in(task.priority, min(now_ns, self._end_ns - 1))
            self._arrive(task, now_ns)
            if waits:  # its job will read all: do not listen before it has
                sources.defer(source)
                task.follow |= FOLLOW
        for source in sources.early():
            self._listen_at(source, source.open_ns)

    def _listen_at(self, source: Source, at_ns: int) -> None:
        self._schedule(at_ns, functools.partial(self._listen, source), source.task.priority)

    def _listen(self, source: Source, now_ns: int) -> None:
        if self._interrupts.reopen(source):
            self._interrupted = self.pending = True

    def _listen_again(self, task: Task) -> None:
        """Hear the sources again that were not heard while a job of their task waited."""
        for source in self._interrupts.waiting_for(task):
            self._listen_at(source, source.open_ns)
