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
from rt_robot_os.kernel.clock import MonotonicClock
from rt_robot_os.kernel.task import Task
from rt_robot_os.linux.interrupt import no_signal_when_readable
from rt_robot_os.linux.interrupt import signal_when_readable


class InterruptSources:
    """
    The table of descriptors and their tasks.

    They send signals only between :meth:`arm` and :meth:`disarm`: without a handler the signal
    would end the process. Under a virtual clock there are no signals; each wait looks at them.
    """

    __slots__ = ('_signals', '_armed', '_tasks', '_flags', '_poll')

    def __init__(self, clock: Clock) -> None:
        self._signals = isinstance(clock, MonotonicClock)
        self._armed = False
        self._tasks: dict[int, Task] = {}
        self._flags: dict[int, int] = {}
        self._poll = select.poll()

    def add(self, fd: int, task: Task) -> None:
        """
        Add a descriptor.

        :raises OSError: it cannot send signals.
        """
        if self._armed:
            self._watch(fd, task)
        self._tasks[fd] = task
        self._poll.register(fd, select.POLLIN)

    def remove(self, fd: int) -> None:
        """Forget a descriptor; unknown ones are fine."""
        if fd in self._tasks:
            self._poll.unregister(fd)
            self._unwatch(fd)
            del self._tasks[fd]

    def arm(self) -> None:
        """
        Let all send their signals from now on.

        :raises OSError: one of them cannot.
        """
        self._armed = True
        for fd, task in self._tasks.items():
            self._watch(fd, task)

    def disarm(self) -> None:
        """Let none send signals any more; may be called twice."""
        self._armed = False
        for fd in tuple(self._flags):
            self._unwatch(fd)

    def ready(self) -> list[Task]:
        """Give the tasks whose descriptors are readable; safe in the real-time loop."""
        return [self._tasks[fd] for fd, _ in self._poll.poll(0)]

    def _watch(self, fd: int, task: Task) -> None:
        if self._signals:
            try:
                self._flags[fd] = signal_when_readable(fd, INTERRUPT_SIGNAL)
            except OSError as error:
                raise OSError(error.errno, f'file descriptor {fd} cannot release task '
                              f'{task.name!r}: {error.strerror}') from error

    def _unwatch(self, fd: int) -> None:
        flags = self._flags.pop(fd, None)
        if flags is not None:
            with suppress(OSError):  # closed without telling: nothing left to undo
                no_signal_when_readable(fd, flags)
