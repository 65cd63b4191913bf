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

Every device returns its next due time, on an absolute time grid. The server waits for the first of
them, for bytes of a driver, or for a command.
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

# A pty does not signal a new reader, so this is polled.
_LONGEST_WAIT_NS: Final = 50 * NS_PER_MS
# Pause after a pump that failed, and limit for a device that is always due.
_SHORTEST_WAIT_NS: Final = 50_000
_MAX_LINE: Final = 4096


class Pumped(Protocol):
    """Runs in the server: a simulated device or a player."""

    @property
    def port(self) -> Plug:
        """Return its port."""

    def pump(self, now_ns: int) -> None:
        """Do everything that is due by now."""

    def next_event_ns(self) -> int:
        """Return when ``pump`` has to be called next."""

    def close(self) -> None:
        """Unplug."""


class CommandInput(Protocol):
    """Served when it is readable."""

    def fileno(self) -> int:
        """Return its file descriptor."""

    def serve(self) -> None:
        """Handle the input; never blocks."""

    def close(self) -> None:
        """Close it; may be called twice."""


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
        Store the devices; nothing runs yet.

        :param clock_ns: returns the time in nanoseconds.
        :param report: called when a device fails, once each time its problem changes.
        """
        self.problem_count = 0
        self._devices = tuple(devices)
        self._clock_ns = clock_ns
        self._report = report
        self._last_problem = ''
        self._input_fd: int | None = None
        self._on_line: Callable[[str], None] | None = None
        self._commands: CommandInput | None = None
        self._received = b''
        self._stopped = False
        self._wake_read, self._wake_write = os.pipe()
        os.set_blocking(self._wake_write, False)

    def read_lines(self, fd: int, on_line: Callable[[str], None]) -> None:
        """
        Pass on each line of text from a file descriptor; its end does not stop the server.

        :param fd: such as that of the standard input.
        """
        self._input_fd = fd
        self._on_line = on_line

    def watch(self, commands: CommandInput) -> None:
        """Serve another input, too, whenever it is readable."""
        self._commands = commands

    def run(self, *, on_start: Callable[[], None] | None = None,
            until: Callable[[], bool] | None = None) -> None:
        """
        Run until :meth:`stop`, then unplug every device.

        :param on_start: called first, to make the process die with its parent.
        :param until: called after each round; True ends the loop.
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
                self._report_problem(str(error))
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
        if self._commands is not None:
            self._commands.close()
            self._commands = None
        if self._wake_read >= 0:
            os.close(self._wake_read)
            os.close(self._wake_write)
            self._wake_read = self._wake_write = -1

    def _report_problem(self, problem: str) -> None:
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
        # Without a reader a pty is always readable (hang-up), so only the others are watched.
        if self._commands is not None:
            watched.append(self._commands.fileno())
        watched += [d.port.fileno() for d in self._devices if d.port.has_reader()]
        # select, because its time-out is in microseconds; that of poll and epoll is in
        # milliseconds.
        readable, _, _ = select.select(watched, [], [], wait_ns / NS_PER_S)
        if self._input_fd in readable:
            self._read_input()
        if self._commands is not None and self._commands.fileno() in readable:
            self._commands.serve()

    def _read_input(self) -> None:
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
