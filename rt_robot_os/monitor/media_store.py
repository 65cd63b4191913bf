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
Pictures, clips and sound of alarms as files, by robot and SHA-256; files are always complete.

A file grows as a ``.part`` while its parts arrive, on one or several connections of the robot. It
gets its name when its length and hash are as announced and it is on the disk. A robot never
reaches files of another one, not even by their hash. When the folder is full, the oldest file of
the robot with the most data is deleted.
"""

from __future__ import annotations

from dataclasses import dataclass
import hashlib
import os
from pathlib import Path
import re
import threading
import time
from typing import Final
from typing import NamedTuple

from rt_robot_os.messages.uplink.frames import PART_BYTES

#: Allowed types of files, by their first bytes; others are neither stored nor served.
JPEG: Final = 'image/jpeg'
AVI: Final = 'video/x-msvideo'
WAVE: Final = 'audio/wav'
FILE_BYTES: Final = 256 << 20
_PARTS_MOST: Final = 4
_PART: Final = '.part'
_SHA: Final = re.compile('[0-9a-f]{64}')
_PLAIN: Final = re.compile('[A-Za-z0-9-]{1,64}')
_MB: Final = 1_000_000
_BLOCK_BYTES: Final = 1 << 20


class FileRefused(Exception):
    """
    A file is refused.

    :ivar retry_s: when it may be offered again; 0: never.
    """

    def __init__(self, text: str, retry_s: float = 0.0) -> None:
        super().__init__(text)
        self.retry_s = retry_s


class Offered(NamedTuple):
    """A file that a robot has."""

    sha256: str
    size: int


@dataclass(frozen=True)
class MediaCounts:
    """
    The store in numbers.

    :ivar made_room: files deleted because the folder was full.
    :ivar expired: files deleted because they were too old.
    :ivar refused: files that were not as announced.
    """

    files: int
    bytes: int  # noqa: A003
    made_room: int
    expired: int
    refused: int


def type_of(head: bytes) -> str:
    """Return the media type of a file by its first 12 bytes; empty for one that is not allowed."""
    if head[:3] == b'\xff\xd8\xff':
        return JPEG
    if head[:4] == b'RIFF':
        return {b'AVI ': AVI, b'WAVE': WAVE}.get(head[8:12], '')
    return ''


class MediaStore:
    """
    A folder of files; its functions block, and any thread may call them.

    :param folder: created with the first file, with access for its owner only.
    :param most_mb: size limit in megabytes.
    :param keep_days: days after which files expire; 0 for never.
    """

    def __init__(self, folder: Path, most_mb: float, keep_days: float = 0.0) -> None:
        self._folder = folder
        self._most_bytes = round(most_mb * _MB)
        self._keep_s = keep_days * 86400.0
        self._lock = threading.Lock()
        self._made_room = self._expired = self._refused = 0
        self._sizes: dict[Path, tuple[float, int]] = {}
        for path in folder.glob('*/*'):
            if _SHA.fullmatch(path.name) and path.is_file() and not path.is_symlink():
                found = path.stat()
                self._sizes[path] = found.st_mtime, found.st_size

    def begin(self, robot: str, offered: Offered) -> int:
        """
        Process the announcement of a file.

        :return: the number of bytes that are stored already; its size when it is complete.
        :raises FileRefused: it is refused.
        """
        _check(offered)
        with self._lock:
            whole = self._path(robot, offered.sha256)
            if whole in self._sizes:
                return offered.size
            if offered.size > self._most_bytes:
                self._refused += 1
                raise FileRefused(f'{offered.size} bytes are more than the server keeps at all: '
                                  'raise media_mb of the monitor')
            part = whole.with_suffix(_PART)
            there = part.stat().st_size if part.exists() else 0
            if there >= offered.size:  # the server ended before it was checked
                part.unlink()
                return 0
            return there

    def add(self, robot: str, offered: Offered, offset: int, data: bytes | memoryview) -> int:
        """
        Store a part; after the last one the file is checked and made available.

        :param offset: its position; a part that was received before is ignored.
        :return: the number of stored bytes, which is the offset of the next part.
        :raises FileRefused: it is not as announced, or the disk is full or broken.
        """
        _check(offered)
        if len(data) > PART_BYTES:
            raise FileRefused(f'a part of {len(data)} bytes; at most {PART_BYTES}')
        with self._lock:
            try:
                return self._add(self._path(robot, offered.sha256), offered, offset, data)
            except OSError as error:
                raise FileRefused(f'the disk of the server takes nothing: '
                                  f'{error.strerror or error}', 30.0) from error

    def _add(self, whole: Path, offered: Offered, offset: int, data: bytes | memoryview) -> int:
        if whole in self._sizes:
            return offered.size
        part = whole.with_suffix(_PART)
        self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        whole.parent.mkdir(mode=0o700, exist_ok=True)
        there = part.stat().st_size if part.exists() else 0
        if not there:
            self._forget_parts(whole.parent)
        if offset != there:
            return there
        if there + len(data) > offered.size:
            part.unlink(missing_ok=True)
            self._refused += 1
            raise FileRefused(f'it is longer than the {offered.size} bytes that were promised')
        handle = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC
                         | os.O_NOFOLLOW, 0o600)
        with os.fdopen(handle, 'ab') as file:
            file.write(data)
            if there + len(data) == offered.size:
                file.flush()
                os.fsync(file.fileno())
        if there + len(data) == offered.size:
            self._finish(part, whole, offered)
        return there + len(data)

    def _finish(self, part: Path, whole: Path, offered: Offered) -> None:
        with part.open('rb') as file:
            kind = type_of(file.read(12))
            file.seek(0)
            found = hashlib.sha256()
            while block := file.read(_BLOCK_BYTES):
                found.update(block)
        if found.hexdigest() != offered.sha256 or not kind:
            part.unlink()
            self._refused += 1
            if kind:
                raise FileRefused('its SHA-256 is not the one that was promised', 1.0)
            raise FileRefused('it is neither JPEG, AVI nor WAVE')
        self._make_room(offered.size)
        part.rename(whole)
        folder = os.open(whole.parent, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
        self._sizes[whole] = time.time(), offered.size

    def _make_room(self, size: int) -> None:
        totals: dict[Path, int] = {}
        for path, (_, length) in self._sizes.items():
            totals[path.parent] = totals.get(path.parent, 0) + length
        while self._sizes and sum(totals.values()) + size > self._most_bytes:
            largest = max(totals, key=lambda each: totals[each])
            oldest = min((path for path in self._sizes if path.parent == largest),
                         key=lambda path: self._sizes[path][0])
            totals[largest] -= self._sizes[oldest][1]
            self._delete(oldest)
            self._made_room += 1
            if not totals[largest]:
                del totals[largest]

    def _delete(self, path: Path) -> None:
        path.unlink(missing_ok=True)
        del self._sizes[path]

    def _forget_parts(self, folder: Path) -> None:
        """Limit the number of incomplete files of a robot."""
        parts = sorted(folder.glob(f'*{_PART}'), key=lambda path: path.stat().st_mtime)
        for part in parts[:max(0, len(parts) - _PARTS_MOST + 1)]:
            part.unlink(missing_ok=True)

    def expire(self, now_s: float | None = None) -> int:
        """Delete expired files; return their number."""
        if not self._keep_s:
            return 0
        before = (time.time() if now_s is None else now_s) - self._keep_s
        with self._lock:
            old = [path for path, (moment, _) in self._sizes.items() if moment < before]
            for path in old:
                self._delete(path)
            self._expired += len(old)
        return len(old)

    def forget(self, robot: str, sha256: str) -> bool:
        """Delete a file; return whether it was there."""
        with self._lock:
            path = self._path(robot, sha256)
            if path not in self._sizes:
                return False
            self._delete(path)
            return True

    def find(self, robot: str, sha256: str) -> tuple[Path, str] | None:
        """Return the path of a complete file and its media type; None when it is missing."""
        if not _SHA.fullmatch(sha256):
            return None
        with self._lock:
            path = self._path(robot, sha256)
            if path not in self._sizes:
                return None
            try:
                with path.open('rb') as file:
                    return path, type_of(file.read(12))
            except OSError:
                return None

    def has(self, robot: str, sha256: str) -> bool:
        """Return whether a complete file is stored."""
        return bool(_SHA.fullmatch(sha256)) and self._path(robot, sha256) in self._sizes

    def counts(self) -> MediaCounts:
        """Return the counters."""
        with self._lock:
            return MediaCounts(len(self._sizes), sum(size for _, size in self._sizes.values()),
                               self._made_room, self._expired, self._refused)

    def _path(self, robot: str, sha256: str) -> Path:
        name = robot if _PLAIN.fullmatch(robot) else hashlib.sha256(robot.encode()).hexdigest()
        return self._folder / name / sha256


def _check(offered: Offered) -> None:
    if not _SHA.fullmatch(offered.sha256):
        raise FileRefused('its SHA-256 is none')
    if not 0 < offered.size <= FILE_BYTES:
        raise FileRefused(f'{offered.size} bytes; 1 to {FILE_BYTES} are taken')
