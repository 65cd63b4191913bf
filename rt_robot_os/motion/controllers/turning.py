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

"""Turns in place: as fast as can be stopped in time, with commands that hold for a period."""

from __future__ import annotations

import math

from rt_robot_os.motion.velocity_limits import VelocityLimits


def turning_rate(angle_rad: float, limits: VelocityLimits, period_s: float) -> float:
    """
    Return the rate for the period that begins now; safe in the real-time loop.

    After that period it must be possible to stop within what is left of the angle:
    ``w T + w^2 / (2 a) <= angle``. With a short period that is ``sqrt(2 a angle)``; with a long
    one the last angle is done in one period, without overshoot.

    :param angle_rad: that is left, to the left positive, when the command takes effect.
    """
    braking = limits.angular_acceleration_rad_s2
    fastest = braking * (math.sqrt(period_s * period_s + 2 * abs(angle_rad) / braking) - period_s)
    return math.copysign(min(fastest, limits.angular_max_rad_s), angle_rad)
