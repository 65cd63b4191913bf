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
The counters of two wheels, as angles without jumps.

A counter wraps, restarts when its board is reset, and is misread when bytes are lost. Only
plausible steps are added to the angles, so none of that becomes a movement of the robot.
"""

from __future__ import annotations

from enum import Enum
import math
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.motion.differential import tick_difference

Counts = tuple[float, float]

# Jitter of the time of a reading, with the turn of the wheels meanwhile.
_JITTER_S: Final = 0.02
# After a longer gap only the turn of this time is accepted.
_LONGEST_GAP_S: Final = 1.0
# A wheel gains or loses its highest speed in this time at least, and half its speed immediately.
_FASTEST_START_S: Final = 0.15
_TOLERANCE_RAD: Final = 0.02
# Error of a coarse encoder, in counts.
_ROUNDING: Final = 1.5
# Consistent readings in a row until they are accepted, and until they count as those of counters
# that were reset.
_SURE: Final = 3
_SURE_OF_RESET: Final = 5
# Over a shorter time the speed would be noise of the arrivals.
_SHORTEST_S: Final = 0.015


class CounterReading(Enum):
    """
    The result of a reading.

    TAKEN: it was added. REJECTED: it is not what the wheels were about to do, and later ones
    decide whether it was wrong. REBASED: the counters restarted at another value.
    """

    TAKEN = 'taken'
    REJECTED = 'rejected'
    REBASED = 'rebased'


class _HeldReadings(NamedTuple):
    """
    Consistent readings that are held back.

    :ivar number: of them.
    :ivar speeds: of both wheels in rad/s; None while it is one reading.
    """

    first: Counts
    first_ns: int
    last: Counts
    last_ns: int
    number: int = 1
    speeds: Counts | None = None


class WheelCounters:
    """
    Angles and speeds of two wheels, left before right; safe in the real-time loop.

    An unexpected reading is held back. If a later one is consistent with those before, it was
    wrong, and nothing is lost. If three in a row are consistent and plausible, they are right, and
    nothing is lost either. If five are consistent, the counters were reset, and the motion since
    the first of those is used.

    :ivar position_rad: how far the wheels have turned since the beginning.
    :ivar velocity_rad_s: how fast they turned between the last readings.
    :ivar stamp_ns: of the last accepted reading; 0 = none yet.
    :ivar rejected: readings that were held back, right or wrong.
    :ivar resets: times that the counters restarted.
    """

    def __init__(self, left_rad: float, right_rad: float, *, bits: int, fastest_rad_s: float,
                 most: float = 0.0, silence_s: float = 0.25) -> None:
        """
        Set the parameters.

        :param left_rad: angle of one count of the left wheel; negative where it counts backwards.
        :param bits: width of the counters, after which they wrap; 0 for numbers that do not.
        :param fastest_rad_s: highest speed of a wheel, of a robot that is pushed as well.
        :param most: counts between two readings that are believed; 0 takes those of the highest
            speed.
        :param silence_s: after a longer one they may have been reset.
        """
        self._units = left_rad, right_rad
        self._bits = bits
        # Numbers that do not wrap have negligible steps.
        self._tolerance_rad = max(_TOLERANCE_RAD, _ROUNDING * max(
            abs(left_rad), abs(right_rad)) if bits else 0.0)
        self._silence_ns = round(silence_s * NS_PER_S)
        self._fastest_rad_s = fastest_rad_s
        self._gain_rad_s2 = fastest_rad_s / _FASTEST_START_S
        self._most_rad = most * max(abs(left_rad), abs(right_rad))
        self._last: Counts | None = None
        self._held: _HeldReadings | None = None
        self._doubted = False
        self._totals: Counts = (0, 0)
        self._from_rad: Counts = (0.0, 0.0)
        self._from_ns = 0
        self.position_rad: Counts = (0.0, 0.0)
        self.velocity_rad_s: Counts = (0.0, 0.0)
        self.stamp_ns = 0
        self.rejected = self.resets = 0

    def restart(self) -> None:
        """Restart with the next reading, whatever its counts; the angles stay."""
        self._last = self._held = None
        self._doubted = False
        self.velocity_rad_s = 0.0, 0.0

    def expect_reset(self) -> None:
        """Expect that the counters may have been reset, after a while without answers."""
        self._doubted = True

    def update(self, left: float, right: float, now_ns: int) -> CounterReading:
        """
        Add a reading.

        :param left: count of the left wheel, as the board gives it.
        :param now_ns: when it was taken.
        """
        if not (math.isfinite(left) and math.isfinite(right)):
            self.rejected += 1
            return CounterReading.REJECTED
        counts = left, right
        last = self._last
        if last is None:
            self._start(now_ns)
            return self._add((0, 0), counts, now_ns, CounterReading.TAKEN)
        steps = self._difference(counts, last)
        doubted = self._doubted or now_ns - self.stamp_ns > self._silence_ns
        self._doubted = False
        if self._are_new(counts, steps, now_ns, doubted):
            self.resets += 1
            self._start(now_ns)
            return self._add((0, 0), counts, now_ns, CounterReading.REBASED)
        if self._is_likely(steps, now_ns - self.stamp_ns, self.velocity_rad_s, self._gain_rad_s2):
            return self._add(steps, counts, now_ns, CounterReading.TAKEN)
        return self._surprise(steps, counts, now_ns)

    def _surprise(self, steps: Counts, counts: Counts, now_ns: int) -> CounterReading:
        """Hold a reading back until later ones decide about it."""
        held = self._held
        if held is None or not self._follows(counts, held, now_ns):
            self._held = _HeldReadings(counts, now_ns, counts, now_ns)
        else:
            self._held = held = _HeldReadings(
                held.first, held.first_ns, counts, now_ns, held.number + 1,
                self._speeds(self._difference(counts, held.last), now_ns - held.last_ns))
            if held.number >= _SURE and self._can_be(steps, now_ns - self.stamp_ns):
                return self._add(steps, counts, now_ns, CounterReading.TAKEN)
            if held.number >= _SURE_OF_RESET:
                self.resets += 1
                self._start(held.first_ns)
                return self._add(self._difference(counts, held.first), counts, now_ns,
                                 CounterReading.REBASED)
        self.rejected += 1
        return CounterReading.REJECTED

    def _follows(self, counts: Counts, held: _HeldReadings, now_ns: int) -> bool:
        """Return whether a reading is consistent with those that are held back."""
        steps, took_ns = self._difference(counts, held.last), now_ns - held.last_ns
        if held.speeds is None:
            return self._can_be(steps, took_ns)
        return self._is_likely(steps, took_ns, held.speeds, self._gain_rad_s2)

    def _speeds(self, steps: Counts, took_ns: int) -> Counts:
        took_s = max(took_ns / NS_PER_S, _SHORTEST_S)
        return steps[0] * self._units[0] / took_s, steps[1] * self._units[1] / took_s

    def _start(self, now_ns: int) -> None:
        """Measure the speed from here on."""
        self._from_rad, self._from_ns = self.position_rad, now_ns
        self.velocity_rad_s = 0.0, 0.0

    def _add(self, steps: Counts, counts: Counts, now_ns: int, reading: CounterReading
             ) -> CounterReading:
        left, right = self._totals[0] + steps[0], self._totals[1] + steps[1]
        self._totals = left, right
        a, b = self.position_rad = left * self._units[0], right * self._units[1]
        took_s = (now_ns - self._from_ns) / NS_PER_S
        if took_s >= _SHORTEST_S:
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

    def _is_likely(self, steps: Counts, took_ns: int, speeds_rad_s: Counts,
                   gain_rad_s2: float) -> bool:
        """
        Return whether the wheels continued about as before.

        :param speeds_rad_s: their previous speeds.
        :param gain_rad_s2: largest acceleration, in addition to half of their speed.
        """
        took_s = min(max(took_ns, 0) / NS_PER_S, _LONGEST_GAP_S)
        gained_rad = gain_rad_s2 * took_s * took_s + self._tolerance_rad
        for step, unit, speed in zip(steps, self._units, speeds_rad_s):
            off_rad = abs(step * unit - speed * took_s)
            if off_rad > abs(speed) * (took_s / 2 + _JITTER_S) + gained_rad:
                return False
        return self._can_be(steps, took_ns)

    def _can_be(self, steps: Counts, took_ns: int) -> bool:
        """Return whether wheels can turn so far."""
        took_s = min(max(took_ns, 0) / NS_PER_S, _LONGEST_GAP_S)
        most_rad = self._most_rad or (
            self._fastest_rad_s * (took_s + _JITTER_S) + self._tolerance_rad)
        return (abs(steps[0] * self._units[0]) <= most_rad
                and abs(steps[1] * self._units[1]) <= most_rad)

    def _are_new(self, counts: Counts, steps: Counts, now_ns: int, doubted: bool) -> bool:
        """Return whether the counters were reset, although they had not gone far before."""
        if counts[0] == 0 and counts[1] == 0:
            return not self._is_likely(steps, now_ns - self.stamp_ns, self.velocity_rad_s, 0.0)
        if not doubted:
            return False
        from_zero = self._difference(counts, (0, 0))
        return abs(from_zero[0]) < abs(steps[0]) and abs(from_zero[1]) < abs(steps[1])
