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
The bytes of the ASCII protocol of ODrive motor controllers.

A command is a line; a request is answered by a line that does not identify it. With a checksum,
``line *N`` where N is the XOR of all bytes before the asterisk, the answer has one too, and a line
with a wrong one is ignored. An empty line is an unknown command; at most nine characters of a
property are sent::

    r vbus_voltage *93   24.150000*44              the value of a property
    f 0 *86              1.500000 -0.250000*14     position and speed of a motor, in turns

Source: the firmware, 0.5.6, and the page "ASCII Protocol" of the documentation of ODrive.
"""

from __future__ import annotations

from functools import reduce
import operator
import re
from typing import Final
from typing import NamedTuple

from rt_robot_os.devices.framing import LineDecoder

IDLE: Final = 1
CLOSED_LOOP: Final = 8
CLEAR_ERRORS: Final = b'sc'
WATCHDOG_ERROR: Final = 0x800

# Errors of an axis, up to firmware 0.5.
ERRORS: Final = {
    0x1: 'invalid state', 0x40: 'motor failed', 0x80: 'sensorless estimator failed',
    0x100: 'encoder failed', 0x200: 'controller failed', WATCHDOG_ERROR: 'watchdog expired',
    0x1000: 'end stop pressed', 0x2000: 'end stop pressed', 0x4000: 'e-stop',
    0x20000: 'homing without end stop', 0x40000: 'over temperature'}

_NUMBER: Final = rb'(-?\d{1,10}(?:\.\d{0,9})?|-?nan|-?inf)'
_REFUSALS: Final = (rb'(unknown command|invalid property|invalid command format|not implemented'
                    rb'|invalid motor \d{1,3})')
_REPLY: Final = re.compile(
    rb'(?:' + _NUMBER + rb'(?: ' + _NUMBER + rb')?|' + _REFUSALS + rb')(?:\*(\d{1,3}))?\r?\n'
).fullmatch
_SURE: Final = 2


def checksum(text: bytes) -> int:
    """Return the XOR of all bytes."""
    return reduce(operator.xor, text, 0)


def line(text: bytes, checked: bool = True) -> bytes:
    """Return a command as a line."""
    if not checked:
        return text + b'\n'
    return b'%s *%d\n' % (text, checksum(text + b' '))


def velocity(axis: int, turns_s: float) -> bytes:
    """Return the command for a speed of the motor."""
    return b'v %d %.5f' % (axis, turns_s)


def feedback(axis: int) -> bytes:
    """Return the request for position and speed."""
    return b'f %d' % axis


def feed(axis: int) -> bytes:
    """Return the command that feeds the watchdog."""
    return b'u %d' % axis


def read(name: str) -> bytes:
    """Return the request for a property."""
    return b'r ' + name.encode()


def write(name: str, value: float) -> bytes:
    """Return the command that sets a property."""
    return b'w %s %s' % (name.encode(), f'{value:g}'.encode())


class OdriveReply(NamedTuple):
    """
    One line of the controller.

    :ivar numbers: one or two; none in a refusal.
    :ivar refusal: the reason, such as ``invalid property``.
    :ivar size: bytes of the line.
    """

    numbers: tuple[float, ...]
    refusal: bytes
    size: int
    end: int


class OdriveDecoder(LineDecoder[OdriveReply]):
    """Turn bytes into lines."""

    LONGEST = 56

    def __init__(self, checked: bool = True) -> None:
        """
        Begin.

        :param checked: a line without a checksum is rejected.
        """
        super().__init__()
        self._checked = checked

    def line(self, buffer: bytes, at: int, end: int, arrived: int) -> OdriveReply | None:
        """Read a line."""
        match = _REPLY(buffer, at, end)
        if match is None:
            return None
        first, second, refusal, given = match.groups()
        if given is not None:
            if checksum(buffer[at:match.start(4) - 1]) != int(given):
                return None
        elif self._checked:
            return None
        numbers = tuple(float(each) for each in (first, second) if each is not None)
        return OdriveReply(numbers, refusal or b'', end - at, arrived)


def is_odrive(data: bytes) -> bool:
    """Return whether bytes are lines of an ODrive: with checksums, or refusals."""
    lines = [each + b'\n' for each in data.split(b'\n')[1:-1]]
    decoder = OdriveDecoder()
    found = decoder.feed(b''.join(lines))
    refused = b'unknown command\r\n'
    return len(lines) >= _SURE and (len(found) == len(lines) or set(lines) == {refused})
