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

"""The storage of a journal: its interface, and one in memory that can lose its power."""

from __future__ import annotations

from collections.abc import Callable
import errno
import os
from random import Random
from typing import Protocol


class JournalStore(Protocol):
    """
    A folder of a few files; each method raises ``OSError`` as the system does.

    After an error in :meth:`append` any part of the data may have been written.
    """

    def read(self, name: str) -> bytes:
        """Return a whole file; empty when there is none."""

    def append(self, name: str, data: bytes) -> None:
        """Add bytes at the end of a file; they are safe with :meth:`sync`."""

    def sync(self, name: str) -> None:
        """Wait until the file is safe against a loss of power."""

    def truncate(self, name: str, size: int) -> None:
        """Cut a file off."""

    def blank(self, name: str, start: int) -> None:
        """Overwrite everything behind a position with ends of lines; needs no room."""

    def write(self, name: str, data: bytes) -> None:
        """
        Rewrite a file and wait until it is safe; its name is safe after :meth:`sync_folder`.

        Room that was reserved for an empty file of this name is used.
        """

    def keep(self, name: str, size: int) -> None:
        """Reserve room for a file of this size; a missing file is created, empty."""

    def kept(self, name: str) -> int:
        """Return the bytes that a file has on the disk, written or reserved."""

    def rename(self, name: str, other: str) -> None:
        """Give a file another name, which another may have had."""

    def sync_folder(self) -> None:
        """Wait until the names are safe."""

    def remove(self, name: str) -> None:
        """Remove a file, if it is there."""


class Killed(BaseException):
    """The process is killed in the middle of an operation; only tests catch it."""


class _File:
    """A file: what a process reads, and what surely survives a loss of power."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.safe = b''
        self.kept = self.safely_kept = 0

    @property
    def room(self) -> int:
        return max(len(self.data), self.kept)


class MemoryStore:
    """
    A store in memory, for tests: it can be full, kill its user, and lose its power.

    :param room: bytes that it holds.
    :ivar calls: number of changes.
    :ivar kill_at: the call that raises :class:`Killed`, half done; 0 for none.
    """

    def __init__(self, room: int = 1 << 30) -> None:
        self.room = room
        self.calls = 0
        self.kill_at = 0
        self._files: dict[str, _File] = {}
        # The names as of the last sync_folder(), and after each change since.
        self._names: list[dict[str, _File]] = [{}]

    def lose_power(self, random: Random) -> None:
        """Keep what was synced, and a random part of the rest."""
        names = random.choice(self._names)
        for file in {id(each): each for each in names.values()}.values():
            data = bytes(file.data)
            if data.startswith(file.safe):
                more = random.randint(0, len(data) - len(file.safe))
                file.data = bytearray(data[:len(file.safe) + more])
            else:
                file.data = bytearray(random.choice((data, file.safe)))
            file.safe = bytes(file.data)
            file.kept = file.safely_kept = random.choice((file.kept, file.safely_kept))
        self._files = dict(names)
        self._names = [names]

    def read(self, name: str) -> bytes:
        """Return a whole file; empty when there is none."""
        file = self._files.get(name)
        return b'' if file is None else bytes(file.data)

    def append(self, name: str, data: bytes) -> None:
        """Append bytes; only a part of them when there is no room."""
        self._call(lambda: self._add(name, data[:len(data) // 2]))
        self._add(name, data)

    def sync(self, name: str) -> None:
        """Make a file safe."""
        self._call()
        file = self._files[name]
        file.safe, file.safely_kept = bytes(file.data), file.kept

    def truncate(self, name: str, size: int) -> None:
        """Truncate a file, and release its reserved room."""
        self._call()
        file = self._files[name]
        del file.data[size:]
        file.kept = file.safely_kept = 0

    def blank(self, name: str, start: int) -> None:
        """Overwrite the rest with ends of lines."""
        self._call()
        data = self._files[name].data
        data[start:] = b'\n' * (len(data) - start)

    def keep(self, name: str, size: int) -> None:
        """Reserve room for a file."""
        self._call()
        file = self._file(name)
        if size - file.room > self._free():
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        file.kept = max(file.kept, size)

    def kept(self, name: str) -> int:
        """Return the room of a file."""
        file = self._files.get(name)
        return 0 if file is None else file.room

    def write(self, name: str, data: bytes) -> None:
        """Rewrite a file."""
        if self.read(name):
            self._files.pop(name)
        self._call(lambda: self._add(name, data[:len(data) // 2]))
        self._add(name, data)
        self.sync(name)

    def rename(self, name: str, other: str) -> None:
        """Give a file another name."""
        self._call()
        self._files[other] = self._files.pop(name)
        self._named()

    def sync_folder(self) -> None:
        """Make the names safe."""
        self._call()
        self._names = [dict(self._files)]

    def remove(self, name: str) -> None:
        """Remove a file."""
        self._call()
        if self._files.pop(name, None) is not None:
            self._named()

    def _named(self) -> None:
        self._names.append(dict(self._files))

    def _add(self, name: str, data: bytes) -> None:
        file = self._file(name)
        free = file.room - len(file.data) + self._free()
        file.data += data[:free]
        if free < len(data):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def _file(self, name: str) -> _File:
        if name not in self._files:
            self._files[name] = _File()
            self._named()
        return self._files[name]

    def _free(self) -> int:
        return max(0, self.room - sum(each.room for each in self._files.values()))

    def _call(self, half: Callable[[], object] = lambda: None) -> None:
        self.calls += 1
        if self.calls == self.kill_at:
            half()
            raise Killed(f'killed in call {self.calls}')
