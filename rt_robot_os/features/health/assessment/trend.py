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
How fast a vital sign rises or falls: the median of the slopes between all pairs of moments.

Single wrong values do not move it (Theil 1950, Sen 1968: up to 29 % of them may be wrong). Whether
there is a change at all is asked of the signs of these slopes (Mann 1945, Kendall 1975), so that a
few values that scatter are none.
"""

from __future__ import annotations

from collections import deque
import math
from statistics import median
from typing import Final

#: The window is cut into so many parts; the values of one are one value, their mean.
PARTS: Final = 30
# Fewer parts with values, or over less of the window, are no trend.
_PARTS_MINIMUM: Final = 5
_SHARE_MINIMUM: Final = 2 / 3
# So many standard deviations more pairs rise than fall, or fewer, or nothing changes.
_DEVIATIONS: Final = 2.3


class Trend:
    """
    The change of a number over a window; safe in the real-time loop.

    :ivar change: over the window, in the unit of the number; 0 where chance would explain it, NaN
        while there is too little.
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
        Take a value; moments never go back.

        :return: whether :attr:`change` was found anew, which it is when a part is over.
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
