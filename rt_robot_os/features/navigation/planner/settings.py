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

"""The settings of the planner."""

from __future__ import annotations

from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.modules.command_age import COMMAND_AGE

SETTINGS: Final = (
    Field('map', str, '', 'The map: a YAML file as map_saver writes it, next to the file that '
          'names it or in config/; with map_topic: for cells that are unknown there',
          is_file=True),
    Field('map_topic', str, '', 'Maps that grow while they are made, each a '
          'nav_msgs/msg/OccupancyGrid; empty: only the file'),
    Field('correction_topic', str, '', 'Movements of the map by loop closures, each a '
          'geometry_msgs/msg/PoseWithCovarianceStamped: plans move along; empty: none'),
    Field('robot_radius_m', float, 0.2, 'What must stay free round base_link: the distance of '
          'the corner that is furthest away', 'm', 0.0, 10.0),
    Field('clearance_m', float, 0.1, 'What must stay free in addition: more than for a '
          'guard, as a path is not followed to the centimetre', 'm', 0.0, 5.0),
    Field('prefer_m', float, 0.5, 'Distance of the centre of the robot from walls where there is '
          'room', 'm', 0.0, 10.0),
    Field('unknown_is_free', bool, False, 'Drive on unknown ground',
          live=True),
    Field('goal_tolerance_m', float, 0.5, 'How far a goal at which the robot cannot stand is '
          'moved at most; beyond that it is refused', 'm', 0.0, 10.0),
    Field('goal_clearance_m', float, 0.2, 'What stays free round the robot at a goal, if '
          'there is such a place within goal_tolerance_m: a guard stops it before it comes '
          'nearer', 'm', 0.0, 5.0),
    Field('start_tolerance_m', float, 0.5, 'How far from free ground the robot may be at the '
          'start', 'm', 0.0, 10.0),
    Field('pose_timeout_s', float, 1.0, 'Age of a pose that is too old to plan from', 's',
          0.02, 60.0, live=True),
    Field('scan_topics', list, [], 'Laser scanners that show what is not on the map, each a '
          'sensor_msgs/msg/LaserScan'),
    Field('scan_minimum_m', float, 0.0, 'Points of a scanner nearer than this are the robot '
          'itself; 0: its own range_min', 'm', 0.0, 5.0),
    Field('obstacle_range_m', float, 2.5, 'Largest distance of obstacles from a scanner', 'm', 0.1,
          30.0),
    Field('obstacle_memory_s', float, 5.0, 'How long an obstacle is stored', 's', 0.1, 600.0),
    Field('map_tolerance_m', float, 0.2, 'Points this near to walls of the map are part of them',
          'm', 0.0, 2.0),
    Field('blocked_s', float, 3.0, 'Time that an obstacle must stand before a path '
          'round it is planned; walking people are waited for', 's', 0.0, 60.0, live=True),
    Field('retry_s', float, 2.0, 'Period of planning round an obstacle', 's', 0.1, 60.0,
          live=True),
    Field('patience_s', float, 30.0, 'Time after which the goal is given up', 's', 0.0,
          3600.0, live=True),
    Field('cancel_topic', str, '', 'True cancels the goal, also one that waits for a path, a '
          'std_msgs/msg/Bool: the cancel_topic of the trajectory; empty: none'),
    COMMAND_AGE,
)
