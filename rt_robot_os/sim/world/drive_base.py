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
The body of the robot: two driven wheels with motors, and its collisions.

Source: the equations of the differential drive; each wheel follows its motor with a lag of first
order and a limit of its acceleration.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import auto
from enum import Enum
import math
import random
from typing import Final
from typing import TypeAlias

from rt_robot_os.motion.angles import wrapped
from rt_robot_os.motion.differential import body_velocity
from rt_robot_os.motion.differential import moved
from rt_robot_os.motion.differential import Pose
from rt_robot_os.sim.world_settings import WorldSettings

# Step of the whole simulation.
STEP_NS: Final = 2_000_000
STEP_S: Final = STEP_NS / 1e9
# After a longer suspension of the whole process it continues at the current time.
LONGEST_STEPS: Final = 300_000

Pair: TypeAlias = tuple[float, float]
# Finds the points of obstacles within a distance of a position.
Obstacles: TypeAlias = Callable[[float, float, float], list[Pair]]

_SLIP_STEPS: Final = 50
# Time constant: an accelerometer on a real body does not resolve a single step of 2 ms.
_SMOOTH: Final = 0.1
# After less travel since the last contact it is the same contact.
_APART_M: Final = 1e-3
_WHEEL_RADIUS_M: Final = 0.05
_SEPARATION_M: Final = 0.3


class Motor(Enum):
    """What a motor is told."""

    SPEED = auto()
    DUTY = auto()
    COAST = auto()


def nothing_near(x: float, y: float, reach_m: float) -> list[Pair]:
    """Return no obstacle: the floor is empty."""
    return []


