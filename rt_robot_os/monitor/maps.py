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

"""The maps of robots, one file each: the last map that a robot sent."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path

from rt_robot_os.messages.uplink.maps import MapMessage


class Maps:
    """
    Maps of robots in a folder. Thread-safe; methods block.

    :param folder: created when missing; readable by this user only.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._digests: dict[str, str] = {}

    def has(self, robot: str, sha256: str) -> bool:
        """Return whether the stored map of a robot has this SHA-256."""
        return bool(sha256) and self.digest(robot) == sha256

    def digest(self, robot: str) -> str:
        """Return the SHA-256 of the stored map of a robot; empty without one."""
        if robot not in self._digests:
            found = self.get(robot)
            self._digests[robot] = found.sha256 if found is not None else ''
        return self._digests[robot]

    def put(self, robot: str, found: MapMessage) -> None:
        """
        Store a map, replacing the previous one.

        :raises OSError: it cannot be written; the previous one is unchanged.
        """
        self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        path = self._path(robot)
        part = path.with_suffix('.part')
        handle = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        with open(handle, 'w', encoding='ascii') as file:
            json.dump(found.content(), file)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
        self._digests[robot] = found.sha256

    def get(self, robot: str) -> MapMessage | None:
        """Return the stored map of a robot; None without a complete one."""
        try:
            return MapMessage.from_json(json.loads(self._path(robot).read_text(encoding='ascii')))
        except (OSError, ValueError, AttributeError):
            return None

    def _path(self, robot: str) -> Path:
        # A robot's name must not determine a path.
        name = hashlib.sha256(robot.encode(errors='surrogatepass')).hexdigest()
        return self._folder / f'{name}.json'
