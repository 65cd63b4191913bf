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
The folder of what was observed: pictures and clips, so many and so large, the oldest make room.

A file appears under its name when it is whole and on the disk, never before. Only files of our own
names are ever deleted. They are readable by their owner alone, for they show people.
"""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from datetime import timezone
import os
from pathlib import Path
import re
from typing import BinaryIO
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.errors import DeviceError

_PREFIX: Final = 'observed_'
_PART: Final = '.part'
_OURS: Final = re.compile(r'observed_\d{8}T\d{6}_\d{6}Z_[A-Za-z0-9_-]*\.(jpg|avi)')
_ODD: Final = re.compile(r'[^A-Za-z0-9-]+')
_LONGEST_WORD: Final = 32


class Kept(NamedTuple):
    """A file that is on the disk: where, how long, and how many older ones made room."""

    path: Path
    bytes: int  # noqa: A003
    deleted: int


def file_name(words: tuple[str, ...], suffix: str, moment: datetime) -> str:
    """
    Name a file; names in alphabetical order are in the order of time.

    :param words: such as subject, alarm and kind; what has no place in a name becomes ``_``.
    :param moment: in UTC.
    """
    plain = [_ODD.sub('_', word)[:_LONGEST_WORD].strip('_') for word in words]
    return (f'{_PREFIX}{moment:%Y%m%dT%H%M%S_%f}Z_'
            + '_'.join(word for word in plain if word) + suffix)


class ObservationFolder:
    """
    A folder with a limit.

    :param folder: it is made when the first file is kept.
    :param most_files: so many are kept.
    :param most_bytes: and so much of them.
    :ivar deleted: files that made room so far.
    """

    def __init__(self, folder: Path, most_files: int, most_bytes: int) -> None:
        self.folder = folder
        self.deleted = 0
        self._most_files = most_files
        self._most_bytes = most_bytes

    def keep(self, words: tuple[str, ...], suffix: str, size: int,
             write: Callable[[BinaryIO], object]) -> Kept:
        """
        Write a file, and delete the oldest ones that are too many.

        :param size: how long it will be, in bytes, to a little.
        :param write: writes it.
        :raises DeviceError: it cannot be; the text says why and what to do. Nothing is left.
        """
        if size > self._most_bytes:
            raise DeviceError(f'it has {size} bytes and the folder may have {self._most_bytes}: '
                              'raise observations_mb, or lower clip_s or clip_rate_hz')
        try:
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            self._remove_parts()
            deleted = self._make_room(size)
            path = self._free_path(words, suffix)
            written = self._write(path, write)
        except OSError as error:
            raise DeviceError(
                f'{self.folder} takes no file: {error.strerror or error}; make room on the disk, '
                'or set observations_folder to one that can be written') from error
        return Kept(path, written, deleted)

    def _free_path(self, words: tuple[str, ...], suffix: str) -> Path:
        while True:
            path = self.folder / file_name(words, suffix, datetime.now(timezone.utc))
            if not path.exists():
                return path

    def _write(self, path: Path, write: Callable[[BinaryIO], object]) -> int:
        part = path.with_name(f'.{path.name}{_PART}')
        try:
            handle = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
            with os.fdopen(handle, 'wb') as file:
                write(file)
                file.flush()
                os.fsync(file.fileno())
                written = file.tell()
            part.replace(path)
        except BaseException:
            part.unlink(missing_ok=True)
            raise
        folder = os.open(self.folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
        return written

    def _make_room(self, size: int) -> int:
        found = []
        with os.scandir(self.folder) as entries:
            for entry in entries:
                if _OURS.fullmatch(entry.name) and entry.is_file(follow_symlinks=False):
                    found.append((entry.name, entry.stat(follow_symlinks=False).st_size))
        found.sort()
        total, deleted = sum(length for _, length in found), 0
        for name, length in found:
            if len(found) - deleted < self._most_files and total + size <= self._most_bytes:
                break
            (self.folder / name).unlink(missing_ok=True)
            total -= length
            deleted += 1
        self.deleted += deleted
        return deleted

    def _remove_parts(self) -> None:
        """Remove what a process that was killed has left; each camera has a writer of its own."""
        for part in self.folder.glob(f'.{_PREFIX}*{_PART}'):
            try:
                # Another camera may be writing it now.
                if part.stat().st_mtime < datetime.now().timestamp() - 600.0:
                    part.unlink(missing_ok=True)
            except OSError:
                pass
