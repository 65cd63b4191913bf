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
Nonin's serial data formats 2 and 7: a pulse oximeter's waveform, rates and saturations.

In the manual's terms a *frame* is five bytes, 75 a second, and a *packet* 25 frames: status,
waveform, and one multiplexed byte of further values. The first frame of a packet has the bit
SYNC. Format 2 has the waveform in 8 bits::

    01  STATUS  PLETH      FLOAT  CHK

and format 7 in 16::

    STATUS  PLETH high  PLETH low  FLOAT  CHK

CHK is the low byte of the sum of the four bytes before it. That is a weak checksum, so the decoder
accepts only whole packets: 25 adjacent frames, each with its checksum, SYNC in the first and in
no other. An incomplete packet is dropped: at most a third of a second is lost.
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from typing import ClassVar
from typing import Final
from typing import NamedTuple

from rt_robot_os.devices.framing import FrameDecoder

FRAME_SIZE: Final = 5
FRAMES: Final = 25
PACKET_SIZE: Final = FRAME_SIZE * FRAMES
FRAMES_PER_S: Final = 75.0
PACKETS_PER_S: Final = 3.0

# ---- the status of each frame -----------------------------------------------------------------

#: Always set in a status.
ALWAYS: Final = 0x80
#: The sensor is unplugged or broken; reserved in models with a fixed sensor.
DISCONNECTED: Final = 0x40
#: This pulse is an artefact; set while the pulse lasts.
ARTEFACT: Final = 0x20
#: No consecutive good pulses: artefacts for some time.
OUT_OF_TRACK: Final = 0x10
#: The signal cannot be used: no finger in the sensor.
NO_FINGER: Final = 0x08
#: Strength of the pulse, set for 12 frames of each: 1 good, 2 poor or none, 3 marginal.
PERFUSION: Final = 0x06
SYNC: Final = 0x01

PERFUSIONS: Final[Mapping[int, str]] = {2: 'good', 4: 'poor', 6: 'marginal'}
GOOD, POOR, MARGINAL = 2, 4, 6
PULSE_FRAMES: Final = 12

# ---- the multiplexed byte, by its frame --------------------------------------------------------

PULSE_4: Final = 0
SPO2_4: Final = 2
FIRMWARE: Final = 3
TIMER: Final = 5
STATUS_2: Final = 7
SPO2_4_DISPLAYED: Final = 8
SPO2_FAST: Final = 9
SPO2_BEAT: Final = 10
PULSE_8: Final = 13
SPO2_8: Final = 15
SPO2_8_DISPLAYED: Final = 16
PULSE_4_DISPLAYED: Final = 19
PULSE_8_DISPLAYED: Final = 21

BATTERY_LOW: Final = 0x01
#: Bit of the second status: the device rates the measurement as good.
SMARTPOINT: Final = 0x20

#: The device has no value.
NO_PULSE: Final = 511
NO_SPO2: Final = 127
#: Modulus of the packet counter.
TIMER_TURN: Final = 1 << 14

# ---- commands: select the format of an Onyx II (model 9560) ------------------------------------

ACCEPTED: Final = b'\x06'
REFUSED: Final = b'\x15'
COMMAND_SIZE: Final = 6

_SYNCS: Final = bytes(range(ALWAYS | SYNC, 0x100, 2))


class OximeterPacket(NamedTuple):
    """
    One valid packet.

    :ivar data: its 125 bytes.
    :ivar status_at: index of the status in each frame: 0 in format 7, 1 in format 2.
    :ivar end: index just after its last byte in the chunk that completed it.
    """

    data: bytes
    status_at: int
    end: int

    @property
    def size(self) -> int:
        """Return the number of bytes."""
        return len(self.data)

    @property
    def statuses(self) -> bytes:
        """Return the 25 statuses."""
        return self.data[self.status_at::FRAME_SIZE]

    def pleth(self) -> list[int]:
        """Return the 25 samples of the waveform: 0 to 255 in format 2, to 65535 in format 7."""
        low = self.data[2::FRAME_SIZE]
        if self.status_at:
            return list(low)
        return [high << 8 | each for high, each in zip(self.data[1::FRAME_SIZE], low)]

    def float_byte(self, frame: int) -> int:
        """Return the multiplexed byte of a frame, 0 to 24; it has seven bits."""
        return self.data[frame * FRAME_SIZE + 3] & 0x7F

    def pulse(self, frame: int) -> int:
        """Return a pulse rate a minute, 0 to 511; 511 means no value."""
        return (self.float_byte(frame) & 0x03) << 7 | self.float_byte(frame + 1)

    def timer(self) -> int:
        """Return the device's counter of packets."""
        return self.float_byte(TIMER) << 7 | self.float_byte(TIMER + 1)


