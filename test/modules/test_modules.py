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

"""Function modules: what they declare, what they get, when a change takes effect."""

from __future__ import annotations

import math
from typing import Any

import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import TaskError
from rt_robot_os.base.errors import TopicError
from rt_robot_os.features.navigation.twist_guard import TwistGuard
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.modules import Field
from rt_robot_os.modules import Input
from rt_robot_os.modules import Module
from rt_robot_os.modules import Output
from rt_robot_os.modules.registry import module_class
from rt_robot_os.modules.registry import names
from rt_robot_os.testing.fakes import settings_of
from rt_robot_os.topics import Bus

pytest.importorskip('geometry_msgs', reason='ROS 2 messages are not installed')

S = 1_000_000_000
INT = 'std_msgs/msg/Int64'


class Doubler(Module):
    """Write twice what is read."""

    number = Input('number', wake=True)
    twice = Output('twice', INT)
    SETTINGS = (Field('factor', int, 2, 'what to multiply by', '', 1, 100, live=True),
                Field('limit', int, 9, 'not live', '', 0, 100))

    def step(self) -> None:
        while self.number.take():
            self.twice.msg.data = self.number.msg.data * self.settings['factor']
            self.twice.publish(self.number.stamp_ns)


class Robot:
    """A kernel with a bus, and modules on it."""

    def __init__(self) -> None:
        self.clock = VirtualClock()
        self.kernel = Kernel(self.clock)
        self.bus = Bus(self.kernel)

    def add(self, module: Module, priority: int = 10, rate_hz: float | None = 10.0) -> Module:
        module.declare(self.bus, rate_hz or 0.0)
        task = self.kernel.add_task(module.name, module.job, priority=priority, rate_hz=rate_hz)
        module.bind(self.bus, task)
        return module


@pytest.fixture
def robot() -> Robot:
    return Robot()


