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
Odometry of two wheels, with its covariance; pure and safe in the real-time loop.

The pose is the sum of exact arcs. Each wheel's travel is uncertain by ``noise`` times the root of
its length, so the variances of a step are ``k |dl|`` and ``k |dr|`` with ``k = noise^2``
(Siegwart, Nourbakhsh, Introduction to Autonomous Mobile Robots, section 5.2.4). With a gyroscope
the turn is the gyroscope's, and the wheels are compared with it: one wheel that slips by s turns
the robot by s / separation less than the wheels indicate, and moves it s / 2 less far.
"""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.motion.differential import body_velocity
from rt_robot_os.motion.ekf import Ekf
from rt_robot_os.motion.ekf import PoseCovariance
from rt_robot_os.motion.gyro_turn import RestBias

# A slower rim stands still, in m/s; a robot that stands for this time does not turn.
_STANDING_M_S: Final = 5e-4
_STANDING_S: Final = 0.2
# Stamps of encoders jitter by some milliseconds: tolerance of a step.
_SLACK_M: Final = 0.005
# Smallest standard deviations of the mean velocity, in m/s and rad/s.
_FLOOR_M_S: Final = 1e-3
_FLOOR_RAD_S: Final = 1e-3
# When encoders jump, the robot moves on as before for this time, with this acceleration.
_COAST_S: Final = 0.2
_ACCELERATION_M_S2: Final = 5.0
# Wheels and gyroscope are compared over about this time; a slip is a larger difference, constant
# and relative to the turn.
_COMPARED_S: Final = 0.3
_SLIP_RAD: Final = 0.04
_SLIP_PART: Final = 0.1
# While the wheels stand, a smaller difference is not from a robot that is pushed round.
_PUSHED_RAD: Final = 0.006


@dataclass(frozen=True)
class WheelParameters:
    """
    The parameters of a pair of wheels.

    :ivar left_radius_m: of the left wheel, as it rolls under load.
    :ivar right_radius_m: of the right one.
    :ivar separation_m: between the points where they touch the ground.
    :ivar speed_most_m_s: of a rim; what is faster is an encoder's error.
    :ivar noise_m: standard deviation of a wheel's travel after 1 m; it grows with the root.
    :ivar gyro_noise_rad: of the gyroscope's turn after 1 s, the same way.
    :ivar gyro_scale_rad: of the gyroscope's turn after 1 rad, the same way.
    :ivar bias_most_rad_s: largest accepted bias of the gyroscope.
    """

    left_radius_m: float
    right_radius_m: float
    separation_m: float
    speed_most_m_s: float = 2.0
    noise_m: float = 0.005
    gyro_noise_rad: float = 0.001
    gyro_scale_rad: float = 0.005
    bias_most_rad_s: float = 0.1


@dataclass
class WheelSampleCounters:
    """
    Counters of samples.

    :ivar steps: used.
    :ivar not_finite: dropped: a position is missing or infinite.
    :ivar duplicates: dropped: a repeated sample.
    :ivar stopped: dropped: the wheels moved, but the stamp did not.
    :ivar backwards: dropped: older than the one before.
    :ivar restarts: the stamps restarted, earlier by more than a second: motion unknown meanwhile.
    :ivar implausible: a wheel jumped; the robot is assumed to have moved on as before.
    :ivar slips: times that wheels and gyroscope began to disagree.
    """

    steps: int = 0
    not_finite: int = 0
    duplicates: int = 0
    stopped: int = 0
    backwards: int = 0
    restarts: int = 0
    implausible: int = 0
    slips: int = 0


class WheelOdometry:
    """
    Integrate the motion of the wheels.

    :ivar distance_m: of the last step, along the arc.
    :ivar turn_rad: of the last step.
    :ivar dt_s: how long it took.
    :ivar distance_variance: of the last step, in m^2.
    :ivar turn_variance: of the last step, in rad^2.
    :ivar step_covariance: of both, in m rad.
    :ivar bias: of the gyroscope.
    :ivar slipping: wheels and gyroscope disagree now.
    :ivar stuck: ``left`` or ``right``, a wheel that reports no motion while slipping; else empty.
    :ivar by_gyro: the last turn is the gyroscope's.
    :ivar in_row: implausible samples since the last good one.
    """

    def __init__(self, wheels: WheelParameters) -> None:
        self.counters = WheelSampleCounters()
        self.bias = RestBias(wheels.bias_most_rad_s)
        self.distance_m = self.turn_rad = self.dt_s = 0.0
        self.distance_variance = self.turn_variance = self.step_covariance = 0.0
        self.slipping = self.by_gyro = False
        self.stuck = ''
        self.in_row = 0
        self._wheels = wheels
        self._state = Ekf()
        self._stamp_ns = 0
        self._left = self._right = 0.0
        self._standing_s = 0.0
        self._mismatch = self._turned = 0.0
        self._slipped_m = 0.0
        self._speed_m_s = self._rate_rad_s = self._bad_s = 0.0

    @property
    def pose(self) -> tuple[float, float, float]:
        """Return x and y in m and the heading in rad, from where it began."""
        return self._state.pose

    @property
    def covariance(self) -> PoseCovariance:
        """Return that of the pose; it grows with the way."""
        return self._state.covariance

    @property
    def stamp_ns(self) -> int:
        """Return the moment of the pose; 0 before the first sample."""
        return self._stamp_ns

    def update(self, stamp_ns: int, left_rad: float, right_rad: float,
               gyro_rad: float = math.nan) -> bool:
        """
        Process the angles of the wheels.

        :param gyro_rad: turn of a gyroscope since the last sample that was used, with its bias;
            NaN when unknown.
        :return: whether there is a new pose.
        """
        if not (math.isfinite(left_rad) and math.isfinite(right_rad)):
            self.counters.not_finite += 1
            return False
        if not self._stamp_ns:
            self._refer_to(stamp_ns, left_rad, right_rad)
            return True
        dt_ns = stamp_ns - self._stamp_ns
        if dt_ns <= 0:
            return self._out_of_order(stamp_ns, left_rad, right_rad)
        self.dt_s = dt_s = dt_ns / NS_PER_S
        wheels = self._wheels
        left = (left_rad - self._left) * wheels.left_radius_m
        right = (right_rad - self._right) * wheels.right_radius_m
        self._refer_to(stamp_ns, left_rad, right_rad)
        self.bias.update(gyro_rad, dt_s, self._stands(left, right, dt_s))
        gyro = gyro_rad - self.bias.rad_s * dt_s if self.bias.known else math.nan
        most = wheels.speed_most_m_s * dt_s + _SLACK_M
        if abs(left) <= most and abs(right) <= most:
            self.in_row, self._bad_s = 0, 0.0
            self._roll(left, right, gyro)
            self._speed_m_s, self._rate_rad_s = self.distance_m / dt_s, self.turn_rad / dt_s
        else:
            self.counters.implausible += 1
            self.in_row += 1
            self._coast(gyro)
        self._state.predict(self.distance_m, self.turn_rad, 0.0, self.distance_variance,
                            self.turn_variance, self.step_covariance)
        self.counters.steps += 1
        return True

    # ---- steps -------------------------------------------------------------------------------

    def _refer_to(self, stamp_ns: int, left_rad: float, right_rad: float) -> None:
        self._stamp_ns, self._left, self._right = stamp_ns, left_rad, right_rad

    def _out_of_order(self, stamp_ns: int, left_rad: float, right_rad: float) -> bool:
        counters = self.counters
        if stamp_ns == self._stamp_ns:
            if (left_rad, right_rad) == (self._left, self._right):
                counters.duplicates += 1
            else:
                counters.stopped += 1
        elif self._stamp_ns - stamp_ns < NS_PER_S:
            counters.backwards += 1
        else:
            counters.restarts += 1
            self._refer_to(stamp_ns, left_rad, right_rad)
        return False

    def _stands(self, left_m: float, right_m: float, dt_s: float) -> bool:
        most = _STANDING_M_S * dt_s
        stands = abs(left_m) <= most and abs(right_m) <= most
        self._standing_s = self._standing_s + dt_s if stands else 0.0
        return stands

    def _roll(self, left_m: float, right_m: float, gyro_rad: float) -> None:
        """Compute a step of the wheels, with the gyroscope if there is one."""
        wheels, dt_s = self._wheels, self.dt_s
        separation = wheels.separation_m
        self.distance_m, turn = body_velocity(left_m, right_m, separation)
        k, rolled = wheels.noise_m * wheels.noise_m, abs(left_m) + abs(right_m)
        self.distance_variance = k * rolled / 4 + (_FLOOR_M_S * dt_s) ** 2
        self.by_gyro = gyro_rad == gyro_rad
        if not self.by_gyro:
            self.turn_rad = turn
            self.turn_variance = k * rolled / separation ** 2 + (_FLOOR_RAD_S * dt_s) ** 2
            self.step_covariance = k * (abs(right_m) - abs(left_m)) / (2 * separation)
            return
        self._compare(turn, gyro_rad, left_m, right_m)
        still = self._standing_s >= _STANDING_S and abs(self._mismatch) < _PUSHED_RAD
        self.turn_rad = 0.0 if still else gyro_rad
        self.turn_variance = (_FLOOR_RAD_S * dt_s) ** 2 + (
            0.0 if still else wheels.gyro_noise_rad ** 2 * dt_s
            + wheels.gyro_scale_rad ** 2 * abs(gyro_rad))
        self.step_covariance = 0.0

    def _compare(self, turn: float, gyro_rad: float, left_m: float, right_m: float) -> None:
        """Detect a slip: wheels and gyroscope disagree about the recent turn."""
        keep = math.exp(-self.dt_s / _COMPARED_S)
        missing = turn - gyro_rad
        self._mismatch = keep * self._mismatch + missing
        self._turned = keep * self._turned + abs(gyro_rad)
        before = self.slipping
        limit = _SLIP_RAD + _SLIP_PART * self._turned
        self.slipping = abs(self._mismatch) > (limit / 2 if before else limit)
        if not self.slipping:
            self._slipped_m, self.stuck = 0.0, ''
            return
        half = self._wheels.separation_m / 2
        if not before:
            self.counters.slips += 1
            added = abs(self._mismatch) * half
        else:
            added = abs(missing) * half
        # Errors of one slip are correlated: they add up linearly.
        self.distance_variance += added * (2 * self._slipped_m + added)
        self._slipped_m += added
        still = _STANDING_M_S * self.dt_s
        self.stuck = ('left' if abs(left_m) <= still < abs(right_m) else
                      'right' if abs(right_m) <= still < abs(left_m) else '')

    def _coast(self, gyro_rad: float) -> None:
        """Move on as before for a moment, at an uncertain distance, as the encoders jumped."""
        wheels, dt_s = self._wheels, self.dt_s
        self._bad_s += dt_s
        goes_on = self._bad_s <= _COAST_S
        self.distance_m = self._speed_m_s * dt_s if goes_on else 0.0
        self.turn_rad = self._rate_rad_s * dt_s if goes_on else 0.0
        doubt_m = min(wheels.speed_most_m_s, _ACCELERATION_M_S2 * self._bad_s) * dt_s
        self.distance_variance = doubt_m * doubt_m
        self.turn_variance = (2 * doubt_m / wheels.separation_m) ** 2
        self.step_covariance = 0.0
        self.by_gyro = gyro_rad == gyro_rad
        if self.by_gyro:
            self.turn_rad = gyro_rad
            self.turn_variance = wheels.gyro_noise_rad ** 2 * dt_s + (
                wheels.gyro_scale_rad ** 2 * abs(gyro_rad))
