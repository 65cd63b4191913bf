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

"""How fast a remote driver may drive: a bound that page, server and robot all apply."""

from __future__ import annotations

import math


def bounded(linear_m_s: float, angular_rad_s: float, most_linear_m_s: float,
            most_angular_rad_s: float) -> tuple[float, float]:
    """
    Shorten a command until it lies within an ellipse; its curve stays the same.

    Not a rectangle: so the wheels turn little faster on a curve than straight ahead, and the robot
    stands after the same time.

    :param most_linear_m_s: fastest ahead or back, in m/s; 0: it must stand.
    :param most_angular_rad_s: fastest turn, in rad/s; 0: it does not turn.
    :return: ahead in m/s, turning in rad/s.
    """
    if not most_linear_m_s > 0.0:
        return 0.0, 0.0
    if not most_angular_rad_s > 0.0:
        return max(-most_linear_m_s, min(most_linear_m_s, linear_m_s)), 0.0
    far = math.hypot(linear_m_s / most_linear_m_s, angular_rad_s / most_angular_rad_s)
    return (linear_m_s, angular_rad_s) if far <= 1.0 else (linear_m_s / far, angular_rad_s / far)
