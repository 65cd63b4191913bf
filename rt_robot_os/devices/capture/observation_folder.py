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
The folder of observations: pictures and clips, limited in number and size; the oldest are deleted.

A file appears under its name only when it is complete and on the disk. Only files with names of
this class are deleted. They are readable only by their owner, because they show people.
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


class StoredObservation(NamedTuple):
    """A stored file: path, size, and the number of older ones deleted for it."""

    path: Path
    bytes: int  # noqa: A003
    deleted: int


def file_name(words: tuple[str, ...], suffix: str, moment: datetime) -> str:
    """
    Return the name of a file; alphabetical order is the order of time.

    :param words: such as subject, alarm and kind; characters not allowed in a name become ``_``.
    :param moment: in UTC.
    """
    plain = [_ODD.sub('_', word)[:_LONGEST_WORD].strip('_') for word in words]
    return (f'{_PREFIX}{moment:%Y%m%dT%H%M%S_%f}Z_'
            + '_'.join(word for word in plain if word) + suffix)


class ObservationFolder:
    """
    A folder with a limit.

    :param folder: created with the first file.
    :param most_files: largest number of files.
    :param most_bytes: largest total size.
    :ivar deleted: number of files deleted so far.
    """

    def __init__(self, folder: Path, most_files: int, most_bytes: int) -> None:
        self.folder = folder
        self.deleted = 0
        self._most_files = most_files
        self._most_bytes = most_bytes

    def store(self, words: tuple[str, ...], suffix: str, size: int,
              write: Callable[[BinaryIO], object]) -> StoredObservation:
        """
        Write a file, and delete the oldest ones above the limits.

        :param size: its approximate size in bytes.
        :param write: writes it.
        :raises DeviceError: it cannot be written; the text contains the remedy. No part of it
            remains.
        """
        if size > self._most_bytes:
            raise DeviceError(f'it has {size} bytes, the limit of the folder is '
                              f'{self._most_bytes}: raise observations_mb, or lower clip_s or '
                              'clip_rate_hz')
        try:
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            self._remove_parts()
            deleted = self._make_room(size)
            path = self._free_path(words, suffix)
            written = self._write(path, write)
        except OSError as error:
            raise DeviceError(
                f'{self.folder}: a file cannot be written: {error.strerror or error}; free space '
                'on the disk, or set observations_folder to a writable one') from error
        return StoredObservation(path, written, deleted)

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
        """Remove incomplete files of a killed process; each camera has its own writer."""
        for part in self.folder.glob(f'.{_PREFIX}*{_PART}'):
            try:
                # Another camera may currently be writing it.
                if part.stat().st_mtime < datetime.now().timestamp() - 600.0:
                    part.unlink(missing_ok=True)
            except OSError:
                pass
