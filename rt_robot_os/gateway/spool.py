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
Files of alarms for the server, stored here until it has them, across restarts.

A file is linked into this folder, or copied from another disk: it is not lost when the robot
deletes observations to free space. Only plain files with a matching name in the folder of
observations are accepted; links are not followed.
"""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping
from contextlib import suppress
from datetime import datetime
from datetime import timezone
import hashlib
import json
import os
from pathlib import Path
import re
import shutil
import stat
import time
from typing import Any
from typing import Final

from rt_robot_os.base.errors import RecordingError

#: As accepted by the server.
FILE_BYTES: Final = 256 << 20
_NAME: Final = re.compile(r'observed_(\d{8}T\d{6}_\d{6})Z_([A-Za-z0-9_-]*)\.(jpg|avi|wav)')
_KNOWN_MOST: Final = 2000
_BLOCK_BYTES: Final = 1 << 20
_TEXT_MOST: Final = 64
_NOW: Final = '%Y%m%dT%H%M%S_%f'


class Spool:
    """
    A folder of waiting files; one thread adds them, another may send them meanwhile.

    :param folder: created with access for its owner only.
    :param observations: folder of the robot's files.
    :param most_bytes: size limit; beyond it the oldest files are dropped.
    :ivar given_up: files that were dropped, or that the server refused.
    :ivar odd: names that are not those of the robot's observations.
    """

    def __init__(self, folder: Path, observations: Path, most_bytes: int) -> None:
        self.given_up = self.odd = 0
        self._folder = folder
        self._observations = observations
        self._most_bytes = most_bytes
        self._known_path = folder / 'known.json'
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        self._items = {str(each['id']): each for each in self._read()}
        self._since, self._known = self._read_known()

    # ---- what waits ---------------------------------------------------------------------------

    def waiting(self) -> list[dict[str, Any]]:
        """Return the waiting files: the small and useful pictures first, the oldest first."""
        return sorted(list(self._items.values()),  # a copy: others are added meanwhile
                      key=lambda each: (each['suffix'] != '.jpg', each['file']))

    def count_bytes(self) -> int:
        """Return the size of the waiting files."""
        return sum(int(each['size']) for each in list(self._items.values()))

    def part(self, item: Mapping[str, Any], offset: int, size: int) -> bytes:
        """
        Read a part of a file.

        :raises OSError: it is gone.
        """
        with self._data(str(item['id'])).open('rb') as file:
            file.seek(offset)
            return file.read(size)

    def done(self, name: str, given_up: bool = False) -> None:
        """Remove a file that the server has or will never accept; may be called twice."""
        if self._items.pop(name, None) is not None:
            self.given_up += given_up
        self._data(name).unlink(missing_ok=True)
        self._facts(name).unlink(missing_ok=True)

    # ---- what comes ---------------------------------------------------------------------------

    def take(self, told: Mapping[str, Any]) -> dict[str, Any] | None:
        """
        Add a file that the robot announces.

        :param told: content of `agent/observed`, with ``t_ns`` in UTC.
        :return: its description; None when it is known already.
        :raises RecordingError: it cannot be added; the text gives the reason.
        """
        path = Path(str(told.get('file', '')))
        matched = _NAME.fullmatch(path.name)
        if matched is None or Path(os.path.abspath(path.parent)) != Path(
                os.path.abspath(self._observations)):
            self.odd += 1
            raise RecordingError(f'{str(path)[:200]!r} is not a file of {self._observations}: set '
                                 'observations_folder of the gateway to that of the camera')
        if path.name in self._known:
            return None
        try:
            item = self._keep(path.name, told)
        except OSError as error:
            raise RecordingError(f'{path} cannot be stored for the server: '
                                 f'{error.strerror or error}') from error
        self._know(path.name)
        self._make_room()
        return item

    def missed(self) -> Iterator[dict[str, Any]]:
        """Yield observations made while the gateway did not run, by the names of files."""
        try:
            names = sorted(os.listdir(self._observations))
        except OSError:
            return
        for name in names:
            matched = _NAME.fullmatch(name)
            if matched is None or name in self._known or matched[1] < self._since:
                continue
            words = matched[2].split('_')
            moment = datetime.strptime(matched[1], _NOW).replace(tzinfo=timezone.utc)
            yield {'file': str(self._observations / name), 'kind': words[-1],
                   'alarm': words[-2] if len(words) > 1 else '',
                   'subject': '_'.join(words[:-2]),
                   't_ns': round(moment.timestamp()) * 1_000_000_000}

    def _keep(self, name: str, told: Mapping[str, Any]) -> dict[str, Any]:
        waiting = self._folder / f'new-{os.getpid()}'
        waiting.unlink(missing_ok=True)
        try:
            self._link(name, waiting)
            sha256, size = _hash(waiting)
            key = hashlib.sha256(f'{name} {sha256}'.encode()).hexdigest()[:32]
            waiting.rename(self._data(key))
        finally:
            waiting.unlink(missing_ok=True)
        item = {'id': key, 'sha256': sha256, 'size': size, 'file': name,
                'suffix': Path(name).suffix, 't_ns': int(told.get('t_ns') or time.time_ns()),
                **{word: str(told.get(word, ''))[:_TEXT_MOST]
                   for word in ('alarm', 'subject', 'kind', 'camera')},
                **{word: _whole(told.get(word)) for word in ('width', 'height')}}
        _write(self._facts(key), item)
        self._items[key] = item
        return item

    def _link(self, name: str, target: Path) -> None:
        folder = os.open(self._observations, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            with suppress(OSError):  # another disk, or another user's file: it is copied
                os.link(name, target, src_dir_fd=folder, follow_symlinks=False)
                return
            with open(_plain(name, folder), 'rb') as source, open(os.open(
                    target, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600),
                    'wb') as copy:
                shutil.copyfileobj(source, copy, _BLOCK_BYTES)
                copy.flush()
                os.fsync(copy.fileno())
        finally:
            os.close(folder)

    def _make_room(self) -> None:
        while self._items and self.count_bytes() > self._most_bytes:
            self.done(min(list(self._items.values()), key=lambda each: str(each['file']))['id'],
                      given_up=True)

    # ---- on the disk --------------------------------------------------------------------------

    def _data(self, name: str) -> Path:
        return self._folder / f'{name}.data'

    def _facts(self, name: str) -> Path:
        return self._folder / f'{name}.json'

    def _read(self) -> Iterator[dict[str, Any]]:
        for path in self._folder.glob('*.json'):
            if path == self._known_path:
                continue
            try:
                found = json.loads(path.read_text())
                if found['id'] == path.stem and self._data(
                        path.stem).stat().st_size == found['size']:
                    yield found
                    continue
            except (OSError, ValueError, KeyError, TypeError):
                pass
            path.unlink(missing_ok=True)
            self._data(path.stem).unlink(missing_ok=True)
            self.given_up += 1

    def _read_known(self) -> tuple[str, dict[str, None]]:
        try:
            found = json.loads(self._known_path.read_text())
            return str(found['since']), dict.fromkeys(map(str, found['names']))
        except (OSError, ValueError, KeyError, TypeError):
            since = datetime.now(timezone.utc).strftime(_NOW)
            _write(self._known_path, {'since': since, 'names': []})
            return since, {}

    def _know(self, name: str) -> None:
        self._known[name] = None
        if len(self._known) > _KNOWN_MOST:
            # Names are in order of time: files older than the removed ones are not searched.
            oldest = sorted(self._known)[:_KNOWN_MOST // 2]
            for each in oldest:
                del self._known[each]
            self._since = max(self._since, _stamp(oldest[-1]))
        _write(self._known_path, {'since': self._since, 'names': list(self._known)})


def _stamp(name: str) -> str:
    matched = _NAME.fullmatch(name)
    return matched[1] if matched else ''


def _whole(value: object) -> int:
    return value if isinstance(value, int) and 0 <= value < 1 << 31 else 0


def _plain(name: str | Path, folder: int | None = None) -> int:
    """
    Open a plain file for reading.

    :raises OSError: it is not a plain file, or too long.
    """
    handle = os.open(name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC,
                     dir_fd=folder)
    found = os.fstat(handle)
    if stat.S_ISREG(found.st_mode) and 0 < found.st_size <= FILE_BYTES:
        return handle
    os.close(handle)
    raise OSError(f'it is not a plain file of 1 to {FILE_BYTES} bytes')


def _hash(path: Path) -> tuple[str, int]:
    digest, size = hashlib.sha256(), 0
    with open(_plain(path), 'rb') as file:
        while block := file.read(_BLOCK_BYTES):
            digest.update(block)
            size += len(block)
    return digest.hexdigest(), size


def _write(path: Path, content: Mapping[str, Any]) -> None:
    part = path.with_suffix('.part')
    with part.open('w') as file:
        json.dump(content, file)
        file.flush()
        os.fsync(file.fileno())
    part.replace(path)
