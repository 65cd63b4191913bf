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
How the firmware ros_arduino_bridge executes commands, without time and motors.

Modelled on a real one, byte by byte: arguments are lenient, the loop computes in integers, most of
them of 16 bits, and its state of the encoders is kept over a stop.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

MOST_PWM: Final = 255
_MOST_ARGUMENT: Final = 15
_RETURN: Final = 13
_SPACE: Final = 32


class Parser:
    """The firmware's parser of commands, one byte at a time."""

    def __init__(self) -> None:
        self._begin()

    def _begin(self) -> None:
        self._command = 0
        self._argument = 0
        self._arguments = [b'', b'']

    def take(self, data: bytes) -> list[tuple[str, bytes, bytes]]:
        """Return the commands that bytes complete: a letter and two arguments, possibly empty."""
        found: list[tuple[str, bytes, bytes]] = []
        for byte in data:
            if byte == _RETURN:
                first, second = self._arguments
                found.append((chr(self._command), first, second))
                self._begin()
            elif byte == _SPACE:
                self._argument = min(self._argument + 1, 2)
            elif not self._argument:
                self._command = byte  # the last one is used
            else:
                at = self._argument - 1
                self._arguments[at] = (self._arguments[at] + bytes((byte,)))[:_MOST_ARGUMENT]
        return found


def number(text: bytes) -> int:
    """Read the leading digits of an argument; 0 without any. 16 bits, as atoi."""
    negative = text[:1] == b'-'
    digits = text[1:] if text[:1] in (b'-', b'+') else text
    value = 0
    for byte in digits:
        if not 48 <= byte <= 57:
            break
        value = value * 10 + byte - 48
    return _wrapped(-value if negative else value)


def _wrapped(value: int) -> int:
    return (value + 0x8000 & 0xFFFF) - 0x8000


def _divided(value: int, by: int) -> int:
    """Divide with rounding towards zero, as C does."""
    return abs(value) // by * (1 if value >= 0 else -1)


@dataclass
class Gains:
    """Of both loops."""

    p: int = 20
    d: int = 12
    i: int = 0
    scale: int = 50


class WheelLoop:
    """
    The control loop of one wheel.

    :ivar target: commanded ticks in a round.
    :ivar output: -255 to 255.
    """

    def __init__(self) -> None:
        self.target = self.output = 0
        self.input = 0
        self._ticks = self._sum = 0

    def reset(self, ticks: int) -> None:
        """Begin anew at a count."""
        self.target = self.output = self.input = self._sum = 0
        self._ticks = ticks

    def step(self, ticks: int, gains: Gains) -> int:
        """Run one round; return the output."""
        went = _wrapped(ticks - self._ticks)
        error = self.target - went
        # An int has 16 bits there: after a jump of the counts the product overflows.
        damping = _wrapped(gains.d * _wrapped(went - self.input))
        change = gains.p * error - damping + self._sum
        output = self.output + _divided(change, gains.scale)
        if abs(output) >= MOST_PWM:
            output = MOST_PWM if output > 0 else -MOST_PWM
        else:
            self._sum = _wrapped(self._sum + gains.i * error)
        self.output, self.input, self._ticks = output, went, ticks
        return output
