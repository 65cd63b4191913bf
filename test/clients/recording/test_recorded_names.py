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

"""The names that topics have in a recording."""

from __future__ import annotations

from rt_robot_os.clients.recording.session import ros_names
from rt_robot_os.settings import MirrorSettings
from rt_robot_os.settings import RobotSettings
from rt_robot_os.settings import to_json


def test_a_topic_of_another_type_in_ros_is_recorded_under_its_own_name() -> None:
    transform = MirrorSettings(name='tf', topic='odom_to_base', as_='tf2_msgs/msg/TFMessage',
                               message='geometry_msgs/msg/TransformStamped')
    odom = MirrorSettings(name='odom', topic='odom', ros_topic='/base/odom',
                          message='nav_msgs/msg/Odometry')
    found = ros_names(to_json(RobotSettings(mirrors=(transform, odom))), 'robot')
    assert {topic: [name for name, _ in rows] for topic, rows in found.items()} == {
        'odom': ['/base/odom']}, 'a /tf with single transforms would be no /tf'
