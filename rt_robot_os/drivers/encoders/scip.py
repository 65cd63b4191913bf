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


"""SCIP 2.0 commands to Hokuyo laser scanners, and the answers of simulated and recorded ones."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from rt_robot_os.drivers.decoders.scip import checksum
from rt_robot_os.drivers.decoders.scip import LINE_CHARACTERS
from rt_robot_os.drivers.decoders.scip import SCAN

QUIT: Final = b'QT'
PARAMETERS: Final = b'PP'
_BASE: Final = 0x30
_LARGEST: Final = (1 << 18) - 1


def command(text: bytes) -> bytes:
    """Make a command."""
    return text + b'\n'


def scan_command(first_step: int, last_step: int) -> bytes:
    """Make the text of MD: every scan, every step, without end."""
    return b'MD%04d%04d00000' % (first_step, last_step)


def answer(echo: bytes, status: int = 0, lines: Iterable[bytes] = ()) -> bytes:
    """Make an answer of lines of data."""
    return b''.join((echo, b'\n', _line(b'%02d' % status), *map(_line, lines), b'\n'))


def parameters(
    *, first_step: int, last_step: int, steps_per_turn: int, front_step: int, minimum_mm: int,
    maximum_mm: int, rpm: int, model: str,
) -> bytes:
    """Make the answer to PP."""
    values = {'MODL': model, 'DMIN': minimum_mm, 'DMAX': maximum_mm, 'ARES': steps_per_turn,
              'AMIN': first_step, 'AMAX': last_step, 'AFRT': front_step, 'SCAN': rpm}
    lines = [f'{key}:{value}'.encode() for key, value in values.items()]
    # The semicolon before the sum does not count.
    content = b''.join(line + b';' + bytes((checksum(line), 10)) for line in lines)
    return PARAMETERS + b'\n' + _line(b'00') + content + b'\n'


def scan(echo: bytes, time_ms: int, distances_mm: Iterable[int]) -> bytes:
    """Make a scan; distances beyond 18 bits are limited to them."""
    data = b''.join(_characters(min(max(mm, 0), _LARGEST), 3) for mm in distances_mm)
    lines = (data[i:i + LINE_CHARACTERS] for i in range(0, len(data), LINE_CHARACTERS))
    return answer(echo, SCAN, (_characters(time_ms & 0xFFFFFF, 4), *lines))


def _line(content: bytes) -> bytes:
    return content + bytes((checksum(content), 10))


def _characters(number: int, count: int) -> bytes:
    return bytes((number >> 6 * (count - 1 - i) & 0x3F) + _BASE for i in range(count))
