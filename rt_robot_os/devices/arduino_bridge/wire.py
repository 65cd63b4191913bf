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
its answer, ended by CR LF, which does not say what it answers::

    e            1024 -17     counts of both encoders
    m 20 -20     OK           ticks that each wheel shall make in a round of the control loop
    b            57600        speed of the line

Source: hbrobotics/ros_arduino_bridge and its descendants.
"""

from __future__ import annotations

import re
from typing import Final
from typing import NamedTuple

from rt_robot_os.devices.framing import StreamDecoder

ENCODERS: Final = b'e\r'
HALT: Final = b'm 0 0\r'
BAUD: Final = b'b\r'
DONE: Final = b'OK'
INVALID: Final = b'Invalid Command'

# The loop runs each 1000 / 30 = 33 ms: the firmware divides whole numbers.
PID_RATE_HZ: Final = 1000 / 33
# Its numbers have 16 bits.
FASTEST: Final = 32767

_LONGEST: Final = 26
_REPLY: Final = re.compile(
    rb'(?:OK|Invalid Command|(-?\d{1,10})(?: (-?\d{1,10}))?)\r?\n').fullmatch
_SURE: Final = 2


def speeds(left: int, right: int) -> bytes:
    """Return the command of the speeds, in ticks for each round of the control loop."""
    return b'm %d %d\r' % (max(-FASTEST, min(left, FASTEST)), max(-FASTEST, min(right, FASTEST)))


def gains(p: int, d: int, i: int, scale: int) -> bytes:
    """Return the command of the gains, in the order of the firmware."""
    return b'u %d:%d:%d:%d\r' % (p, d, i, scale)


def analog(pin: int) -> bytes:
    """Return the question for the voltage of a pin; the answer is 0 to 1023."""
    return b'a %d\r' % pin


class Reply(NamedTuple):
    """
    One line of the board.

    :ivar text: ``OK`` or ``Invalid Command``; empty where there are numbers.
    :ivar numbers: one or two.
    :ivar size: bytes of the line.
    """

    text: bytes
    numbers: tuple[int, ...]
    size: int
    end: int


class ReplyDecoder(StreamDecoder[Reply]):
    """
    Turn bytes into lines; one that no command is answered with is none.

    There is no checksum: a line that lost a digit may look right.
    """

    def __init__(self) -> None:
        super().__init__()
        self._passing_over = False

    def reset(self) -> None:
        """Reject what is pending: the stream starts anew."""
        super().reset()
        self._passing_over = False

    def feed(self, data: bytes) -> list[Reply]:
        """Take the next bytes of the stream; never raises."""
        held = len(self._pending)
        buffer = self._pending + data
        replies: list[Reply] = []
        at = framed = 0
        while end := buffer.find(b'\n', at) + 1:
            match = None
            if not self._passing_over and end - at <= _LONGEST:
                match = _REPLY(buffer, at, end)
            self._passing_over = False
            if match is None:
                self.rejected_frames += 1
            else:
                numbers = tuple(int(each) for each in match.groups() if each is not None)
                text = b'' if numbers else buffer[at:end].rstrip()
                replies.append(Reply(text, numbers, end - at, end - held))
                framed += end - at
            at = end
        if self._passing_over or len(buffer) - at >= _LONGEST:
            self._passing_over = True
            at = len(buffer)
        self.rejected_bytes += at - framed
        self._pending = buffer[at:]
        self.frames += len(replies)
        return replies


def is_arduino_bridge(data: bytes) -> bool:
    """Return whether bytes are what the firmware says to somebody else's commands."""
    lines = data.split(b'\n')[1:-1]
    return len(lines) >= _SURE and all(line == INVALID + b'\r' for line in lines)
