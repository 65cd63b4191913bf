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

"""What can be set of the planner."""

from __future__ import annotations

from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.modules.command_age import COMMAND_AGE

SETTINGS: Final = (
    Field('map', str, '', 'The map: a YAML file as map_saver writes it, beside the file that '
          'names it or in config/; with map_topic: for what nobody has seen there yet',
          is_file=True),
    Field('map_topic', str, '', 'Maps that grow while they are made, each a '
          'nav_msgs/msg/OccupancyGrid; empty: the file is all there is'),
    Field('correction_topic', str, '', 'By how much the map moved when a loop was closed, each a '
          'geometry_msgs/msg/PoseWithCovarianceStamped: plans move along; empty: nobody says so'),
    Field('robot_radius_m', float, 0.2, 'What must stay free round base_link: the distance of '
          'the corner that is furthest away', 'm', 0.0, 10.0),
    Field('clearance_m', float, 0.1, 'What must stay free besides: more than a guard asks '
          'for, as nobody follows a way to the centimetre', 'm', 0.0, 5.0),
    Field('prefer_m', float, 0.5, 'Where there is room, the middle of the robot keeps so far '
          'from walls', 'm', 0.0, 10.0),
    Field('unknown_is_free', bool, False, 'Drive where the map does not know what is there',
          live=True),
    Field('goal_tolerance_m', float, 0.5, 'A goal at which the robot cannot stand is moved so '
          'far at most; beyond it is refused', 'm', 0.0, 10.0),
    Field('goal_clearance_m', float, 0.2, 'What stays free round the robot at a goal, if '
          'there is such a place within goal_tolerance_m: a guard stops it before it comes '
          'nearer', 'm', 0.0, 5.0),
    Field('start_tolerance_m', float, 0.5, 'How far from free ground the robot may be when it '
          'sets out', 'm', 0.0, 10.0),
    Field('pose_timeout_s', float, 1.0, 'Age of a pose from which nothing is planned', 's',
          0.02, 60.0, live=True),
    Field('scan_topics', list, [], 'Laser scanners that show what is not on the map, each a '
          'sensor_msgs/msg/LaserScan'),
    Field('scan_minimum_m', float, 0.0, 'What a scanner sees nearer than this is the robot '
          'itself; 0: its own range_min', 'm', 0.0, 5.0),
    Field('obstacle_range_m', float, 2.5, 'How far from the robot that is believed', 'm', 0.1,
          30.0),
    Field('obstacle_memory_s', float, 5.0, 'How long it is remembered', 's', 0.1, 600.0),
    Field('map_tolerance_m', float, 0.2, 'What is seen so near to what the map has, is that',
          'm', 0.0, 2.0),
    Field('blocked_s', float, 3.0, 'How long something has to stand in its place before a way '
          'round it is looked for; who walks is waited for', 's', 0.0, 60.0, live=True),
    Field('retry_s', float, 2.0, 'How often a way round is looked for', 's', 0.1, 60.0,
          live=True),
    Field('patience_s', float, 30.0, 'How long, before the goal is given up', 's', 0.0,
          3600.0, live=True),
    Field('cancel_topic', str, '', 'True takes the goal back, also one that waits for a way, a '
          'std_msgs/msg/Bool: the cancel_topic of the trajectory; empty: there is none'),
    COMMAND_AGE,
)
