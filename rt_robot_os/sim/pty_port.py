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
The port of a simulated device: a pty under a constant path.

The path is a symbolic link, which disappears when the device is unplugged and returns, to another
pty, when it is plugged in again, as udev's links do. Nothing blocks: bytes without a reader are
dropped and counted, like those of a UART that is not connected.
"""

from __future__ import annotations

import os
from pathlib import Path
import pty
import select
import tty

from rt_robot_os.base.errors import DeviceError

_MAX_READ = 4096


class PtyPort:
    """
    A pty and the link to it.

    :ivar link: the path that the driver opens.
    :ivar bytes_sent: bytes that the pty has accepted.
    :ivar bytes_dropped: bytes without a reader, or without room.
    """

    def __init__(self, link: str | os.PathLike[str]) -> None:
        """Store the path; nothing is opened."""
        self.link = Path(link)
        self.bytes_sent = 0
        self.bytes_dropped = 0
        self._master = -1
        self._slave_path = ''
        self._poll = select.poll()

    @property
    def plugged(self) -> bool:
        """Return whether the link exists."""
        return self._master >= 0

    def fileno(self) -> int:
        """Return the file descriptor of the device's end, -1 when unplugged."""
        return self._master

    def plug(self) -> None:
        """
        Make a pty and the link to it.

        :raises DeviceError: no pty is available, or the link cannot be made.
        """
        if self.plugged:
            return
        try:
            master, slave = pty.openpty()
        except OSError as error:
            raise DeviceError(f'{self.link}: no pty is available ({error})') from error
        try:
            tty.setraw(slave)
            self._slave_path = os.ttyname(slave)
            os.set_blocking(master, False)
            self._make_link()
        except OSError as error:
            os.close(master)
            raise DeviceError(
                f'{self.link} cannot be made ({error}): choose another folder') from error
        finally:
            # With the other end closed here, POLLHUP shows whether a reader exists.
            os.close(slave)
        self._master = master
        self._poll.register(master, select.POLLIN)

    def unplug(self) -> None:
        """Remove the link and the pty; a reader gets end of file. May be repeated."""
        if not self.plugged:
            return
        self._remove_link()
        self._poll.unregister(self._master)
        os.close(self._master)
        self._master = -1

    def has_reader(self) -> bool:
        """Return whether a program has the port open."""
        return self.plugged and not any(
            events & select.POLLHUP for _, events in self._poll.poll(0))

    def write(self, data: bytes) -> None:
        """Send without blocking; bytes that do not fit are dropped and counted."""
        sent = 0
        if self.has_reader():
            try:
                sent = os.write(self._master, data)
            except OSError:  # full, or closed at this moment
                sent = 0
        self.bytes_sent += sent
        self.bytes_dropped += len(data) - sent

    def read(self) -> bytes:
        """Return the bytes of the driver, without blocking; empty if there are none."""
        if not self.plugged:
            return b''
        try:
            return os.read(self._master, _MAX_READ)
        except OSError:  # no bytes, or no reader
            return b''

    def _make_link(self) -> None:
        self.link.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        if self.link.exists() and not self.link.is_symlink():
            raise FileExistsError(f'{self.link} is a file of another program')
        # Replaced atomically: a reader sees the old link or the new one.
        temporary = self.link.with_name(f'.{self.link.name}.{os.getpid()}')
        temporary.unlink(missing_ok=True)
        temporary.symlink_to(self._slave_path)
        temporary.replace(self.link)

    def _remove_link(self) -> None:
        try:
            if os.readlink(self.link) == self._slave_path:
                self.link.unlink()
        except OSError:
            pass  # another process has removed or replaced it
