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

"""Processes: how a child ends with its parent, and whether Linux lets a process run."""

from __future__ import annotations

import os
from pathlib import Path
import signal
import weakref

from rt_robot_os.linux import _libc


def die_with_parent(parent_pid: int | None = None, signo: int = signal.SIGTERM) -> bool:
    """
    Ask for a signal when the parent dies (PR_SET_PDEATHSIG, prctl(2)).

    :param parent_pid: the parent that started this process; a parent that died before this call
        is noticed by comparing it with the present one.
    :return: False when the parent is gone already: the caller should end.
    """
    _libc.prctl(_libc.PR_SET_PDEATHSIG, int(signo), 0, 0, 0)
    return parent_pid is None or os.getppid() == parent_pid


def parent_of(pid: int) -> int:
    """Return the parent of a process; 0 when it has ended or is not ours to see."""
    try:
        return int(Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()[1])
    except (OSError, ValueError, IndexError):
        return 0


# For a process these are the numbers of its first thread (proc_pid_schedstat(5)).
_PATH = Path('/proc/self/schedstat')


class WaitingTime:
    """
    The waiting time of the main thread.

    Always 0 on a Linux without these numbers (CONFIG_SCHED_INFO).
    """

    def __init__(self) -> None:
        try:
            self._fd = os.open(_PATH, os.O_RDONLY | os.O_CLOEXEC)
        except OSError:
            self._fd = -1
        else:
            weakref.finalize(self, os.close, self._fd)

    def read(self) -> int:
        """Return the nanoseconds so far; about 1 us, safe in the real-time loop."""
        if self._fd < 0:
            return 0
        try:
            return int(os.pread(self._fd, 64, 0).split()[1])
        except (OSError, ValueError, IndexError):
            return 0


def computing(pid: int) -> tuple[bool, int]:
    """
    Look at the first thread of a process.

    :return: whether it runs or is ready to, and the nanoseconds that it has computed so far; not
        ready when there is no such process.
    """
    try:
        # The name, which stands before the state, may hold anything.
        state = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()[0]
        return state == 'R', int(Path(f'/proc/{pid}/schedstat').read_text().split()[0])
    except (OSError, ValueError, IndexError):
        return False, 0
