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

"""A lock that a process holds for its life: `kill -9` frees it too, and others see who has it."""

from __future__ import annotations

from collections.abc import Mapping
import fcntl
import json
import os
from pathlib import Path
import time
from types import MappingProxyType
from typing import Any

# A process that only checks whether the lock is held holds it for microseconds itself.
_TRIES = 20
_PAUSE_S = 0.01
_FACTS_BYTES_MAXIMUM = 4096
_NOBODY: Mapping[str, Any] = MappingProxyType({})


class LockFile:
    """
    A file under flock(2), with facts about its holder as JSON.

    Not for the real-time loop.

    :param path: in a folder that only this user can write.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._fd = -1
        self._facts: dict[str, Any] = {}
        # The lock belongs to the open file: a child that was forked would hold it as well.
        os.register_at_fork(after_in_child=self._forget)

    def acquire(self) -> bool:
        """
        Take the lock; False when another process has it.

        :raises OSError: the file cannot be made.
        """
        for _ in range(_TRIES):
            fd = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
            try:
                fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                os.close(fd)
                time.sleep(_PAUSE_S)
                continue
            if _same(fd, self.path):
                self._fd = fd
                return True
            os.close(fd)  # its holder has just ended and removed it
        return False

    def note(self, **facts: Any) -> None:
        """Say something about its holder, beside what was said before."""
        self._facts |= facts
        data = json.dumps(self._facts).encode()
        os.ftruncate(self._fd, 0)
        os.pwrite(self._fd, data, 0)

    def release(self) -> None:
        """Remove the file and release the lock; may be called twice."""
        fd, self._fd = self._fd, -1
        if fd >= 0:
            if _same(fd, self.path):
                self.path.unlink(missing_ok=True)
            os.close(fd)

    def _forget(self) -> None:
        fd, self._fd = self._fd, -1
        if fd >= 0:
            os.close(fd)


def holder(path: Path) -> Mapping[str, Any] | None:
    """
    Return who holds a lock.

    :return: what it noted, empty when that cannot be read; None when nobody holds it.
    """
    try:
        fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
    except OSError:
        return None
    try:
        fcntl.flock(fd, fcntl.LOCK_SH | fcntl.LOCK_NB)
        return None
    except BlockingIOError:
        data = os.pread(fd, _FACTS_BYTES_MAXIMUM, 0)
    except OSError:
        return None
    finally:
        os.close(fd)
    try:
        facts = json.loads(data)
    except (ValueError, RecursionError):
        return _NOBODY
    return facts if isinstance(facts, dict) else _NOBODY


def _same(fd: int, path: Path) -> bool:
    try:
        there = path.lstat()
    except OSError:
        return False
    mine = os.fstat(fd)
    return (mine.st_dev, mine.st_ino) == (there.st_dev, there.st_ino)
