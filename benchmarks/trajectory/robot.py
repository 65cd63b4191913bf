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
A simulated robot that is brought up to date whenever somebody looks at it or commands it.

It has no thread and no clock: between two looks it does what it was told last, with the wheels'
lag. So a loop that comes late really drives on for that long.
"""

from __future__ import annotations

import math
import random
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.motion.differential import moved
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.differential import wheel_speeds
from rt_robot_os.motion.localizer import Localizer
from rt_robot_os.motion.pose_history import OdometryStep
from rt_robot_os.motion.pose_history import PoseFix
from rt_robot_os.motion.wheel_odometry import WheelOdometry
from rt_robot_os.motion.wheel_odometry import WheelParameters
from rt_robot_os.sim.world.drive_base import DriveBase
from rt_robot_os.sim.world_settings import WorldSettings

RADIUS_M: Final = 0.05
SEPARATION_M: Final = 0.30
TICKS: Final = 2000
# The encoders are read so often, and each n-th time the marks on the ceiling are seen, some time
# after the picture was taken.
SAMPLE_NS: Final = 10 * NS_PER_MS
SAMPLES_A_FIX: Final = 5
FIX_DELAY_NS: Final = 50 * NS_PER_MS
FIX_STDDEV_M: Final = 0.01
FIX_STDDEV_RAD: Final = math.radians(1.0)

_TICK_RAD: Final = math.tau / TICKS


class Seen(NamedTuple):
    """
    A pose from the marks on the ceiling.

    :ivar arrival_ns: when it is there.
    """

    stamp_ns: int
    arrival_ns: int
    pose: Pose


class Robot:
    """
    The plant with its sensors: encoders at 100 Hz, a StarGazer at 20 Hz.

    :ivar lag_s: time constant of its wheels.
    :ivar travelled_m: the way of base_link.
    """

    def __init__(self, start: Pose, seed: int, slip: float = 0.0) -> None:
        """Put it down."""
        settings = WorldSettings(start=start, seed=seed, slip=slip)
        self.base = DriveBase(settings, wheel_radius_m=RADIUS_M, wheel_separation_m=SEPARATION_M)
        self.lag_s = settings.motor_lag_s
        self.travelled_m = 0.0
        self._chance = random.Random(seed)
        self._localiser = Localiser()
        self._next_ns = 0
        self._count = 0
        self._seen: list[Seen] = []

    def advance(self, now_ns: int) -> None:
        """Let it drive on as it was told, and its sensors look; the first call is its start."""
        if not self._next_ns:
            self._next_ns = now_ns
        while self._next_ns <= now_ns:
            self._sample(self._next_ns)
            self._next_ns += SAMPLE_NS
        self._move(now_ns)

    def pose(self, now_ns: int, lead_s: float = 0.0) -> Pose:
        """
        Return where it thinks it is.

        :param lead_s: how much later than now, if it goes on as it does.
        """
        self.advance(now_ns)
        while self._seen and self._seen[0].arrival_ns <= now_ns:
            seen = self._seen.pop(0)
            self._localiser.see(seen.stamp_ns, seen.pose)
        return self._localiser.at(now_ns, lead_s)

    @property
    def velocity(self) -> tuple[float, float]:
        """Return how fast it thinks it is, in m/s and rad/s."""
        return self._localiser.velocity

    def command(self, now_ns: int, linear: float, angular: float) -> None:
        """Tell the motors what to do from now on."""
        self.advance(now_ns)
        left, right = wheel_speeds(linear, angular, SEPARATION_M)
        self.base.set_wheel_speeds(left / RADIUS_M, right / RADIUS_M)

    def _move(self, now_ns: int) -> None:
        x, y, _ = self.base.pose
        self.base.advance(now_ns)
        new_x, new_y, _ = self.base.pose
        self.travelled_m += math.hypot(new_x - x, new_y - y)

    def _sample(self, stamp_ns: int) -> None:
        self._move(stamp_ns)
        left, right = self.base.wheel_angles
        self._localiser.roll(stamp_ns, _counted(left), _counted(right))
        if self._count % SAMPLES_A_FIX == 0:
            x, y, heading = self.base.pose
            gauss = self._chance.gauss
            self._seen.append(Seen(stamp_ns, stamp_ns + FIX_DELAY_NS, (
                x + gauss(0.0, FIX_STDDEV_M), y + gauss(0.0, FIX_STDDEV_M),
                heading + gauss(0.0, FIX_STDDEV_RAD))))
        self._count += 1


class Localiser:
    """
    What the robot knows: wheels and marks in the filter of the module ``localization``.

    :ivar velocity: in m/s and rad/s, by the wheels.
    """

    def __init__(self) -> None:
        self.velocity = (0.0, 0.0)
        self._wheels = WheelOdometry(WheelParameters(RADIUS_M, RADIUS_M, SEPARATION_M))
        self._localizer = Localizer()
        self._recent: list[tuple[float, float, float]] = []

    @property
    def located(self) -> bool:
        """Return whether it knows where it is."""
        return self._localizer.located

    def roll(self, stamp_ns: int, left_rad: float, right_rad: float) -> None:
        """Take the angles of the wheels."""
        wheels = self._wheels
        if not wheels.update(stamp_ns, left_rad, right_rad):
            return
        self._localizer.move(OdometryStep(
            stamp_ns, wheels.distance_m, wheels.turn_rad, 0.0, wheels.distance_variance,
            wheels.turn_variance, wheels.step_covariance))
        self._recent = [*self._recent[-4:], (wheels.dt_s, wheels.distance_m, wheels.turn_rad)]
        seconds = sum(each[0] for each in self._recent)
        if seconds:
            # Of some samples: one of them is only a few ticks.
            self.velocity = (sum(each[1] for each in self._recent) / seconds,
                             sum(each[2] for each in self._recent) / seconds)

    def see(self, stamp_ns: int, pose: Pose) -> None:
        """Take a pose from the marks."""
        variance = FIX_STDDEV_M ** 2
        self._localizer.add_fix(PoseFix(stamp_ns, pose, (
            variance, 0.0, 0.0, variance, 0.0, FIX_STDDEV_RAD ** 2)))

    def at(self, now_ns: int, lead_s: float) -> Pose:
        """Return the pose, carried on from the last sample."""
        seconds = (now_ns - self._localizer.stamp_ns) / NS_PER_S + lead_s
        linear, angular = self.velocity
        return moved(self._localizer.state.pose, linear * seconds, angular * seconds)


def _counted(angle_rad: float) -> float:
    """Return the angle that an encoder counts."""
    return math.floor(angle_rad / _TICK_RAD) * _TICK_RAD
