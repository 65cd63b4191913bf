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
Recordings of a drive as text: what `bench localization --data FILE` reads.

A line is ``seconds,kind,values...``; lines may be out of order as they came. Kinds:

- ``odom,x,y,qz,qw,vx,vy,wz,var_vx,var_wz``: wheel odometry, as in ``nav_msgs/msg/Odometry``;
- ``imu,qx,qy,qz,qw,wx,wy,wz,ax,ay,az``: as in ``sensor_msgs/msg/Imu``, mounted as
  ``--imu-mounting`` says; the orientation is 0,0,0,0 when there is none;
- ``fix,x,y,yaw,var_x,var_y,var_yaw``: a pose measured on the map;
- ``truth,x,y,yaw``: where the robot really was; only compared with.

Empty lines and those that begin with ``#`` are left out. The file may be compressed with gzip.
"""

from __future__ import annotations

from dataclasses import dataclass
import gzip
import json
from pathlib import Path
from typing import Final

from rt_robot_os.base.errors import RtRobotError

_NUMBERS: Final = {'odom': 9, 'imu': 10, 'fix': 6, 'truth': 3}
_EXPECTED: Final = '.expected.json'
# Larger files are no recordings of a drive.
_LINES_MOST: Final = 5_000_000
# Also of those who count from 1970.
_TIME_MOST_S: Final = 1e11


@dataclass(frozen=True)
class Line:
    """One line of a recording."""

    time_s: float
    kind: str
    values: tuple[float, ...]


class RecordingError(RtRobotError):
    """A recording cannot be read; the message names file and line."""


def read(path: Path) -> list[Line]:
    """
    Read a recording, in the order of its lines.

    :raises RecordingError: it is none.
    :raises OSError: it cannot be opened.
    """
    lines: list[Line] = []
    try:
        with open(path, 'rb') as start:
            packed = start.read(2) == b'\x1f\x8b'
        with (gzip.open if packed else open)(path, 'rt', encoding='utf-8-sig') as file:
            for number, text in enumerate(file, 1):
                if number > _LINES_MOST:
                    raise RecordingError(f'{path}: more than {_LINES_MOST} lines')
                text = text.strip()
                if text and not text.startswith('#'):
                    lines.append(_line(f'{path}:{number}', text))
    except (UnicodeDecodeError, EOFError, gzip.BadGzipFile) as error:
        raise RecordingError(f'{path}: is no text, nor one that gzip has packed: {error}'
                             ) from None
    if sum(line.kind == 'odom' for line in lines) < 2:
        raise RecordingError(f'{path}: has no two lines of odom; a line is '
                             'seconds,odom,x,y,qz,qw,vx,vy,wz,var_vx,var_wz')
    return lines


def _line(where: str, text: str) -> Line:
    time, *rest = text.split(',')
    kind = rest[0].strip() if rest else ''
    if kind not in _NUMBERS:
        raise RecordingError(f'{where}: kind {kind!r}; there are {", ".join(_NUMBERS)}')
    try:
        time_s, values = float(time), tuple(float(value) for value in rest[1:])
    except ValueError as error:
        raise RecordingError(f'{where}: {error}') from None
    if len(values) != _NUMBERS[kind]:
        raise RecordingError(f'{where}: {kind} has {len(values)} numbers, not {_NUMBERS[kind]}')
    if not abs(time_s) < _TIME_MOST_S:
        raise RecordingError(f'{where}: the time {time!r} is none')
    return Line(time_s, kind, values)


def expected(path: Path, given: Path | None) -> dict[str, tuple[float, float]]:
    """
    Read where other filters end on a recording: ``{"ekf_final": [x, y, ...], ...}``.

    :param given: the file; None looks for ``NAME.expected.json`` beside the recording.
    :return: x and y in m by name, without ``_final``; empty when there is no such file.
    :raises RecordingError: it is none.
    """
    found = given or path.with_name(path.name.partition('.')[0] + _EXPECTED)
    if given is None and not found.is_file():
        return {}
    try:
        content = json.loads(found.read_text(encoding='utf-8'))
        ends = {name.removesuffix('_final'): (float(end[0]), float(end[1]))
                for name, end in content.items() if name.endswith('_final')}
    except (ValueError, TypeError, AttributeError, IndexError, KeyError) as error:
        raise RecordingError(f'{found}: not as expected: {error}') from None
    if not ends:
        raise RecordingError(f'{found}: has no "NAME_final": [x, y]')
    return ends
