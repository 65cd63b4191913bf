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

"""What is driven: the paper's run of 130 cm, and an eight."""

from __future__ import annotations

from collections.abc import Iterator
import math
from typing import Final

from benchmarks.trajectory.loop import Drive
from benchmarks.trajectory.robot import SEPARATION_M
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.follower_tuning import FollowerTuning
from rt_robot_os.motion.velocity_limits import VelocityLimits

# Paper 2, section 5.4: from (344, 100) to (344, 230) cm, from 120 to 90 degrees, every 300 ms.
PAPER_START: Final = (3.44, 1.00, math.radians(120))
PAPER_GOAL: Final = (3.44, 2.30, math.radians(90))
PAPER_PERIOD_NS: Final = 300 * NS_PER_MS
PAPER_M: Final = 1.30

EIGHT_PERIOD_NS: Final = 20 * NS_PER_MS
EIGHT_RADIUS_M: Final = 2.0
_EIGHT_POSES: Final = 400
# It begins askew and should be on its line soon: stiffer than the defaults, which are for long
# ways, and well damped.
_STIFF: Final = {'k_y': 36.0, 'k_theta': 9.6}


def paper_drive() -> Drive:
    """Return the paper's run: it turns by 30 degrees while it drives, in 21 periods."""
    return Drive(
        PAPER_START, (PAPER_GOAL,), PAPER_PERIOD_NS,
        VelocityLimits(speed_m_s=0.23, linear_max_m_s=0.30, acceleration_m_s2=0.6,
                       deceleration_m_s2=0.6, angular_acceleration_rad_s2=2.0,
                       wheel_separation_m=SEPARATION_M),
        FollowerTuning(turn_above_rad=0.7, goal_tolerance_m=0.012, attempts=0), gains=_STIFF)


def eight_drive(speed_m_s: float, law: str = 'kanayama') -> Drive:
    """Return an eight of 4 m by 2 m at 50 Hz."""
    poses = tuple(eight())
    return Drive(
        poses[0], poses, EIGHT_PERIOD_NS,
        VelocityLimits(speed_m_s=speed_m_s, linear_max_m_s=1.25 * speed_m_s,
                       angular_max_rad_s=2.0, acceleration_m_s2=0.6, deceleration_m_s2=0.6,
                       angular_acceleration_rad_s2=4.0, lateral_max_m_s2=0.5,
                       wheel_separation_m=SEPARATION_M),
        FollowerTuning(attempts=0), law=law)


def eight() -> Iterator[Pose]:
    """Yield the lemniscate of Gerono, with headings along it."""
    for i in range(_EIGHT_POSES + 1):
        angle = math.tau * i / _EIGHT_POSES
        yield (EIGHT_RADIUS_M * math.sin(angle),
               EIGHT_RADIUS_M * math.sin(angle) * math.cos(angle),
               math.atan2(math.cos(2 * angle), math.cos(angle)))
