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
The number of readable bytes of a terminal (a serial port, or a pty), without waiting.

Bytes that arrive are queued; a worker of Linux, with the priority of an ordinary program, moves
them to the read buffer. While bytes are queued, ``read`` and ``poll`` of a terminal with an empty
read buffer wait for that worker, even with ``O_NONBLOCK`` and whatever the priority of the calling
thread: tens of milliseconds on a busy machine. Reading the number of bytes does not wait.
"""

from __future__ import annotations

import errno
import fcntl
import os
import sys
import termios
from typing import Final

_COUNT: Final = bytes(4)  # room for the C int of FIONREAD
_LOCAL_FLAGS: Final = 3  # index in the result of tcgetattr


def is_raw_terminal(fd: int) -> bool:
    """
    Return whether a descriptor is a terminal in non-canonical mode.

    False for a terminal in canonical mode: its end of file does not count as a byte.
    """
    try:
        return not termios.tcgetattr(fd)[_LOCAL_FLAGS] & termios.ICANON
    except (OSError, ValueError, termios.error):  # not a terminal, gone, or closed
        return False


def unread_bytes(fd: int) -> int:
    """
    Return how many bytes can be read from a terminal; safe in the real-time loop.

    Queued bytes do not count; ``O_ASYNC`` sends its signal when they become readable.

    :raises OSError: the other side has hung up, or the descriptor is closed or not a terminal.
    """
    if fd < 0:  # a closed port: fcntl.ioctl would raise ValueError
        raise OSError(errno.EBADF, os.strerror(errno.EBADF))
    return int.from_bytes(fcntl.ioctl(fd, termios.FIONREAD, _COUNT), sys.byteorder)
