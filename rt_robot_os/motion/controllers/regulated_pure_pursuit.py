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
Regulated pure pursuit, to the rules of Nav2: drive on a circle through a point ahead on the path.

Source: S. Macenski, S. Singh, F. Martin, J. Gines, Regulated pure pursuit for robot path tracking,
2023, and the behaviour of nav2_regulated_pure_pursuit_controller. The terms about costs of a map
and collisions are not here: :mod:`rt_robot_os.modules` has a guard for that.
"""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Final

from rt_robot_os.base.schema import setting
from rt_robot_os.motion.controllers.base import Controller
from rt_robot_os.motion.controllers.base import Velocity
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.reference import PathReference
from rt_robot_os.motion.reference_path import Path
from rt_robot_os.motion.reference_path import Point

_CHORD_MINIMUM_M2: Final = 0.001
_SEARCH_SAMPLES: Final = 200


@dataclass(frozen=True)
class RegulatedPurePursuitGains:
    """The settings, with the defaults of Nav2."""

    lookahead_m: float = setting(
        0.6, 'Law regulated_pure_pursuit: how far ahead on the path the robot aims, when that '
        'does not depend on the speed', 'm', 0.02, 10.0, live=True)
    lookahead_time_s: float = setting(
        1.5, 'Law regulated_pure_pursuit: the same by the speed, within the next two; 0: it does '
        'not depend on the speed', 's', 0.0, 10.0, live=True)
    lookahead_min_m: float = setting(
        0.3, 'Law regulated_pure_pursuit: shortest', 'm', 0.02, 10.0, live=True)
    lookahead_max_m: float = setting(
        0.9, 'Law regulated_pure_pursuit: longest', 'm', 0.02, 10.0, live=True)
    radius_min_m: float = setting(
        0.9, 'Law regulated_pure_pursuit: tighter curves are driven slower', 'm', 0.0, 10.0,
        live=True)
    speed_min_m_s: float = setting(
        0.25, 'Law regulated_pure_pursuit: not slower than this for a curve', 'm/s', 0.0, 10.0,
        live=True)
    approach_m: float = setting(
        0.6, 'Law regulated_pure_pursuit: so far before the end the speed begins to shrink', 'm',
        0.0, 10.0, live=True)
    approach_speed_m_s: float = setting(
        0.05, 'Law regulated_pure_pursuit: not slower than this before the end', 'm/s', 0.001,
        10.0, live=True)
    rotate_above_rad: float = setting(
        0.785, 'Law regulated_pure_pursuit: turn in place when the point aimed at is farther '
        'aside', 'rad', 0.01, 3.2, live=True)
    rotate_rad_s: float = setting(
        1.8, 'Law regulated_pure_pursuit: rate of that turn', 'rad/s', 0.01, 50.0, live=True)
    rotate_acceleration_rad_s2: float = setting(
        3.2, 'Law regulated_pure_pursuit: angular acceleration of that turn', 'rad/s^2', 0.01,
        500.0, live=True)


class RegulatedPurePursuit(Controller):
    """Follow the path of a reference, at a speed that curvature and the end regulate."""

    NAME = 'regulated_pure_pursuit'
    Gains = RegulatedPurePursuitGains
    TIMED = False

    def __init__(self, gains: RegulatedPurePursuitGains = RegulatedPurePursuitGains()) -> None:
        super().__init__()
        self.gains = gains
        self._commanded: Velocity = (0.0, 0.0)

    def restart(self) -> None:
        """Reset the last command."""
        super().restart()
        self._commanded = (0.0, 0.0)

    def lookahead(self, linear_m_s: float) -> float:
        """Return how far ahead the robot aims at a speed, in m."""
        gains = self.gains
        if gains.lookahead_time_s <= 0.0:
            return gains.lookahead_m
        return min(gains.lookahead_max_m, max(
            gains.lookahead_min_m, abs(linear_m_s) * gains.lookahead_time_s))

    def step(self, pose: Pose, reference: PathReference, period_s: float,
             velocity: Velocity | None = None) -> Velocity:
        """Return the velocity for the period that begins now."""
        linear, angular = self._commanded if velocity is None else velocity
        left, turned = reference.locate(pose)
        self.error = (0.0, -left, math.remainder(-turned, math.tau))
        x, y = carrot(reference.path, pose, reference.nearest_m, self.lookahead(linear))
        aside = math.atan2(y, x)
        if abs(aside) > self.gains.rotate_above_rad:
            found = (0.0, rotation(aside, angular, self.gains.rotate_rad_s,
                                   self.gains.rotate_acceleration_rad_s2, period_s))
        else:
            bend = curvature_to(x, y)
            speed = self._regulated(bend, reference, pose)
            found = (speed, speed * bend)
        self._commanded = found
        reference.advance(period_s)
        return found

    def _regulated(self, bend: float, reference: PathReference, pose: Pose) -> float:
        """Return the speed for a curvature and what is left of the path."""
        gains, path = self.gains, reference.path
        most = reference.limits.speed_m_s
        speed = max(for_curvature(most, bend, gains.radius_min_m), gains.speed_min_m_s)
        left_m = path.length_m - reference.nearest_m
        if left_m < gains.approach_m:
            to_end = math.hypot(path.x[-1] - pose[0], path.y[-1] - pose[1])
            speed = min(speed, max(speed * to_end / gains.approach_m, gains.approach_speed_m_s))
        return min(speed, most)


def for_curvature(speed_m_s: float, curvature: float, radius_min_m: float) -> float:
    """Return the speed for a curve: that times its radius when it is tighter than a radius."""
    return speed_m_s * min(1.0, 1.0 / (abs(curvature) * radius_min_m)) if (
        curvature and radius_min_m) else speed_m_s


def curvature_to(x_m: float, y_m: float) -> float:
    """Return the curvature in 1/m of the circle from the robot through a point ahead and left."""
    square = x_m * x_m + y_m * y_m
    return 2.0 * y_m / square if square > _CHORD_MINIMUM_M2 else 0.0


def rotation(angle_rad: float, rate_rad_s: float, wanted_rad_s: float, acceleration_rad_s2: float,
             period_s: float) -> float:
    """
    Return the rate of a turn in place: within reach, and never too fast to stop in time.

    :param angle_rad: that is left, to the left positive.
    :param rate_rad_s: of now.
    """
    sign = 1.0 if angle_rad > 0.0 else -1.0
    change = acceleration_rad_s2 * period_s
    rate = min(rate_rad_s + change, max(rate_rad_s - change, sign * wanted_rad_s))
    most = math.sqrt(2 * acceleration_rad_s2 * abs(angle_rad))
    return sign * most if abs(rate) > most else rate


def carrot(path: Path, pose: Pose, nearest_m: float, lookahead_m: float) -> Point:
    """
    Return the first point of the path, ahead and left of the robot, at a distance from it.

    :return: the end of the path when that is nearer.
    """
    x, y, yaw = pose
    cosine, sine = math.cos(yaw), math.sin(yaw)
    xs, ys, last = path.x, path.y, path.last
    square = lookahead_m * lookahead_m
    # No point along the path is farther away than over the one nearest to the robot.
    px, py = path.at(nearest_m)[:2]
    surely_inside = max(0.0, lookahead_m - math.hypot(px - x, py - y))
    i = min(last, math.ceil((nearest_m + surely_inside) / path.spacing_m))
    for _ in range(_SEARCH_SAMPLES):
        dx, dy = xs[i] - x, ys[i] - y
        if i == last or dx * dx + dy * dy >= square:
            break
        i += 1
    ahead, left = cosine * dx + sine * dy, cosine * dy - sine * dx
    if dx * dx + dy * dy > square and i:
        bx, by = xs[i - 1] - x, ys[i - 1] - y
        if bx * bx + by * by <= square:
            return on_circle((cosine * bx + sine * by, cosine * by - sine * bx), (ahead, left),
                             lookahead_m)
    return ahead, left


def on_circle(one: Point, other: Point, radius_m: float) -> Point:
    """Return where a segment cuts a circle about 0, 0; one of its ends is inside."""
    (ax, ay), (bx, by) = sorted((one, other), key=_square)
    dx, dy = bx - ax, by - ay
    square = dx * dx + dy * dy
    if square == 0.0:
        return bx, by
    along = ax * dx + ay * dy
    root = along * along - square * (ax * ax + ay * ay - radius_m * radius_m)
    part = (-along + math.sqrt(max(0.0, root))) / square
    return ax + part * dx, ay + part * dy


def _square(point: Point) -> float:
    return point[0] * point[0] + point[1] * point[1]
