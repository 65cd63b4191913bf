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
Shared memory in slots, for samples that are too long for a packet.

It is an anonymous file (memfd_create(2)) whose descriptor is sent through a Unix socket. Its size
is sealed, so that neither side can remove pages that the other uses. It ends with the last process
that holds it: no clean-up is needed.

Allocating and releasing pages is slow in Linux, where no signal is served: some 50 us for 64 KiB.
So both are done in chunks, and a task may be preempted in between.
"""

from __future__ import annotations

from collections.abc import Sequence
import fcntl
import mmap
import os
import socket
import struct

_CHUNK_BYTES = 16 * 1024
_FD = struct.Struct('i')
FD_BYTES = socket.CMSG_SPACE(_FD.size)
_SEALS = fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW | fcntl.F_SEAL_SEAL

FREE, FILLING, LOANED = 0, 1, 2


def slot_stride(size: int) -> int:
    """Return the distance between slots: whole pages, so that no two slots share one."""
    return max(1, -(-size // mmap.PAGESIZE)) * mmap.PAGESIZE


class MemoryFile:
    """
    Shared slots; made by :meth:`create` or :meth:`received`.

    :ivar fd: its descriptor; -1 once it is closed.
    :ivar slots: a writable view of each.
    """

    def __init__(self, fd: int, count: int, size: int) -> None:
        stride = slot_stride(size)
        self.fd = fd
        self._map = mmap.mmap(fd, count * stride)
        self._all = memoryview(self._map)
        self.slots = [self._all[i * stride:i * stride + size] for i in range(count)]

    @classmethod
    def create(cls, name: str, count: int, size: int) -> MemoryFile:
        """
        Create the file and allocate all pages; takes some milliseconds, preemptible.

        :param name: as shown in ``/proc/PID/maps``.
        :param count: number of slots.
        :param size: bytes of each.
        :raises OSError: not enough memory or descriptors.
        """
        fd = os.memfd_create(name, os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
        try:
            os.ftruncate(fd, count * slot_stride(size))
            fcntl.fcntl(fd, fcntl.F_ADD_SEALS, _SEALS)
            made = cls(fd, count, size)
        except OSError:
            os.close(fd)
            raise
        zeros = bytes(_CHUNK_BYTES)
        for start in range(0, len(made._all), _CHUNK_BYTES):
            piece = made._all[start:start + _CHUNK_BYTES]
            piece[:] = zeros[:len(piece)]
        return made

    @classmethod
    def received(cls, fd: int, count: int, size: int) -> MemoryFile:
        """
        Map a file that was received through a socket; takes ownership of the descriptor.

        :raises OSError: its size or its seals are wrong.
        """
        try:
            if count < 1 or size < 1:
                raise OSError(f'a memory file of {count} slots of {size} bytes')
            if os.fstat(fd).st_size != count * slot_stride(size):
                raise OSError(f'a memory file of {os.fstat(fd).st_size} bytes for {count} slots '
                              f'of {size}')
            if fcntl.fcntl(fd, fcntl.F_GET_SEALS) & _SEALS != _SEALS:
                raise OSError('a memory file whose size is not sealed')
            return cls(fd, count, size)
        except OSError:
            os.close(fd)
            raise

    def discard(self) -> None:
        """Release the pages; their content is lost for both sides. Preemptible."""
        self._advise(mmap.MADV_REMOVE)

    def close(self) -> None:
        """
        Unmap it; may be called twice; preemptible.

        If views of slots still exist it is unmapped with the last one.
        """
        if self.fd < 0:
            return
        self._advise(mmap.MADV_DONTNEED)
        os.close(self.fd)
        self.fd = -1
        try:
            for slot in self.slots:
                slot.release()
            self._all.release()
            self._map.close()
        except BufferError:
            pass
        self.slots = []

    def _advise(self, advice: int) -> None:
        if self.fd < 0:
            return
        for start in range(0, len(self._map), _CHUNK_BYTES):
            try:
                self._map.madvise(advice, start, min(_CHUNK_BYTES, len(self._map) - start))
            except OSError:
                return


class Loans:
    """
    The states of the slots; any two calls may preempt each other.

    Bounded by construction: one byte per slot.
    """

    def __init__(self, count: int) -> None:
        self._states = bytearray(count)

    def acquire(self) -> int:
        """Allocate a free slot to fill it; -1 when there is none."""
        states = self._states
        slot = states.find(FREE)
        if slot >= 0:
            states[slot] = FILLING
        return slot

    def lend(self, slot: int) -> None:
        """Mark a slot as lent to the other side."""
        self._states[slot] = LOANED

    def put_back(self, slot: int) -> None:
        """Free a slot that was not handed over."""
        self._states[slot] = FREE

    def returned(self, slot: int) -> bool:
        """
        Free a slot that the other side returned.

        :return: False when the slot was not lent: the other side violates the protocol.
        """
        if not 0 <= slot < len(self._states) or self._states[slot] != LOANED:
            return False
        self._states[slot] = FREE
        return True

    @property
    def out(self) -> int:
        """Return the number of lent slots."""
        return self._states.count(LOANED)


def send_with_fd(connection: socket.socket, packet: bytes, fd: int) -> None:
    """
    Send a packet together with a descriptor.

    :raises BlockingIOError: the socket buffer is full.
    :raises OSError: the other side is gone.
    """
    connection.sendmsg([packet], [(socket.SOL_SOCKET, socket.SCM_RIGHTS, _FD.pack(fd))])


def received_fds(ancillary: Sequence[tuple[int, int, bytes]]) -> list[int]:
    """Return the descriptors that came with a packet; the caller has to close them."""
    found: list[int] = []
    for level, kind, data in ancillary:
        if level == socket.SOL_SOCKET and kind == socket.SCM_RIGHTS:
            whole = len(data) - len(data) % _FD.size
            found += [fd for fd, in _FD.iter_unpack(data[:whole])]
    return found
