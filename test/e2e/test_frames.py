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

"""Frames and ways between a robot and ROS: /tf, /tf_static, paths and goals, over real DDS."""

from __future__ import annotations

from array import array
from collections.abc import Callable
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402, I100
from geometry_msgs.msg import PoseStamped  # noqa: E402
from nav_msgs.msg import OccupancyGrid  # noqa: E402
from nav_msgs.msg import Path  # noqa: E402
from rclpy.qos import QoSDurabilityPolicy  # noqa: E402
from rclpy.qos import QoSProfile  # noqa: E402
from rt_robot_os.base.needs import ros_remedy  # noqa: E402
from rt_robot_os.link import LinkClient  # noqa: E402
from rt_robot_os.link.conversions import transform  # noqa: E402

Until = Callable[..., Any]

ROBOT = """
robot:
  ros__parameters:
    core: {cpu: -2, scheduler_priority: 0}
    devices: [laser, camera]
    laser: {type: hokuyo, port: sim, mounting_m: [0.1, 0.0, 0.3], mounting_rad: [0.0, 0.0, 1.5708]}
    camera: {type: camera, port: sim, enabled: false, mounting_m: [0.0, 0.0, 1.0]}
    topics: [way, goal, odom_to_base, map_to_odom, map]
    map: {message: nav_msgs/msg/OccupancyGrid, depth: 2, tail: 1000000,
          fixed: {header.frame_id: map}}
    way: {message: std_msgs/msg/Float64MultiArray, tail: 30}
    goal: {message: geometry_msgs/msg/PoseStamped, fixed: {header.frame_id: map}}
    odom_to_base: {message: geometry_msgs/msg/TransformStamped,
                   fixed: {header.frame_id: odom, child_frame_id: base_link}}
    map_to_odom: {message: geometry_msgs/msg/TransformStamped,
                  fixed: {header.frame_id: map, child_frame_id: odom}}
    mirrors: [way_in, way_out, goal_in, goal_out, odom_tf, map_tf, map_in, map_out]
    map_in: {topic: map, direction: in, durability: transient_local}
    map_out: {topic: map, ros_topic: map_taken, durability: transient_local}
    way_in: {topic: way, direction: in, ros_topic: path, as: nav_msgs/msg/Path}
    way_out: {topic: way, ros_topic: plan, as: nav_msgs/msg/Path}
    goal_in: {topic: goal, direction: in, ros_topic: goal_pose}
    goal_out: {topic: goal, ros_topic: goal_taken}
    odom_tf: {topic: odom_to_base, as: tf2_msgs/msg/TFMessage}
    map_tf: {topic: map_to_odom, as: tf2_msgs/msg/TFMessage}
"""


def path(*xs: float, frame_id: str = 'map') -> Path:
    message = Path()
    message.header.frame_id = frame_id
    for x in xs:
        pose = PoseStamped()
        pose.pose.position.x = x
        message.poses.append(pose)
    return message


def grid(width: int, value: int) -> OccupancyGrid:
    """Make a square map as map_server and slam_toolbox send it."""
    message = OccupancyGrid()
    message.header.frame_id = 'map'
    message.info.resolution = 0.05
    message.info.width = message.info.height = width
    message.info.origin.position.x = -3.0
    message.data = array('b', bytes([value]) * (width * width))
    return message


def row(diagnostics: list[Any], what: str) -> dict[str, str]:
    """Give the last row of /diagnostics with that name: its values, and what it says."""
    for message in reversed(list(diagnostics)):
        for status in message.status:
            if status.name == f'robot: mirror {what}':
                return {'says': status.message, **{v.key: v.value for v in status.values}}
    return {}


