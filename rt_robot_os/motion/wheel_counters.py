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
The counters of two wheels, as angles that never jump.

A counter wraps, starts anew when its board is reset, and is misread when bytes are lost. Only what
wheels can turn is added to the angles, so none of that becomes a movement of the robot.
"""

from __future__ import annotations

from enum import Enum
import math
from typing import Final

from rt_robot_os.motion.differential import tick_difference
from rt_robot_os.units import NS_PER_S

Counts = tuple[float, float]

# A reading may be later than the one before by this, with all that the wheels turned meanwhile.
_JITTER_S: Final = 0.05
# After a longer gap no more is believed than in this time.
_LONGEST_GAP_S: Final = 1.0
# Of the highest speed: the wheels of a robot that is pushed or runs downhill are faster.
_MARGIN: Final = 1.5
_TOLERANCE_RAD: Final = 0.02
# Over a shorter time the speed would be noise of the arrivals.
_SHORTEST_NS: Final = 15_000_000


class Reading(Enum):
    """
    What became of a reading.

    TAKEN: it was added. REJECTED: the wheels cannot have turned that far, and the next reading
    decides whether this one was wrong. REBASED: the counters started anew, elsewhere.
    """

    TAKEN = 'taken'
    REJECTED = 'rejected'
    REBASED = 'rebased'


class WheelCounters:
    """
    Angles and speeds of two wheels, left before right; safe in the real-time loop.

    A reading that is too far off is held back: if the next one fits to it, the counters were
    reset, and what they do from there on counts; if the next one fits to those before, it was
    wrong, and nothing is lost.

    :ivar position_rad: how far the wheels have turned since the beginning.
    :ivar velocity_rad_s: how fast they turned between the last readings.
    :ivar stamp_ns: of the last reading that was taken; 0 = none yet.
    :ivar rejected: readings that were held back.
    :ivar resets: times that the counters started anew.
    """

    def __init__(self, left_rad: float, right_rad: float, *, bits: int, fastest_rad_s: float,
                 most: float = 0.0) -> None:
        """
        Keep what a count means.

        :param left_rad: angle of one count of the left wheel; negative where it counts backwards.
        :param bits: width of the counters, after which they wrap; 0 for numbers that do not.
        :param fastest_rad_s: highest speed of a wheel.
        :param most: counts between two readings that are believed; 0 takes those of the highest
            speed.
        """
        self._units = left_rad, right_rad
        self._bits = bits
        self._fastest_rad_s = fastest_rad_s
        self._most_rad = most * max(abs(left_rad), abs(right_rad))
        self._last: Counts | None = None
        self._held: Counts | None = None
        self._held_ns = 0
        self._doubted = False
        self._totals: Counts = (0, 0)
        self._from_rad: Counts = (0.0, 0.0)
        self._from_ns = 0
        self.position_rad: Counts = (0.0, 0.0)
        self.velocity_rad_s: Counts = (0.0, 0.0)
        self.stamp_ns = 0
        self.rejected = self.resets = 0

    def forget(self) -> None:
        """Begin anew with the next reading, wherever the counters are; the angles stay."""
        self._last = self._held = None
        self._doubted = False
        self.velocity_rad_s = 0.0, 0.0

    def doubt(self) -> None:
        """Expect that the counters may have been reset: answers stayed away for a while."""
        self._doubted = True

    def take(self, left: float, right: float, now_ns: int) -> Reading:
        """
        Add a reading.

        :param left: count of the left wheel, as the board gives it.
        :param now_ns: when it was taken.
        """
        if not (math.isfinite(left) and math.isfinite(right)):
            self.rejected += 1
            return Reading.REJECTED
        counts = left, right
        last = self._last
        if last is None:
            self._start(now_ns)
            return self._add((0, 0), counts, now_ns, Reading.TAKEN)
        steps = self._difference(counts, last)
        doubted, self._doubted = self._doubted, False
        if self._are_new(counts, steps, now_ns, doubted):
            self.resets += 1
            self._start(now_ns)
            return self._add((0, 0), counts, now_ns, Reading.REBASED)
        if self._can_be(steps, now_ns - self.stamp_ns):
            return self._add(steps, counts, now_ns, Reading.TAKEN)
        held, held_ns = self._held, self._held_ns
        if held is not None:
            steps = self._difference(counts, held)
            if self._can_be(steps, now_ns - held_ns):
                self.resets += 1
                self._start(held_ns)
                return self._add(steps, counts, now_ns, Reading.REBASED)
        self._held, self._held_ns = counts, now_ns
        self.rejected += 1
        return Reading.REJECTED

    def _start(self, now_ns: int) -> None:
        """Measure the speed from here on."""
        self._from_rad, self._from_ns = self.position_rad, now_ns
        self.velocity_rad_s = 0.0, 0.0

    def _add(self, steps: Counts, counts: Counts, now_ns: int, reading: Reading) -> Reading:
        left, right = self._totals[0] + steps[0], self._totals[1] + steps[1]
        self._totals = left, right
        a, b = self.position_rad = left * self._units[0], right * self._units[1]
        took_ns = now_ns - self._from_ns
        if took_ns >= _SHORTEST_NS:
            took_s = took_ns / NS_PER_S
            self.velocity_rad_s = ((a - self._from_rad[0]) / took_s,
                                   (b - self._from_rad[1]) / took_s)
            self._from_rad, self._from_ns = self.position_rad, now_ns
        self._last, self._held = counts, None
        self.stamp_ns = now_ns
        return reading

    def _difference(self, new: Counts, old: Counts) -> Counts:
        bits = self._bits
        if not bits:
            return new[0] - old[0], new[1] - old[1]
        return (tick_difference(int(new[0]), int(old[0]), bits),
                tick_difference(int(new[1]), int(old[1]), bits))

    def _can_be(self, steps: Counts, took_ns: int) -> bool:
        took_s = min(max(took_ns, 0) / NS_PER_S, _LONGEST_GAP_S)
        most_rad = self._most_rad or (
            _MARGIN * self._fastest_rad_s * (took_s + _JITTER_S) + _TOLERANCE_RAD)
        return (abs(steps[0] * self._units[0]) <= most_rad
                and abs(steps[1] * self._units[1]) <= most_rad)

    def _are_new(self, counts: Counts, steps: Counts, now_ns: int, doubted: bool) -> bool:
        """Return whether the counters were reset, although they had not gone far before."""
        if counts[0] == 0 and counts[1] == 0:
            return not self._expected(steps, now_ns)
        if not doubted:
            return False
        from_zero = self._difference(counts, (0, 0))
        return abs(from_zero[0]) < abs(steps[0]) and abs(from_zero[1]) < abs(steps[1])

    def _expected(self, steps: Counts, now_ns: int) -> bool:
        """Return whether the wheels went on about as fast as before."""
        took_s = (now_ns - self.stamp_ns) / NS_PER_S
        for step, unit, speed in zip(steps, self._units, self.velocity_rad_s):
            foreseen_rad = speed * took_s
            if abs(step * unit - foreseen_rad) > abs(foreseen_rad) / 2 + _TOLERANCE_RAD:
                return False
        return True
