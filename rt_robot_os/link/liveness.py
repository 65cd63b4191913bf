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
The liveness counter of the core: a page of shared memory that its kernel writes.

Packets are sent by the lowest tasks, so missing packets may only mean that these tasks starve.
The page is written by a task above all others: as long as its count grows, the kernel is alive,
however long a job takes. It also holds for how long the link has been starved, and by which task.
"""

from __future__ import annotations

from contextlib import suppress
import mmap
import os
import struct
from typing import NamedTuple

from rt_robot_os.base.errors import LinkError
from rt_robot_os.linux.memory_file import MemoryFile

# The count, time, time at which the link ran last, the task that runs instead; the count again.
_PAGE = struct.Struct('<Qqq64sQ')
LIVENESS_BYTES = _PAGE.size
_TRIES = 100


class Liveness(NamedTuple):
    """
    The content of the page; times on CLOCK_MONOTONIC.

    :ivar ticks: grows as long as the kernel ticks; 0 before the first time.
    :ivar at_ns: when the page was written.
    :ivar served_ns: when the link's task ran last.
    :ivar task: the running task, if the link has not run for a while; empty otherwise.
    """

    ticks: int
    at_ns: int
    served_ns: int
    task: str


class LivenessPage:
    """
    The side of the core; without memory for it clients rely on heartbeats alone.

    :param given_fd: of a page that the parent process has created; -1 creates one.
    """

    def __init__(self, given_fd: int = -1) -> None:
        self._count = 0
        self._memory = _mapped(given_fd) if given_fd >= 0 else None
        if self._memory is None:
            with suppress(OSError):
                self._memory = MemoryFile.create('rt_robot_os life', 1, LIVENESS_BYTES)

    @property
    def fd(self) -> int:
        """Return the file descriptor to send to clients; -1 without memory."""
        return self._memory.fd if self._memory is not None else -1

    def write(self, now_ns: int, served_ns: int, task: str = '') -> None:
        """Write the page; safe in the real-time loop."""
        if self._memory is not None and self._memory.fd >= 0:
            self._count += 1
            _PAGE.pack_into(self._memory.slots[0], 0, self._count, now_ns, served_ns,
                            task.encode(errors='replace'), self._count)

    def close(self) -> None:
        """Unmap the page; clients keep their mappings. May be called twice."""
        if self._memory is not None:
            self._memory.close()


def _mapped(fd: int) -> MemoryFile | None:
    try:
        os.set_inheritable(fd, False)
        return MemoryFile.received(fd, 1, LIVENESS_BYTES)
    except OSError:
        return None


class LivenessReader:
    """
    The side of a client; it only reads.

    :param fd: as received through the socket; closed here in any case.
    :raises LinkError: it is not such a page.
    """

    def __init__(self, fd: int) -> None:
        try:
            if os.fstat(fd).st_size < LIVENESS_BYTES:
                raise LinkError(f'the liveness page has {os.fstat(fd).st_size} bytes')
            self._map = mmap.mmap(fd, LIVENESS_BYTES, access=mmap.ACCESS_READ)
        except (OSError, ValueError) as error:
            raise LinkError(f'the core sent an unusable liveness page: {error}') from error
        finally:
            os.close(fd)

    def read(self) -> Liveness | None:
        """
        Read the page.

        :return: None when it changed during every attempt: another process writes to it.
        """
        for _ in range(_TRIES):
            # Copy first, so that both counts belong to the same time.
            count, at_ns, served_ns, task, again = _PAGE.unpack(self._map[:LIVENESS_BYTES])
            if count == again:
                return Liveness(count, at_ns, served_ns,
                                task.rstrip(b'\0').decode(errors='replace'))
        return None

    def close(self) -> None:
        """Unmap the page; may be called twice."""
        self._map.close()
