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
The lower half of the kernel: its data, and what releases tasks.

Each priority has its own timers. What has fallen due at a level is taken in when the dispatcher
comes to that level (:meth:`Releases._take_in`), in the order of time, and not before: as long as
something higher runs, a due timer costs nothing, however many there are. All that is done before
is to note that a level has to be looked at (``_ready``), once until it has been looked at.

A periodic task whose job waits or is late has no timer in the heap; the next is in ``task.timer``.
When the job has ended, the points of the grid that passed meanwhile are reckoned in one step
(``Consequences.reckon``), and the timer goes back.

So the work of releasing is in proportion to the jobs that run, not to the releases that fall due.
The alternative, an alarm for each release, ends in a livelock as soon as the alarms alone take
more than the CPU has (Mogul, Ramakrishnan: Eliminating receive livelock, 1997).
"""

from __future__ import annotations

from abc import ABC
from abc import abstractmethod
from collections import deque
from collections.abc import Callable
from collections.abc import Sequence
import functools
from typing import Final

from rt_robot_os.kernel.black_box import BlackBox
from rt_robot_os.kernel.black_box import INTERRUPT
from rt_robot_os.kernel.black_box import Record
from rt_robot_os.kernel.black_box import RECORDS_DEFAULT
from rt_robot_os.kernel.clock import Clock
from rt_robot_os.kernel.clock import NEVER_NS
from rt_robot_os.kernel.failure import describe
from rt_robot_os.kernel.failure import FailureReport
from rt_robot_os.kernel.interrupts import InterruptSources
from rt_robot_os.kernel.interrupts import Source
from rt_robot_os.kernel.spec import PRIORITY_MAXIMUM
from rt_robot_os.kernel.spec import TaskState
from rt_robot_os.kernel.stolen import Stolen
from rt_robot_os.kernel.task import Task
from rt_robot_os.kernel.timers import insert
from rt_robot_os.kernel.timers import SENTINELS
from rt_robot_os.kernel.timers import Timer
from rt_robot_os.units import NS_PER_MS

IDLE_LEVEL: Final = 0
# Above every task: what happens at a point in time rather than in a job.
LEVEL_END: Final = PRIORITY_MAXIMUM + 3
LEVEL_OUTPUTS: Final = PRIORITY_MAXIMUM + 2
LEVEL_INPUTS: Final = PRIORITY_MAXIMUM + 1
LEVELS: Final = LEVEL_END + 1

_FAILURES_KEPT: Final = 32
_ONE_SHOT_ORDER: Final = 1 << 32
# Entries of _firsts that no longer count may not outgrow those that do.
_FIRSTS_MOST: Final = 4 * LEVELS
# What an alarm that came in vain takes out of the way of the next: levels, and how far ahead.
# To take out one that was not due and put it back costs 1 us, an alarm in vain 20 to 40 us.
_ASIDE_MOST: Final = 8
_ASIDE_NS: Final = NS_PER_MS

TraceHook = Callable[[int, str, str], None]
Observer = Callable[[Record], None]


class Releases(ABC):
    """
    Timers, events and interrupts that make tasks ready.

    What begins with an underscore is the kernel's own and called locked.

    :ivar locked: set inside a critical section of the kernel or of a topic.
    :ivar pending: something came up meanwhile: call ``settle`` after clearing ``locked``.
    :ivar current: the task whose job runs; None between jobs.
    :ivar record: adds to the black box, and tells the observers.
    :ivar trace: called with (time, kind, task name) for each start and end, unless it is None;
        may not raise.
    :ivar black_box: the last things that happened.
    :ivar stolen: time that Linux took from the jobs.
    :ivar stop_grace_ns: jobs that run so long after :meth:`Kernel.stop` are ended; by default
        never.
    :ivar ended: the tasks whose jobs were, since the kernel was started.
    :ivar overhead_ns: what the kernel itself computed for: releasing, dispatching, setting alarms.

    Of what is not public:

    - ``_timers``, of each level: what falls due, sorted;
    - ``_queues``, of each level: tasks whose job waits, in the order of their releases;
    - ``_ready``: bits of the levels at which something waits, or may have fallen due;
    - ``_firsts``: sorted, (due, level) with the first timer of each level that has no bit there;
    - ``_watched_ns``, of each level: which entry of ``_firsts`` counts;
    - ``_level``: of what runs, its task's priority or the ceiling of a resource that it is in.
    """

    # Slots are the fastest attributes, and there are more than an inline dictionary holds.
    __slots__ = (
        'clock', 'now_ns', 'running',
        # The critical section, and what runs
        'locked', 'pending', 'current', '_level', '_stolen_ns',
        # What is due
        '_ready', '_bits', '_queues', '_timers', '_firsts', '_watched_ns', '_one_shots',
        '_interrupts', '_interrupted',
        # The end
        'stop_grace_ns', 'ended', '_stopping', '_stop_reason', '_stop_ns', '_end_ns',
        # What is told of it
        'trace', 'record', 'black_box', 'failures', 'failures_total', 'stolen', 'overhead_ns',
        '_observers')

    def __init__(self, clock: Clock, records: int = RECORDS_DEFAULT) -> None:
        self.clock = clock
        self.now_ns = clock.now_ns
        self.running = False
        self.locked = False
        self.pending = False
        self.current: Task | None = None
        self._level = IDLE_LEVEL
        self._stolen_ns = 0
        self._bits = [1 << level for level in range(LEVELS)]
        self._queues: list[deque[Task]] = [deque() for _ in range(LEVELS)]
        self._clear_timers()
        self._one_shots = 0
        self._interrupts = InterruptSources(clock)
        self._interrupted = False
        self.stop_grace_ns = NEVER_NS
        self.ended: list[str] = []
        self._stopping = False
        self._stop_reason = ''
        self._stop_ns = NEVER_NS
        self._end_ns = NEVER_NS
        self.trace: TraceHook | None = None
        self.black_box = BlackBox(records)
        self.record: Observer = self.black_box.add
        self._observers: tuple[Observer, ...] = ()
        self.failures: deque[FailureReport] = deque(maxlen=_FAILURES_KEPT)
        self.failures_total = 0
        self.stolen = Stolen(clock)
        self.overhead_ns = 0

    # ---- critical sections -------------------------------------------------------------------

    @abstractmethod
    def settle(self, signum: int = 0, frame: object = None) -> None:
        """Do what came up while ``locked`` was set."""

    def lock(self) -> bool:
        """
        Enter a critical section.

        :return: what :meth:`unlock` takes: whether it lies within another.
        """
        before, self.locked = self.locked, True
        return before

    def unlock(self, before: bool) -> None:
        """Leave a critical section and do what came up meanwhile; written out where it is hot."""
        self.locked = before
        if not before and (self.pending or self._ready >> self._level + 1):
            self.settle()

    # ---- what is told ------------------------------------------------------------------------

    def add_observer(self, observer: Observer) -> None:
        """
        Let something be told all that the kernel and the topics record, besides the black box.

        :param observer: gets the record, see :mod:`rt_robot_os.kernel.black_box`, within a
            critical section: it must be quick. One that raises is reported, and told no more.
        """
        self._observers = (*self._observers, observer)
        self.record = self._tell

    def _tell(self, record: Record) -> None:
        self.black_box.add(record)
        for observer in self._observers:
            try:
                observer(record)
            except Exception as error:
                self._observers = tuple(one for one in self._observers if one is not observer)
                self._note_failure(describe('observer', self.now_ns(), error))

    def _note_failure(self, failure: FailureReport) -> None:
        self.failures_total += 1
        self.failures.append(failure)

    # ---- timers ------------------------------------------------------------------------------

    def _clear_timers(self) -> None:
        """Forget all."""
        self._ready = 0
        self._timers: list[list[Timer]] = [SENTINELS.copy() for _ in range(LEVELS + 3)]
        self._firsts: list[tuple[int, int]] = [(NEVER_NS, LEVELS + n) for n in range(3)]
        self._watched_ns = [NEVER_NS] * LEVELS

    def _expect(self, level: int) -> None:
        """See to it that the first timer of a level is not overlooked."""
        firsts, watched_ns = self._firsts, self._watched_ns
        due_ns = self._timers[level][0][0]
        if level <= self._level:  # an alarm would be in vain: look when that has ended
            self._ready |= self._bits[level]
        elif due_ns < watched_ns[level]:
            watched_ns[level] = due_ns
            insert(firsts, (due_ns, level))
            if firsts[0][0] == due_ns:
                self.pending = True  # the alarm must be set anew
        if len(firsts) > _FIRSTS_MOST:
            firsts[:] = sorted({entry for entry in firsts
                                if entry[1] >= LEVELS or watched_ns[entry[1]] == entry[0]})

    def _notice(self, now_ns: int) -> None:
        """Note which levels have something due, and hear the interrupts."""
        firsts, watched_ns = self._firsts, self._watched_ns
        while firsts[0][0] <= now_ns:
            due_ns, level = firsts.pop(0)
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
            firsts.pop(0)
            if watched_ns[low] == due_ns:
                watched_ns[low] = NEVER_NS
                self._ready |= self._bits[low]

    def _take_in(self, level: int, now_ns: int) -> None:
        """Release what is due at a level, in the order of time."""
        timers = self._timers[level]
        while not self._stopping:
            due_ns: int = timers[0][0]
            if due_ns > now_ns:
                break
            self._serve(timers.pop(0), now_ns)

    def _take_out(self, task: Task, now_ns: int) -> None:
        """Take the timer of the task that runs out of the others, if it has fallen due."""
        timers = self._timers[task.priority]
        now_ns = min(now_ns, self._end_ns - 1)
        while task.timer is None and timers[0][0] <= now_ns:
            self._serve(timers.pop(0), now_ns)

    def _serve(self, timer: Timer, now_ns: int) -> None:
        if timer[3]:
            self._release(timer)
        else:
            timer[2](now_ns)

    def _release(self, timer: Timer) -> None:
        """Release a periodic task, or leave that to the end of the job that waits or runs."""
        due_ns: int
        task: Task
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
        insert(self._timers[level], timer)
        self._expect(level)
        return timer

    def _cancel(self, timer: Timer, level: int) -> None:
        """Undo :meth:`_schedule`, unless it has happened."""
        timers = self._timers[level]
        if timer in timers:
            timers.remove(timer)

    # ---- events ------------------------------------------------------------------------------

    def wake(self, tasks: Sequence[Task], now_ns: int) -> None:
        """
        Note that an event released tasks, also such that run; ignored while not running.

        For topics; called locked, as a part of each publication.
        """
        if not self.running:
            return
        for task in tasks:
            level = task.priority
            if not task.pending:
                due_ns: int = self._timers[level][0][0]
                if due_ns <= now_ns:
                    self._take_in(level, min(now_ns, self._end_ns - 1))  # it came before
                if level > self._level:
                    self.pending = True
                if not task.pending:  # as _arrive, written out: the usual case of a publication
                    task.releases += 1
                    task.pending = True
                    task.release_ns = now_ns
                    self._queues[level].append(task)
                    self._ready |= self._bits[level]
                    continue
            self._arrive(task, now_ns)

    def _arrive(self, task: Task, release_ns: int) -> None:
        """Note an event that came after all that is due at its level and not taken in."""
        task.releases += 1
        if not task.pending:
            level = task.priority
            task.pending = True
            task.release_ns = release_ns
            self._queues[level].append(task)
            self._ready |= self._bits[level]
        elif task.state is TaskState.ACTIVE:
            task.coalesced += 1
        else:
            task.missed += 1

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
                task.follow_up = True
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
