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
Read logs of scans: CSV with a reference beside, and CARMEN's.

The CSV has a first line that begins with ``#`` and says how many ranges there are, and the angle
of the first beam and from beam to beam in degrees; then rows of time in s, x, y, yaw of
odometry, x, y, yaw of a reference, and the ranges in m. CARMEN's has a message a line:
``FLASER`` with ranges and poses, ``ODOM`` with what the wheels say.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
import gzip
import math
from pathlib import Path
import re
from typing import Final
from typing import IO

import numpy as np

from rt_robot_os.errors import ConfigError
from rt_robot_os.slam.scan import Scan
from rt_robot_os.slam.transforms import Floats
from rt_robot_os.units import NS_PER_S

_HEAD: Final = re.compile(
    r'(\d+) ranges.*first beam at (-?[\d.]+) deg, step (-?[\d.]+) deg')
_POSES: Final = 7
#: Of a scan; a line with more is no scan.
BEAMS_MOST: Final = 100_000
_GZIP: Final = b'\x1f\x8b'
#: Half a turn in so many beams, the last one included or not.
_HALF_TURN: Final = (180, 360)


@dataclass(frozen=True)
class Log:
    """
    The scans of a log.

    :ivar reference: shape (scans, 3): where somebody else says that they were; None when nobody
        does.
    :ivar bad_lines: lines that could not be read, and were left out.
    """

    scans: tuple[Scan, ...]
    reference: Floats | None
    bad_lines: int


def read_log(path: Path) -> Log:
    """
    Read a log, gzipped or not.

    :raises ConfigError: it cannot be read, or holds no scan; the message says which.
    """
    try:
        with path.open('rb') as raw:
            packed = raw.read(2) == _GZIP
        with (gzip.open(path, 'rt', errors='replace') if packed
              else path.open(errors='replace')) as file:
            log = _read(file)
    except (OSError, EOFError) as error:
        raise ConfigError([f'{path}: {getattr(error, "strerror", None) or error}']) from error
    if not log.scans:
        raise ConfigError([f'{path}: no scan in it: neither rows of a CSV with ranges nor '
                           'FLASER lines of a CARMEN log'])
    return log


def _read(file: IO[str]) -> Log:
    first = file.readline()
    head = _HEAD.search(first) if first.startswith('#') else None
    if head is None:
        return _carmen([first, *file])
    beams, start, step = int(head[1]), math.radians(float(head[2])), math.radians(float(head[3]))
    scans, reference, bad = [], [], 0
    for row in file:
        found = _numbers(row.split(','))
        if found is None or len(found) != _POSES + beams:
            bad += bool(row.strip())
            continue
        scans.append(Scan(round(found[0] * NS_PER_S), found[1:4], found[_POSES:], start, step))
        reference.append(found[4:_POSES])
    return Log(tuple(scans), np.array(reference).reshape(-1, 3), bad)


def _numbers(words: list[str]) -> Floats | None:
    try:
        found = np.array([float(each) for each in words])
    except ValueError:
        return None
    return found if np.isfinite(found[:_POSES]).all() else None


def _carmen(lines: list[str]) -> Log:
    scans: list[Scan] = []
    reference: list[Floats] = []
    bad = 0
    wheels: Floats | None = None
    for line in lines:
        words = line.split()
        try:
            if words[:1] == ['ODOM']:
                wheels = np.array([float(each) for each in words[1:4]])
            elif words[:1] == ['FLASER']:
                scan, place = _flaser(words, wheels)
                scans.append(scan)
                reference.append(place)
        except (ValueError, IndexError):
            bad += 1
    # Raw logs have one pose in both places: that is no reference.
    of_odometry = all(np.array_equal(scan.odometry, place)
                      for scan, place in zip(scans, reference))
    return Log(tuple(scans), None if of_odometry else np.array(reference), bad)


def _flaser(words: list[str], wheels: Floats | None) -> tuple[Scan, Floats]:
    """
    Read one scan with its two poses.

    Corrected logs have the corrected pose in both places; then what the wheels said last counts.
    """
    beams = int(words[1])
    if not 0 < beams < BEAMS_MOST:
        raise ValueError('no scan')
    ranges = np.array([float(each) for each in words[2:2 + beams]])
    rest = [float(each) for each in words[2 + beams:9 + beams]]
    place, odometry, stamp_s = np.array(rest[:3]), np.array(rest[3:6]), rest[6]
    if len(ranges) != beams or not np.isfinite(rest).all():
        raise ValueError('no scan')
    if wheels is not None and len(wheels) == 3 and np.isfinite(wheels).all():
        odometry = wheels
    step = math.pi / (beams if beams in _HALF_TURN else max(1, beams - 1))
    return Scan(round(stamp_s * NS_PER_S), odometry, ranges, -math.pi / 2, step), place


def rows(poses: Floats) -> Iterator[list[float]]:
    """Write poses as lists of numbers, to a tenth of a millimetre."""
    for x, y, yaw in poses.tolist():
        yield [round(x, 4), round(y, 4), round(yaw, 5)]
