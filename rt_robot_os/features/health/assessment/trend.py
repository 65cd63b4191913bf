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
Trend of a vital sign: the median of the slopes between all pairs of values.

Single outliers do not affect it (Theil 1950, Sen 1968: up to 29 % of the values may be wrong).
A test on the signs of the slopes (Mann 1945, Kendall 1975) decides whether there is a trend at
all, so that scattered values give none.
"""

from __future__ import annotations

from collections import deque
import math
from statistics import median
from typing import Final

#: Parts of the window; the mean of the values in a part is one value.
PARTS: Final = 30
# Fewer parts with values, or a smaller share of the window, give no trend.
_PARTS_MINIMUM: Final = 5
_SHARE_MINIMUM: Final = 2 / 3
# Least excess of rising over falling pairs, or of falling over rising, in standard deviations.
_DEVIATIONS: Final = 2.3


class Trend:
    """
    Change of a number over a sliding window; safe in the real-time loop.

    :ivar change: over the window, in the unit of the number; 0 where it is not significant, NaN
        with too few values.
    """

    __slots__ = ('window_ns', 'change', '_part_ns', '_parts', '_part', '_sum', '_count')

    def __init__(self, window_ns: int) -> None:
        self.window_ns = window_ns
        self.change = math.nan
        self._part_ns = window_ns // PARTS
        self._parts: deque[tuple[int, float]] = deque(maxlen=PARTS + 1)
        self._part = -1
        self._sum = 0.0
        self._count = 0

    def put(self, value: float, stamp_ns: int) -> bool:
        """
        Add a value; stamps never decrease.

        :return: whether :attr:`change` was updated, which it is at the end of a part.
        """
        part = stamp_ns // self._part_ns
        is_new = part != self._part and self._count > 0
        if is_new:
            self._parts.append((self._part, self._sum / self._count))
            self._sum, self._count = 0.0, 0
            self.change = self._changed(part)
        self._part = part
        self._sum += value
        self._count += 1
        return is_new

    def _changed(self, part: int) -> float:
        while self._parts and self._parts[0][0] < part - PARTS:
            self._parts.popleft()
        parts = list(self._parts)
        if len(parts) < _PARTS_MINIMUM or parts[-1][0] - parts[0][0] < PARTS * _SHARE_MINIMUM:
            return math.nan
        slopes = [(later - earlier) / (at - before) for place, (at, later) in enumerate(parts)
                  for before, earlier in parts[:place]]
        excess = sum((slope > 0.0) - (slope < 0.0) for slope in slopes)
        count = len(parts)
        deviation = math.sqrt(count * (count - 1) * (2 * count + 5) / 18.0)
        if abs(excess) < _DEVIATIONS * deviation:
            return 0.0
        return PARTS * median(slopes)