class DriveBase:
    """
    A robot on two wheels.

    A simulated motor board commands it and reads its wheels. The angles and speeds of wheels are
    in rad and rad/s, left before right, positive ahead.

    :ivar wheel_radius_m: as configured; the true wheels differ by ``wheel_radius_error``.
    :ivar wheel_separation_m: between the wheels.
    :ivar radius_m: of the robot.
    :ivar wheel_angles: true angles; they never wrap.
    :ivar wheel_speeds: true speeds.
    :ivar velocity: of ``base_link``: ahead in m/s, turning in rad/s.
    :ivar acceleration: of ``base_link``: ahead and to the left, in m/s^2.
    :ivar angular_acceleration: in rad/s^2.
    :ivar contact_rad: direction from the robot of the obstacle that it pushes against; None if it
        does not push. :meth:`touched` returns obstacles next to it.
    :ivar contacts: number of collisions from the start.
    :ivar impact_m_s: the largest speed of a collision from the start.
    :ivar slip: share of the wheels' travel that is lost.
    """

    def __init__(
        self, settings: WorldSettings | None = None, *, wheel_radius_m: float = _WHEEL_RADIUS_M,
        wheel_separation_m: float = _SEPARATION_M, obstacles: Obstacles = nothing_near,
    ) -> None:
        """
        Put the robot at its start.

        :param settings: those of the world; without them the floor is open and the wheels are
            exact.
        :param obstacles: finds obstacles nearby.
        """
        self._settings = s = settings or WorldSettings()
        self._obstacles = obstacles
        self._chance = random.Random(s.seed)
        self.radius_m = s.robot_radius_m
        self.fit(wheel_radius_m, wheel_separation_m)
        self.slip = s.slip
        self.wheel_angles: Pair = (0.0, 0.0)
        self.wheel_speeds: Pair = (0.0, 0.0)
        self._mode = Motor.COAST
        self._target: Pair = (0.0, 0.0)
        self._lag = 1.0 - math.exp(-STEP_S / s.motor_lag_s)
        self._coast = 1.0 - math.exp(-STEP_S / s.coast_s)
        self._most = s.motor_acceleration_rad_s2 * STEP_S
        self._extra_slip: Pair = (0.0, 0.0)
        self._steps = 0
        self._start_ns: int | None = None
        self.contacts = 0
        self.impact_m_s = 0.0
        self._apart = True
        self._pushed_at: Pair = (math.inf, math.inf)
        self.teleport(*s.start)

    def fit(self, wheel_radius_m: float, wheel_separation_m: float) -> None:
        """Fit other wheels; the simulated board does it with the settings of its device."""
        left, right = self._settings.wheel_radius_error
        self.wheel_radius_m, self.wheel_separation_m = wheel_radius_m, wheel_separation_m
        self._true_radius = (wheel_radius_m * (1.0 + left), wheel_radius_m * (1.0 + right))

    # ---- commands of the motors ----------------------------------------------------------------

    def set_wheel_speeds(self, left_rad_s: float, right_rad_s: float) -> None:
        """Control the wheels to speeds, as far as the motors can; NaN counts as 0."""
        most = self._settings.motor_speed_rad_s
        self._mode = Motor.SPEED
        self._target = (_within(left_rad_s, most), _within(right_rad_s, most))

    def set_duty(self, left: float, right: float) -> None:
        """Apply a share of the full voltage to the motors, from -1 to 1; NaN counts as 0."""
        most = self._settings.motor_speed_rad_s
        self._mode = Motor.DUTY
        self._target = (_within(left, 1.0) * most, _within(right, 1.0) * most)

    def coast(self) -> None:
        """Switch off the voltage: the robot coasts."""
        self._mode = Motor.COAST
        self._target = (0.0, 0.0)

    # ---- position ------------------------------------------------------------------------------

    @property
    def pose(self) -> Pose:
        """Return x, y and yaw (from -pi to pi) of ``base_link`` in the map."""
        return self._x, self._y, wrapped(self._yaw)

    def teleport(self, x: float, y: float, yaw: float) -> None:
        """Lift it and put it down elsewhere; its wheels do not turn."""
        self._x, self._y, self._yaw = x, y, yaw
        self.velocity: Pair = (0.0, 0.0)
        self.acceleration: Pair = (0.0, 0.0)
        self.angular_acceleration = 0.0
        self.contact_rad: float | None = None

    def touched(self, margin_m: float) -> list[float]:
        """
        Return the directions, from the robot, of obstacles that touch it.

        :param margin_m: from its outline.
        """
        reach_m = self.radius_m + margin_m
        return [wrapped(math.atan2(py - self._y, px - self._x) - self._yaw)
                for px, py in self._obstacles(self._x, self._y, reach_m)
                if math.hypot(px - self._x, py - self._y) < reach_m]

    def advance(self, now_ns: int) -> None:
        """
        Advance to a time, for a robot without a world; the first call sets the start.

        :param now_ns: absolute.
        """
        if self._start_ns is None:
            self._start_ns = now_ns
        due = (now_ns - self._start_ns) // STEP_NS
        if due - self._steps > LONGEST_STEPS:
            self._start_ns += (due - self._steps) * STEP_NS
            return
        while self._steps < due:
            self.step()

    def step(self) -> None:
        """Advance by ``STEP_NS``."""
        if self._steps % _SLIP_STEPS == 0 and self._settings.slip_noise:
            noise, gauss = self._settings.slip_noise, self._chance.gauss
            self._extra_slip = (gauss(0.0, noise), gauss(0.0, noise))
        self._steps += 1
        before_left, before_right = self.wheel_speeds
        left, right = self._driven(before_left, 0), self._driven(before_right, 1)
        if not (left or right or before_left or before_right):
            # It stands: the usual case, and a cheap one.
            self._settle((0.0, 0.0))
            self.contact_rad = None
            return
        self.wheel_speeds = (left, right)
        turn_left, turn_right = (before_left + left) / 2, (before_right + right) / 2
        self.wheel_angles = (self.wheel_angles[0] + turn_left * STEP_S,
                             self.wheel_angles[1] + turn_right * STEP_S)
        kept = 1.0 - self.slip
        self._move(*body_velocity(
            turn_left * self._true_radius[0] * (kept - self._extra_slip[0]),
            turn_right * self._true_radius[1] * (kept - self._extra_slip[1]),
            self.wheel_separation_m))

    def _driven(self, speed: float, side: int) -> float:
        """Return the speed of a wheel after a step."""
        if self._mode is Motor.COAST:
            speed -= self._coast * speed
            return speed if abs(speed) > 1e-3 else 0.0
        target = self._target[side]
        change = self._lag * (target - speed)
        change = max(-self._most, min(self._most, change))
        return speed + change if abs(target - speed) > 1e-6 else target

    def _move(self, linear: float, angular: float) -> None:
        x, y, yaw = moved((self._x, self._y, self._yaw), linear * STEP_S, angular * STEP_S)
        dx, dy = self._allowed(x - self._x, y - self._y)
        self._x += dx
        self._y += dy
        self._yaw = yaw
        if self.contact_rad is not None:
            # The wheels slip as far as a wall blocks them.
            linear = (dx * math.cos(yaw) + dy * math.sin(yaw)) / STEP_S
        self._settle((linear, angular))

    def _settle(self, velocity: Pair) -> None:
        ahead, aside = self.acceleration
        linear, angular = velocity
        self.acceleration = (
            ahead + _SMOOTH * ((linear - self.velocity[0]) / STEP_S - ahead),
            aside + _SMOOTH * (linear * angular - aside))
        turning = (angular - self.velocity[1]) / STEP_S
        self.angular_acceleration += _SMOOTH * (turning - self.angular_acceleration)
        self.velocity = velocity

    def _allowed(self, dx: float, dy: float) -> Pair:
        """Remove the motion into a wall; the motion along it remains."""
        self.contact_rad = None
        if not (dx or dy):
            return 0.0, 0.0
        points = self._obstacles(self._x, self._y, self.radius_m)
        for _ in range(2):  # in a corner each wall is applied after the other
            for px, py in points:
                nx, ny = self._x - px, self._y - py
                before = math.hypot(nx, ny)
                if not 0.0 < before < self.radius_m + abs(dx) + abs(dy):
                    continue
                into = -(dx * nx + dy * ny) / before
                if into > 0.0 and math.hypot(nx + dx, ny + dy) < self.radius_m:
                    self.impact_m_s = max(self.impact_m_s, into / STEP_S)
                    dx += into * nx / before
                    dy += into * ny / before
                    self.contact_rad = wrapped(math.atan2(-ny, -nx) - self._yaw)
        pushed_x, pushed_y = self._pushed_at
        self._apart |= math.hypot(self._x - pushed_x, self._y - pushed_y) > _APART_M
        if self.contact_rad is not None:
            self.contacts += self._apart
            self._apart, self._pushed_at = False, (self._x, self._y)
        return dx, dy


def _within(value: float, most: float) -> float:
    return max(-most, min(most, value)) if value == value else 0.0
