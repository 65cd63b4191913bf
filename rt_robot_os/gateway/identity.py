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

"""The ids of this robot and of this start of its gateway, which make record numbers unique."""

from __future__ import annotations

from contextlib import suppress
import os
from pathlib import Path
from typing import Final
from uuid import UUID
from uuid import uuid4

from rt_robot_os.base.errors import StartError
from rt_robot_os.linux.folders import read_file

_FILE: Final = 'robot.id'


class Identity:
    """
    The identity of this robot.

    :param folder: folder of the gateway's files; created with access for this user only.
    :ivar robot: id of the robot; it stays the same unless the folder is deleted.
    :ivar boot: id of this start.
    :raises StartError: the folder cannot be used.
    """

    def __init__(self, folder: Path) -> None:
        path = folder / _FILE
        try:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            self.robot = _read(path) or _write(path, folder)
        except OSError as error:
            raise StartError(f'{folder} cannot be used: {error.strerror}; set folder under '
                             '/**/gateway to a writable one') from error
        self.boot = str(uuid4())


def _read(path: Path) -> str:
    """Return the content of the file; empty when it is missing or truncated."""
    with suppress(FileNotFoundError, ValueError):
        return str(UUID(read_file(path).decode().strip()))
    return ''


def _write(path: Path, folder: Path) -> str:
    """Create an identity; it is on the disk before it is used."""
    made = str(uuid4())
    new = path.with_suffix('.new')
    fd = os.open(new, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
    with open(fd, 'wb') as file:
        file.write(made.encode())
        file.flush()
        os.fsync(fd)
    os.replace(new, path)
    at = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    os.fsync(at)
    os.close(at)
    return made
