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

"""The file of the delivery log: a line is on the disk before its delivery or report."""

from __future__ import annotations

from contextlib import suppress
import os
from pathlib import Path
from typing import Final

from rt_robot_os.base.errors import StartError

#: Lines more than needed, with which the file is rewritten.
LINES_SPARE: Final = 4096
_LARGEST_BYTES: Final = 64 << 20


class DeliveryLogFile:
    """
    An append-only file of lines; calls may wait for the disk.

    A disk that is full or broken stops nothing: lines that cannot be stored are counted and
    reported.

    :param path: of the file; its folder is created, for this user only.
    :ivar problem: why the last line could not be stored; empty when it was.
    :ivar failed: lines that could not be stored.
    :raises StartError: the folder cannot be used.
    """

    def __init__(self, path: Path) -> None:
        self.problem = ''
        self.failed = 0
        self._path = path
        self._lines = 0
        try:
            path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            self._fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC
                               | os.O_NOFOLLOW, 0o600)
        except OSError as error:
            raise StartError(f'{path} cannot be written: {error.strerror}; set folder to one that '
                             'can be') from error

    def read(self) -> list[str]:
        """Return the lines; the last one may have been cut."""
        size = os.fstat(self._fd).st_size
        start = max(0, size - _LARGEST_BYTES)
        data = b''
        while start + len(data) < size:
            more = os.pread(self._fd, 1 << 20, start + len(data))
            if not more:
                break
            data += more
        lines = data.decode(errors='replace').splitlines()
        self._lines = len(lines)
        if data and not data.endswith(b'\n'):
            self._put(b'\n')  # a cut line must not damage the next one
        return lines

    def keep(self, line: str) -> bool:
        """Write a line and wait until it is on the disk; return whether it is."""
        if not self._put(line.encode()):
            return False
        self._lines += 1
        return True

    def is_long(self, needed: int) -> bool:
        """Return whether it has many more lines than this number."""
        return self._lines > needed + LINES_SPARE

    def rewrite(self, lines: list[str]) -> None:
        """Replace all lines by these, or leave the file unmodified."""
        new = self._path.with_suffix('.new')
        try:
            fd = os.open(new, os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND | os.O_CLOEXEC
                         | os.O_NOFOLLOW, 0o600)
            try:
                with os.fdopen(os.dup(fd), 'wb') as file:
                    file.write(''.join(lines).encode())
                os.fsync(fd)
                os.replace(new, self._path)
                folder = os.open(self._path.parent, os.O_RDONLY | os.O_DIRECTORY)
                os.fsync(folder)
                os.close(folder)
            except OSError:
                os.close(fd)
                raise
        except OSError as error:
            self.problem = f'{self._path} cannot be rewritten: {error.strerror}'
            with suppress(OSError):
                os.unlink(new)
            return
        os.close(self._fd)
        self._fd, self._lines = fd, len(lines)

    def _put(self, data: bytes) -> bool:
        try:
            size = os.fstat(self._fd).st_size
        except OSError as error:
            self.failed += 1
            self.problem = f'{self._path}: {error.strerror}'
            return False
        try:
            if os.write(self._fd, data) != len(data):
                raise OSError(28, 'No space left on device')
            os.fsync(self._fd)
        except OSError as error:
            self.failed += 1
            self.problem = f'{self._path}: {error.strerror}'
            with suppress(OSError):  # no partial line stays
                os.ftruncate(self._fd, size)
            return False
        self.problem = ''
        return True

    def close(self) -> None:
        """Close the file; may be called twice."""
        fd, self._fd = self._fd, -1
        if fd >= 0:
            os.close(fd)
