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


"""File descriptors that release tasks when they become readable."""

from __future__ import annotations

from contextlib import suppress
import select

from rt_robot_os.kernel.clock import Clock
from rt_robot_os.kernel.clock import INTERRUPT_SIGNAL
from rt_robot_os.kernel.statistics import SourceStatistics
from rt_robot_os.kernel.task import Task
from rt_robot_os.linux.interrupt import mask_signal
from rt_robot_os.linux.interrupt import no_signal_when_readable
from rt_robot_os.linux.interrupt import signal_when_readable
from rt_robot_os.linux.interrupt import unmask_signal
from rt_robot_os.linux.terminal import is_raw_terminal
from rt_robot_os.linux.terminal import unread_bytes


class Source:
    """A descriptor, its task, and how often it was readable."""

    __slots__ = ('fd', 'name', 'task', 'separation_ns', 'open_ns', 'flags', 'arrivals', 'deferred',
                 'waits', 'counted')

    def __init__(self, fd: int, name: str, task: Task, separation_ns: int) -> None:
        self.fd = fd
        self.name = name
        self.task = task
        self.separation_ns = separation_ns
        self.open_ns = 0
        self.waits = False
        self.counted = is_raw_terminal(fd)
        self.flags: int | None = None
        self.arrivals = 0
        self.deferred = 0

    def statistics(self) -> SourceStatistics:
        """Take the statistics."""
        return SourceStatistics(self.name, self.task.name, self.arrivals, self.deferred)


class InterruptSources:
    """
    The table of descriptors and their tasks.

    Once the kernel runs all methods are called locked, except :meth:`statistics`.

    They send signals only between :meth:`arm` and :meth:`disarm`: without a handler the signal
    would end the process. Under a clock without signals they are polled after each wait.

    A source that is readable again before its separation has passed is masked until then: it
    sends no signals meanwhile, so that a flood costs no more than one handler a separation. So is
    one that becomes readable while a job of its task waits, until that has ended: the job will
    read all, so that a flood costs nothing as long as the task does not have its turn.

    Terminals are asked how many bytes they have, one by one: ``poll`` would wait for a worker of
    Linux while bytes are underway (:mod:`rt_robot_os.linux.terminal`). The signal comes when they
    can be read.
    """

    __slots__ = ('_signals', '_armed', '_sources', '_masked', '_early', '_poll', '_terminals')

    def __init__(self, clock: Clock) -> None:
        self._signals = clock.has_signals
        self._armed = False
        self._sources: dict[int, Source] = {}
        self._masked: list[Source] = []
        self._early: list[Source] = []
        self._poll = select.poll()
        self._terminals: list[Source] = []

    def add(self, fd: int, task: Task, separation_ns: int = 0, name: str = '') -> None:
        """
        Add a descriptor.

        :raises OSError: it cannot send signals.
        """
        self.remove(fd)
        source = Source(fd, name or f'fd {fd}', task, separation_ns)
        if self._armed:
            self._watch(source)
        self._sources[fd] = source
        self._listen(source)

    def remove(self, fd: int) -> None:
        """Forget a descriptor; unknown ones are fine."""
        source = self._sources.pop(fd, None)
        if source is None:
            return
        if source in self._masked:
            self._masked.remove(source)
        else:
            self._ignore(source)
        self._unwatch(source)

    def arm(self) -> None:
        """
        Let all send their signals from now on.

        :raises OSError: one of them cannot.
        """
        self._armed = True
        for source in self._sources.values():
            source.open_ns = 0
            self._watch(source)

    def disarm(self) -> None:
        """Let none send signals any more; may be called twice."""
        self._armed = False
        self._early.clear()
        for source in self._sources.values():
            self._unwatch(source)
        while self._masked:
            self._listen(self._masked.pop())

    def ready(self, now_ns: int) -> list[Source]:
        """Return the sources that are readable and not too early; safe in the real-time loop."""
        readable = [self._sources[fd] for fd, _ in self._poll.poll(0)]
        readable += [source for source in self._terminals if _has_bytes(source)]
        found = []
        for source in readable:
            source.arrivals += 1
            if now_ns >= source.open_ns:
                source.open_ns = now_ns + source.separation_ns
                found.append(source)
            else:
                self.defer(source)
                source.waits = False
                self._early.append(source)
        return found

    def early(self) -> list[Source]:
        """Return, once, those that were masked because they came too early."""
        early, self._early = self._early, []
        return early

    def defer(self, source: Source) -> None:
        """Do not listen to a source for now: until the job of its task that waits has ended."""
        source.deferred += 1
        source.waits = True
        self._ignore(source)
        if source.flags is not None:
            with suppress(OSError):  # closed by its owner: nothing left to do
                mask_signal(source.fd)
        self._masked.append(source)

    def waiting_for(self, task: Task) -> list[Source]:
        """Return, once, the deferred sources for which a job of a task had to end."""
        found = [source for source in self._masked if source.waits and source.task is task]
        for source in found:
            source.waits = False
        return found

    def reopen(self, source: Source) -> bool:
        """
        Listen again to a source that was deferred; ask :meth:`ready` afterwards.

        :return: False when it was forgotten meanwhile.
        """
        if source not in self._masked:
            return False
        self._masked.remove(source)
        self._listen(source)
        if source.flags is not None:
            with suppress(OSError):  # closed by its owner: ready() says so to its reader
                unmask_signal(source.fd)
        return True

    def statistics(self) -> tuple[SourceStatistics, ...]:
        """Take the statistics of all."""
        return tuple(source.statistics() for source in tuple(self._sources.values()))

    def _listen(self, source: Source) -> None:
        if source.counted:
            self._terminals.append(source)
        else:
            self._poll.register(source.fd, select.POLLIN)

    def _ignore(self, source: Source) -> None:
        if source.counted:
            self._terminals.remove(source)
        else:
            self._poll.unregister(source.fd)

    def _watch(self, source: Source) -> None:
        if self._signals:
            try:
                source.flags = signal_when_readable(source.fd, INTERRUPT_SIGNAL)
            except OSError as error:
                raise OSError(error.errno, f'file descriptor {source.fd} cannot release task '
                              f'{source.task.name!r}: {error.strerror}') from error

    def _unwatch(self, source: Source) -> None:
        flags, source.flags = source.flags, None
        if flags is not None:
            with suppress(OSError):  # closed by its owner: nothing left to undo
                no_signal_when_readable(source.fd, flags)


def _has_bytes(source: Source) -> bool:
    """Return whether a terminal can be read, or its reader has to learn that it is gone."""
    try:
        return unread_bytes(source.fd) > 0
    except OSError:
        return True
