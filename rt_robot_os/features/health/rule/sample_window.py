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


"""The samples of the last minutes, as their lowest and highest in each part of that time."""

from __future__ import annotations

from collections import deque
import math
from typing import Final

# A window has so many parts, whatever its length and the rate of the samples.
_PARTS: Final = 60


class SampleWindow:
    """
    How much a value went up or down lately; safe in the real-time loop.

    Memory and time are bounded: samples are kept by sixtieths of the window, and a sixtieth is
    forgotten as a whole, so that a window may reach back by that much less than it should.

    :param length_ns: of the window, at least 60 ns.
    """

    __slots__ = ('_part_ns', '_parts', '_spans')

    def __init__(self, length_ns: int) -> None:
        self._part_ns = max(1, length_ns // _PARTS)
        # Of each part: its number, its lowest, highest and last value; the most that it rose and
        # fell within it.
        self._parts: deque[list[float]] = deque()
        self._spans: dict[str, float] | None = None

    def add(self, value: float, time_ns: int) -> None:
        """Take a sample that is not before the last one."""
        number = time_ns // self._part_ns
        parts = self._parts
        self._spans = None
        if not parts or parts[-1][0] < number:
            parts.append([number, value, value, 0.0, 0.0])
            if len(parts) > _PARTS + 1:
                parts.popleft()
            return
        part = parts[-1]
        part[3] = max(part[3], value - part[1])
        part[4] = max(part[4], part[2] - value)
        part[1] = min(part[1], value)
        part[2] = max(part[2], value)

    def forget(self, now_ns: int) -> None:
        """Forget what is too old."""
        oldest = now_ns // self._part_ns - _PARTS
        parts = self._parts
        while parts and parts[0][0] <= oldest:
            parts.popleft()
            self._spans = None

    @property
    def next_ns(self) -> float:
        """When there is something to forget; infinite without a sample."""
        if not self._parts:
            return math.inf
        return (int(self._parts[0][0]) + _PARTS) * self._part_ns

    def spans(self, way: str) -> float:
        """
        Return how much a value rose, fell or moved from any sample to a later one; 0 at least.

        :param way: ``rises``, ``falls`` or ``moves``.
        """
        if self._spans is None:
            self._spans = self._measured()
        return self._spans[way]

    def _measured(self) -> dict[str, float]:
        low, high = math.inf, -math.inf
        rises = falls = 0.0
        for _, lowest, highest, rose, fell in self._parts:
            rises = max(rises, rose, highest - low)
            falls = max(falls, fell, high - lowest)
            low, high = min(low, lowest), max(high, highest)
        return {'rises': rises, 'falls': falls, 'moves': max(rises, falls)}
