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

"""A lock file: held for the life of a process, released even by `kill -9`, readable by others."""

from __future__ import annotations

from collections.abc import Mapping
import fcntl
import json
import os
from pathlib import Path
import time
from types import MappingProxyType
from typing import Any

# A process that only checks the lock holds it itself for microseconds.
_TRIES = 20
_PAUSE_S = 0.01
_FACTS_BYTES_MAXIMUM = 4096
_UNKNOWN: Mapping[str, Any] = MappingProxyType({})


class LockFile:
    """
    A file under flock(2), with information about its holder as JSON.

    Not for the real-time loop.

    :param path: in a folder that only this user can write to.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._fd = -1
        self._facts: dict[str, Any] = {}
        # The lock belongs to the open file: a forked child would hold it as well.
        os.register_at_fork(after_in_child=self._forget)

    def acquire(self) -> bool:
        """
        Acquire the lock; False when another process holds it.

        :raises OSError: the file cannot be created.
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
            os.close(fd)  # its holder has just ended and removed the file
        return False

    def note(self, **facts: Any) -> None:
        """Add information about the holder."""
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
    Return information about the holder of a lock.

    :return: empty when it cannot be read; None when the lock is free.
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
        return _UNKNOWN
    return facts if isinstance(facts, dict) else _UNKNOWN


def _same(fd: int, path: Path) -> bool:
    try:
        there = path.lstat()
    except OSError:
        return False
    opened = os.fstat(fd)
    return (opened.st_dev, opened.st_ino) == (there.st_dev, there.st_ino)
