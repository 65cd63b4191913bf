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

"""Which CPU a core is pinned to: several robots on one machine spread over its CPUs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from collections.abc import Iterable
import fcntl
import os
import time
from typing import Final

from rt_robot_os.link.robots import running_cores
from rt_robot_os.linux.lock_file import LockFile

ANY: Final = -1
_TRIES: Final = 100
_PAUSE_S: Final = 0.01


def choose_cpu(wanted: int, lock: LockFile) -> int:
    """
    Choose the CPU of a core and note it in its lock, which the next core reads.

    Robots of other users, and those with another runtime folder, are not considered.

    :param wanted: the setting ``core.cpu``; a CPU is chosen only for ``ANY``.
    :return: the number of a CPU, or ``wanted``.
    """
    folder = os.open(lock.path.parent, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        _lock(folder)  # so that of two cores that start together the second sees the first
        if wanted == ANY:
            taken = [cpu for facts in running_cores().values()
                     if isinstance(cpu := facts.get('cpu'), int) and cpu >= 0]
            wanted = least_used(os.sched_getaffinity(0), taken)
        lock.note(cpu=wanted)
    finally:
        os.close(folder)
    return wanted


def _lock(folder: int) -> None:
    for _ in range(_TRIES):  # a process that was stopped here must not block the others
        try:
            fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except BlockingIOError:
            time.sleep(_PAUSE_S)


def least_used(allowed: Collection[int], taken: Iterable[int]) -> int:
    """Return the CPU with the fewest robots, of several the last: Linux often uses the first."""
    robots = Counter(taken)
    return min(allowed, key=lambda cpu: (robots[cpu], -cpu))
