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
The bytes of ros_arduino_bridge, the firmware that Arduinos of hobby robots run.

A command is one letter and up to two arguments, ended by a carriage return; each has one line as
its answer, ended by CR LF, which does not identify the command::

    e            1024 -17     counts of both encoders
    m 20 -20     OK           commanded ticks of each wheel in a round of the control loop
    b            57600        speed of the line; some firmwares put a space before it

Source: hbrobotics/ros_arduino_bridge and its descendants.
"""

from __future__ import annotations

import re
from typing import Final
from typing import NamedTuple

from rt_robot_os.devices.framing import LineDecoder

ENCODERS: Final = b'e\r'
HALT: Final = b'm 0 0\r'
BAUD: Final = b'b\r'
DONE: Final = b'OK'
INVALID: Final = b'Invalid Command'

# The loop runs each 1000 / 30 = 33 ms: the firmware divides integers.
PID_RATE_HZ: Final = 1000 / 33
# Its numbers have 16 bits.
FASTEST: Final = 32767

_REPLY: Final = re.compile(
    rb' ?(?:OK|Invalid Command|(-?\d{1,10})(?: (-?\d{1,10}))?)\r?\n').fullmatch
_SURE: Final = 2


def speeds(left: int, right: int) -> bytes:
    """Return the command of the speeds, in ticks for each round of the control loop."""
    return b'm %d %d\r' % (max(-FASTEST, min(left, FASTEST)), max(-FASTEST, min(right, FASTEST)))


def gains(p: int, d: int, i: int, scale: int) -> bytes:
    """Return the command of the gains, in the order of the firmware."""
    return b'u %d:%d:%d:%d\r' % (p, d, i, scale)


def analog(pin: int) -> bytes:
    """Return the request for the voltage of a pin; the answer is 0 to 1023."""
    return b'a %d\r' % pin


class BridgeReply(NamedTuple):
    """
    One line of the board.

    :ivar text: ``OK`` or ``Invalid Command``; empty if there are numbers.
    :ivar numbers: one or two.
    :ivar size: bytes of the line.
    """

    text: bytes
    numbers: tuple[int, ...]
    size: int
    end: int


class ReplyDecoder(LineDecoder[BridgeReply]):
    """
    Decode lines; one that is not the answer to any command is rejected.

    There is no checksum: a line that lost a digit may look right.
    """

    LONGEST = 27

    def line(self, buffer: bytes, at: int, end: int, arrived: int) -> BridgeReply | None:
        """Read a line."""
        match = _REPLY(buffer, at, end)
        if match is None:
            return None
        numbers = tuple(int(each) for each in match.groups() if each is not None)
        return BridgeReply(b'' if numbers else buffer[at:end].strip(), numbers, end - at, arrived)


def is_arduino_bridge(data: bytes) -> bool:
    """Return whether bytes are answers of the firmware to commands of another program."""
    lines = data.split(b'\n')[1:-1]
    return len(lines) >= _SURE and all(line == INVALID + b'\r' for line in lines)
