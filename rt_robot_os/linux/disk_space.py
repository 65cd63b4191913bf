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

"""Preallocation of disk space for a file."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Final

from rt_robot_os.linux import _libc

_BLOCK_BYTES: Final = 512  # unit of st_blocks on every file system
_NO_ROOM: Final = (errno.ENOSPC, errno.EDQUOT)


def reserve_space(fd: int, size_bytes: int) -> None:
    """
    Preallocate space for a file of a size (fallocate(2)); its length does not change.

    Appended bytes use this space even if the disk has become full meanwhile. Truncating the file
    releases the space, even when it is truncated to its own length. May wait for the disk.

    :raises OSError: there is no space (see :func:`is_full`), or the file system does not support
        it.
    """
    try:
        _libc.fallocate(fd, _libc.FALLOC_FL_KEEP_SIZE, 0, size_bytes)
    except OSError as error:
        raise OSError(error.errno, os.strerror(error.errno or 0)) from None


def allocated_bytes(path: Path) -> int:
    """Return the allocated bytes of a file, written or reserved; 0 when it does not exist."""
    try:
        return path.stat().st_blocks * _BLOCK_BYTES
    except FileNotFoundError:
        return 0


def is_full(error: OSError) -> bool:
    """Return whether an error means that the disk, or the quota of this user, is full."""
    return error.errno in _NO_ROOM
