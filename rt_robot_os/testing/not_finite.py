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
Frames with NaN and infinity, made from good ones.

A format with floating point numbers, or with numbers as text, can say NaN and infinity. Where the
numbers stand is not known here: every place is tried, with every kind of checksum that is usual,
and what the decoder takes is a frame.
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
    """Yield candidates: a frame with NaN or infinity at each place, and its checksum mended."""
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
    # A sum that is added, one that makes the whole 0, and XOR; then sums of sums.
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
        # As NMEA has it: XOR of what is between the first character and the asterisk.
        at = found[-1].start()
        check = 0
        for byte in changed[1:at]:
            check ^= byte
        yield changed[:at] + b'*%02X' % check + changed[at + 3:]
