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
The settings of mapping, in the parameter file of the robot.

::

    /**/mapping:
      ros__parameters:
        map_file: ~/maps/flat
        mode: mapping
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from typing import Final

from rt_robot_os.base.schema import made
from rt_robot_os.base.schema import setting
from rt_robot_os.features.mapping.slam.tuning import MapperTuning
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.settings.problems import Problems
from rt_robot_os.settings.program_settings import read_values
from rt_robot_os.settings.sections import Section

MAPPING: Final = 'mapping'
LOCALIZATION: Final = 'localization'
#: The initial pose on the map.
POSE: Final = 'pose'
ORIGIN: Final = 'origin'
GLOBAL: Final = 'global'


@dataclass(frozen=True)
class MappingSettings:
    """All of it."""

    scan_topic: str = setting('scan', 'Where scans come from: sensor_msgs/msg/LaserScan')
    odom_topic: str = setting('odom', 'Where odometry comes from: nav_msgs/msg/Odometry')
    pose_topic: str = setting('pose', 'The pose of localization on the map')
    fix_topic: str = setting('stargazer/pose', 'Absolute poses: the map is made in their frame. '
                             'Empty, or no topic of the robot: there are none')
    initial_pose_topic: str = setting('initialpose', 'Initial poses given by an operator, such as '
                                      'from RViz; empty: there are none')
    map_file: str = setting('', 'The map that `save` writes and that localization reads, without '
                            'a suffix; default: map in the folder', is_file=True)
    folder: str = setting('', 'Folder of the state that survives restarts; default: '
                          'mapping-ROBOT in $ROS_HOME or ~/.ros')
    mode: str = setting(MAPPING, 'mapping: the map grows; localization: it stays unmodified',
                        choices=(MAPPING, LOCALIZATION))
    start: str = setting(POSE, 'Initial pose: pose, that of localization; origin, 0, 0, 0 of the '
                         'map; global, found by a search of the whole map',
                         choices=(POSE, ORIGIN, GLOBAL))
    resume: bool = setting(True, 'Continue with the map of the last run')
    cell_m: float = setting(0.05, 'Edge of a cell of the map', 'm', 0.01, 1.0)
    map_period_s: float = setting(1.0, 'Minimum time between two maps, which are published '
                                  'only after a change', 's', 0.1, 3600.0)
    state_period_s: float = setting(10.0, 'Time between two saved states', 's',
                                    1.0, 3600.0)
    range_max_m: float = setting(20.0, 'Longer ranges are ignored', 'm', 0.5,
                                 250.0)
    keyframe_m: float = setting(0.3, 'Distance after which a scan becomes a keyframe', 'm',
                                0.02, 10.0)
    keyframe_rad: float = setting(0.2, 'Turn after which it does, too', 'rad', 0.02, 3.2)
    odometry_per_m: float = setting(0.15, 'Error of odometry: standard deviation after 1 m; '
                                    'more for wheels that slip', 'm', 0.001, 1.0)
    odometry_per_rad: float = setting(0.25, 'The same after a turn of 1 rad', 'rad', 0.001, 2.0)
    deskew: bool = setting(True, 'Correct each beam for the motion of the laser during the scan; '
                           'off for drivers whose time_increment is wrong')
    mounting_m: tuple[float, ...] = setting((), 'Position of the laser in base_link, if the '
                                            'robot does not know it: x, y, z', 'm')
    mounting_rad: tuple[float, ...] = setting((), 'Its orientation: roll, pitch, yaw; '
                                              '[3.1416, 0.0, 0.0] is upside down', 'rad')
    goal_topic: str = setting('goal_pose', 'Topic of goals while it explores; empty: it cannot '
                              'explore')
    cancel_topic: str = setting('trajectory_cancel', 'Topic that stops the robot when exploring '
                                'is stopped: std_msgs/msg/Bool; empty: none')
    planner_state_topic: str = setting('planner/state', 'State of the planner')
    explore_radius_m: float = setting(0.35, 'Free radius round the robot at goals: '
                                      'robot_radius_m plus clearance_m of the planner',
                                      'm', 0.01, 5.0)
    explore_least_m: float = setting(0.4, 'Smallest frontier that it drives to', 'm', 0.05,
                                     10.0)
    explore_patience_s: float = setting(30.0, 'Time without progress until a goal is given up',
                                        's', 1.0, 600.0)
    explore_goes_back: bool = setting(True, 'At the end it drives back to the start')
    find_turns: bool = setting(False, 'It may turn the robot on the spot by itself while it '
                               'searches for its pose and several places match. While it '
                               'explores it may in any case')
    find_turn_rad_s: float = setting(0.4, 'Rate of that turn', 'rad/s', 0.05, 2.0)
    find_topic: str = setting('cmd_vel', 'Topic of the commands of that turn: '
                              'geometry_msgs/msg/Twist, to velocity_mux; empty: it never '
                              'turns')
    nice: int = setting(5, 'Niceness of the process', '', 0, 19)
    avoid_cpus: tuple[int, ...] = setting((), 'CPUs that are left to the core')

    def tuning(self) -> MapperTuning:
        """Return the tuning of the mapper."""
        return MapperTuning(range_max_m=self.range_max_m, keyframe_m=self.keyframe_m,
                            keyframe_rad=self.keyframe_rad, odometry_per_m=self.odometry_per_m,
                            odometry_per_rad=self.odometry_per_rad)

    def mounting(self) -> Mounting | None:
        """Return the mounting of the laser if it is set here."""
        if not self.mounting_m and not self.mounting_rad:
            return None
        x, y, z = self.mounting_m or (0.0, 0.0, 0.0)
        roll, pitch, yaw = self.mounting_rad or (0.0, 0.0, 0.0)
        return Mounting((x, y, z), (roll, pitch, yaw))


def load(paths: Sequence[Path], overrides: Mapping[str, Any], node: str = 'mapping',
         namespace: str = '/') -> MappingSettings:
    """
    Read the parameter files; opens nothing else.

    :param overrides: by dotted name; they win over the files.
    :raises ConfigError: with one line for each problem.
    """
    settings: MappingSettings = made(MappingSettings, read_values(
        MappingSettings, paths, overrides, node, namespace, _check))
    return settings


def _check(section: Section, problems: Problems) -> None:
    for key in ('mounting_m', 'mounting_rad'):
        given = section.values.get(key, ())
        if len(given) not in (0, 3):
            section.reject(key, 'three numbers, or none', problems)
    for key in ('scan_topic', 'odom_topic'):
        if section.values.get(key) == '':
            section.reject(key, 'mapping needs it', problems)
