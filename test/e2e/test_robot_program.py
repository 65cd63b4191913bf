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

"""The program `robot` as its user meets it: it starts, it answers, it ends and leaves nothing."""

from __future__ import annotations

from collections.abc import Callable
import os
import shutil
import signal
from typing import Any

from processes import TIMEOUT_S
import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402, I100
from geometry_msgs.msg import Twist  # noqa: E402
from geometry_msgs.msg import TwistStamped  # noqa: E402
from geometry_msgs.msg import Vector3  # noqa: E402
from lifecycle_msgs.msg import Transition  # noqa: E402
from lifecycle_msgs.srv import ChangeState  # noqa: E402
from rcl_interfaces.msg import Parameter  # noqa: E402
from rcl_interfaces.msg import ParameterType  # noqa: E402
from rcl_interfaces.msg import ParameterValue  # noqa: E402
from rcl_interfaces.srv import DescribeParameters  # noqa: E402
from rcl_interfaces.srv import GetParameters  # noqa: E402
from rcl_interfaces.srv import SetParameters  # noqa: E402
from rclpy.qos import QoSProfile  # noqa: E402
from rclpy.qos import QoSReliabilityPolicy  # noqa: E402
from rt_robot_os.link import LinkClient  # noqa: E402
from sensor_msgs.msg import Imu  # noqa: E402
from sensor_msgs.msg import NavSatFix  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

Until = Callable[..., Any]

GUARD = """
robot:
  ros__parameters:
    core: {cpu: -2, scheduler_priority: 0}
    modules: [guard]
    guard: {type: twist_guard, rate_hz: 50.0, priority: 40, timeout_s: 60.0}
    topics: [cmd_vel]
    cmd_vel: {message: geometry_msgs/msg/Twist, depth: 8, rate_hz: 20.0}
    mirrors: [cmd_vel_in, safe_out]
    cmd_vel_in: {topic: cmd_vel, direction: in}
    safe_out: {topic: cmd_vel_safe, direction: out}
"""


def set_parameter(world: Any, name: str, **value: Any) -> Any:
    kinds = {'double_value': ParameterType.PARAMETER_DOUBLE,
             'integer_value': ParameterType.PARAMETER_INTEGER,
             'string_value': ParameterType.PARAMETER_STRING}
    kind, = (kinds[key] for key in value)
    request = SetParameters.Request(parameters=[
        Parameter(name=name, value=ParameterValue(type=kind, **value))])
    return world.call(SetParameters, '/robot/set_parameters', request).results[0]


def values_of(diagnostics: list[Any], name: str) -> dict[str, str]:
    for message in reversed(list(diagnostics)):
        for status in message.status:
            if status.name == name:
                return {'message': status.message, 'level': str(status.level[0]),
                        **{v.key: v.value for v in status.values}}
    return {}


def test_the_default_robot_publishes_imu_and_gps_with_fresh_stamps(
        world: Any, until: Until) -> None:
    imu, fix = world.listen(Imu, '/imu/data'), world.listen(NavSatFix, '/gps/fix')
    robot = world.robot()
    until(lambda: len(imu) > 50 and len(fix) > 1, 'samples of both devices')
    now = world.node.get_clock().now().nanoseconds
    stamps = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in list(imu)]
    assert all(a < b for a, b in zip(stamps, stamps[1:]))
    assert 0 < now - stamps[0] < 60 * 10**9
    assert imu[0].header.frame_id == 'imu_link'
    assert robot.end() == 0
    assert world.leftovers() == []


