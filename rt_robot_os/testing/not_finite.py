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
Frames with NaN and infinity, made from valid ones.

A format with floating point numbers, or with numbers as text, can contain NaN and infinity. The
positions of the numbers are unknown here: every position is tried, with every common kind of
checksum; candidates that the decoder accepts are frames.
"""

from __future__ import annotations

from collections.abc import Iterator
import math
import re
import struct
from typing import Final

_BINARY: Final = tuple(dict.fromkeys(
    struct.pack(order + kind, value) for value in (math.nan, math.inf, -math.inf)
    for kind in 'fd' for order in '<>'))
_NUMBER: Final = re.compile(rb'[+-]?\d+(?:\.\d+)?')
_TEXTS: Final = (b'nan', b'-nan', b'inf', b'-inf', b'1e999')
_HEXADECIMAL: Final = re.compile(rb'\*[0-9A-Fa-f]{2}')


def not_finite(frame: bytes) -> Iterator[bytes]:
    """Yield candidates: a frame with NaN or infinity at each position, and a valid checksum."""
    for value in _BINARY:
        for at in range(1, len(frame) - len(value)):
            changed = frame[:at] + value + frame[at + len(value):]
            yield from _binary_mends(frame, changed)
    for match in _NUMBER.finditer(frame):
        for text in _TEXTS:
            yield from _text_mends(frame[:match.start()] + text + frame[match.end():])


def _binary_mends(frame: bytes, changed: bytes) -> Iterator[bytes]:
    body, last = changed[:-1], frame[-1]
    more = sum(body) - sum(frame[:-1])
    exclusive = last
    for one, other in zip(frame[:-1], body):
        exclusive ^= one ^ other
    # A sum, one that makes the total 0, and XOR; then sums of sums.
    for check in dict.fromkeys(((last + more) & 0xFF, (last - more) & 0xFF, exclusive)):
        yield body + bytes((check,))
    for begin in (0, 1, 2):
        first = second = 0
        for byte in changed[begin:-2]:
            first += byte
            second += first
        yield changed[:-2] + bytes((first & 0xFF, second & 0xFF))


def _text_mends(changed: bytes) -> Iterator[bytes]:
    yield changed
    found = list(_HEXADECIMAL.finditer(changed))
    if found:
        # As in NMEA: XOR of the characters between the first one and the asterisk.
        at = found[-1].start()
        check = 0
        for byte in changed[1:at]:
            check ^= byte
        yield changed[:at] + b'*%02X' % check + changed[at + 3:]
