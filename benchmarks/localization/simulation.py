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
Odometry and localisation on a simulated drive: how far off, how sure, how soon found again.

Everything follows from the seed, and nothing from the machine.
"""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import field
import math

from benchmarks.localization.plant import DT_S
from benchmarks.localization.plant import eight
from benchmarks.localization.plant import RADIUS_M
from benchmarks.localization.plant import Robot
from benchmarks.localization.plant import SEPARATION_M
import numpy as np

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.ekf import PoseCovariance
from rt_robot_os.motion.gyro_turn import GyroTurn
from rt_robot_os.motion.localizer import Localizer
from rt_robot_os.motion.pose_history import OdometryStep
from rt_robot_os.motion.pose_history import PoseFix
from rt_robot_os.motion.wheel_odometry import WheelOdometry
from rt_robot_os.motion.wheel_odometry import WheelParameters

GYRO_NOISE_RAD = 0.001
WHEEL_NOISE_M = 0.005
_BEGIN_NS = NS_PER_S
_NEES_EVERY = 25


@dataclass(frozen=True)
class Scenario:
    """
    What happens to the robot.

    :ivar seconds: how long it drives the eight at 0.3 m/s, two seconds at rest before included.
    :ivar gyro: it has a gyroscope.
    :ivar wheel_error: part by which its right wheel is larger than it is said to be.
    :ivar fix_every: of so many samples of odometry one has a measured pose.
    :ivar stddev_m: of the measured x and y.
    :ivar stddev_rad: of the measured heading.
    :ivar outliers: part of the measured poses that are false: half of them are of anywhere, half
        within 0.3 m and 0.3 rad.
    :ivar blind: between these moments, in s, no pose is measured.
    :ivar kidnapped_s: moment at which the robot is carried away by ``kidnapped_by``.
    :ivar delay_s: by which measured poses are late.
    """

    seed: int
    seconds: float = 60.0
    gyro: bool = True
    wheel_error: float = 0.01
    fix_every: int = 5
    stddev_m: float = 0.01
    stddev_rad: float = math.radians(1.0)
    outliers: float = 0.0
    blind: tuple[float, float] = (0.0, 0.0)
    kidnapped_s: float = math.inf
    kidnapped_by: Pose = (1.5, -1.0, 2.0)
    delay_s: float = 0.0


@dataclass
class Trace:
    """
    What came of it, a value for each sample of odometry once the pose is known.

    :ivar time_s: since the beginning.
    :ivar innovations: normalised, squared, of each measured pose that was no outlier and was
        compared.
    :ivar leaps: largest ratio of a correction by an outlier to the standard deviation before it.
    """

    time_s: list[float] = field(default_factory=list)
    truth: list[Pose] = field(default_factory=list)
    estimate: list[Pose] = field(default_factory=list)
    covariance: list[PoseCovariance] = field(default_factory=list)
    odometry: list[Pose] = field(default_factory=list)
    fixes: list[Pose] = field(default_factory=list)
    innovations: list[float] = field(default_factory=list)
    leaps: float = 0.0
    replayed: int = 0
    recovered: int = 0

    def errors_m(self, begin_s: float = 0.0, end_s: float = math.inf) -> list[float]:
        """Return the distances of the estimate from the truth in a stretch of time."""
        return [math.hypot(e[0] - t[0], e[1] - t[1]) for time_s, t, e in zip(
            self.time_s, self.truth, self.estimate) if begin_s <= time_s < end_s]

    def turns_rad(self, begin_s: float = 0.0, end_s: float = math.inf) -> list[float]:
        """Return the errors of the heading, without sign."""
        return [abs(math.remainder(e[2] - t[2], math.tau)) for time_s, t, e in zip(
            self.time_s, self.truth, self.estimate) if begin_s <= time_s < end_s]

    def nees(self, end_s: float = math.inf) -> float:
        """
        Return the mean of the errors squared over their covariance, twice a second.

        Of three numbers it is 3 when the covariance is right; the errors of one drive follow each
        other slowly, so that it takes many drives to tell.
        """
        found = []
        for index in range(0, len(self.time_s), _NEES_EVERY):
            if self.time_s[index] >= end_s:
                break
            (x, y, h), (tx, ty, th) = self.estimate[index], self.truth[index]
            xx, xy, xh, yy, yh, hh = self.covariance[index]
            error = np.array([x - tx, y - ty, math.remainder(h - th, math.tau)])
            found.append(error @ np.linalg.solve(
                [[xx, xy, xh], [xy, yy, yh], [xh, yh, hh]], error))
        return float(np.mean(found))


def rms(values: list[float]) -> float:
    """Return the root of the mean square."""
    return math.sqrt(sum(value * value for value in values) / len(values))


def simulate(scenario: Scenario) -> Trace:
    """Drive once."""
    return _Drive(scenario).run()


class _Drive:
    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self.robot = Robot(eight, right_error=scenario.wheel_error,
                           wheel_noise_m=WHEEL_NOISE_M, gyro_bias=0.02,
                           gyro_stddev=GYRO_NOISE_RAD / math.sqrt(DT_S), seed=scenario.seed)
        self.odometry = WheelOdometry(WheelParameters(RADIUS_M, RADIUS_M, SEPARATION_M))
        self.gyro = GyroTurn(0.1)
        self.localizer = Localizer()
        self.localizer.state.begin_drift(0.0, 0.05 ** 2)
        self.trace = Trace()
        self.late: list[tuple[float, PoseFix, bool]] = []

    def run(self) -> Trace:
        scenario, robot = self.scenario, self.robot
        kidnapped = False
        for index in range(round(scenario.seconds / DT_S)):
            robot.step()
            if not kidnapped and robot.time_s >= scenario.kidnapped_s:
                kidnapped = True
                x, y, heading = robot.pose
                a, b, c = scenario.kidnapped_by
                robot.pose = x + a, y + b, heading + c
            self._move()
            begin_s, end_s = scenario.blind
            if index % scenario.fix_every == 0 and not begin_s <= robot.time_s < end_s:
                self._look()
            while self.late and self.late[0][0] <= robot.time_s:
                _, fix, false = self.late.pop(0)
                self._take(fix, false)
            if self.localizer.located:
                self._note()
        self.trace.replayed = self.localizer.replayed
        self.trace.recovered = self.localizer.counters.recovered
        return self.trace

    @property
    def _now_ns(self) -> int:
        return _BEGIN_NS + round(self.robot.time_s * NS_PER_S)

    def _move(self) -> None:
        odometry, now_ns = self.odometry, self._now_ns
        self.gyro.add(now_ns, self.robot.gyro())
        turned = self.gyro.until(now_ns)
        if not odometry.update(now_ns, *self.robot.angles):
            return
        if self.scenario.gyro and turned == turned:
            step = OdometryStep(now_ns, odometry.distance_m, turned, odometry.dt_s,
                                odometry.distance_variance,
                                GYRO_NOISE_RAD ** 2 * odometry.dt_s, 0.0, 1e-10 * odometry.dt_s)
        else:
            step = OdometryStep(now_ns, odometry.distance_m, odometry.turn_rad,
                                odometry.distance_m,
                                odometry.distance_variance, odometry.turn_variance,
                                odometry.step_covariance, 1e-6 * abs(odometry.distance_m))
        self.localizer.move(step)

    def _look(self) -> None:
        scenario, robot = self.scenario, self.robot
        false = robot.chance(scenario.outliers)
        seen = robot.misled() if false else robot.seen(scenario.stddev_m, scenario.stddev_rad)
        variance = scenario.stddev_m ** 2
        self.trace.fixes.append(seen)
        self.late.append((robot.time_s + scenario.delay_s, PoseFix(
            self._now_ns, seen, (variance, 0.0, 0.0, variance, 0.0, scenario.stddev_rad ** 2)),
            false))

    def _take(self, fix: PoseFix, false: bool) -> None:
        state, located = self.localizer.state, self.localizer.located
        recovered = self.localizer.counters.recovered
        before, covariance = state.pose, state.covariance
        self.localizer.add_fix(fix)
        if not located or not fix.judged:
            return
        if not false:
            # From when the robot is carried away until it is found there is nothing to agree with.
            if self.robot.time_s < self.scenario.kidnapped_s:
                self.trace.innovations.append(fix.nis)
        elif recovered == self.localizer.counters.recovered:
            self.trace.leaps = max(self.trace.leaps, *(
                abs(math.remainder(new - old, math.tau) if index == 2 else new - old)
                / math.sqrt(variance) for index, (new, old, variance) in enumerate(zip(
                    state.pose, before, (covariance[0], covariance[3], covariance[5])))))

    def _note(self) -> None:
        trace = self.trace
        trace.time_s.append(self.robot.time_s)
        trace.truth.append(self.robot.pose)
        trace.estimate.append(self.localizer.state.pose)
        trace.covariance.append(self.localizer.state.covariance)
        trace.odometry.append(self.odometry.pose)
