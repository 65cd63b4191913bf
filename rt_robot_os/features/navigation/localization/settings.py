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

"""The settings of the module localization."""

from __future__ import annotations

from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.motion.mounting import BASE_FRAME

SETTINGS: Final = (
    Field('second_fix_topic', str, '', 'A further source of measured poses, such as a SLAM node: '
          'geometry_msgs/msg/PoseWithCovarianceStamped on the map; empty: none'),
    Field('third_fix_topic', str, '', 'One more; empty: none'),
    Field('fix_correlation_s', float, 0.0,
          'Correlation time of the errors of fix_topic: within it '
          'many poses have no more information than one, as of a SLAM with errors of its map',
          's', 0.0, 600.0),
    Field('second_fix_correlation_s', float, 0.0, 'The same of second_fix_topic', 's', 0.0,
          600.0),
    Field('third_fix_correlation_s', float, 0.0, 'The same of third_fix_topic', 's', 0.0, 600.0),
    Field('correction_topic', str, '', 'Movements of the map, such as by a SLAM that closed '
          'a loop: geometry_msgs/msg/PoseWithCovarianceStamped; the estimate moves with it. Not '
          'if something else fixes the map in place; empty: none'),
    Field('correction_max_m', float, 10.0, 'A correction that moves the robot by more is refused',
          'm', 0.001, 1e6),
    Field('initial_pose_topic', str, '', 'Initial poses of an operator, such as '
          'initialpose of RViz; empty: none'),
    Field('map_frame_id', str, 'map', 'Frame of the estimate, and of the measured poses'),
    Field('odom_frame_id', str, 'odom', 'Frame of the odometry'),
    Field('base_frame_id', str, BASE_FRAME, 'Frame of the robot'),
    Field('initial_pose_known', bool, False,
          'Start at the initial pose. Else the first consistent '
          'measured poses set the pose, and nothing is published before'),
    Field('initial_x_m', float, 0.0, 'The initial pose on the map', 'm', -1e6, 1e6),
    Field('initial_y_m', float, 0.0, 'The same', 'm', -1e6, 1e6),
    Field('initial_heading_rad', float, 0.0, 'The same', 'rad', -6.3, 6.3),
    Field('initial_stddev_m', float, 0.1, 'Standard deviation of its x and y', 'm', 0.0, 1000.0),
    Field('initial_stddev_rad', float, 0.1, 'The same of its heading', 'rad', 0.0, 10.0),
    Field('use_gyro', bool, False, 'Use the turn of the angular velocity of imu_topic instead '
          'of that of odometry; its bias is estimated'),
    Field('use_imu_heading', bool, False, 'Use the heading of the orientation of imu_topic as '
          'one on the map, such as that of a magnetometer, and its pitch for slopes'),
    Field('imu_heading_offset_rad', float, 0.0, 'What is added to that heading: the direction of '
          'the zero of the sensor on the map', 'rad', -6.3, 6.3),
    Field('imu_heading_stddev_rad', float, 0.1, 'Least standard deviation of one such heading. '
          'Their errors last: do not take the noise of the sensor', 'rad', 0.001, 10.0),
    Field('fix_stddev_min_m', float, 0.005,
          'Smallest standard deviation of a measured pose, also if its '
          'covariance is zero', 'm', 1e-6, 100.0),
    Field('fix_stddev_min_rad', float, 0.005, 'The same of its heading', 'rad', 1e-6, 10.0),
    Field('second_fix_stddev_min_m', float, 0.0, 'More than that for second_fix_topic', 'm', 0.0,
          100.0),
    Field('third_fix_stddev_min_m', float, 0.0, 'More than that for third_fix_topic', 'm', 0.0,
          100.0),
    Field('speed_max_m_s', float, 3.0, 'Fastest speed of the robot; odometry that is faster has '
          'jumped', 'm/s', 0.01, 100.0),
    Field('scale_stddev', float, 0.01, 'Relative error of travelled distance', '', 0.0,
          1.0),
    Field('wheel_mismatch_stddev_rad_m', float, 0.05, 'How much unequal wheels may turn the robot '
          'on each metre at the start; it is then estimated. Not with use_gyro', 'rad/m', 0.0,
          1.0),
    Field('wheel_mismatch_walk_rad_m', float, 0.001, 'By how much that changes on a metre; it '
          'grows with the root of the distance', 'rad/m', 0.0, 1.0),
    Field('gyro_bias_stddev_rad_s', float, 0.05, 'The bias of the gyroscope at the start', 'rad/s',
          0.0, 1.0),
    Field('gyro_bias_walk_rad_s', float, 0.0001, 'By how much that changes in a second; it grows '
          'with the root of the time', 'rad/s', 0.0, 1.0),
    Field('gyro_noise_rad', float, 0.001, 'Standard deviation of the turn of the gyroscope after '
          '1 s; it grows with the root of the time', 'rad', 0.0, 1.0),
    Field('gyro_scale_rad', float, 0.005, 'The same after a turn of 1 rad', 'rad', 0.0, 1.0),
    Field('kidnapped_s', float, 2.0,
          'Time after which measured poses that agree with each other and '
          'contradict the estimate replace it; 0: never', 's', 0.0, 600.0),
    Field('kidnapped_fixes', int, 4, 'Minimum number of such poses', '', 2, 1000),
    Field('start_fixes', int, 3, 'Number of consistent poses that set the first estimate', '', 1,
          1000),
    Field('fix_silent_warn_s', float, 0.0, 'Warn after this time without a measured pose; '
          '0: never, as where marks are far apart', 's', 0.0, 3600.0, live=True),
    Field('disagreement_warn_m', float, 0.15, 'Warn when two sources differ by more in the '
          'mean: their maps are not the same', 'm', 0.001, 1e6, live=True),
    Field('stddev_warn_m', float, 0.5,
          'Warn when the standard deviation of the position is larger', 'm', 0.001, 1e6,
          live=True),
)
