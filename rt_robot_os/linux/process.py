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

"""How a child process ends with its parent, so that nothing is left behind."""

from __future__ import annotations

import os
from pathlib import Path
import signal

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
