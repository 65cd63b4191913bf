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
Run several simulated devices in one process and one thread.

Every device says when it is due next, on an absolute time grid, and the server waits for the first
of them, for a driver that sends something, or for a line of text that asks for a fault.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence
import os
import select
import time
from typing import Final
from typing import Protocol

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.sim.base import Plug

# A pty does not tell when a reader comes, so look every now and then.
_LONGEST_WAIT_NS: Final = 50 * NS_PER_MS
# After a pump that failed, and as a limit to a device that is always due.
_SHORTEST_WAIT_NS: Final = 50_000
_MAX_LINE: Final = 4096


class Pumped(Protocol):
    """What the server runs: a simulated device or a player."""

    @property
    def port(self) -> Plug:
        """Return where it is plugged in."""

    def pump(self, now_ns: int) -> None:
        """Do everything that is due by now."""

    def next_event_ns(self) -> int:
        """Return when ``pump`` has to be called next."""

    def close(self) -> None:
        """Unplug."""


class CommandInput(Protocol):
    """What is served when it is readable."""

    def fileno(self) -> int:
        """Return its file descriptor."""

    def serve(self) -> None:
        """Take what has come; never waits."""

    def close(self) -> None:
        """Take no more; may be called twice."""


class SimServer:
    """
    The loop.

    :ivar problem_count: pumps that failed; the device is tried again.
    """

    def __init__(
        self, devices: Sequence[Pumped], *, clock_ns: Callable[[], int] = time.monotonic_ns,
        report: Callable[[str], None] | None = None,
    ) -> None:
        """
        Keep the devices; nothing runs yet.

        :param clock_ns: the time, in nanoseconds.
        :param report: is told of a device that cannot go on, once each time its problem changes.
        """
        self.problem_count = 0
        self._devices = tuple(devices)
        self._clock_ns = clock_ns
        self._report = report
        self._last_problem = ''
        self._input_fd: int | None = None
        self._on_line: Callable[[str], None] | None = None
        self._orders: CommandInput | None = None
        self._received = b''
        self._stopped = False
        self._wake_read, self._wake_write = os.pipe()
        os.set_blocking(self._wake_write, False)

    def read_lines(self, fd: int, on_line: Callable[[str], None]) -> None:
        """
        Hand over each line of text that comes from a file descriptor; its end is not an exit.

        :param fd: such as that of the standard input.
        """
        self._input_fd = fd
        self._on_line = on_line

    def watch(self, orders: CommandInput) -> None:
        """Serve something else, too, whenever it is readable."""
        self._orders = orders

    def run(self, *, on_start: Callable[[], None] | None = None,
            until: Callable[[], bool] | None = None) -> None:
        """
        Run until :meth:`stop`, then unplug every device.

        :param on_start: called first, where a process asks to die with its parent.
        :param until: asked after each round whether that was all.
        """
        try:
            if on_start is not None:
                on_start()
            while not self._stopped:
                next_ns = self.step(self._clock_ns())
                if until is not None and until():
                    break
                self._wait(next_ns)
        finally:
            self.close()

    def step(self, now_ns: int) -> int:
        """
        Pump every device once.

        :return: when the next one is due.
        """
        for device in self._devices:
            try:
                device.pump(now_ns)
            except DeviceError as error:
                self._tell(str(error))
        return min((d.next_event_ns() for d in self._devices), default=now_ns + NS_PER_S)

    def stop(self) -> None:
        """End :meth:`run`; may be called from a signal handler."""
        self._stopped = True
        try:
            os.write(self._wake_write, b'x')
        except OSError:
            pass  # full, so it wakes up anyway; or closed, so it has ended

    def close(self) -> None:
        """Unplug every device; may be called twice."""
        for device in self._devices:
            device.close()
        if self._orders is not None:
            self._orders.close()
            self._orders = None
        if self._wake_read >= 0:
            os.close(self._wake_read)
            os.close(self._wake_write)
            self._wake_read = self._wake_write = -1

    def _tell(self, problem: str) -> None:
        self.problem_count += 1
        if problem != self._last_problem and self._report is not None:
            self._report(problem)
        self._last_problem = problem

    def _wait(self, next_ns: int) -> None:
        wait_ns = min(max(next_ns - self._clock_ns(), 0), _LONGEST_WAIT_NS)
        if self.problem_count:
            wait_ns = max(wait_ns, _SHORTEST_WAIT_NS)
        watched = [self._wake_read]
        if self._input_fd is not None:
            watched.append(self._input_fd)
        # Without a reader a pty is readable for ever (hang-up), so only the others are watched.
        if self._orders is not None:
            watched.append(self._orders.fileno())
        watched += [d.port.fileno() for d in self._devices if d.port.has_reader()]
        # select, because its time-out has microseconds where poll and epoll have milliseconds.
        readable, _, _ = select.select(watched, [], [], wait_ns / NS_PER_S)
        if self._input_fd in readable:
            self._take_input()
        if self._orders is not None and self._orders.fileno() in readable:
            self._orders.serve()

    def _take_input(self) -> None:
        fd, on_line = self._input_fd, self._on_line
        if fd is None or on_line is None:
            return
        try:
            data = os.read(fd, _MAX_LINE)
        except OSError:
            data = b''
        if not data:
            self._input_fd = None
            return
        *lines, rest = (self._received + data).split(b'\n')
        self._received = rest[-_MAX_LINE:]
        for line in lines:
            on_line(line.decode('utf-8', errors='replace').strip())