def test_a_module_reads_its_inputs_and_writes_its_outputs(robot: Robot) -> None:
    robot.bus.declare('number', INT)
    robot.add(Doubler('doubler', {'factor': 2}), rate_hz=None)
    number, twice = robot.bus.publisher('number'), robot.bus.subscribe('twice', 'test')

    def source() -> None:
        number.msg.data += 1
        number.publish(robot.kernel.now_ns())

    robot.kernel.add_task('source', source, priority=5, rate_hz=10.0)
    robot.kernel.run(S // 2)
    got = []
    while twice.take():
        got.append((twice.msg.data, twice.stamp_ns))
    assert got == [(2 * n, (n - 1) * S // 10) for n in range(1, 6)]


def test_a_port_of_another_name_is_a_setting(robot: Robot) -> None:
    robot.bus.declare('left/number', INT)
    settings = {'factor': 2, 'number_topic': 'left/number', 'twice_topic': 'left/twice'}
    module = robot.add(Doubler('doubler', settings))
    assert [p.topic for p in module.publications()] == ['left/twice']
    assert module.subscriptions() == ('left/number',)
    assert [f.name for f in Doubler.fields()] == ['factor', 'limit', 'number_topic', 'twice_topic']


def test_an_input_that_nobody_declares_is_told_with_what_there_is(robot: Robot) -> None:
    with pytest.raises(TopicError, match="no topic 'number'; there are: twice"):
        robot.add(Doubler('doubler', {'factor': 2}))


def test_a_port_cannot_be_used_before_it_is_connected() -> None:
    module = Doubler('doubler', {'factor': 2})
    with pytest.raises(TopicError, match="module 'doubler': the input 'number'"):
        module.number.take()
    with pytest.raises(TopicError, match="module 'doubler': the output 'twice'"):
        module.twice.publish()


def test_a_change_takes_effect_with_the_next_job_and_not_in_the_middle_of_one(
        robot: Robot) -> None:
    seen: list[Any] = []

    class Slow(Module):
        SETTINGS = (Field('gain', float, 1.0, 'gain', '', 0.0, 10.0, live=True),)

        def step(self) -> None:
            before = self.settings['gain']
            robot.clock.spend(S // 20)  # preempted by the one that changes it
            seen.append((before, self.settings['gain']))

        def changed(self, name: str) -> None:
            seen.append((name, self.settings[name]))

    module = robot.add(Slow('slow', {'gain': 1.0}), priority=5)
    robot.kernel.add_task('tuner', lambda: module.change('gain', 3), priority=50, rate_hz=1.0,
                          phase_ns=S // 50)
    robot.kernel.run(S // 4)
    assert seen == [(1.0, 1.0), ('gain', 3.0), (3.0, 3.0), (3.0, 3.0)]


@pytest.mark.parametrize(('name', 'value', 'reason'), [
    ('factor', 0, 'doubler.factor = 0: must be an integer from 1 to 100'),
    ('factor', 'x', "doubler.factor = 'x': must be"),
    ('limit', 1, 'doubler.limit cannot be changed while the robot runs; live settings: factor'),
    ('nothing', 1, 'doubler.nothing cannot be changed')])
def test_a_bad_change_is_refused_with_the_reason(name: str, value: Any, reason: str) -> None:
    module = Doubler('doubler', {'factor': 2})
    with pytest.raises(ConfigError, match=reason):
        module.change(name, value)
    assert module.settings['factor'] == 2


def test_modules_are_found_by_name_and_by_path() -> None:
    assert 'twist_guard' in names()
    assert module_class('twist_guard') is TwistGuard
    assert module_class('rt_robot_os.features.navigation.twist_guard:TwistGuard') is TwistGuard


@pytest.mark.parametrize(('name', 'reason'), [
    ('nothing', 'twist_guard'), ('no_such_package.x:Y', 'no_such_package'),
    ('rt_robot_os.base.units:NS_PER_S', 'not a class derived from Module')])
def test_a_module_that_cannot_be_loaded_is_told_why(name: str, reason: str) -> None:
    with pytest.raises(ConfigError, match=reason):
        module_class(name)


class Guarded:
    """A guard, somebody who steers, and what comes out."""

    def __init__(self, robot: Robot) -> None:
        robot.bus.declare('cmd_vel', 'geometry_msgs/msg/Twist')
        self.guard = robot.add(TwistGuard('guard', settings_of(TwistGuard)), rate_hz=10.0)
        self.command = robot.bus.publisher('cmd_vel')
        self.safe = robot.bus.subscribe('cmd_vel_safe', 'test')
        self.robot = robot

    def steer_at(self, at_s: float, linear: Any, angular: Any) -> None:
        def job() -> None:
            self.command.msg.linear, self.command.msg.angular = linear, angular
            self.command.publish()
        self.robot.kernel.add_task(f'steer at {at_s}', job, priority=50, rate_hz=0.01,
                                   phase_ns=round(at_s * S))

    def outputs(self) -> list[tuple[list[float], list[float]]]:
        self.robot.kernel.run(S + S // 20)
        found = []
        while self.safe.take():
            found.append((list(self.safe.msg.linear), list(self.safe.msg.angular)))
        return found


def test_the_guard_stands_still_until_somebody_steers_and_after_the_timeout(
        robot: Robot) -> None:
    guarded = Guarded(robot)
    guarded.steer_at(0.25, (0.5, 0.0, 0.0), (0.0, 0.0, 0.1))
    outputs = guarded.outputs()
    moving = [n for n, (linear, _) in enumerate(outputs) if linear[0]]
    assert len(outputs) == 11
    # Released every 100 ms; the command came at 250 ms and is too old after 750 ms.
    assert moving == [3, 4, 5, 6, 7]
    assert outputs[3] == ([0.5, 0.0, 0.0], [0.0, 0.0, 0.1])
    assert outputs[8] == ([0.0] * 3, [0.0] * 3)


@pytest.mark.parametrize(('given', 'passed'), [
    ((5.0, -5.0, 0.2), [1.0, -1.0, 0.2]), ((math.inf, -math.inf, 0.0), [1.0, -1.0, 0.0]),
    ((math.nan, 0.1, math.nan), [0.0, 0.1, 0.0])])
def test_the_guard_limits_and_lets_no_nan_through(
        robot: Robot, given: Any, passed: list[float]) -> None:
    guarded = Guarded(robot)
    guarded.steer_at(0.0, given, (9.0, 0.0, math.nan))
    assert guarded.outputs()[1] == (passed, [2.0, 0.0, 0.0])


def test_a_module_changes_its_own_rate(robot: Robot) -> None:
    class Hasty(Module):
        def step(self) -> None:
            self.change('rate_hz', 100.0)

    module = robot.add(Hasty('hasty', {}))
    with pytest.raises(TaskError, match="task 'hasty': rate_hz 0"):
        module.change('rate_hz', 0)
    robot.kernel.run(S)
    assert module.task is not None
    assert module.task.rate_hz == 100.0
    assert module.task.runs > 50
