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

"""Room on a disk that is kept for a file before anything is written there."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Final

from rt_robot_os.linux import _libc

_BLOCK_BYTES: Final = 512  # of st_blocks, whatever the file system has
_NO_ROOM: Final = (errno.ENOSPC, errno.EDQUOT)


def keep_room(fd: int, size_bytes: int) -> None:
    """
    Keep room for a file of such a size (fallocate(2)); its length stays as it is.

    Bytes that are added find this room also when the disk has become full meanwhile. To cut the
    file off gives the room back, even to its own length. May wait for the disk.

    :raises OSError: there is no room (see :func:`is_full`), or the file system cannot do it.
    """
    try:
        _libc.fallocate(fd, _libc.FALLOC_FL_KEEP_SIZE, 0, size_bytes)
    except OSError as error:
        raise OSError(error.errno, os.strerror(error.errno or 0)) from None


def room_of(path: Path) -> int:
    """Return the bytes that a file has on its disk, written or kept; 0 when it is not there."""
    try:
        return path.stat().st_blocks * _BLOCK_BYTES
    except FileNotFoundError:
        return 0


def is_full(error: OSError) -> bool:
    """Return whether an error says that there is no room, for this user or at all."""
    return error.errno in _NO_ROOM
