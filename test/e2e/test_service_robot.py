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

"""The service robot as it is shipped, on ptys: it drives to goals, and stops for people."""

from __future__ import annotations

from collections.abc import Callable
import math
from pathlib import Path
from typing import Any

from processes import TIMEOUT_S
import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')
pytest.importorskip('mcap', reason='recordings need mcap')

from geometry_msgs.msg import PoseStamped  # noqa: E402, I100
from geometry_msgs.msg import PoseWithCovarianceStamped  # noqa: E402
from geometry_msgs.msg import Twist  # noqa: E402
from nav_msgs.msg import Odometry  # noqa: E402
from recorded_graph import play_to_rviz  # noqa: E402
from recorded_graph import Recorded  # noqa: E402
from rt_robot_os.features.mapping.graph_markers import EdgeKind  # noqa: E402
from rt_robot_os.features.mapping.graph_markers import graph_numbers  # noqa: E402
from rt_robot_os.link import LinkClient  # noqa: E402
from rt_robot_os.topics import Layout  # noqa: E402
from std_msgs.msg import Bool  # noqa: E402
from std_msgs.msg import String  # noqa: E402

pytestmark = pytest.mark.one_build

Until = Callable[..., Any]

CONFIG = Path(__file__).resolve().parents[2] / 'config' / 'service_robot.yaml'
# On any CPU, without asking for real time: other tests run beside it.
HERE = """
/**:
  ros__parameters:
    core: {{cpu: -2, scheduler_priority: 0}}
    camera: {{enabled: false}}
    world: {{start: [{x}, {y}, 1.5], people: [anna 0 {person[0]} {person[1]}]}}
"""
DOOR = 2.45, 4.47
FAR_AWAY = 9.0, 3.5
PERSON_M = 0.22
# What RViz asks for, and what the core has in another type, or in several.
COMPARED = ('/tf', '/tf_static', '/scan', '/plan', '/map', '/slam/path', '/slam/graph', '/odom',
            '/wsn/nodes', '/rosout')
ROBOT_M = 0.18


class Drive:
    """The robot, and what it says of itself."""

    def __init__(self, world: Any, until: Until, start: tuple[float, float],
                 person: tuple[float, float] = FAR_AWAY) -> None:
        self.until = until
        self.poses = world.listen(PoseWithCovarianceStamped, '/pose')
        self.odometry = world.listen(Odometry, '/odom')
        self.states = world.listen(String, '/trajectory/state')
        self.reasons = world.listen(String, '/stop_reason')
        self.goals = world.node.create_publisher(PoseStamped, '/goal_pose', 10)
        self.stops = world.node.create_publisher(Bool, '/estop', 10)
        self.releases = world.node.create_publisher(Bool, '/estop_release', 10)
        path = world.folder / 'here.yaml'
        path.write_text(HERE.format(x=start[0], y=start[1], person=person))
        self.program = world.robot(None, '--params-file', str(CONFIG), '--params-file', str(path))
        until(lambda: self.poses and self.odometry, 'a pose and a speed')
        for publisher in (self.goals, self.stops, self.releases):
            until(publisher.get_subscription_count, publisher.topic_name)

        self._speed_m_s = 0.0
        self._twists = world.node.create_publisher(Twist, '/cmd_vel', 1)
        world.node.create_timer(0.05, self._command)

    def _command(self) -> None:
        if self._speed_m_s:
            twist = Twist()
            twist.linear.x = self._speed_m_s
            self._twists.publish(twist)

    def steer(self, speed_m_s: float) -> None:
        """Command a speed twenty times a second from now on, as Nav2 or a joystick does."""
        self._speed_m_s = speed_m_s

    @property
    def place(self) -> tuple[float, float]:
        point = self.poses[-1].pose.pose.position
        return point.x, point.y

    @property
    def state(self) -> str:
        return str(self.states[-1].data) if self.states else ''

    @property
    def is_moving(self) -> bool:
        twist = self.odometry[-1].twist.twist
        return abs(twist.linear.x) > 0.005 or abs(twist.angular.z) > 0.01

    def stopped_for(self) -> list[str]:
        return [each.data for each in list(self.reasons) if each.data]

    def aim(self, x: float, y: float, heading: float) -> None:
        goal = PoseStamped()
        goal.header.frame_id = 'map'
        goal.pose.position.x, goal.pose.position.y = x, y
        goal.pose.orientation.z = math.sin(heading / 2)
        goal.pose.orientation.w = math.cos(heading / 2)
        self.goals.publish(goal)

    def go(self, x: float, y: float, heading: float) -> None:
        before = len(self.states)
        self.aim(x, y, heading)
        self.until(lambda: any(each.data in ('turning', 'driving')
                               for each in list(self.states)[before:]), 'a start')

    def distance_to(self, x: float, y: float) -> float:
        return math.dist(self.place, (x, y))


