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
The tracking law of Kanayama and others: asymptotically stable as long as the reference moves.

Source: Y. Kanayama, Y. Kimura, F. Miyazaki, T. Noguchi, A stable tracking control method for an
autonomous mobile robot, ICRA 1990.
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

# The steepest way back to the path is at 45 degrees: beyond a right angle the law runs in circles.
_STEEPEST: Final = math.sin(math.pi / 4)


@dataclass(frozen=True)
class KanayamaGains:
    """The gains, of continuous time: the period is taken into account by the law."""

    k_x: float = setting(1.2, 'Law kanayama: gain on the distance along the path', '1/s', 0.01,
                         50.0, live=True)
    k_y: float = setting(16.0, 'Law kanayama: gain on the distance across; its root is how fast '
                         'the robot finds back, in 1/m', '1/m^2', 0.01, 1000.0, live=True)
    k_theta: float = setting(6.4, 'Law kanayama: gain on the heading; twice the root of k_y times '
                             'the damping ratio, 0.8 here', '1/m', 0.01, 200.0, live=True)


class Kanayama(Controller):
    """Track a reference in time."""

    NAME = 'kanayama'
    Gains = KanayamaGains

    def __init__(self, gains: KanayamaGains = KanayamaGains()) -> None:
        super().__init__()
        self.gains = gains
        self._held = HeldGains()

    def step(self, pose: Pose, reference: PathReference, period_s: float,
             velocity: Velocity | None = None) -> Velocity:
        """Return the velocity for the period that begins now."""
        target = reference.target(period_s)
        self.error = ahead, left, turned = error_of(pose, target)
        speed, gains = target.linear_m_s, self.gains
        f_y, f_theta = self._held.across(gains.k_y * speed * speed, gains.k_theta * abs(speed),
                                         period_s)
        steepest = _STEEPEST * gains.k_theta / gains.k_y
        left = steepest if left > steepest else -steepest if left < -steepest else left
        reference.advance(period_s, ahead)
        return (speed * math.cos(turned) + held(gains.k_x, period_s) * ahead,
                target.angular_rad_s + speed * (
                    f_y * gains.k_y * left + f_theta * gains.k_theta * math.sin(turned)))
