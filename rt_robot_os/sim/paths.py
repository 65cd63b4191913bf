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

"""Locks on the paths of simulated devices: each is served by one simulator, and ends with it."""

from __future__ import annotations

from collections.abc import Iterable
import os
from pathlib import Path

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.linux.lock_file import holder
from rt_robot_os.linux.lock_file import LockFile


def hold_paths(folder: Path, names: Iterable[str]) -> list[LockFile]:
    """
    Lock the paths of some devices, and remove those of a killed simulator.

    Linux reuses the numbers of ptys: an old link could lead to a terminal of the user.

    :return: the locks to release at the end.
    :raises DeviceError: another process simulates one of them, or the folder cannot be written.
    """
    held: list[LockFile] = []
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        for path in folder.glob('.*.lock'):
            _remove_dead(path)
        for name in names:
            lock = LockFile(_lock_path(folder, name))
            if not lock.acquire():
                pid = (holder(lock.path) or {}).get('pid', 'unknown')
                raise DeviceError(f'{folder / name} is simulated by another process (pid {pid}): '
                                  'stop that one, or choose another --dir')
            held.append(lock)
            lock.note(pid=os.getpid())
    except OSError as error:
        release(held)
        if isinstance(error, DeviceError):
            raise
        raise DeviceError(f'{folder} cannot be used ({error.strerror}): choose another '
                          'folder (--dir)') from error
    return held


def release(held: Iterable[LockFile]) -> None:
    """Release the paths; may be called twice."""
    for lock in held:
        lock.release()


def _lock_path(folder: Path, name: str) -> Path:
    return folder / f'.{name}.lock'


def _remove_dead(path: Path) -> None:
    lock = LockFile(path)
    if holder(path) is None and lock.acquire():
        link = path.with_name(path.name.removeprefix('.').removesuffix('.lock'))
        if link.is_symlink():
            link.unlink()
        lock.release()
