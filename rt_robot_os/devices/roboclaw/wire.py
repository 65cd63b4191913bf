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
RoboClaw packet serial: requests ``address command data CRC``, each with its own answer.

The CRC is CRC-16/XMODEM, big-endian as all numbers are. A request that sets a value has a CRC and
is answered by one byte, 0xFF; a request that reads a value has none, and its answer has one over
address, command and data. An answer does not identify its request, so the decoder must know the
requests; the CRC then detects an answer to another one.

The unit drops a request whose bytes arrive more than 10 ms apart. Answers for simulated units and
tests are encoded here as well.
"""

from __future__ import annotations

from binascii import crc_hqx
from collections import deque
import struct
from typing import Final
from typing import NamedTuple

from rt_robot_os.devices.framing import StreamDecoder

FIRST_ADDRESS: Final = 0x80
LAST_ADDRESS: Final = 0x87
ACKNOWLEDGED: Final = b'\xff'
# A unit drops a partial request after such a gap.
GAP_S: Final = 0.01

SET_TIMEOUT: Final = 14
READ_TIMEOUT: Final = 15
VERSION: Final = 21
SET_ENCODER_1: Final = 22
SET_ENCODER_2: Final = 23
MAIN_BATTERY: Final = 24
SET_PID_1: Final = 28
SET_PID_2: Final = 29
DUTY: Final = 34
SPEED: Final = 37
SPEED_ACCEL: Final = 40
CURRENTS: Final = 49
ENCODERS: Final = 78
TEMPERATURE: Final = 82
STATUS: Final = 90

# Meaning of the status bits.
STATUS_WORDS: Final = {
    0x1: 'emergency stop', 0x2: 'temperature error', 0x4: 'temperature 2 error',
    0x8: 'main voltage too high', 0x10: 'logic voltage too high', 0x20: 'logic voltage too low',
    0x40: 'driver fault of M1', 0x80: 'driver fault of M2', 0x100: 'speed error of M1',
    0x200: 'speed error of M2', 0x400: 'position error of M1', 0x800: 'position error of M2',
    0x1000: 'current error of M1', 0x2000: 'current error of M2', 0x1_0000: 'overcurrent of M1',
    0x2_0000: 'overcurrent of M2', 0x4_0000: 'main voltage high', 0x8_0000: 'main voltage low',
    0x10_0000: 'temperature high', 0x20_0000: 'temperature 2 high',
    0x40_0000: 'S4 triggered', 0x80_0000: 'S5 triggered', 0x100_0000: 'speed error limit',
    0x200_0000: 'position error limit'}

# Scale of PID gains.
GAIN_ONE: Final = 65536
BATTERY_V: Final = 0.1
CURRENT_A: Final = 0.01
TEMPERATURE_C: Final = 0.1
FULL_DUTY: Final = 32767
MAX_SPEED: Final = 2**31 - 1

_CRC: Final = 2
# Longest version, including its NUL.
_LONGEST_TEXT: Final = 48
_SIZES: Final = {READ_TIMEOUT: 1, MAIN_BATTERY: 2, CURRENTS: 4, ENCODERS: 8, TEMPERATURE: 2}
_STATUS: Final = 4
_OLD_STATUS: Final = 2
# Bits of the status of old firmware, in their order, as bits of the new one.
_OLD_BITS: Final = (0x10000, 0x20000, 0x1, 0x2, 0x4, 0x8, 0x10, 0x20, 0x40, 0x80, 0x40000, 0x80000,
                    0x100000, 0x200000, 0, 0)


class RoboClawRequest(NamedTuple):
    """
    A request to a unit.

    :ivar data: its bytes.
    """

    data: bytes

    @property
    def command(self) -> int:
        """Return the number of the command."""
        return self.data[1]

    @property
    def asks(self) -> bool:
        """Return whether the answer has data; otherwise it is an acknowledgement."""
        return len(self.data) == 2


class RoboClawReply(NamedTuple):
    """
    The answer to a request.

    :ivar request: the answered request.
    :ivar data: without the CRC; empty for an acknowledgement.
    :ivar size: bytes on the line.
    :ivar end: index just after its last byte in the chunk that completed it.
    """

    request: RoboClawRequest
    data: bytes
    size: int
    end: int


class RoboClawDecoder(StreamDecoder[RoboClawReply]):
    """
    Find the answers to the requests that were sent; safe in the loop, keeps at most 50 bytes.

    An answer begins with the first byte after the request, or after the previous answer. After a
    wrong one all bytes up to the next request are rejected.

    :ivar failed: the bytes were not the answer to the request, which must be repeated.
    :ivar status_bytes: size of a status: 4, with old firmware 2.
    """

    def __init__(self) -> None:
        super().__init__()
        self.failed = False
        self.status_bytes = _STATUS
        self._expected: deque[RoboClawRequest] = deque()

    def expect(self, request: RoboClawRequest, behind: bool = False) -> None:
        """
        Expect the answer to a request.

        :param behind: it follows other expected answers; otherwise pending bytes are rejected.
        """
        if not behind:
            self.abandon()
        self._expected.append(request)

    def abandon(self) -> None:
        """Expect nothing; bytes are rejected."""
        super().reset()
        self.failed = False
        self._expected.clear()

    def reset(self) -> None:
        """Reject the pending bytes: the stream restarts, perhaps that of another unit."""
        self.abandon()
        self.status_bytes = _STATUS

    def feed(self, data: bytes) -> list[RoboClawReply]:
        """
        Decode the next bytes of the stream; never raises.

        :return: the answers that they complete, in order; independent of how the stream is split.
        """
        held = len(self._pending)
        buffer, self._pending = self._pending + data, b''
        replies: list[RoboClawReply] = []
        at = 0
        while self._expected:
            request, rest = self._expected[0], buffer[at:]
            size = self._size(request, rest)
            if size == 0:
                self._pending = rest
                return replies
            if size < 0:
                self.failed = True
                self.rejected_frames += 1
                self._expected.clear()
                break
            self._expected.popleft()
            self.frames += 1
            at += size
            replies.append(RoboClawReply(request, rest[:size - _CRC] if request.asks else b'',
                                         size, at - held))
        self.rejected_bytes += len(buffer) - at
        return replies

    def learn(self) -> bool:
        """
        Check whether the pending bytes are the shorter status of old firmware, and remember it.

        To be called when no more bytes have arrived for a while: only then is it complete.
        """
        if not self._expected or self.status_bytes == _OLD_STATUS:
            return False
        request, pending = self._expected[0], self._pending
        if request.command != STATUS:
            return False
        if len(pending) != _OLD_STATUS + _CRC or crc(request.data + pending):
            return False
        self.status_bytes = _OLD_STATUS
        return True

    def _size(self, request: RoboClawRequest, buffer: bytes) -> int:
        """Return the size of the answer in a buffer; 0 = incomplete, -1 = invalid."""
        if not request.asks:
            return 0 if not buffer else 1 if buffer[:1] == ACKNOWLEDGED else -1
        if request.command == VERSION:
            end = buffer.find(b'\x00', 0, _LONGEST_TEXT) + 1
            if not end:
                return -1 if len(buffer) >= _LONGEST_TEXT else 0
            size = end + _CRC
        else:
            size = _SIZES.get(request.command, self.status_bytes) + _CRC
        if len(buffer) < size:
            return 0
        return size if crc(request.data + buffer[:size]) == 0 else -1


def crc(data: bytes) -> int:
    """Return the CRC-16/XMODEM; 0 for bytes followed by their own CRC."""
    return crc_hqx(data, 0)


# ---- requests -----------------------------------------------------------------------------------

def ask(address: int, command: int) -> RoboClawRequest:
    """Make a request for data."""
    return RoboClawRequest(bytes((address, command)))


def order(address: int, command: int, data: bytes) -> RoboClawRequest:
    """Encode a request that sets a value."""
    content = bytes((address, command)) + data
    return RoboClawRequest(content + crc(content).to_bytes(_CRC, 'big'))


def speeds(address: int, first: int, second: int, acceleration: int = 0) -> RoboClawRequest:
    """
    Encode the command for both speeds.

    :param first: of motor M1, in quadrature pulses per second; limited to 32 bits, as the others.
    :param acceleration: in quadrature pulses per second squared; 0 = no limit.
    """
    both = _limited(first), _limited(second)
    if acceleration:
        return order(address, SPEED_ACCEL, struct.pack(
            '>Iii', min(acceleration, MAX_SPEED), *both))
    return order(address, SPEED, struct.pack('>ii', *both))


def duty(address: int, first: int, second: int) -> RoboClawRequest:
    """Encode the command for both duty cycles, full at 32767; it leaves speed control."""
    return order(address, DUTY, struct.pack('>hh', first, second))


def timeout_tenths(seconds: float) -> int:
    """Return the time of the unit's own watchdog in steps of 0.1 s; 0 = none."""
    return min(max(round(seconds * 10), 0), 255)


