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

"""How much memory a process has, and which processes a process started."""

from __future__ import annotations

import os
from pathlib import Path

_PROC = Path('/proc')


def resident_bytes(pid: int) -> int:
    """
    Read the resident size of a process.

    :raises OSError: it is gone.
    """
    pages = int((_PROC / str(pid) / 'statm').read_text().split()[1])
    return pages * os.sysconf('SC_PAGE_SIZE')


def proportional_bytes(pid: int) -> int:
    """
    Read the resident size of a process with each shared page divided among those that share it.

    :raises OSError: it is gone, or this kernel does not tell.
    """
    for line in (_PROC / str(pid) / 'smaps_rollup').read_text().splitlines():
        if line.startswith('Pss:'):
            return int(line.split()[1]) * 1024
    raise OSError('smaps_rollup has no line Pss')


def descendants(pid: int) -> dict[int, str]:
    """Find the processes that a process started, and theirs, with their command lines."""
    parents: dict[int, int] = {}
    for entry in _PROC.iterdir():
        if entry.name.isdigit():
            try:
                stat = (entry / 'stat').read_text()
            except OSError:
                continue
            parents[int(entry.name)] = int(stat.rpartition(')')[2].split()[1])
    found = {pid}
    while True:
        further = {child for child, parent in parents.items() if parent in found} - found
        if not further:
            break
        found |= further
    return {child: _command(child) for child in sorted(found - {pid})}


def _command(pid: int) -> str:
    try:
        return (_PROC / str(pid) / 'cmdline').read_bytes().replace(b'\0', b' ').decode().strip()
    except OSError:
        return ''
