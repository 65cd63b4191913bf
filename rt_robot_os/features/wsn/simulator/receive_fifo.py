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
The receive FIFO of a CC2420 after a frame was cut off, and how TinyOS 2 reads it.

When an emulated mote starts to send while it receives, the chip leaves the first bytes of the
cut-off frame in the receive FIFO. It raises FIFOP when the *first* frame in the FIFO is complete,
which the cut-off one never is, and TinyOS starts to read only at that edge. So the mote is deaf:
it receives no frame and no acknowledgement, and acknowledges nothing, until the 128 bytes are
full. The overflow raises FIFOP; TinyOS reads up to the first invalid length, and flushes the FIFO.

After the flush the emulated chip still counts down the bytes of the frame that TinyOS had started
to read. While this count and TinyOS do not reach the end of a frame together, a frame that was
completed during the reading is not reported: the acknowledgement that follows a frame for another
node stays in the FIFO, and the mote is deaf again.

Sources: TinyOS 2.1.2, ``tos/chips/cc2420/receive/CC2420ReceiveP.nc`` (``InterruptFIFOP.fired``,
``RXFIFO.readDone``, ``waitForNextPacket``, ``flush``) and
``transmit/CC2420TransmitP.nc`` (``attemptSend``); the chip as MSPSim emulates it,
``se/sics/mspsim/chip/CC2420.java`` (``receivedByte``, ``dataReceived``, ``flushRX``). A real
CC2420 with CCA mode 3, as TinyOS sets it (``CC2420ControlP.nc``), does not send into a frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final
from typing import NamedTuple

from rt_robot_os.features.wsn.radio.cc2420 import BYTE_NS
from rt_robot_os.features.wsn.simulator.air import Transmission

#: Capacity of the FIFO.
CAPACITY_BYTES: Final = 128
#: Preamble and start of frame delimiter, which do not go into the FIFO.
SYNC_NS: Final = 5 * BYTE_NS
#: ``MAC_PACKET_SIZE`` of TinyOS: a greater length makes it flush the FIFO.
_LONGEST_MPDU: Final = 41
#: Time from FIFOP to the first byte, and for each byte, measured with the firmware of a Tmote Sky;
#: so is the delay of its acknowledgements.
_READ_BEGIN_NS: Final = 371_000
_READ_BYTE_NS: Final = 19_600
_CRC_OK: Final = 0x80


class Arrival(NamedTuple):
    """
    A frame in the FIFO.

    :ivar frame: None for one that was cut off.
    :ivar data: from the length byte; the last two bytes are RSSI, and CRC with LQI.
    """

    frame: Transmission | None
    data: bytes

    @property
    def lqi(self) -> int:
        """Return the LQI of a complete frame."""
        return self.data[-1] & 0x7F

    @property
    def rssi_dbm(self) -> int:
        """Return the RSSI of a complete frame."""
        return (self.data[-2] ^ 0x80) - 0x80 - 45


def in_fifo(mpdu: bytes, lqi: int, rssi_dbm: int) -> bytes:
    """
    Return a frame as the chip stores it.

    :param mpdu: from the length byte to the frame check sequence.
    """
    return mpdu[:-2] + bytes(((rssi_dbm + 45) & 0xFF, _CRC_OK | lqi))


class _Crossing(NamedTuple):
    """
    A byte at which the chip wrongly treats a frame as read.

    :ivar at_ns: when it is read.
    :ivar left: bytes of the frame that are still in the FIFO.
    :ivar length: the next byte, which the chip treats as the length of the next frame.
    """

    at_ns: int
    left: int
    length: int


