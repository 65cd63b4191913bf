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


"""Sliding window of samples that stores the minimum and maximum of each part."""

from __future__ import annotations

from collections import deque
import math
from typing import Final

# Parts of a window, whatever its length and the rate of the samples.
_PARTS: Final = 60


class SampleWindow:
    """
    How much a value rose or fell within a time; safe in the real-time loop.

    Memory and time are bounded: the window consists of 60 parts, and a part expires as a whole, so
    a window may be shorter by up to one part.

    :param length_ns: of the window, at least 60 ns.
    """

    __slots__ = ('_part_ns', '_parts', '_spans')

    def __init__(self, length_ns: int) -> None:
        self._part_ns = max(1, length_ns // _PARTS)
        # Of each part: index, minimum, maximum, largest rise and largest fall within it.
        self._parts: deque[list[float]] = deque()
        self._spans: dict[str, float] | None = None

    def add(self, value: float, time_ns: int) -> None:
        """Add a sample that is not older than the last one."""
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

    def expire(self, now_ns: int) -> None:
        """Remove the parts that have expired."""
        oldest = now_ns // self._part_ns - _PARTS
        parts = self._parts
        while parts and parts[0][0] <= oldest:
            parts.popleft()
            self._spans = None

    @property
    def next_ns(self) -> float:
        """Time at which the oldest part expires; infinite without a sample."""
        if not self._parts:
            return math.inf
        return (int(self._parts[0][0]) + _PARTS) * self._part_ns

    def spans(self, direction: str) -> float:
        """
        Return the largest rise, fall or either of them from a sample to a later one; 0 at least.

        :param direction: ``rises``, ``falls`` or ``moves``.
        """
        if self._spans is None:
            self._spans = self._measured()
        return self._spans[direction]

    def _measured(self) -> dict[str, float]:
        low, high = math.inf, -math.inf
        rises = falls = 0.0
        for _, lowest, highest, rose, fell in self._parts:
            rises = max(rises, rose, highest - low)
            falls = max(falls, fell, high - lowest)
            low, high = min(low, lowest), max(high, highest)
        return {'rises': rises, 'falls': falls, 'moves': max(rises, falls)}