class _PacketDecoder(FrameDecoder[OximeterPacket]):
    """Find whole packets in a byte stream; safe in the loop, stores at most 124 bytes."""

    SHORTEST = FRAME_SIZE
    LONGEST = PACKET_SIZE
    STATUS_AT: ClassVar[int]

    def end(self, buffer: bytes, at: int) -> int:
        """Return the end of a packet with a valid first frame."""
        if sum(buffer[at:at + 4]) & 0xFF != buffer[at + 4]:
            return 0
        status = buffer[at + self.STATUS_AT]
        return at + PACKET_SIZE if status & (ALWAYS | SYNC) == ALWAYS | SYNC else 0

    def frame(self, buffer: bytes, at: int, end: int, arrived: int) -> OximeterPacket | None:
        """Check the other frames of a packet."""
        status_at = self.STATUS_AT
        for place in range(at + FRAME_SIZE, end, FRAME_SIZE):
            if buffer[place + status_at] & (ALWAYS | SYNC) != ALWAYS or (
                    sum(buffer[place:place + 4]) & 0xFF != buffer[place + 4]) or (
                    status_at and buffer[place] != 1):
                return None
        return OximeterPacket(buffer[at:end], status_at, arrived)


class Format7Decoder(_PacketDecoder):
    """Find packets of data format 7."""

    STARTS = _SYNCS
    STATUS_AT = 0


class Format2Decoder(_PacketDecoder):
    """Find packets of data format 2."""

    STARTS = b'\x01'
    PATTERN = b'\x01(?:[' + b''.join(b'\\x%02x' % each for each in _SYNCS) + b']|\\Z)'
    STATUS_AT = 1


DECODERS: Final[Mapping[int, type[_PacketDecoder]]] = {7: Format7Decoder, 2: Format2Decoder}


def is_format_7(data: bytes) -> bool:
    """Return whether bytes contain a packet of data format 7."""
    return bool(Format7Decoder().feed(data))


def is_format_2(data: bytes) -> bool:
    """Return whether bytes contain a packet of data format 2."""
    return bool(Format2Decoder().feed(data))


# ---- from values to bytes ---------------------------------------------------------------------

def frame(data_format: int, status: int, pleth: int, float_byte: int) -> bytes:
    """
    Make one frame.

    :param pleth: the sample, 0 to 65535; format 2 sends its high byte.
    :raises ValueError: the sample is out of range.
    """
    status |= ALWAYS
    if data_format == 2:
        content = bytes((1, status, pleth >> 8, float_byte))
    else:
        content = bytes((status, pleth >> 8, pleth & 0xFF, float_byte))
    return content + bytes((sum(content) & 0xFF,))


def float_bytes(pulse_per_min: int, spo2_percent: int, *, timer: int = 0, status_2: int = 0,
                firmware: int = 0x2A, displayed: tuple[int, int] | None = None) -> bytes:
    """
    Make the 25 multiplexed bytes of one packet, with equal averages.

    :param displayed: pulse and saturation of the display; None: the same.
    """
    found = bytearray(FRAMES)
    shown = displayed or (pulse_per_min, spo2_percent)
    for place, pulse in ((PULSE_4, pulse_per_min), (PULSE_8, pulse_per_min),
                         (PULSE_4_DISPLAYED, shown[0]), (PULSE_8_DISPLAYED, shown[0])):
        found[place], found[place + 1] = pulse >> 7, pulse & 0x7F
    for place in (SPO2_4, SPO2_FAST, SPO2_BEAT, SPO2_8):
        found[place] = spo2_percent
    found[SPO2_4_DISPLAYED] = found[SPO2_8_DISPLAYED] = shown[1]
    found[FIRMWARE], found[STATUS_2] = firmware & 0x7F, status_2 & 0x7F
    found[TIMER], found[TIMER + 1] = timer >> 7 & 0x7F, timer & 0x7F
    return bytes(found)


def packet(data_format: int, statuses: Sequence[int], pleth: Sequence[int],
           floats: Sequence[int]) -> bytes:
    """Make a packet; SYNC is set here."""
    return b''.join(
        frame(data_format, status & ~SYNC | (SYNC if not number else 0), sample, each)
        for number, (status, sample, each) in enumerate(
            zip(statuses, pleth, floats, strict=True)))


def format_command(data_format: int) -> bytes:
    """Make the command that selects a data format; the device answers with one byte."""
    return bytes((0x02, 0x70, 0x02, 0x02, data_format, 0x03))
