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

"""The files of a journal in a folder of the disk, for this user only."""

from __future__ import annotations

import os
from pathlib import Path

from rt_robot_os.linux.disk_space import allocated_bytes
from rt_robot_os.linux.disk_space import reserve_space

_FLAGS = os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW


class JournalFolder:
    """
    A :class:`~rt_robot_os.features.alarms.journal_store.JournalStore` on a disk; not real-time.

    :param path: of the folder; a missing one is created.
    :raises OSError: it cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._fds: dict[str, int] = {}
        path.mkdir(mode=0o700, parents=True, exist_ok=True)

    def read(self, name: str) -> bytes:
        """Return a whole file; empty when there is none."""
        try:
            return (self.path / name).read_bytes()
        except FileNotFoundError:
            return b''

    def append(self, name: str, data: bytes) -> None:
        """Add bytes at the end of a file."""
        _write(self._opened(name), data)

    def sync(self, name: str) -> None:
        """Wait until the file is on the disk."""
        os.fsync(self._opened(name))

    def truncate(self, name: str, size: int) -> None:
        """Cut a file off."""
        os.ftruncate(self._opened(name), size)

    def blank(self, name: str, start: int) -> None:
        """Overwrite everything behind a position with ends of lines."""
        fd = os.open(self.path / name, _FLAGS)  # where it is to be: not at the end
        try:
            os.lseek(fd, start, os.SEEK_SET)
            _write(fd, b'\n' * (os.fstat(fd).st_size - start))
        finally:
            os.close(fd)

    def keep(self, name: str, size: int) -> None:
        """Reserve room for a file of this size; a missing file is created, empty."""
        reserve_space(self._opened(name), size)

    def kept(self, name: str) -> int:
        """Return the bytes that a file has on the disk, written or reserved."""
        return allocated_bytes(self.path / name)

    def write(self, name: str, data: bytes) -> None:
        """Rewrite a file and wait until it is on the disk."""
        self._close(name)
        fd = os.open(self.path / name, _FLAGS, 0o600)
        try:
            if os.fstat(fd).st_size:  # to cut off an empty one would give back what is kept
                os.ftruncate(fd, 0)
            _write(fd, data)
            os.fsync(fd)
        finally:
            os.close(fd)

    def rename(self, name: str, other: str) -> None:
        """Give a file another name."""
        self._close(name)
        self._close(other)
        os.replace(self.path / name, self.path / other)

    def sync_folder(self) -> None:
        """Wait until the names are on the disk."""
        fd = os.open(self.path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            os.fsync(fd)
        finally:
            os.close(fd)

    def remove(self, name: str) -> None:
        """Remove a file, if it is there."""
        self._close(name)
        (self.path / name).unlink(missing_ok=True)

    def close(self) -> None:
        """Close all files; may be called twice."""
        for name in list(self._fds):
            self._close(name)

    def _opened(self, name: str) -> int:
        if name not in self._fds:
            self._fds[name] = os.open(self.path / name, _FLAGS | os.O_APPEND, 0o600)
        return self._fds[name]

    def _close(self, name: str) -> None:
        fd = self._fds.pop(name, -1)
        if fd >= 0:
            os.close(fd)


def _write(fd: int, data: bytes) -> None:
    """Write all of it, or raise."""
    left = memoryview(data)
    while left:
        left = left[os.write(fd, left):]