@pytest.mark.parametrize('signo', [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_nothing_is_left_behind(world: Any, until: Until, signo: int) -> None:
    robot = world.robot()
    robot.wait_for_line('connected to the core')
    robot.end(signo)
    # A lock that was held by a process that was killed is free; its file stays for the next.
    kept = ['robot.lock'] if signo == signal.SIGKILL else []
    until(lambda: [each for each in world.leftovers() if each not in kept] == [],
          f'everything gone ({world.leftovers()})')


def test_commands_go_in_and_come_out_guarded(world: Any, until: Until) -> None:
    safe = world.listen(Twist, '/cmd_vel_safe')
    commands = world.node.create_publisher(Twist, '/cmd_vel', 10)
    world.robot(GUARD)

    def steer() -> bool:
        command = Twist()
        command.linear.x, command.angular.z = 7.0, 0.25
        commands.publish(command)
        return any(m.linear.x == 1.0 and m.angular.z == 0.25 for m in list(safe))

    until(steer, 'a limited command')


STAMPED = GUARD.replace('timeout_s: 60.0', 'timeout_s: 5.0').replace(
    'direction: in', 'direction: in, stamped: true').replace(
    'direction: out', 'direction: out, stamped: true, frame_id: base_link')


def test_stamped_commands_go_in_and_come_out_and_their_age_counts(
        world: Any, until: Until) -> None:
    safe = world.listen(TwistStamped, '/cmd_vel_safe')
    diagnostics = world.listen(DiagnosticArray, '/diagnostics')
    commands = world.node.create_publisher(TwistStamped, '/cmd_vel', 10)
    world.robot(STAMPED)
    command = TwistStamped()
    command.header.frame_id = 'a frame of any length'

    def steer(speed_m_s: float, age_s: float) -> bool:
        now_ns = world.node.get_clock().now().nanoseconds - round(age_s * 1e9)
        command.header.stamp.sec, command.header.stamp.nanosec = divmod(now_ns, 10 ** 9)
        command.twist.linear.x = speed_m_s
        commands.publish(command)
        return any(m.twist.linear.x == speed_m_s for m in list(safe)[-5:])

    until(lambda: steer(0.5, 0.0), 'a fresh command')
    assert safe[-1].header.frame_id == 'base_link'
    now_s = world.node.get_clock().now().nanoseconds / 1e9
    assert abs(safe[-1].header.stamp.sec - now_s) < 60
    until(lambda: steer(0.25, 3600.0) or 'clocks synchronised' in values_of(
        diagnostics, 'robot: module guard').get('message', ''), 'a warning')
    assert not steer(0.25, 3600.0)
    until(lambda: steer(0.75, -3600.0), 'a command of a sender whose clock is ahead')


def test_an_inward_mirror_hears_publishers_of_either_reliability(
        world: Any, until: Until) -> None:
    safe = world.listen(Twist, '/cmd_vel_safe')
    best_effort = world.node.create_publisher(Twist, '/cmd_vel', QoSProfile(
        depth=1, reliability=QoSReliabilityPolicy.BEST_EFFORT))
    world.robot(GUARD)

    def steer() -> bool:
        best_effort.publish(Twist(linear=Vector3(x=0.5)))
        return any(m.linear.x == 0.5 for m in list(safe))

    until(steer, 'a command that was sent best effort')


def test_a_rate_changes_while_it_runs_and_a_bad_one_is_refused_with_the_reason(
        world: Any, until: Until) -> None:
    diagnostics = world.listen(DiagnosticArray, '/diagnostics')
    world.robot(GUARD)
    refused = set_parameter(world, 'guard.rate_hz', double_value=0.0)
    assert not refused.successful
    assert 'guard.rate_hz' in refused.reason and '0.1' in refused.reason
    assert not set_parameter(world, 'guard.priority', integer_value=1).successful
    assert set_parameter(world, 'guard.rate_hz', integer_value=20).successful
    until(lambda: values_of(diagnostics, 'robot: task guard').get('rate_hz') == '20',
          'the new rate in /diagnostics')
    assert set_parameter(world, 'guard.linear_max_m_s', double_value=3.0).successful
    answer = world.call(GetParameters, '/robot/get_parameters', GetParameters.Request(
        names=['guard.rate_hz', 'guard.linear_max_m_s']))
    assert [v.double_value for v in answer.values] == [20.0, 3.0]


def test_parameters_are_described_with_unit_and_range(world: Any) -> None:
    world.robot(GUARD)
    answer = world.call(DescribeParameters, '/robot/describe_parameters',
                        DescribeParameters.Request(names=['guard.rate_hz', 'guard.priority']))
    rate, priority = answer.descriptors
    assert 'Hz' in rate.description and rate.floating_point_range[0].from_value == 0.1
    assert priority.read_only and priority.integer_range[0].to_value == 99


def test_what_was_changed_from_ros_and_in_the_core_is_saved_for_the_next_start(
        world: Any, until: Until) -> None:
    saved = world.folder / 'saved.yaml'
    arguments = ('-p', f'parameters_file:={saved}')
    names = ['guard.rate_hz', 'guard.timeout_s', 'safe_out.policy']

    def values() -> list[Any]:
        answer = world.call(GetParameters, '/robot/get_parameters', GetParameters.Request(
            names=names))
        return [*(v.double_value for v in answer.values[:2]), answer.values[2].string_value]

    robot = world.robot(GUARD, *arguments)
    assert set_parameter(world, 'guard.rate_hz', double_value=20.0).successful
    assert set_parameter(world, 'safe_out.policy', string_value='latest').successful
    with LinkClient(world.folder / 'robot.sock', 'test', timeout_s=TIMEOUT_S) as client:
        client.change('guard.timeout_s', 0.25)
        until(lambda: values() == [20.0, 0.25, 'latest'], "the core's change in the node")
        client.change('guard.rate_hz', 25.0)
        answer = world.call(Trigger, '/robot/save_parameters', Trigger.Request())
    assert answer.success, answer.message
    assert answer.message == (f'{saved}: guard.rate_hz = 25.0, guard.timeout_s = 0.25, '
                              "safe_out.policy = 'latest'")
    assert robot.end() == 0
    world.robot(GUARD, '--params-file', str(saved), '-p', f'parameters_file:={world.folder}')
    assert values() == [25.0, 0.25, 'latest']
    assert set_parameter(world, 'guard.rate_hz', double_value=30.0).successful
    answer = world.call(Trigger, '/robot/save_parameters', Trigger.Request())
    assert not answer.success
    assert answer.message.startswith(
        f'{world.folder} cannot be written: it is not a regular file: give')


def test_a_core_that_dies_is_started_again_with_what_was_changed(
        world: Any, until: Until) -> None:
    diagnostics = world.listen(DiagnosticArray, '/diagnostics')
    robot = world.robot(GUARD)
    assert set_parameter(world, 'guard.rate_hz', double_value=20.0).successful
    core = until(lambda: values_of(diagnostics, 'robot: core').get('pid'), 'diagnostics')
    os.kill(int(core), signal.SIGKILL)
    robot.wait_for_line('again in')
    until(lambda: values_of(diagnostics, 'robot: core').get('pid') not in (None, core),
          'a new core')
    until(lambda: values_of(diagnostics, 'robot: task guard').get('rate_hz') == '20',
          'the changed rate in the new core')


def test_a_core_that_hangs_is_killed_and_started_again(world: Any, until: Until) -> None:
    diagnostics = world.listen(DiagnosticArray, '/diagnostics')
    robot = world.robot(GUARD.replace('core: {', 'core: {heartbeat_s: 0.3, '))
    core = until(lambda: values_of(diagnostics, 'robot: core').get('pid'), 'diagnostics')
    os.kill(int(core), signal.SIGSTOP)
    robot.wait_for_line('again in')
    until(lambda: values_of(diagnostics, 'robot: core').get('pid') not in (None, core),
          'a new core')


def test_deactivate_stops_mirroring_and_activate_resumes_it(world: Any, until: Until) -> None:
    safe = world.listen(Twist, '/cmd_vel_safe')
    diagnostics = world.listen(DiagnosticArray, '/diagnostics')
    world.robot(GUARD)
    until(lambda: safe, 'a first message')

    def published() -> int:
        counts = [int(value.value) for message in list(diagnostics)[-1:]
                  for status in message.status if ': mirror ' in status.name
                  for value in status.values if value.key == 'published']
        return sum(counts)

    until(published, 'the counter of what is published')

    def change(transition: int) -> None:
        request = ChangeState.Request(transition=Transition(id=transition))
        assert world.call(ChangeState, '/robot/change_state', request).success

    change(Transition.TRANSITION_DEACTIVATE)
    seen = len(diagnostics)
    until(lambda: len(diagnostics) > seen + 1, 'two rounds of diagnostics')
    # What the node published, not what has arrived here: that may lag on a busy machine.
    silent = published()
    runs = int(values_of(diagnostics, 'robot: task guard')['runs'])
    until(lambda: int(values_of(diagnostics, 'robot: task guard')['runs']) > runs + 20,
          'the core running on')
    assert published() == silent
    change(Transition.TRANSITION_ACTIVATE)
    until(lambda: published() > silent, 'messages again')


def test_a_bad_configuration_ends_with_code_2_and_all_problems(world: Any) -> None:
    robot = world.robot(GUARD.replace('rate_hz: 50.0, priority: 40', 'rate_hz: .nan, priority: 0'))
    assert robot.process.wait(60) == 2
    robot.end()
    assert 'guard.rate_hz' in robot.output and 'guard.priority' in robot.output
    assert 'test.yaml:6' in robot.output
    assert world.leftovers() == []


def test_an_ordinary_user_is_told_what_is_lacking_and_the_robot_runs(
        world: Any, until: Until) -> None:
    setpriv = shutil.which('setpriv')
    if os.getuid() != 0 or setpriv is None:
        pytest.skip('needs root and setpriv to become an ordinary user')
    diagnostics = world.listen(DiagnosticArray, '/diagnostics')
    safe = world.listen(Twist, '/cmd_vel_safe')
    # Root without any capability: the files stay readable, the privileges are gone.
    world.robot(GUARD.replace('core: {cpu: -2, scheduler_priority: 0}', 'core: {cpu: -1}'),
                prefix=(setpriv, '--bounding-set=-all', '--inh-caps=-all', '--ambient-caps=-all'))
    until(lambda: len(safe) > 10, 'messages without privileges')
    until(lambda: 'wakeups' in values_of(diagnostics, 'robot: core'), 'diagnostics of a core')
    core = values_of(diagnostics, 'robot: core')
    assert 'SCHED_FIFO' in core['message'] and core['level'] == '1'
    assert 'limits.conf' in core['SCHED_FIFO priority 80']
