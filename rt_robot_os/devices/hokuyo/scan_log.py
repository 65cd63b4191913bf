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
Recorded laser scans as the bytes that the scanner sent.

The format is that of BreezySLAM and CoreSLAM, one scan of a Hokuyo URG-04LX a line: numbers with
spaces between, the time in microseconds first, and from the 25th on 682 distances in mm, 0 for no
echo. The odometry in between is not used.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.devices.hokuyo.wire import scan
from rt_robot_os.devices.hokuyo.wire import scan_command
from rt_robot_os.sim.player import Piece

FIRST_STEP: Final = 44
LAST_STEP: Final = 725
_FIRST_COLUMN: Final = 24
_LAST_COLUMN: Final = _FIRST_COLUMN + LAST_STEP - FIRST_STEP
_LONGEST_MM: Final = (1 << 18) - 1
_US_PER_MS: Final = 1000


def by_scan_time(lines: Sequence[bytes]) -> tuple[Piece, ...]:
    """
    Send each scan at its time.

    :param lines: from :func:`rt_robot_os.sim.player.load_log`.
    :raises ConfigError: a line is not a scan, or the times go back.
    """
    echo = scan_command(FIRST_STEP, LAST_STEP)
    pieces: list[Piece] = []
    first_us = last_us = 0
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        time_us, distances_mm = _read(line, number)
        if not pieces:
            first_us = last_us = time_us
        if time_us < last_us:
            raise ConfigError([f'scan {number}: its time {time_us} us is before that of the '
                               f'previous scan, {last_us} us: sort the log'])
        last_us = time_us
        pieces.append(((time_us - first_us) * NS_PER_US,
                       scan(echo, time_us // _US_PER_MS, distances_mm)))
    if not pieces:
        raise ConfigError(['the log contains no scan: choose another'])
    return tuple(pieces)


def _read(line: bytes, number: int) -> tuple[int, list[int]]:
    columns = line.split()
    if len(columns) <= _LAST_COLUMN:
        raise ConfigError([f'scan {number} has {len(columns)} columns: at least '
                           f'{_LAST_COLUMN + 1} are needed, so this is another format'])
    try:
        time_us = int(columns[0])
        distances_mm = [int(c) for c in columns[_FIRST_COLUMN:_LAST_COLUMN + 1]]
    except ValueError as error:
        raise ConfigError([f'scan {number}: {error}: times and distances are integers'
                           ]) from error
    if min(distances_mm) < 0 or max(distances_mm) > _LONGEST_MM or time_us < 0:
        raise ConfigError([f'scan {number}: a time or distance is negative or beyond '
                           f'{_LONGEST_MM} mm: this is another format'])
    return time_us, distances_mm
