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
The turn of a robot by a gyroscope, between any two times.

A joint's or an encoder's stamps are not those of a gyroscope: its angle is interpolated between
two samples, and carried on a little after the last one.
"""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Final

from rt_robot_os.base.units import NS_PER_S

# Impossible rate of a robot on wheels, in rad/s.
_RATE_MOST: Final = 350.0


@dataclass
class GyroCounters:
    """
    Counters of samples.

    :ivar samples: used.
    :ivar not_finite: dropped: no number, or an impossible one.
    :ivar backwards: dropped: not newer than the one before.
    :ivar stopped: dropped: with the stamp of the one before, but another value.
    :ivar gaps: pauses that are too long to integrate over.
    """

    samples: int = 0
    not_finite: int = 0
    backwards: int = 0
    stopped: int = 0
    gaps: int = 0


class GyroTurn:
    """
    Integrate the rate about the vertical; safe in the real-time loop.

    :param gap_s: longest time between two samples, and after the last, to integrate over.
    :ivar stamp_ns: of the last sample; 0 before the first.
    """

    __slots__ = ('counters', 'stamp_ns', '_gap_ns', '_rate', '_angle', '_before_ns',
                 '_before_angle', '_read_ns', '_read_angle')

    def __init__(self, gap_s: float) -> None:
        self.counters = GyroCounters()
        self._gap_ns = round(gap_s * NS_PER_S)
        self.stamp_ns = self._before_ns = self._read_ns = 0
        self._rate = self._angle = self._before_angle = self._read_angle = 0.0

    def add(self, stamp_ns: int, rate_rad_s: float) -> bool:
        """
        Add a sample.

        :return: whether it was used.
        """
        if not -_RATE_MOST < rate_rad_s < _RATE_MOST:
            self.counters.not_finite += 1
            return False
        dt_ns = stamp_ns - self.stamp_ns
        if -self._gap_ns <= dt_ns <= 0 and self.stamp_ns:
            self.counters.backwards += 1
            if not dt_ns and rate_rad_s != self._rate:
                self.counters.stopped += 1
            return False
        if 0 < dt_ns <= self._gap_ns:
            self._before_ns, self._before_angle = self.stamp_ns, self._angle
            self._angle += (self._rate + rate_rad_s) / 2 * dt_ns / NS_PER_S
        else:
            if self.stamp_ns:
                self.counters.gaps += 1
            self._before_ns, self._before_angle = stamp_ns, self._angle
            self._read_ns = 0
        self.stamp_ns, self._rate = stamp_ns, rate_rad_s
        self.counters.samples += 1
        return True

    def until(self, stamp_ns: int) -> float:
        """
        Return the turn since the time of the last call, in rad.

        :return: NaN when samples are missing there, or were then.
        """
        angle = self._at(stamp_ns)
        known = angle == angle and self._read_ns != 0
        turn = angle - self._read_angle if known else math.nan
        self._read_ns = stamp_ns if angle == angle else 0
        self._read_angle = angle
        return turn

    def _at(self, stamp_ns: int) -> float:
        ahead_ns = stamp_ns - self.stamp_ns
        if 0 <= ahead_ns <= self._gap_ns and self.stamp_ns:
            return self._angle + self._rate * ahead_ns / NS_PER_S
        if ahead_ns < 0 and stamp_ns >= self._before_ns and self.stamp_ns > self._before_ns:
            part = (stamp_ns - self._before_ns) / (self.stamp_ns - self._before_ns)
            return self._before_angle + part * (self._angle - self._before_angle)
        return math.nan


# Duration of the mean that is the bias; both halves must agree within this, in rad/s.
_BLOCK_S: Final = 1.0
_STEADY_RAD_S: Final = 0.01
# A bias changes slowly, with temperature: a larger change must last for this many blocks.
_NEAR_RAD_S: Final = 0.02
_FAR_BLOCKS: Final = 10
_PART: Final = 0.3


class RestBias:
    """
    The bias of a gyroscope while the wheels stand still; safe in the real-time loop.

    :param most_rad_s: the largest accepted one. A robot that is turned by hand, steadily and
        slower than that, while its wheels stand, looks as if at rest.
    :ivar known: there has been a second of rest.
    :ivar rad_s: the bias; 0 before.
    """

    __slots__ = ('known', 'rad_s', '_most', '_turn', '_time_s', '_half', '_far')

    def __init__(self, most_rad_s: float) -> None:
        self.known = False
        self.rad_s = 0.0
        self._most = most_rad_s
        self._far = 0
        self._turn = self._time_s = 0.0
        self._half = math.nan

    def update(self, turn_rad: float, dt_s: float, standing: bool) -> None:
        """
        Add the turn of a step, with its bias.

        :param turn_rad: NaN when that is not known.
        :param standing: the wheels did not move.
        """
        if not standing or turn_rad != turn_rad:
            self._restart()
            return
        self._turn += turn_rad
        self._time_s += dt_s
        if self._half != self._half and self._time_s >= _BLOCK_S / 2:
            self._half = self._turn / self._time_s
        if self._time_s >= _BLOCK_S:
            self._judge(self._turn / self._time_s)
            self._restart()

    def _judge(self, mean: float) -> None:
        # Twice the difference of a half to the whole is that of the halves.
        if abs(mean) > self._most or 2 * abs(mean - self._half) > _STEADY_RAD_S:
            return
        far = self.known and abs(mean - self.rad_s) > _NEAR_RAD_S
        self._far = self._far + 1 if far else 0
        if not self.known or self._far >= _FAR_BLOCKS:
            self.rad_s, self._far = mean, 0
        elif not far:
            self.rad_s += _PART * (mean - self.rad_s)
        self.known = True

    def _restart(self) -> None:
        self._turn = self._time_s = 0.0
        self._half = math.nan