def test_paths_and_goals_go_both_ways_and_those_of_other_frames_are_told(
        world: Any, until: Until) -> None:
    latched = QoSProfile(depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
    maps = world.listen(OccupancyGrid, '/map_taken', latched)
    drawn = world.node.create_publisher(OccupancyGrid, '/map', latched)
    drawn.publish(grid(900, 42))  # once, before there is a robot
    plans, goals = world.listen(Path, '/plan'), world.listen(PoseStamped, '/goal_taken')
    diagnostics = world.listen(DiagnosticArray, '/diagnostics')
    ways = world.node.create_publisher(Path, '/path', 10)
    wanted = world.node.create_publisher(PoseStamped, '/goal_pose', 10)
    robot = world.robot(ROBOT)
    robot.wait_for_line('connected to the core')
    until(lambda: ways.publish(path(1.0, 2.0)) or plans, 'a path')
    assert plans[-1].header.frame_id == 'map' and plans[-1].header.stamp.sec > 1_000_000_000
    assert [(p.pose.position.x, p.pose.orientation.w) for p in plans[-1].poses] == [
        (1.0, 1.0), (2.0, 1.0)]
    before = len(plans)
    until(lambda: ways.publish(path(3.0, frame_id='odom')) or row(
        diagnostics, 'path -> way').get('refused', '0') > '0', 'a refused path')
    assert "frame_id 'odom': it must be 'map'" in row(diagnostics, 'path -> way')['says']
    # The console comes another way than /diagnostics.
    robot.wait_for_line("path -> way: refused: frame_id 'odom': it must be 'map'")
    assert all(p.poses[0].pose.position.x == 1.0 for p in plans[before:])
    goal = path(4.0).poses[0]
    goal.header.frame_id = 'base_link'
    until(lambda: wanted.publish(goal) or robot.said('goal_pose -> goal: refused'), 'a refusal')
    goal.header.frame_id = 'map'
    goal.pose.orientation.z = 1.0
    until(lambda: wanted.publish(goal) or goals, 'a goal')
    assert goals[0].pose.position.x == 4.0
    assert goals[0].pose.orientation.z == pytest.approx(0.5 ** 0.5)
    until(lambda: maps, 'the map of before')
    assert (maps[0].info.width, maps[0].info.origin.position.x) == (900, -3.0)
    assert maps[0].data == array('b', bytes([42]) * 810_000)
    drawn.publish(grid(1001, 1))
    until(lambda: robot.said('map -> map: refused: a sample of 1'), 'a refusal')
    drawn.publish(grid(300, 7))
    until(lambda: len(maps) > 1, 'a map that fits')
    assert set(maps[1].data) == {7} and len(maps[1].data) == 90_000
    assert robot.end() == 0


def test_transforms_reach_who_listens_and_mountings_who_comes_late(
        world: Any, until: Until) -> None:
    messages = pytest.importorskip('tf2_msgs.msg', reason='TFMessage is not installed')
    came = world.listen(messages.TFMessage, '/tf')
    robot = world.robot(ROBOT)
    robot.wait_for_line('connected to the core')
    assert not robot.said('tf2_msgs')
    with LinkClient(world.folder / 'robot.sock', 'test') as client:
        channels = {each: client.advertise(each) for each in ('odom_to_base', 'map_to_odom')}

        def both() -> set[tuple[str, str]]:
            for topic, frames in (('odom_to_base', ('odom', 'base_link')),
                                  ('map_to_odom', ('map', 'odom'))):
                client.publish(channels[topic], b'\0\1\0\0' + transform(
                    *frames, (1.0, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0), 0))
            client.pump(0.01)
            return {(each.transforms[0].header.frame_id, each.transforms[0].child_frame_id)
                    for each in list(came)}

        until(lambda: len(both()) == 2, 'both transforms')
    one = came[-1].transforms[0]
    assert (one.transform.translation.y, one.transform.rotation.w) == (2.0, 1.0)
    assert one.header.stamp.sec > 1_000_000_000, 'the time of day'
    late: list[Any] = []
    world.node.create_subscription(messages.TFMessage, '/tf_static', late.append, QoSProfile(
        depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL))
    until(lambda: late, 'the mountings')
    mounted, = late[0].transforms
    assert (mounted.header.frame_id, mounted.child_frame_id) == ('base_link', 'laser_link')
    assert mounted.transform.translation.z == 0.3
    assert mounted.transform.rotation.z == pytest.approx(0.5 ** 0.5, abs=1e-5)
    assert robot.end() == 0


def test_without_tf2_msgs_one_line_says_so_and_the_rest_runs(world: Any, until: Until) -> None:
    diagnostics = world.listen(DiagnosticArray, '/diagnostics')
    robot = world.robot(ROBOT, prelude='import sys; sys.modules["tf2_msgs"] = None')
    robot.wait_for_line('connected to the core')
    robot.wait_for_line('no /tf and /tf_static: the ROS package tf2_msgs is not installed '
                        f'({ros_remedy("tf2_msgs")}); everything else runs')
    assert sum('tf2_msgs' in line for line in robot.lines) == 1
    until(lambda: row(diagnostics, 'mountings -> /tf_static'), 'what /diagnostics says')
    assert 'tf2_msgs' in row(diagnostics, 'odom_to_base -> /tf')['says']
    assert row(diagnostics, 'way -> plan')['says'] == 'carried'
    assert robot.end() == 0
