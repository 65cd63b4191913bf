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
The hardware watchdog: it resets the machine unless it is fed in time.

The interface of Linux (Documentation/watchdog/watchdog-api.rst): opening ``/dev/watchdog`` starts
it, each write feeds it, and writing ``V`` right before closing stops it, unless the driver was
loaded with the option ``nowayout``.
"""

from __future__ import annotations

from contextlib import suppress
import fcntl
import os
from pathlib import Path
import struct

from rt_robot_os.linux.realtime import RtResult

WDIOC_SETTIMEOUT = 0xC0045706
_KEEPALIVE, _STOP = b'\0', b'V'


class MachineWatchdog:
    """
    An open watchdog; it is running.

    :ivar timeout_s: after which it resets the machine; 0 when the driver does not report it.
    """

    def __init__(self, fd: int, timeout_s: int) -> None:
        self.timeout_s = timeout_s
        self._fd = fd

    def feed(self) -> None:
        """Restart its timeout; a write to a driver that does not block."""
        if self._fd >= 0:
            with suppress(OSError):
                os.write(self._fd, _KEEPALIVE)

    def close(self, stop: bool = True) -> None:
        """
        Close it; may be called twice.

        :param stop: stop it; otherwise it resets the machine unless it is opened again in time.
        """
        if self._fd < 0:
            return
        fd, self._fd = self._fd, -1
        with suppress(OSError):
            if stop:
                os.write(fd, _STOP)
        os.close(fd)


def open_machine_watchdog(
    path: Path, timeout_s: int,
) -> tuple[RtResult, MachineWatchdog | None]:
    """
    Start a watchdog.

    :param timeout_s: requested timeout; drivers may round it.
    :return: the result, and the watchdog; None when it cannot be opened.
    """
    step = f'watchdog {path}'
    try:
        fd = os.open(path, os.O_WRONLY | os.O_CLOEXEC)
    except OSError as error:
        remedies = {
            FileNotFoundError: 'load the driver of the hardware, or softdog: modprobe softdog',
            PermissionError: f'give the group of the robot the right to write {path}, by udev'}
        remedy = remedies.get(type(error), f'another program may have it open: fuser -v {path}')
        return RtResult(False, step, f'{error.strerror}. Remedy: {remedy}'), None
    granted_s = 0
    try:
        answer = fcntl.ioctl(fd, WDIOC_SETTIMEOUT, struct.pack('=i', timeout_s))
        granted_s, = struct.unpack('=i', answer)
    except OSError:
        pass  # it has a fixed timeout
    return RtResult(True, step), MachineWatchdog(fd, granted_s)
