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

"""The last seconds of what a worn accelerometer felt, with means of any part of them."""

from __future__ import annotations

from bisect import bisect_left
import math
from typing import Final
from typing import NamedTuple
from typing import TypeAlias

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import STANDARD_GRAVITY_M_S2

Vector: TypeAlias = tuple[float, float, float]

# A gap in the samples is bridged for so long where something is summed over time.
_BRIDGED_S: Final = 0.15
_LEAST_BLOCKS: Final = 3
# An impact and its rebounds: from so long before its peak until so long after it.
_STOP_FROM_NS: Final = 200 * NS_PER_MS
_STOP_UNTIL_NS: Final = 500 * NS_PER_MS


class Span(NamedTuple):
    """
    A part of the past.

    :ivar mean: of the specific force, in g.
    :ivar spread_g: standard deviation of its size.
    :ivar turning_deg: the most that any of its thirds is turned against another.
    :ivar lasts_s: from its first to its last block.
    """

    mean: Vector
    spread_g: float
    turning_deg: float
    lasts_s: float


def angle_deg(one: Vector, two: Vector) -> float:
    """Return the angle between two vectors in degrees; 0 if one of them is none."""
    sizes = math.hypot(*one) * math.hypot(*two)
    if sizes <= 0.0:
        return 0.0
    cosine = (one[0] * two[0] + one[1] * two[1] + one[2] * two[2]) / sizes
    return math.degrees(math.acos(min(1.0, max(-1.0, cosine))))


class MotionHistory:
    """
    Keep blocks of samples; sums up to each make every mean cheap.

    :param blocks: as many are kept, at least.

    Safe in the real-time loop: plain numbers, no more memory than twice the blocks.
    """

    def __init__(self, blocks: int) -> None:
        self._most = blocks
        self._times: list[int] = []
        self._sizes: list[float] = []
        self._turns: list[float] = []
        # Sums of all blocks before that of the index, one more than there are blocks.
        self._x, self._y, self._z = [0.0], [0.0], [0.0]
        self._size, self._square = [0.0], [0.0]

    def add(self, stamp_ns: int, x: float, y: float, z: float, turn_deg_s: float) -> float:
        """
        Append a block, in g; stamps rise.

        :param turn_deg_s: how fast it turned; 0 without a gyroscope.
        :return: the size of the vector.
        """
        size = math.sqrt(x * x + y * y + z * z)
        self._times.append(stamp_ns)
        self._sizes.append(size)
        self._turns.append(turn_deg_s)
        for sums, value in ((self._x, x), (self._y, y), (self._z, z), (self._size, size),
                            (self._square, size * size)):
            sums.append(sums[-1] + value)
        if len(self._times) >= 2 * self._most:
            del self._times[:self._most]
            for each in (self._sizes, self._turns, self._x, self._y, self._z, self._size,
                         self._square):
                del each[:self._most]
        return size

    def span(self, from_ns: int, until_ns: int) -> Span | None:
        """Return what was from one time to another, both included; None with hardly a block."""
        times = self._times
        first, end = bisect_left(times, from_ns), bisect_left(times, until_ns + 1)
        if end - first < _LEAST_BLOCKS:
            return None
        count = end - first
        thirds = [self._mean(first + part * count // 3, first + (part + 1) * count // 3)
                  for part in range(3)]
        mean = (self._size[end] - self._size[first]) / count
        square = (self._square[end] - self._square[first]) / count
        return Span(
            self._mean(first, end), math.sqrt(max(0.0, square - mean * mean)),
            max(angle_deg(thirds[one], thirds[one - 1]) for one in range(3)),
            (times[end - 1] - times[first]) / NS_PER_S)

    def fastest_deg_s(self, from_ns: int) -> float:
        """Return the fastest turn since a time."""
        return max(self._turns[bisect_left(self._times, from_ns):], default=0.0)

    def range_g(self, from_ns: int) -> float:
        """Return how far apart the largest and the smallest size since a time are."""
        sizes = self._sizes[bisect_left(self._times, from_ns):]
        return max(sizes) - min(sizes) if sizes else 0.0

    def descent(self, at_ns: int, within_s: float = 1.2) -> tuple[float, float]:
        """
        Return how fast it went down before a time, and the least that was felt meanwhile.

        The speed is the integral of what is missing from 1 g: exact for a fall straight down from
        rest, an estimate for a body that turns.

        :param at_ns: of an impact.
        :return: m/s and g.
        """
        times, sizes = self._times, self._sizes
        index = bisect_left(times, at_ns)
        if index >= len(sizes):
            return 0.0, 1.0
        earliest_ns = at_ns - round(within_s * NS_PER_S)
        while index > 0 and sizes[index] > 1.0 and times[index] > at_ns - NS_PER_S // 3:
            index -= 1  # the rise of the impact itself
        speed = best = 0.0
        least = sizes[index]
        while index > 0 and times[index - 1] >= earliest_ns:
            lasts_s = min((times[index] - times[index - 1]) / NS_PER_S, _BRIDGED_S)
            missing = 1.0 - 0.5 * (sizes[index] + sizes[index - 1])
            speed += missing * lasts_s * STANDARD_GRAVITY_M_S2
            best = max(best, speed)
            least = min(least, sizes[index])
            index -= 1
        return best, least

    def stop_m_s(self, at_ns: int, rest_g: float) -> float:
        """
        Return how much speed an impact took away: the integral of what is beyond rest around it.

        A soft floor takes longer for it and is felt less, but has to take away as much as a hard
        one.

        :param at_ns: of its peak.
        :param rest_g: what the sensor feels at rest: 1 g, but for its scale and its zero.
        """
        times, sizes = self._times, self._sizes
        index = bisect_left(times, at_ns - _STOP_FROM_NS)
        end = bisect_left(times, at_ns + _STOP_UNTIL_NS + 1)
        speed = 0.0
        while index + 1 < end:
            lasts_s = min((times[index + 1] - times[index]) / NS_PER_S, _BRIDGED_S)
            beyond = max(0.0, sizes[index] - rest_g) + max(0.0, sizes[index + 1] - rest_g)
            speed += 0.5 * beyond * lasts_s * STANDARD_GRAVITY_M_S2
            index += 1
        return speed

    def _mean(self, first: int, end: int) -> Vector:
        count = max(1, end - first)
        return ((self._x[end] - self._x[first]) / count, (self._y[end] - self._y[first]) / count,
                (self._z[end] - self._z[first]) / count)
