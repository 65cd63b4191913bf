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

"""The sound levels of the last seconds, and their mean and maximum."""

from __future__ import annotations

from bisect import bisect_left
from bisect import bisect_right
import math
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.units import NS_PER_S

#: Levels below this count as silence, in dB below full scale.
QUIETEST_DB: Final = -120.0


class Loudness(NamedTuple):
    """
    The loudness of a period, in dB below full scale.

    :ivar mean_db: level of the mean power.
    :ivar loudest_db: the highest level of a block.
    :ivar blocks: number of blocks.
    """

    mean_db: float
    loudest_db: float
    blocks: int


class Levels:
    """
    Stores levels for a time; safe in the real-time loop.

    :param seconds: how long levels are stored.
    :param most: number of levels at most.
    """

    def __init__(self, seconds: float, most: int = 8192) -> None:
        self._keep_ns = round(seconds * NS_PER_S)
        self._most = most
        self._times: list[int] = []
        self._levels_db: list[float] = []

    def add(self, stamp_ns: int, level_db: float) -> None:
        """Add a level; one that is older than the last, or NaN, is dropped."""
        if math.isnan(level_db) or (self._times and stamp_ns <= self._times[-1]):
            return
        self._times.append(stamp_ns)
        self._levels_db.append(min(max(level_db, QUIETEST_DB), 20.0))
        old = max(bisect_left(self._times, stamp_ns - 2 * self._keep_ns),
                  len(self._times) - self._most)
        if 2 * old > len(self._times) or len(self._times) > 2 * self._most:
            del self._times[:old], self._levels_db[:old]

    def between(self, from_ns: int, until_ns: int) -> Loudness | None:
        """Return the loudness from one moment to another; None without a level."""
        first, end = bisect_left(self._times, from_ns), bisect_right(self._times, until_ns)
        levels = self._levels_db[first:end]
        if not levels:
            return None
        power = sum(10.0 ** (level / 10.0) for level in levels) / len(levels)
        return Loudness(10.0 * math.log10(power), max(levels), len(levels))
