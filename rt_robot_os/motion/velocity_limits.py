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
Limits of speeds and accelerations of a robot with two wheels.

A command beyond a limit is not clipped axis by axis, which would change the curvature: both
velocities shrink together, so that the curvature stays. All is safe in the real-time loop.
"""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Final

from rt_robot_os.base.schema import setting


# In m/s and rad/s.
_NOTHING: Final = 1e-9


@dataclass(frozen=True)
class VelocityLimits:
    """The limits of a robot; infinity where there is none."""

    speed_m_s: float = setting(
        0.3, 'Speed at which paths are driven where nothing else limits it', 'm/s', 0.001, 20.0,
        live=True)
    linear_max_m_s: float = setting(
        0.4, 'Largest speed of a command: the part above speed_m_s is for catching up', 'm/s',
        0.001, 20.0, live=True)
    angular_max_rad_s: float = setting(
        1.0, 'Largest turning rate', 'rad/s', 0.001, 50.0, live=True)
    acceleration_m_s2: float = setting(
        0.3, 'Largest acceleration ahead', 'm/s^2', 0.001, 50.0, live=True)
    deceleration_m_s2: float = setting(
        0.3, 'Largest deceleration, also of a stop', 'm/s^2', 0.001, 50.0, live=True)
    angular_acceleration_rad_s2: float = setting(
        1.5, 'Largest change of the turning rate', 'rad/s^2', 0.001, 500.0, live=True)
    lateral_max_m_s2: float = setting(
        0.5, 'Largest acceleration across, in curves', 'm/s^2', 0.001, 50.0, live=True)
    jerk_max_m_s3: float = setting(
        0.0, 'Largest change of the acceleration of a reference: an S-curve instead of a '
        'trapezoid; 0: no limit', 'm/s^3', 0.0, 1000.0, live=True)
    wheel_max_m_s: float = setting(
        0.0, 'Largest speed of the rim of a wheel; 0: no limit', 'm/s', 0.0, 50.0, live=True)
    wheel_separation_m: float = setting(
        0.3, 'Distance of the wheels from each other', 'm', 0.01, 10.0)

    @property
    def wheel_m_s(self) -> float:
        """Return the largest speed of a wheel, infinite without limit."""
        return self.wheel_max_m_s or math.inf


def within_speeds(linear: float, angular: float, limits: VelocityLimits) -> tuple[float, float]:
    """
    Scale a velocity until robot and wheels are within their speeds; the curvature stays.

    NaN is treated as a standstill.
    """
    if not (math.isfinite(linear) and math.isfinite(angular)):
        return 0.0, 0.0
    over = max(abs(linear) / limits.linear_max_m_s, abs(angular) / limits.angular_max_rad_s,
               (abs(linear) + abs(angular) * limits.wheel_separation_m / 2) / limits.wheel_m_s)
    if over > 1.0:
        return linear / over, angular / over
    return linear, angular


def within_reach(linear: float, angular: float, now: tuple[float, float], limits: VelocityLimits,
                 period_s: float) -> tuple[float, float]:
    """
    Return the velocity nearest to a wanted one that can be reached in a period.

    It lies on the line of the wanted curvature where that line passes the reachable window, as in
    dynamic window pure pursuit, else as near to that line as possible. A standstill is approached
    on the curve that is being driven.

    :param now: the present linear and angular velocity.
    """
    # Immeasurably small is 0: ratios to it would be infinite.
    linear = linear if abs(linear) > _NOTHING else 0.0
    angular = angular if abs(angular) > _NOTHING else 0.0
    v0, w0 = now
    turn = limits.angular_acceleration_rad_s2 * period_s
    faster, slower = (limits.acceleration_m_s2 * period_s, limits.deceleration_m_s2 * period_s)
    v_low, v_high = _window(v0, faster, slower)
    w_low, w_high = w0 - turn, w0 + turn
    if v_low <= linear <= v_high and w_low <= angular <= w_high:
        return linear, angular
    if linear == 0.0 and angular == 0.0:
        part = min(slower / abs(v0) if v0 else 1.0, turn / abs(w0) if w0 else 1.0)
        return (v0 * (1.0 - part), w0 * (1.0 - part)) if part < 1.0 else (0.0, 0.0)
    low, high = 0.0, math.inf
    for wanted, least, most in ((linear, v_low, v_high), (angular, w_low, w_high)):
        if wanted > 0.0:
            low, high = max(low, least / wanted), min(high, most / wanted)
        elif wanted < 0.0:
            low, high = max(low, most / wanted), min(high, least / wanted)
        elif not least <= 0.0 <= most:
            high = -1.0
    part = min(high, max(low, 1.0))
    # Above 1 the robot cannot slow down that fast; it does not speed up to turn less sharply.
    if low <= high and abs(linear * part) <= max(abs(linear), abs(v0)):
        return linear * part, angular * part
    # As fast as wanted, or slower; never backwards to get nearer to the line behind the robot.
    return _beside(linear, angular, [min(v_high, max(v_low, each)) for each in (linear, 0.0)],
                   [min(w_high, max(w_low, each)) for each in (angular, 0.0)])


def _window(v0: float, faster: float, slower: float) -> tuple[float, float]:
    """Return the reachable speeds: acceleration and deceleration have different limits."""
    if v0 > 0.0:
        # The rest of the period after the standstill is for the other direction.
        return (v0 - slower if v0 >= slower else (v0 / slower - 1.0) * faster), v0 + faster
    if v0 < 0.0:
        return v0 - faster, (v0 + slower if -v0 >= slower else (1.0 + v0 / slower) * faster)
    return -faster, faster


def _beside(linear: float, angular: float, v: list[float], w: list[float]
            ) -> tuple[float, float]:
    """Return the reachable velocity nearest to the line of a curvature."""
    norm = math.hypot(linear, angular)
    across = [(abs(a * angular - b * linear) / norm, math.hypot(a - linear, b - angular), a, b)
              for a in v for b in w]
    return min(across)[2:]