def map_something(world: Any) -> None:
    """Publish in the core what `mapping` does once it has a map."""
    with LinkClient(world.folder / 'robot.sock', 'mapping', timeout_s=TIMEOUT_S) as core:
        for name, value in (
                ('map', {'info': {'resolution': 0.05, 'width': 3, 'height': 2}, 'data': [0] * 6}),
                ('slam/path', {'data': [1.0, 2.0, 0.0]}),
                ('slam/graph', {'data': graph_numbers(
                    [(0.0, 0.0), (1.0, 0.0)], [(0, 1, EdgeKind.NEIGHBOUR)])})):
            info = core.topics[name]
            layout = Layout.compile(
                info.type_name, {'header.frame_id': 'map'} if name == 'map' else None, tail=1000)
            core.publish(core.advertise(name), layout.from_dict(value))


def test_it_drives_to_a_goal_and_an_e_stop_holds_it_until_it_is_released(
        world: Any, until: Until) -> None:
    drive = Drive(world, until, (3.44, 1.0))
    map_something(world)
    recorded = Recorded(world, until, CONFIG, *COMPARED)
    drive.aim(3.44, 2.3, math.pi / 2)
    until(lambda: recorded.live['/plan'], 'a plan')
    recorded.wait_for('/wsn/nodes')
    recorded.end()
    recorded.check(*COMPARED)
    drive.go(3.44, 2.3, math.pi / 2)
    until(lambda: drive.distance_to(3.44, 1.0) > 0.2, 'some way')
    drive.stops.publish(Bool(data=True))
    until(lambda: not drive.is_moving, 'a standstill')
    held = drive.place
    drive.stops.publish(Bool(data=False))
    seen = len(drive.odometry)
    until(lambda: len(drive.odometry) > seen + 50, 'a second of odometry')
    assert drive.distance_to(*held) < 0.05, 'false alone released it'
    drive.releases.publish(Bool(data=True))
    seen = len(drive.odometry)
    until(lambda: len(drive.odometry) > seen + 50, 'a second of odometry')
    assert drive.distance_to(*held) < 0.05, 'the release alone moved it'
    assert drive.state == 'stopped: e-stop'
    drive.go(3.44, 2.3, math.pi / 2)
    until(lambda: drive.state == 'done', 'the goal')
    until(lambda: drive.distance_to(3.44, 2.3) < 0.06 and not drive.is_moving, 'a robot there')
    assert drive.program.end() == 0
    got = play_to_rviz(world, until, recorded)
    for name, messages in got.items():
        assert messages == [raw for _, raw, _, _ in recorded.messages(name)], name


def test_whoever_steers_it_it_stops_for_a_person_and_may_be_driven_away(
        world: Any, until: Until) -> None:
    drive = Drive(world, until, (2.45, 3.0), person=DOOR)
    drive.steer(0.3)
    until(drive.stopped_for, 'a stop')
    until(lambda: not drive.is_moving, 'a standstill')
    held = drive.place
    assert 'obstacle' in drive.stopped_for()[0]
    assert held[1] > 3.2, 'far from any person'
    assert drive.distance_to(*DOOR) > PERSON_M + ROBOT_M
    drive.steer(-0.2)
    until(lambda: drive.distance_to(*held) > 0.3, 'the way back')
    assert drive.place[1] < held[1]
