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
Reader of recordings of falls and daily activities: text files, gzipped or not.

A recording starts with ``@ name,fall,movement,subject``, where fall is 1 or 0. Rows
``t_ms,sensor,x,y,z`` follow: sensor ``a`` is an accelerometer in g or m/s^2, ``w`` a gyroscope in
deg/s; other sensors are ignored. Lines with ``#`` are comments.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from dataclasses import field
import gzip
from itertools import islice
import math
from pathlib import Path
from typing import Final
from typing import IO
import zlib

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import STANDARD_GRAVITY_M_S2

_GZIP: Final = b'\x1f\x8b'
_ACCELEROMETER: Final = 'a'
_GYROSCOPES: Final = ('w', 'g')
_YES: Final = ('1', 'yes', 'true', 'fall')
_NO: Final = ('0', 'no', 'false', 'adl')
# A worn sensor measures 1 g most of the time: a larger median is in m/s^2.
_MOST_G: Final = 4.0
_DAY_MS: Final = 86_400_000.0
_LINE: Final = 400


@dataclass
class FallRecording:
    """
    One recording.

    :ivar fall: whether it is one; None when the file does not say.
    :ivar samples: time in ms, specific force in g, and magnitude of the angular rate in deg/s (of
        the newest row of the gyroscope; 0 without one).
    :ivar ignored: number of rows of other sensors.
    :ivar bad: number of malformed rows.
    :ivar problem: why the recording cannot be evaluated; empty if it can.
    """

    name: str
    fall: bool | None = None
    movement: str = ''
    subject: str = ''
    samples: list[tuple[float, float, float, float, float]] = field(default_factory=list)
    ignored: int = 0
    bad: int = 0
    in_m_s2: bool = False
    problem: str = ''

    @property
    def peak_ms(self) -> float:
        """Return the time of the largest specific force."""
        return max(self.samples, key=lambda row: row[1] ** 2 + row[2] ** 2 + row[3] ** 2)[0]


def read_recordings(path: Path) -> Iterator[FallRecording]:
    """
    Read a file, one recording at a time.

    :raises ConfigError: the file cannot be read, or contains no recording.
    """
    found = 0
    try:
        with _opened(path) as file:
            for recording in _split(file, path.name):
                found += 1
                yield _finished(recording)
    except (OSError, EOFError, zlib.error) as error:
        raise ConfigError([f'{path}: {getattr(error, "strerror", None) or error}: name a file '
                           'that exists, is readable and complete']) from error
    except UnicodeDecodeError as error:
        raise ConfigError([f'{path} is not a text file: write rows such as '
                           '346,a,0.974,-0.039,-0.128']) from error
    if not found:
        raise ConfigError([f'{path} has no recording: start one with a line '
                           '"@ name,fall,movement,subject", then rows t_ms,a,x,y,z'])


def _opened(path: Path) -> IO[str]:
    with path.open('rb') as file:
        packed = file.read(2) == _GZIP
    return gzip.open(path, 'rt', encoding='utf-8') if packed else path.open(encoding='utf-8')


def _split(file: IO[str], name: str) -> Iterator[FallRecording]:
    recording: FallRecording | None = None
    turn_deg_s = 0.0
    while (line := file.readline(_LINE)):
        line = line.strip().lstrip('\ufeff')
        if not line or line.startswith('#'):
            continue
        if line.startswith('@'):
            if recording is not None:
                yield recording
            recording, turn_deg_s = _header(line[1:]), 0.0
            continue
        if recording is None:
            recording = FallRecording(name)
        turn_deg_s = _row(recording, line, turn_deg_s)
    if recording is not None:
        yield recording


def _header(text: str) -> FallRecording:
    parts = [part.strip() for part in text.split(',')]
    parts += [''] * (4 - len(parts))
    label = parts[1].lower()
    fall = True if label in _YES else False if label in _NO else None
    return FallRecording(parts[0] or 'without a name', fall, parts[2], parts[3])


def _row(recording: FallRecording, line: str, turn_deg_s: float) -> float:
    """Add a row; return the newest angular rate."""
    parts = [part.strip() for part in line.split(',')]
    try:
        time_ms, x, y, z = float(parts[0]), float(parts[2]), float(parts[3]), float(parts[4])
    except (ValueError, IndexError):
        recording.bad += 1
        return turn_deg_s
    # A time beyond any clock is as unusable as one that is not finite.
    if not (math.isfinite(x + y + z) and abs(time_ms) < 1e5 * _DAY_MS):
        recording.bad += 1
    elif parts[1] == _ACCELEROMETER:
        recording.samples.append((time_ms, x, y, z, turn_deg_s))
    elif parts[1] in _GYROSCOPES:
        return math.hypot(x, y, z)
    else:
        recording.ignored += 1
    return turn_deg_s


def _finished(recording: FallRecording) -> FallRecording:
    """Convert a recording to g, and note its problem."""
    samples = recording.samples
    if not samples:
        recording.problem = 'no accelerometer row (t_ms,a,x,y,z)'
        return recording
    sizes = sorted(math.hypot(x, y, z) for _, x, y, z, _ in islice(samples, 20_000))
    if sizes[len(sizes) // 2] > _MOST_G:
        recording.in_m_s2 = True
        recording.samples = [
            (time_ms, x / STANDARD_GRAVITY_M_S2, y / STANDARD_GRAVITY_M_S2,
             z / STANDARD_GRAVITY_M_S2, turn) for time_ms, x, y, z, turn in samples]
    return recording
