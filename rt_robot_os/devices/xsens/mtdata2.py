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
MTData2, the measurement message of Xsens motion trackers: items of identifier, size and data.

An identifier is group and type, and in its low four bits the number format (single, fixed 12.20,
fixed 16.32, double) and, for orientations, the frame of reference (ENU, NED, NWU). A device sends
the same items in each message, so the layout of a message is computed once and kept; after that a
message costs one ``unpack`` and a comparison of its identifiers.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence
import math
from operator import itemgetter
import struct
from typing import Any
from typing import Final
from typing import NamedTuple

MTDATA2: Final = 0x36

TEMPERATURE: Final = 0x0810
PACKET_COUNTER: Final = 0x1020
SAMPLE_TIME_FINE: Final = 0x1060
QUATERNION: Final = 0x2010
EULER: Final = 0x2030
ACCELERATION: Final = 0x4020
RATE_OF_TURN: Final = 0x8020
MAGNETIC_FIELD: Final = 0xC020
STATUS_BYTE: Final = 0xE010
STATUS_WORD: Final = 0xE020

ENU, NED, NWU = 0x0, 0x4, 0x8
# Bits of the status word; the status byte is its lowest byte.
SELF_TEST_OK: Final = 0x1
FILTER_VALID: Final = 0x2

Quaternion = tuple[float, float, float, float]

_HEADER: Final = struct.Struct('>HB')
_LAYOUTS: Final = 8
_WORDS: Final = {PACKET_COUNTER: 'H', SAMPLE_TIME_FINE: 'I', STATUS_BYTE: 'B', STATUS_WORD: 'I'}
_REALS: Final = {TEMPERATURE: 1, QUATERNION: 4, EULER: 3, ACCELERATION: 3, RATE_OF_TURN: 3,
                 MAGNETIC_FIELD: 3}
# Format of one number and its size.
_FORMATS: Final = (('f', 4), ('i', 4), ('Ih', 6), ('d', 8))
_FIXED_12_20: Final = 1
_FIXED_16_32: Final = 2
_HALF_ROOT: Final = math.sqrt(0.5)
# The rotation of each frame of reference to east, north, up: w, x, y, z.
_TO_ENU: Final[dict[int, Quaternion]] = {
    NED: (0.0, _HALF_ROOT, _HALF_ROOT, 0.0), NWU: (_HALF_ROOT, 0.0, 0.0, _HALF_ROOT)}


class MtSample(NamedTuple):
    """
    The content of one message; None for missing items.

    :ivar counter: packet counter, 16 bits.
    :ivar time_fine: in units of 0.1 ms, 32 bits.
    :ivar quaternion: w, x, y, z from the device's axes to east, north, up.
    :ivar acceleration: m/s^2.
    :ivar rate: rad/s.
    :ivar field: magnetic field as a multiple of that at its place of calibration.
    :ivar temperature_c: of the device.
    :ivar status: the status word, or its lowest byte, which some devices send instead.
    """

    counter: int | None = None
    time_fine: int | None = None
    quaternion: Quaternion | None = None
    acceleration: tuple[float, ...] | None = None
    rate: tuple[float, ...] | None = None
    field: tuple[float, ...] | None = None
    temperature_c: float | None = None
    status: int | None = None


_PLACES: Final = {
    PACKET_COUNTER: 0, SAMPLE_TIME_FINE: 1, QUATERNION: 2, EULER: 2, ACCELERATION: 3,
    RATE_OF_TURN: 4, MAGNETIC_FIELD: 5, TEMPERATURE: 6, STATUS_BYTE: 7,
    STATUS_WORD: 7}

Finish = Callable[[tuple[Any, ...]], Any]


class _Layout(NamedTuple):
    unpack: Callable[[bytes], tuple[Any, ...]]
    headers: Callable[[tuple[Any, ...]], Any]
    expected: Any
    # Index in the sample, first and last of the numbers, their conversion.
    parts: tuple[tuple[int, int, int, Finish | None], ...]


