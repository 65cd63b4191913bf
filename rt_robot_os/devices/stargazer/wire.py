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
The sentences of a Hagisonic StarGazer: ``~``, a kind, a content, and a grave accent.

======  ========  =====================================================
kind    from      what
======  ========  =====================================================
``#``   host      write a parameter, run a command: ``~#Name|value```
``@``   host      read a parameter: ``~@Name```
``!``   device    acknowledgement: repeats a sentence of the host
``$``   device    value that was read: ``~$Name|value```
``^``   device    measurement
``*``   device    notice, such as ``~*DeadZone```
======  ========  =====================================================

Measurements have three forms, angles in degrees, lengths in cm:

* old: letter, then ``angle|x|y|id``;
* single: letter and id, then ``angle|x|y|z``;
* multi: number of marks, then ``id|angle|x|y|z`` for each, the first id right behind the number.

The letter is I (position), F (building a map) or Z (measuring the height). There is no checksum:
anything of another form is rejected.

Source: vendor's user guide and manual; recorded sentences agree with these.
"""

from __future__ import annotations

from collections.abc import Sequence
import re
from typing import Final
from typing import NamedTuple

from rt_robot_os.devices.framing import FrameDecoder

# Six marks with all digits; a longer sentence has lost its end.
LONGEST: Final = 256
WRITE: Final = '#'
READ: Final = '@'
ACKNOWLEDGEMENT: Final = '!'
VALUE: Final = '$'
MEASUREMENT: Final = '^'
NOTICE: Final = '*'

POSITION: Final = 'I'
MAP_BUILDING: Final = 'F'
HEIGHT: Final = 'Z'
# The names of the vendor's parameters.
STOP: Final = 'CalcStop'
START: Final = 'CalcStart'
END: Final = 'SetEnd'
UPDATED: Final = 'ParameterUpdate'
HEIGHT_CALCULATION: Final = 'HeightCalc'
BUILD_MAP: Final = 'MapMode|Start'

_BEGIN: Final = 0x7E
_END: Final = 0x60
# A sentence, or its part before the end of the buffer.
_PATTERN: Final = rb'~(?:[#@!$^*][ -_a-}]*(?:`|\Z)|\Z)'
_MATCH: Final = re.compile(_PATTERN).match
_ANGLE: Final = r'([+-]?\d{1,3}(?:\.\d{1,4})?)'
_LENGTH: Final = r'([+-]?\d{1,5}(?:\.\d{1,4})?)'
_NUMBER: Final = r'(\d{1,6})'
_OLD: Final = re.compile(rf'([IFZ]){_ANGLE}\|{_LENGTH}\|{_LENGTH}\|{_NUMBER}').fullmatch
_SINGLE: Final = re.compile(
    rf'([IFZ]){_NUMBER}\|{_ANGLE}\|{_LENGTH}\|{_LENGTH}\|{_LENGTH}').fullmatch
_GROUP: Final = re.compile(rf'{_NUMBER}\|{_ANGLE}\|{_LENGTH}\|{_LENGTH}\|{_LENGTH}').fullmatch
_FIELDS: Final = 5
_HALF_TURN_DEG: Final = 180.0
_SURE: Final = 2


class CeilingMark(NamedTuple):
    """
    One measured mark.

    :ivar number: its ID.
    :ivar angle_deg: of the device, from -180 to 180.
    :ivar x_cm: position of the device in the frame of the mark, or of the reference mark.
    :ivar z_cm: distance to the ceiling; None in the old form, which lacks it.
    """

    number: int
    angle_deg: float
    x_cm: float
    y_cm: float
    z_cm: float | None


class StarGazerFrame(NamedTuple):
    """
    One sentence.

    :ivar kind: its second character.
    :ivar content: the characters after that.
    :ivar size: number of its bytes.
    :ivar end: index just after its last byte in the chunk that completed it.
    :ivar mode: of a measurement ``I``, ``F`` or ``Z``; empty otherwise.
    :ivar marks: of a measurement.
    """

    kind: str
    content: str
    size: int
    end: int
    mode: str = ''
    marks: tuple[CeilingMark, ...] = ()

    @property
    def name(self) -> str:
        """Return the name of its parameter or command."""
        return self.content.partition('|')[0]

    @property
    def is_dead_zone(self) -> bool:
        """Return whether it reports a dead zone; firmwares spell that differently."""
        return self.kind == NOTICE and (
            self.content.replace(' ', '').lower().startswith('deadzone'))