def serial_timeout(address: int, seconds: float) -> RoboClawRequest:
    """Encode the command for the unit's own watchdog: in steps of 0.1 s, 0 = none."""
    return order(address, SET_TIMEOUT, bytes((timeout_tenths(seconds),)))


def encoder(address: int, command: int, count: int) -> RoboClawRequest:
    """
    Encode the command that sets the counter of an encoder; it is lost with the power.

    :param command: ``SET_ENCODER_1`` or ``SET_ENCODER_2``.
    """
    return order(address, command, (count & 0xFFFFFFFF).to_bytes(4, 'big'))


def gains(address: int, command: int, p: float, i: float, d: float, qpps: int) -> RoboClawRequest:
    """
    Encode the command for the velocity control of a motor; it is lost with the power.

    :param command: ``SET_PID_1`` (M1) or ``SET_PID_2`` (M2).
    :param qpps: speed of the motor at full duty.
    """
    return order(address, command, struct.pack(
        '>IIII', round(d * GAIN_ONE), round(p * GAIN_ONE), round(i * GAIN_ONE), qpps))


def _limited(speed: int) -> int:
    return min(max(speed, -MAX_SPEED), MAX_SPEED)


# ---- answers ------------------------------------------------------------------------------------

def answer(address: int, command: int, data: bytes) -> bytes:
    """Encode the answer to a request for data."""
    return data + crc(bytes((address, command)) + data).to_bytes(_CRC, 'big')