class MtData2Parser:
    """
    Decode the payloads of MTData2; safe in the loop, keeps the last few layouts.

    :ivar malformed: payloads whose items have wrong sizes.
    """

    def __init__(self) -> None:
        self.malformed = 0
        self._layouts: dict[int, _Layout] = {}

    def parse(self, payload: bytes) -> MtSample | None:
        """
        Decode a payload.

        :return: None if its items have wrong sizes.
        """
        layout = self._layouts.get(len(payload))
        if layout is not None:
            values = layout.unpack(payload)
            if layout.headers(values) != layout.expected:
                layout = None
        if layout is None:
            layout = _compile(payload)
            if layout is None:
                self.malformed += 1
                return None
            if len(self._layouts) >= _LAYOUTS:
                self._layouts.clear()
            self._layouts[len(payload)] = layout
            values = layout.unpack(payload)
        found: list[Any] = [None] * 8
        for place, first, last, finish in layout.parts:
            numbers = values[first:last]
            found[place] = numbers if finish is None else finish(numbers)
        return MtSample(*found)


def _compile(payload: bytes) -> _Layout | None:
    """Compute the layout of a payload; None if its items have wrong sizes."""
    text = ['>']
    parts = []
    headers = []
    at = count = 0
    while at < len(payload):
        if len(payload) - at < _HEADER.size:
            return None
        identifier, size = _HEADER.unpack_from(payload, at)
        at += _HEADER.size + size
        if at > len(payload):
            return None
        headers.append(count)
        content, numbers, finish = _item(identifier, size)
        text.append(f'3s{content}')
        if numbers:
            parts.append((_PLACES[identifier & 0xFFF0], count + 1, count + 1 + numbers, finish))
        count += 1 + numbers
    if not headers:
        return None
    pick = itemgetter(*headers)
    unpack = struct.Struct(''.join(text)).unpack
    return _Layout(unpack, pick, pick(unpack(payload)), tuple(parts))


def _item(identifier: int, size: int) -> tuple[str, int, Finish | None]:
    """Return the format of an item, the count of its numbers (0: unused), their conversion."""
    kind = identifier & 0xFFF0
    word = _WORDS.get(kind)
    if word is not None and struct.calcsize('>' + word) == size:
        return word, 1, _only
    count = _REALS.get(kind, 0)
    precision = identifier & 0x3
    letters, width = _FORMATS[precision]
    if not count or count * width != size:
        return f'{size}x', 0, None
    steps: list[Finish] = []
    if precision == _FIXED_12_20:
        steps.append(_from_12_20)
    elif precision == _FIXED_16_32:
        steps.append(_from_16_32)
    if kind == EULER:
        steps.append(_from_euler)
    if kind in (EULER, QUATERNION) and identifier & 0xC in _TO_ENU:
        steps.append(_Turn(_TO_ENU[identifier & 0xC]))
    if kind == TEMPERATURE:
        steps.append(_only)
    return letters * count, len(letters) * count, _chain(steps)


def _chain(steps: Sequence[Finish]) -> Finish | None:
    if len(steps) < 2:
        return steps[0] if steps else None

    def apply(numbers: tuple[Any, ...]) -> Any:
        for step in steps:
            numbers = step(numbers)
        return numbers

    return apply


def _only(numbers: tuple[Any, ...]) -> Any:
    return numbers[0]


def _from_12_20(numbers: tuple[int, ...]) -> tuple[float, ...]:
    return tuple(n / 1048576 for n in numbers)


def _from_16_32(numbers: tuple[int, ...]) -> tuple[float, ...]:
    # The 32 bits of the fraction come first, then the 16 of the integer part.
    return tuple(whole + part / 4294967296 for part, whole in zip(numbers[::2], numbers[1::2]))


def _from_euler(degrees: tuple[float, ...]) -> Quaternion:
    """Convert roll, pitch and yaw, applied in the order yaw, pitch, roll, to w, x, y, z."""
    halves = [math.radians(math.fmod(d, 720.0)) / 2 if math.isfinite(d) else math.nan
              for d in degrees]
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(h), math.sin(h)) for h in halves)
    return (cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy)


class _Turn:
    """Convert an orientation to another frame of reference."""

    def __init__(self, by: Quaternion) -> None:
        self._by = by

    def __call__(self, q: tuple[float, ...]) -> Quaternion:
        aw, ax, ay, az = self._by
        bw, bx, by, bz = q
        return (aw * bw - ax * bx - ay * by - az * bz, aw * bx + ax * bw + ay * bz - az * by,
                aw * by - ax * bz + ay * bw + az * bx, aw * bz + ax * by - ay * bx + az * bw)
