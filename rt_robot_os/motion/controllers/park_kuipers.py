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
The graceful motion of Park and Kuipers: to a pose on a smooth curve, in polar coordinates.

Source: J. J. Park, B. Kuipers, A smooth control law for graceful motion of differential wheeled
mobile robots in 2D environment, ICRA 2011; the behaviour of nav2_graceful_controller.
"""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Final

from rt_robot_os.base.schema import setting
from rt_robot_os.motion.angles import wrapped
from rt_robot_os.motion.controllers.base import Controller
from rt_robot_os.motion.controllers.base import Velocity
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.reference import PathReference

_NEAR_M: Final = 1e-3


@dataclass(frozen=True)
class ParkKuipersGains:
    """The gains, with the names of Nav2 where it has one."""

    k_phi: float = setting(1.0, 'Law park_kuipers: how early the robot turns into the line of the '
                           'target', '', 0.0, 50.0, live=True)
    k_delta: float = setting(3.0, 'Law park_kuipers: how hard it turns towards that', '', 0.0,
                             100.0, live=True)
    beta: float = setting(0.4, 'Law park_kuipers: how much curvature slows down', '', 0.0, 10.0,
                          live=True)
    exponent: float = setting(2.0, 'Law park_kuipers: exponent of that', '', 1.0, 10.0, live=True)
    lookahead_m: float = setting(0.5, 'Law park_kuipers: how far ahead on the path the target is',
                                 'm', 0.02, 10.0, live=True)
    slowdown_m: float = setting(0.25, 'Law park_kuipers: so near to the end the speed shrinks in '
                                'proportion', 'm', 0.01, 10.0, live=True)
    speed_min_m_s: float = setting(0.02, 'Law park_kuipers: not slower than this', 'm/s', 0.0,
                                   10.0, live=True)


class ParkKuipers(Controller):
    """Follow the path of a reference from target to target, at a speed that curvature gives."""

    NAME = 'park_kuipers'
    Gains = ParkKuipersGains
    TIMED = False

    def __init__(self, gains: ParkKuipersGains = ParkKuipersGains()) -> None:
        super().__init__()
        self.gains = gains

    def step(self, pose: Pose, reference: PathReference, period_s: float,
             velocity: Velocity | None = None) -> Velocity:
        """Return the velocity for the period that begins now."""
        left, turned = reference.locate(pose)
        self.error = (0.0, -left, wrapped(-turned))
        path, limits = reference.path, reference.limits
        target_m = reference.nearest_m + self.gains.lookahead_m
        x, y, heading, _ = path.at(target_m)
        # Beyond the end the path goes straight on: near its target the law turns with every error.
        beyond_m = max(0.0, target_m - path.length_m)
        x, y = x + beyond_m * math.cos(heading), y + beyond_m * math.sin(heading)
        reference.advance(period_s)
        return self.to_pose(
            pose, (x, y, heading),
            min(limits.speed_m_s, limits.angular_max_rad_s
                / max(1e-9, abs(path.at(reference.nearest_m)[3]))),
            limits.angular_max_rad_s, limits.deceleration_m_s2,
            path.length_m - reference.nearest_m)

    def to_pose(self, pose: Pose, target: Pose, linear_max_m_s: float, angular_max_rad_s: float,
                deceleration_m_s2: float, left_m: float | None = None) -> Velocity:
        """
        Return the velocity towards a pose.

        :param left_m: of the way; None: as far as the target is.
        """
        gains = self.gains
        r, phi, delta = polar(pose, target)
        if r < _NEAR_M:
            return 0.0, 0.0
        bend = curvature(r, phi, delta, gains.k_phi, gains.k_delta)
        left_m = r if left_m is None else max(left_m, 0.0)
        speed = min(linear_max_m_s / (1.0 + gains.beta * abs(bend) ** gains.exponent),
                    linear_max_m_s * left_m / gains.slowdown_m,
                    math.sqrt(2 * left_m * deceleration_m_s2))
        speed = min(linear_max_m_s, max(gains.speed_min_m_s, speed))
        angular = min(angular_max_rad_s, max(-angular_max_rad_s, bend * speed))
        return (angular / bend if bend else speed), angular


def polar(pose: Pose, target: Pose) -> tuple[float, float, float]:
    """
    Return a target as a robot sees it: distance, and two angles from the line of sight.

    :return: r in m, phi of the target's heading and delta of the robot's in rad.
    """
    dx, dy = target[0] - pose[0], target[1] - pose[1]
    sight = math.atan2(-dy, dx)
    return math.hypot(dx, dy), wrapped(target[2] + sight), wrapped(pose[2] + sight)


def curvature(r: float, phi: float, delta: float, k_phi: float, k_delta: float) -> float:
    """Return the curvature in 1/m of the way to a target."""
    scaled = k_phi * phi
    return -(k_delta * (delta + math.atan(scaled))
             + (1.0 + k_phi / (1.0 + scaled * scaled)) * math.sin(delta)) / r
