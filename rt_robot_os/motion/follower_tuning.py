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

"""When a follower counts as arrived, off the path or blocked, as settings."""

from __future__ import annotations

from dataclasses import dataclass

from rt_robot_os.base.schema import setting


@dataclass(frozen=True)
class FollowerTuning:
    """When a follower counts as arrived, off the path or blocked."""

    path_shape: str = setting(
        'spline', 'Curve through the poses of a path: a smooth one, or straight lines with a turn '
        'in place at each pose', choices=('spline', 'line'), live=True)
    turn_above_rad: float = setting(
        0.35, 'Turn in place before driving when the path begins farther aside', 'rad', 0.02, 3.2,
        live=True)
    corner_rad: float = setting(
        0.8, 'A sharper bend in a path is a corner: stop and turn in place', 'rad', 0.02, 3.2,
        live=True)
    goal_tolerance_m: float = setting(
        0.03, 'Distance to the goal that is near enough', 'm', 0.001, 10.0, live=True)
    goal_tolerance_rad: float = setting(
        0.02, 'The same of the heading; above 3.2 any heading will do', 'rad', 0.001, 7.0,
        live=True)
    attempts: int = setting(
        2, 'How often a missed goal is tried again before the robot stops', '', 0, 20,
        live=True)
    goal_distance_max_m: float = setting(
        100.0, 'A goal on a straight line that is farther away is refused', 'm', 0.1,
        10000.0, live=True)
    off_path_max_m: float = setting(
        0.5, 'Stop when the robot is farther from its path', 'm', 0.01, 100.0, live=True)
    blocked_after_s: float = setting(
        10.0, 'Stop when the robot has hardly moved for this time', 's', 0.5, 3600.0, live=True)
