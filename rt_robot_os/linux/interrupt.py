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

"""A signal when a file descriptor becomes readable (O_ASYNC and F_SETSIG, fcntl(2))."""

from __future__ import annotations

import fcntl
import os
import struct
import threading

F_SETSIG = 10
F_SETOWN_EX = 15
F_OWNER_TID = 0


def signal_when_readable(fd: int, signo: int) -> int:
    """
    Send a signal to the calling thread whenever the descriptor becomes readable.

    Works for sockets, pipes and terminals (ttys and ptys). Reading no longer blocks.

    :return: the flags that the descriptor had, for :func:`no_signal_when_readable`.
    :raises OSError: the descriptor is closed or does not support it.
    """
    owner = struct.pack('ii', F_OWNER_TID, threading.get_native_id())
    fcntl.fcntl(fd, F_SETOWN_EX, owner)
    fcntl.fcntl(fd, F_SETSIG, signo)
    flags = fcntl.fcntl(fd, fcntl.F_GETFL)
    fcntl.fcntl(fd, fcntl.F_SETFL, flags | fcntl.FASYNC | os.O_NONBLOCK)
    return flags


def mask_signal(fd: int) -> None:
    """
    Suspend the signals of a descriptor; reading it still never blocks.

    :raises OSError: the descriptor is closed.
    """
    fcntl.fcntl(fd, fcntl.F_SETFL, fcntl.fcntl(fd, fcntl.F_GETFL) & ~fcntl.FASYNC)


def unmask_signal(fd: int) -> None:
    """
    Undo :func:`mask_signal`.

    :raises OSError: the descriptor is closed.
    """
    fcntl.fcntl(fd, fcntl.F_SETFL, fcntl.fcntl(fd, fcntl.F_GETFL) | fcntl.FASYNC)


def no_signal_when_readable(fd: int, flags: int) -> None:
    """
    Undo :func:`signal_when_readable`.

    A terminal shares its flags with the shell that runs after this program, so blocking reads must
    be restored.

    :param flags: the return value of that function.
    :raises OSError: the descriptor is closed.
    """
    undone = (fcntl.FASYNC | os.O_NONBLOCK) & ~flags
    fcntl.fcntl(fd, fcntl.F_SETFL, fcntl.fcntl(fd, fcntl.F_GETFL) & ~undone)
    fcntl.fcntl(fd, F_SETSIG, 0)
