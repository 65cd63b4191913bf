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


class InterruptSource:
    """A descriptor, its task, and its counters."""

    __slots__ = ('fd', 'name', 'task', 'separation_ns', 'open_ns', 'flags', 'arrivals', 'deferred',
                 'waits_for_job', 'counts_bytes')

    def __init__(self, fd: int, name: str, task: Task, separation_ns: int) -> None:
        self.fd = fd
        self.name = name
        self.task = task
        self.separation_ns = separation_ns
        self.open_ns = 0
        self.waits_for_job = False
        self.counts_bytes = is_raw_terminal(fd)
        self.flags: int | None = None
        self.arrivals = 0
        self.deferred = 0

    def statistics(self) -> SourceStatistics:
        """Return the statistics."""
        return SourceStatistics(self.name, self.task.name, self.arrivals, self.deferred)


class InterruptSources:
    """
    The table of descriptors and their tasks.

    Once the kernel runs all methods are called locked, except :meth:`statistics`.

    Descriptors send signals only between :meth:`arm` and :meth:`disarm`: without a handler the
    signal would end the process. With a clock without signals they are polled after each wait.

    A source that is readable again before its separation has passed is masked until then: it
    sends no signals meanwhile, so a flood costs at most one handler per separation. A source that
    becomes readable while a job of its task waits is masked until that job has ended: the job
    will read everything, so a flood costs nothing while the task does not run.

    For terminals the number of readable bytes is read one by one: ``poll`` would wait for a worker
    of Linux while bytes are in transit (:mod:`rt_robot_os.linux.terminal`). The signal comes when
    they can be read.
    """

    __slots__ = ('_signals', '_armed', '_sources', '_masked', '_early', '_poll', '_terminals')

    def __init__(self, clock: Clock) -> None:
        self._signals = clock.has_signals
        self._armed = False
        self._sources: dict[int, InterruptSource] = {}
        self._masked: list[InterruptSource] = []
        self._early: list[InterruptSource] = []
        self._poll = select.poll()
        self._terminals: list[InterruptSource] = []

    def add(self, fd: int, task: Task, separation_ns: int = 0, name: str = '') -> None:
        """
        Add a descriptor.

        :raises OSError: it cannot send signals.
        """
        self.remove(fd)
        source = InterruptSource(fd, name or f'fd {fd}', task, separation_ns)
        if self._armed:
            self._watch(source)
        self._sources[fd] = source
        self._register(source)

    def remove(self, fd: int) -> None:
        """Remove a descriptor; unknown ones are ignored."""
        source = self._sources.pop(fd, None)
        if source is None:
            return
        if source in self._masked:
            self._masked.remove(source)
        else:
            self._unregister(source)
        self._unwatch(source)

    def arm(self) -> None:
        """
        Enable the signals of all descriptors.

        :raises OSError: one of them cannot send signals.
        """
        self._armed = True
        for source in self._sources.values():
            source.open_ns = 0
            self._watch(source)

    def disarm(self) -> None:
        """Disable all signals; may be called twice."""
        self._armed = False
        self._early.clear()
        for source in self._sources.values():
            self._unwatch(source)
        while self._masked:
            self._register(self._masked.pop())

    def ready(self, now_ns: int) -> list[InterruptSource]:
        """Return the readable sources whose separation has passed; safe in the real-time loop."""
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
                source.waits_for_job = False
                self._early.append(source)
        return found

    def early(self) -> list[InterruptSource]:
        """Return, once, the sources that were masked because of their separation."""
        early, self._early = self._early, []
        return early

    def defer(self, source: InterruptSource) -> None:
        """Mask a source until the waiting job of its task has ended."""
        source.deferred += 1
        source.waits_for_job = True
        self._unregister(source)
        if source.flags is not None:
            with suppress(OSError):  # closed by its owner: nothing to do
                mask_signal(source.fd)
        self._masked.append(source)

    def waiting_for(self, task: Task) -> list[InterruptSource]:
        """Return, once, the deferred sources for which a job of a task had to end."""
        found = [source for source in self._masked if source.waits_for_job and source.task is task]
        for source in found:
            source.waits_for_job = False
        return found

    def reopen(self, source: InterruptSource) -> bool:
        """
        Unmask a source that was deferred; call :meth:`ready` afterwards.

        :return: False when it was removed meanwhile.
        """
        if source not in self._masked:
            return False
        self._masked.remove(source)
        self._register(source)
        if source.flags is not None:
            with suppress(OSError):  # closed by its owner: ready() reports it to the reader
                unmask_signal(source.fd)
        return True

    def statistics(self) -> tuple[SourceStatistics, ...]:
        """Return the statistics of all sources."""
        return tuple(source.statistics() for source in tuple(self._sources.values()))

    def _register(self, source: InterruptSource) -> None:
        if source.counts_bytes:
            self._terminals.append(source)
        else:
            self._poll.register(source.fd, select.POLLIN)

    def _unregister(self, source: InterruptSource) -> None:
        if source.counts_bytes:
            self._terminals.remove(source)
        else:
            self._poll.unregister(source.fd)

    def _watch(self, source: InterruptSource) -> None:
        if self._signals:
            try:
                source.flags = signal_when_readable(source.fd, INTERRUPT_SIGNAL)
            except OSError as error:
                raise OSError(error.errno, f'file descriptor {source.fd} cannot release task '
                              f'{source.task.name!r}: {error.strerror}') from error

    def _unwatch(self, source: InterruptSource) -> None:
        flags, source.flags = source.flags, None
        if flags is not None:
            with suppress(OSError):  # closed by its owner: nothing to undo
                no_signal_when_readable(source.fd, flags)


def _has_bytes(source: InterruptSource) -> bool:
    """Return whether a terminal can be read, or is gone, which its reader has to notice."""
    try:
        return unread_bytes(source.fd) > 0
    except OSError:
        return True