def old_status(bits: int) -> bytes:
    """Encode a new status as the data of old firmware."""
    return sum(1 << place for place, bit in enumerate(_OLD_BITS) if bits & bit).to_bytes(2, 'big')


def encoder_counts(data: bytes) -> tuple[int, int]:
    """Decode the answer to ``ENCODERS``: counts of M1 and M2, 32 bits that wrap."""
    first, second = struct.unpack('>II', data)
    return first, second


def unsigned(data: bytes) -> int:
    """Decode the answer to ``MAIN_BATTERY``, ``TEMPERATURE`` or ``READ_TIMEOUT``."""
    return int.from_bytes(data, 'big')


def status_bits(data: bytes) -> int:
    """Decode the answer to ``STATUS``; that of old firmware is converted to the new bits."""
    bits = int.from_bytes(data, 'big')
    if len(data) > _OLD_STATUS:
        return bits
    return sum(bit for place, bit in enumerate(_OLD_BITS) if bits >> place & 1)


def status_text(bits: int) -> str:
    """Return a status as text; empty without an error."""
    return ', '.join(words for bit, words in STATUS_WORDS.items() if bits & bit)


def currents_a(data: bytes) -> tuple[float, float]:
    """Decode the answer to ``CURRENTS``: of M1 and M2."""
    first, second = struct.unpack('>hh', data)
    return first * CURRENT_A, second * CURRENT_A


def version_text(data: bytes) -> str:
    """Decode the answer to ``VERSION``, such as ``USB Roboclaw 2x15a v4.2.4``."""
    return ''.join(chr(c) for c in data if 0x20 <= c < 0x7F).strip()
