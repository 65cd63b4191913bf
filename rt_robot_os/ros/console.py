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
Prevent the output of this process from blocking it.

A terminal that is stopped (Ctrl-S) or a pipe that is not read blocks its writer, and rclpy holds
Python's lock meanwhile: every thread would stop. So standard output and standard error, of this
process and of its children, are redirected to a pipe that threads here read immediately.
"""

from __future__ import annotations

from collections import deque
from contextlib import suppress
import faulthandler
import fcntl
import os
import select
import stat
import termios
import threading
import time

_PIPE_BYTES = 1 << 20
_KEPT_BYTES = 1 << 20
_READ_BYTES = 64 * 1024
_END_PATIENCE_S = 1.0
_POLL_S = 0.005
_COLOURS = 'RCUTILS_COLORIZED_OUTPUT'


def _can_block(status: os.stat_result, fd: int) -> bool:
    return stat.S_ISFIFO(status.st_mode) or stat.S_ISSOCK(status.st_mode) or os.isatty(fd)


class Pump:
    """
    Forward output from some descriptors to their original target.

    :param fds: descriptors of the same output.
    :ivar dropped: lines that were dropped because the output was not read.
    """

    def __init__(self, fds: list[int]) -> None:
        self.dropped = 0
        self.real = os.dup(fds[0])
        self._fds = fds
        self._waiting: deque[bytes] = deque()
        self._bytes = 0
        self._writing = False
        self._changed = threading.Condition()
        self._source, write = os.pipe2(os.O_CLOEXEC)
        with suppress(OSError):  # above the user's limit: the default size is sufficient
            fcntl.fcntl(write, fcntl.F_SETPIPE_SZ, _PIPE_BYTES)
        os.set_blocking(write, False)
        for fd in fds:
            os.dup2(write, fd, inheritable=True)
        os.close(write)
        for run, name in ((self._read, 'take'), (self._write, 'give')):
            threading.Thread(target=run, name=f'rt_robot_os {name}', daemon=True).start()

    def close(self, deadline_s: float) -> None:
        """Wait until everything is written, or the deadline, and restore the descriptors."""
        while not self._empty() and time.monotonic() < deadline_s:
            time.sleep(_POLL_S)
        target = self.real if self._empty() else os.open(os.devnull, os.O_WRONLY)
        for fd in self._fds:
            os.dup2(target, fd, inheritable=True)

    def _empty(self) -> bool:
        size = bytearray(4)
        with self._changed:
            fcntl.ioctl(self._source, termios.FIONREAD, size)
            return not (any(size) or self._waiting or self._writing)

    def _read(self) -> None:
        ready = select.poll()
        ready.register(self._source, select.POLLIN)
        while ready.poll():
            # Under the lock: data that is neither in the pipe nor waiting counts as written.
            with self._changed:
                data = os.read(self._source, _READ_BYTES)
                if not data:
                    return
                self._waiting.append(data)
                self._bytes += len(data)
                while self._bytes > _KEPT_BYTES and len(self._waiting) > 1:
                    old = self._waiting.popleft()
                    self._bytes -= len(old)
                    self.dropped += old.count(b'\n')
                self._changed.notify()

    def _write(self) -> None:
        while True:
            with self._changed:
                self._writing = False
                while not self._waiting:
                    self._changed.wait()
                data = self._waiting.popleft()
                self._bytes -= len(data)
                self._writing = True
            left = memoryview(data)
            try:
                while left:
                    left = left[os.write(self.real, left):]
            except OSError:
                self.dropped += data.count(b'\n')  # the reader has closed it


class Console:
    """
    Standard output and standard error of this process.

    Python's fault handler writes to the original standard error, because data in the pipe of a
    crashing process is lost.
    """

    def __init__(self) -> None:
        self._pumps: list[Pump] = []

    @property
    def dropped(self) -> int:
        """Return the number of lines that were not read."""
        return sum(pump.dropped for pump in self._pumps)

    def open(self) -> None:  # noqa: A003
        """Redirect the outputs to pipes, except an output that never blocks (a file)."""
        groups: dict[tuple[int, int], list[int]] = {}
        for fd in (1, 2):
            with suppress(OSError):
                status = os.fstat(fd)
                if _can_block(status, fd):
                    groups.setdefault((status.st_dev, status.st_ino), []).append(fd)
        for fds in groups.values():
            if 2 in fds and os.isatty(2):
                os.environ.setdefault(_COLOURS, '1')
            with suppress(OSError):  # no descriptors: not redirected
                pump = Pump(fds)
                self._pumps.append(pump)
                if 2 in fds:
                    faulthandler.enable(pump.real)

    def close(self) -> None:
        """Write the remaining output, for a limited time; may be called twice."""
        deadline_s = time.monotonic() + _END_PATIENCE_S
        for pump in self._pumps:
            pump.close(deadline_s)
        self._pumps = []
