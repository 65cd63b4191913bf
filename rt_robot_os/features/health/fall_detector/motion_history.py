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

"""History of the last seconds of a worn accelerometer, with means of any interval."""

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

# Longest gap between samples that an integral bridges.
_BRIDGED_S: Final = 0.15
_LEAST_BLOCKS: Final = 3
# Interval of an impact and its rebounds, before and after its peak.
_STOP_FROM_NS: Final = 200 * NS_PER_MS
_STOP_UNTIL_NS: Final = 500 * NS_PER_MS


class Span(NamedTuple):
    """
    Statistics of an interval.

    :ivar mean: of the specific force, in g.
    :ivar spread_g: standard deviation of its magnitude.
    :ivar turning_deg: largest angle between the means of its thirds.
    :ivar lasts_s: from the first to the last block.
    """

    mean: Vector
    spread_g: float
    turning_deg: float
    lasts_s: float


def angle_deg(one: Vector, two: Vector) -> float:
    """Return the angle between two vectors in degrees; 0 if one of them is zero."""
    sizes = math.hypot(*one) * math.hypot(*two)
    if sizes <= 0.0:
        return 0.0
    cosine = (one[0] * two[0] + one[1] * two[1] + one[2] * two[2]) / sizes
    return math.degrees(math.acos(min(1.0, max(-1.0, cosine))))


class MotionHistory:
    """
    Store blocks of samples with prefix sums, so that every mean is cheap.

    Safe in the real-time loop: plain numbers, bounded memory.

    :param blocks: at least as many are stored, at most twice as many.
    """

    def __init__(self, blocks: int) -> None:
        self._most = blocks
        self._times: list[int] = []
        self._sizes: list[float] = []
        self._turns: list[float] = []
        # Prefix sums: entry i is the sum of the blocks before i.
        self._x, self._y, self._z = [0.0], [0.0], [0.0]
        self._size, self._square = [0.0], [0.0]

    def add(self, stamp_ns: int, x: float, y: float, z: float, turn_deg_s: float) -> float:
        """
        Append a block, in g; stamps increase.

        :param turn_deg_s: angular rate; 0 without a gyroscope.
        :return: the magnitude of the vector.
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
        """Return statistics from one time to another, both inclusive; None with too few blocks."""
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
        """Return the largest angular rate since a time."""
        return max(self._turns[bisect_left(self._times, from_ns):], default=0.0)

    def range_g(self, from_ns: int) -> float:
        """Return the range of the magnitude since a time."""
        sizes = self._sizes[bisect_left(self._times, from_ns):]
        return max(sizes) - min(sizes) if sizes else 0.0

    def descent(self, at_ns: int, within_s: float = 1.2) -> tuple[float, float]:
        """
        Return the downward speed before a time, and the least specific force meanwhile.

        The speed is the integral of 1 g minus the specific force: exact for a vertical fall from
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
            index -= 1  # skip the rising edge of the impact
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
        Return the speed that an impact absorbed: the integral of the force beyond that at rest.

        A soft floor takes longer with a lower peak, but absorbs the same speed as a hard one.

        :param at_ns: of its peak.
        :param rest_g: specific force at rest: 1 g with the errors of the sensor.
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
