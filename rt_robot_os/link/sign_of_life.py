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
The core's sign of life: a page of memory that its kernel writes and its clients read.

Packets are sent by the lowest tasks, so silence may only mean that those are starved. This page is
written by a task above all others: as long as its count grows, the kernel is alive, however long a
job takes. It also says for how long the link has been starved, and by which task.
"""

from __future__ import annotations

from contextlib import suppress
import mmap
import os
import struct
from typing import NamedTuple

from rt_robot_os.base.errors import LinkError
from rt_robot_os.linux.memory_file import MemoryFile

# The count, moment, moment at which the link ran, the task that runs instead; the count again.
_PAGE = struct.Struct('<Qqq64sQ')
LIFE_BYTES = _PAGE.size
_TRIES = 100


class Signs(NamedTuple):
    """
    What the page said; times on CLOCK_MONOTONIC.

    :ivar ticks: grows as long as the kernel ticks; 0 before the first time.
    :ivar at_ns: when it was written.
    :ivar served_ns: when the link's task ran last.
    :ivar task: what ran as the page was written, when the link has not run for a while.
    """

    ticks: int
    at_ns: int
    served_ns: int
    task: str


class LifePage:
    """
    The core's side; where there is no memory for it, clients have the heartbeats alone.

    :param given_fd: of a page that was made before, by whoever started the core; -1 makes one.
    """

    def __init__(self, given_fd: int = -1) -> None:
        self._count = 0
        self._memory = _taken(given_fd) if given_fd >= 0 else None
        if self._memory is None:
            with suppress(OSError):
                self._memory = MemoryFile.create('rt_robot_os life', 1, LIFE_BYTES)

    @property
    def fd(self) -> int:
        """Return what is sent to clients; -1 when there is none."""
        return self._memory.fd if self._memory is not None else -1

    def write(self, now_ns: int, served_ns: int, task: str = '') -> None:
        """Write the page; safe in the real-time loop."""
        if self._memory is not None and self._memory.fd >= 0:
            self._count += 1
            _PAGE.pack_into(self._memory.slots[0], 0, self._count, now_ns, served_ns,
                            task.encode(errors='replace'), self._count)

    def close(self) -> None:
        """Unmap it; clients keep their mappings. May be called twice."""
        if self._memory is not None:
            self._memory.close()


def _taken(fd: int) -> MemoryFile | None:
    try:
        os.set_inheritable(fd, False)
        return MemoryFile.received(fd, 1, LIFE_BYTES)
    except OSError:
        return None


class Life:
    """
    The client's side; it only reads.

    :param fd: as it came through the socket; closed here in any case.
    :raises LinkError: it is no such page.
    """

    def __init__(self, fd: int) -> None:
        try:
            if os.fstat(fd).st_size < LIFE_BYTES:
                raise LinkError(f'the page of life has {os.fstat(fd).st_size} bytes')
            self._map = mmap.mmap(fd, LIFE_BYTES, access=mmap.ACCESS_READ)
        except (OSError, ValueError) as error:
            raise LinkError(f'the core sent no usable page of life: {error}') from error
        finally:
            os.close(fd)

    def read(self) -> Signs | None:
        """
        Read the page.

        :return: None when it changes during each attempt: somebody else writes there.
        """
        for _ in range(_TRIES):
            # A copy first: the two counts are those of one moment.
            count, at_ns, served_ns, task, again = _PAGE.unpack(self._map[:LIFE_BYTES])
            if count == again:
                return Signs(count, at_ns, served_ns,
                             task.rstrip(b'\0').decode(errors='replace'))
        return None

    def close(self) -> None:
        """Unmap it; may be called twice."""
        self._map.close()