class ReceiveFifo:
    """The FIFO of a radio from the first cut-off frame until it is in step again."""

    __slots__ = ('_waiting', '_filled', '_left', '_read_until_ns', '_in_step', '_crossings',
                 '_flushed_ns')

    def __init__(self) -> None:
        """Create an empty FIFO that is in step."""
        self._waiting: list[Arrival] = []
        self._filled = 0
        self._left = 0
        self._read_until_ns = 0
        self._in_step = True
        self._crossings: list[_Crossing] = []
        self._flushed_ns = 0

    @property
    def is_in_step(self) -> bool:
        """Return whether it behaves as a normal FIFO, and needs no simulation."""
        return not self._filled and not self._left

    def cut_off(self, data: bytes, now_ns: int) -> list[Arrival]:
        """
        Add the first bytes of a frame whose end the radio does not receive.

        :return: as with ``complete``.
        """
        if self._filled + len(data) > CAPACITY_BYTES:
            return self._overflow(data, now_ns)
        self._store(Arrival(None, data))
        return []

    def complete(self, frame: Transmission, data: bytes) -> list[Arrival]:
        """
        Add a frame that has just ended.

        :param data: see :class:`Arrival`.
        :return: the frames that the mote now reads: this one, none, or older ones.
        """
        now_ns = frame.end_ns
        if frame.begin_ns + SYNC_NS < self._flushed_ns:
            return []
        if self._filled + len(data) > CAPACITY_BYTES:
            return self._overflow(data, now_ns)
        if self._filled or (now_ns < self._read_until_ns and not self._is_reported(frame)):
            self._store(Arrival(frame, data))
            return []
        self._read(data, max(now_ns, self._read_until_ns))
        return [Arrival(frame, data)]

    def _store(self, arrival: Arrival) -> None:
        self._waiting.append(arrival)
        self._filled += len(arrival.data)

    def _is_reported(self, frame: Transmission) -> bool:
        """Return whether FIFOP rises for a frame completed while another one was read."""
        if self._in_step:
            return True
        return any(
            left + max(0, (at_ns - frame.begin_ns - SYNC_NS) // BYTE_NS) > length
            for at_ns, left, length in self._crossings)

    def _read(self, data: bytes, begin_ns: int) -> None:
        """Read a frame, and count its bytes as the chip does."""
        size = len(data)
        self._crossings.clear()
        self._in_step = False
        for index, value in enumerate(data):
            if self._count(value):
                if index == size - 1:
                    self._in_step = True
                else:
                    self._crossings.append(_Crossing(
                        begin_ns + _READ_BEGIN_NS + index * _READ_BYTE_NS, size - 1 - index,
                        data[index + 1]))
        self._read_until_ns = begin_ns + _reading_ns(size)

    def _count(self, value: int) -> bool:
        """Count a byte; return whether the chip treats it as the last one of a frame."""
        if not self._left:
            self._left = value
            return False
        self._left -= 1
        return not self._left

    def _overflow(self, data: bytes, now_ns: int) -> list[Arrival]:
        """Read the full FIFO until it is flushed."""
        content = b''.join(arrival.data for arrival in self._waiting) + data
        starts = self._starts()
        free = CAPACITY_BYTES
        at = 0
        arrivals: list[Arrival] = []
        self._flushed_ns = now_ns
        while True:
            length = self._next(content, at)
            self._flushed_ns += _reading_ns(length + 1)
            if length + 1 > free or length > _LONGEST_MPDU:
                break
            free -= length + 1
            for index in range(at + 1, at + 1 + length):
                self._next(content, index)
            if at in starts:
                arrivals.append(starts[at])
            at += 1 + length
        self._waiting.clear()
        self._filled = 0
        self._read_until_ns = self._flushed_ns
        return arrivals

    def _starts(self) -> dict[int, Arrival]:
        """Return the complete frames by their start."""
        starts: dict[int, Arrival] = {}
        at = 0
        for arrival in self._waiting:
            if arrival.frame is not None:
                starts[at] = arrival
            at += len(arrival.data)
        return starts

    def _next(self, content: Sequence[int], at: int) -> int:
        """Read a byte; an empty FIFO gives 0."""
        value = content[at] if at < min(len(content), CAPACITY_BYTES) else 0
        self._count(value)
        return value


def _reading_ns(size: int) -> int:
    """Return the time that TinyOS needs to read a frame."""
    return _READ_BEGIN_NS + size * _READ_BYTE_NS


def bytes_until(frame: Transmission, now_ns: int) -> int:
    """Return the number of bytes of a frame in the FIFO of a radio that receives it."""
    return max(0, (now_ns - frame.begin_ns - SYNC_NS) // BYTE_NS)
