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
Asking a terminal (a serial port, or a pty) how much there is to read, without waiting.

Bytes that arrive are queued; a worker of Linux, with the priority of an ordinary program, pushes
them to where they can be read. While bytes are queued, ``read`` and ``poll`` of a terminal that
has nothing to read wait for that worker, also with ``O_NONBLOCK`` and whatever the priority of the
thread that calls: tens of milliseconds beside programs that compute. Counting does not wait.
"""

from __future__ import annotations

import errno
import fcntl
import os
import sys
import termios
from typing import Final

_COUNT: Final = bytes(4)  # room for the C int of FIONREAD
_LOCAL_FLAGS: Final = 3  # index in what tcgetattr returns


def is_raw_terminal(fd: int) -> bool:
    """
    Return whether a descriptor is a terminal whose bytes can be read as soon as they are there.

    False for a terminal that hands over whole lines: its end of file is no byte to count.
    """
    try:
        return not termios.tcgetattr(fd)[_LOCAL_FLAGS] & termios.ICANON
    except (OSError, ValueError, termios.error):  # not a terminal, gone, or closed
        return False


def unread_bytes(fd: int) -> int:
    """
    Return how many bytes can be read from a terminal; safe in the real-time loop.

    Bytes that are not yet pushed do not count; ``O_ASYNC`` sends its signal when they are.

    :raises OSError: the other side has hung up, or the descriptor is closed or no terminal.
    """
    if fd < 0:  # of a closed port: fcntl.ioctl would raise ValueError
        raise OSError(errno.EBADF, os.strerror(errno.EBADF))
    return int.from_bytes(fcntl.ioctl(fd, termios.FIONREAD, _COUNT), sys.byteorder)