class StarGazerDecoder(FrameDecoder[StarGazerFrame]):
    """
    Find the sentences in a stream of bytes; safe in the loop, keeps less than ``LONGEST`` bytes.

    A ``~`` within a sentence begins another; a sentence that is too long is dropped.
    """

    STARTS = b'~'
    SHORTEST = 3
    LONGEST = LONGEST
    PATTERN = _PATTERN

    def end(self, buffer: bytes, at: int) -> int:
        """Return the end of the sentence."""
        match = _MATCH(buffer, at)
        if match is None:
            return 0
        end = match.end()
        if buffer[end - 1] == _END and end - at > 1:
            return end
        return at + LONGEST if len(buffer) - at < LONGEST else 0

    def frame(self, buffer: bytes, at: int, end: int, arrived: int) -> StarGazerFrame | None:
        """Decode a sentence; None if it is an invalid measurement."""
        kind = chr(buffer[at + 1])
        content = buffer[at + 2:end - 1].decode('ascii')
        if kind != MEASUREMENT:
            return StarGazerFrame(kind, content, end - at, arrived)
        measured = measurement(content)
        if measured is None:
            return None
        return StarGazerFrame(kind, content, end - at, arrived, *measured)


def measurement(content: str) -> tuple[str, tuple[CeilingMark, ...]] | None:
    """
    Decode the characters between ``~^`` and the end of a measurement.

    :return: mode and marks; None if it has none of the three forms.
    """
    if content[:1] in ('1', '2', '3', '4', '5', '6', '7', '8', '9'):
        marks = _multi(int(content[0]), content[1:].split('|'))
        return None if marks is None else (POSITION, marks)
    if (match := _OLD(content)) is not None:
        mode, angle, x, y, number = match.groups()
        mark = _mark(number, angle, x, y, None)
    elif (match := _SINGLE(content)) is not None:
        mode, number, angle, x, y, z = match.groups()
        mark = _mark(number, angle, x, y, z)
    else:
        return None
    return None if mark is None else (mode, (mark,))


def _multi(count: int, fields: list[str]) -> tuple[CeilingMark, ...] | None:
    if len(fields) != _FIELDS * count:
        return None
    marks = []
    for at in range(0, len(fields), _FIELDS):
        match = _GROUP('|'.join(fields[at:at + _FIELDS]))
        mark = _mark(*match.groups()) if match is not None else None
        if mark is None:
            return None
        marks.append(mark)
    return tuple(marks)


def _mark(number: str, angle: str, x: str, y: str, z: str | None) -> CeilingMark | None:
    angle_deg = float(angle)
    if abs(angle_deg) > _HALF_TURN_DEG:
        return None
    return CeilingMark(int(number), angle_deg, float(x), float(y),
                       None if z is None else abs(float(z)))


def is_stargazer(data: bytes) -> bool:
    """Return whether some bytes contain measurements or notices of a StarGazer."""
    found = [frame for frame in StarGazerDecoder().feed(data)
             if frame.marks or frame.is_dead_zone]
    return len(found) >= _SURE


# ---- encoding -----------------------------------------------------------------------------------

def sentence(kind: str, content: str) -> bytes:
    """Frame a content."""
    return f'~{kind}{content}`'.encode('ascii')


def old(mark: CeilingMark, mode: str = POSITION) -> bytes:
    """Encode a measurement in the form of 2004 to 2008."""
    return sentence(MEASUREMENT, f'{mode}{_position(mark)}|{mark.number}')


def single(mark: CeilingMark, mode: str = POSITION) -> bytes:
    """Encode a measurement of one mark in the newer form; 0 cm if the ceiling is unknown."""
    return sentence(MEASUREMENT, f'{mode}{mark.number}|{_position(mark)}|{mark.z_cm or 0.0:.2f}')


def multi(marks: Sequence[CeilingMark]) -> bytes:
    """Encode a measurement of one to nine marks."""
    groups = '|'.join(f'{mark.number}|{_position(mark)}|{mark.z_cm or 0.0:.2f}' for mark in marks)
    return sentence(MEASUREMENT, f'{len(marks)}{groups}')


def _position(mark: CeilingMark) -> str:
    return f'{mark.angle_deg:+.2f}|{mark.x_cm:+.2f}|{mark.y_cm:+.2f}'
