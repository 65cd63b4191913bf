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
The nonlinear tracking law of Samson, as De Luca, Oriolo and Vendittelli give it.

Its damping does not depend on the reference, so that curves and straight lines are found back to
in the same way.
Source: C. Samson, Time-varying feedback stabilization of car-like wheeled mobile robots, 1993;
A. De Luca, G. Oriolo, M. Vendittelli, Control of wheeled mobile robots: an experimental overview,
2001.
"""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Final

from rt_robot_os.base.schema import setting
from rt_robot_os.motion.controllers.base import Controller
from rt_robot_os.motion.controllers.base import error_of
from rt_robot_os.motion.controllers.base import held
from rt_robot_os.motion.controllers.base import HeldGains
from rt_robot_os.motion.controllers.base import Velocity
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.reference import PathReference

_STEEPEST_RAD: Final = math.pi / 4
# A reference at rest still has to be reached along the path.
_GAIN_MINIMUM_1_S: Final = 0.5


@dataclass(frozen=True)
class SamsonGains:
    """The gains, of continuous time: the period is taken into account by the law."""

    zeta: float = setting(0.8, 'Law samson: damping ratio', '', 0.1, 3.0, live=True)
    b: float = setting(16.0, 'Law samson: its root is how fast the robot finds back, in 1/m',
                       '1/m^2', 0.01, 1000.0, live=True)


class Samson(Controller):
    """Track a reference in time."""

    NAME = 'samson'
    Gains = SamsonGains

    def __init__(self, gains: SamsonGains = SamsonGains()) -> None:
        super().__init__()
        self.gains = gains
        self._held = HeldGains()

    def step(self, pose: Pose, reference: PathReference, period_s: float,
             velocity: Velocity | None = None) -> Velocity:
        """Return the velocity for the period that begins now."""
        target = reference.target(period_s)
        self.error = ahead, left, turned = error_of(pose, target)
        speed, gains = target.linear_m_s, self.gains
        square = gains.b * speed * speed
        k = 2 * gains.zeta * math.sqrt(target.angular_rad_s ** 2 + square)
        f_y, f_theta = self._held.across(square, k, period_s)
        if speed:
            steepest = _STEEPEST_RAD * k / (gains.b * abs(speed))
            left = steepest if left > steepest else -steepest if left < -steepest else left
        sinc = math.sin(turned) / turned if abs(turned) > 1e-6 else 1.0
        reference.advance(period_s, ahead)
        return (speed * math.cos(turned) + held(max(k, _GAIN_MINIMUM_1_S), period_s) * ahead,
                target.angular_rad_s + f_theta * k * turned
                + f_y * gains.b * speed * sinc * left)
