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
Memory that two processes share in slots: for samples that are too long for a packet.

It is a file without a name (memfd_create(2)) whose descriptor goes through a Unix socket. Its size
is sealed, so that neither side can take pages away under the other. It ends with the last process
that holds it: nothing is left behind, and nobody has to tidy up.

Taking pages and giving them back is slow in the kernel, where no signal is served: some 50 us for
64 KiB. So both are done piece by piece, and a task may be preempted in between.
"""

from __future__ import annotations

from collections.abc import Sequence
import fcntl
import mmap
import os
import socket
import struct

_PIECE_BYTES = 16 * 1024
_FD = struct.Struct('i')
FD_BYTES = socket.CMSG_SPACE(_FD.size)
_SEALS = fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW | fcntl.F_SEAL_SEAL

FREE, FILLING, LOANED = 0, 1, 2


def slot_stride(size: int) -> int:
    """Return the distance between slots of a size: whole pages, so that no two share one."""
    return max(1, -(-size // mmap.PAGESIZE)) * mmap.PAGESIZE


class MemoryFile:
    """
    Shared slots; made by :meth:`create` or :meth:`received`.

    :ivar fd: to be sent; -1 once it is closed.
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
        Make the file and take all of its pages; some milliseconds, but preemptible.

        :param name: as ``/proc/PID/maps`` shows it.
        :param count: number of slots.
        :param size: bytes of each.
        :raises OSError: there is not so much memory, or not so many descriptors.
        """
        fd = os.memfd_create(name, os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
        try:
            os.ftruncate(fd, count * slot_stride(size))
            fcntl.fcntl(fd, fcntl.F_ADD_SEALS, _SEALS)
            made = cls(fd, count, size)
        except OSError:
            os.close(fd)
            raise
        zeros = bytes(_PIECE_BYTES)
        for start in range(0, len(made._all), _PIECE_BYTES):
            piece = made._all[start:start + _PIECE_BYTES]
            piece[:] = zeros[:len(piece)]
        return made

    @classmethod
    def received(cls, fd: int, count: int, size: int) -> MemoryFile:
        """
        Take over a file that came through a socket, and with it its descriptor.

        :raises OSError: it is not what it is said to be.
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
        """Give the pages back to Linux; their content is lost for both sides. Preemptible."""
        self._advise(mmap.MADV_REMOVE)

    def close(self) -> None:
        """
        Unmap it; may be called twice, and is preemptible.

        Where somebody holds a view of a slot it is unmapped with the last one.
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
        for start in range(0, len(self._map), _PIECE_BYTES):
            try:
                self._map.madvise(advice, start, min(_PIECE_BYTES, len(self._map) - start))
            except OSError:
                return


class Loans:
    """
    Which slots are out on loan; any two calls may preempt each other.

    Bounded by construction: a slot is one byte, and nothing is kept in lists.
    """

    def __init__(self, count: int) -> None:
        self._states = bytearray(count)

    def take(self) -> int:
        """Take a free slot to fill it; -1 when there is none."""
        states = self._states
        slot = states.find(FREE)
        if slot >= 0:
            states[slot] = FILLING
        return slot

    def lend(self, slot: int) -> None:
        """Say that a slot is about to be handed over."""
        self._states[slot] = LOANED

    def put_back(self, slot: int) -> None:
        """Take a slot back that was not handed over after all."""
        self._states[slot] = FREE

    def returned(self, slot: int) -> bool:
        """
        Take a slot back from the other side.

        :return: False when that slot was not on loan: the other side does not keep the rules.
        """
        if not 0 <= slot < len(self._states) or self._states[slot] != LOANED:
            return False
        self._states[slot] = FREE
        return True

    @property
    def out(self) -> int:
        """How many slots are on loan."""
        return self._states.count(LOANED)


def send_with_fd(connection: socket.socket, packet: bytes, fd: int) -> None:
    """
    Send a packet together with a descriptor.

    :raises BlockingIOError: there is no room now.
    :raises OSError: the other side is gone.
    """
    connection.sendmsg([packet], [(socket.SOL_SOCKET, socket.SCM_RIGHTS, _FD.pack(fd))])


def received_fds(ancillary: Sequence[tuple[int, int, bytes]]) -> list[int]:
    """Return the descriptors that came with a packet; whoever asks has to close them."""
    found: list[int] = []
    for level, kind, data in ancillary:
        if level == socket.SOL_SOCKET and kind == socket.SCM_RIGHTS:
            whole = len(data) - len(data) % _FD.size
            found += [fd for fd, in _FD.iter_unpack(data[:whole])]
    return found
