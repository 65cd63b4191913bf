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


"""Modules whose settings are changed without end, that fail, and commands with odd stamps."""

from __future__ import annotations

from typing import Any

import pytest

from rt_robot_os.features.navigation.twist_guard import TwistGuard
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.modules import Field
from rt_robot_os.modules import Input
from rt_robot_os.modules import Module
from rt_robot_os.modules import Output
from rt_robot_os.testing.fakes import settings_of
from rt_robot_os.topics import Bus
from rt_robot_os.topics import Publisher
from rt_robot_os.topics import Subscription

pytest.importorskip('geometry_msgs', reason='ROS 2 messages are not installed')

MS = 1_000_000
S = 1_000_000_000


class Tuned(Module):
    """Note every change and every job."""

    SETTINGS = (Field('gain', float, 1.0, 'gain', '', 0.0, 1e6, live=True),
                Field('offset', float, 0.0, 'offset', '', -1e6, 1e6, live=True))

    def __init__(self, name: str, settings: dict[str, Any]) -> None:
        super().__init__(name, settings)
        self.log: list[Any] = []

    def changed(self, name: str) -> None:
        self.log.append((name, self.settings[name]))
        if self.settings[name] == 13.0:
            raise ValueError('an unlucky number')

    def step(self) -> None:
        self.log.append('step')


class Base(Module):
    """Have a port that a subclass inherits."""

    value = Output('value', 'std_msgs/msg/Int64')


class Derived(Base):
    """Add a port, and replace none."""

    other = Input('value')

    def step(self) -> None:
        self.value.publish()


@pytest.fixture
def kernel() -> Kernel:
    return Kernel(VirtualClock(start_ns=S))


def test_changes_before_a_job_are_bounded_and_the_last_one_counts() -> None:
    module = Tuned('tuned', {'gain': 1.0, 'offset': 0.0})
    for value in range(10_000):
        module.change('gain', value)
        module.change('offset', -value)
    assert module.settings == {'gain': 1.0, 'offset': 0.0}
    module.job()
    module.job()
    assert module.log == [('gain', 9999.0), ('offset', -9999.0), 'step', 'step']


def test_a_change_that_a_module_cannot_bear_is_its_own_failure(kernel: Kernel) -> None:
    module = Tuned('tuned', {'gain': 1.0, 'offset': 0.0})
    task = kernel.add_task('tuned', module.job, priority=10, rate_hz=10.0)

    def tune() -> None:
        module.change('gain', 13)
        module.change('offset', 1)

    kernel.add_task('tuner', tune, priority=50, rate_hz=0.1, phase_ns=150 * MS)
    kernel.run(S // 2)
    assert module.log == ['step', 'step', ('gain', 13.0), ('offset', 1.0), 'step', 'step']
    assert (task.runs, task.failures) == (5, 1)
    assert kernel.failures[0].error == 'ValueError: an unlucky number'


def test_a_module_without_step_says_so(kernel: Kernel) -> None:
    module = Base('base', {})
    kernel.add_task('base', module.job, priority=10, rate_hz=10.0)
    kernel.run(S // 20)
    assert kernel.failures[0].error == 'NotImplementedError: Base has no step()'


def test_ports_are_inherited_and_belong_to_each_module(kernel: Kernel) -> None:
    bus = Bus(kernel)
    modules = []
    for name in ('first', 'second'):
        module = Derived(name, {'value_topic': f'{name}/value', 'other_topic': 'first/value'})
        module.declare(bus, 10.0)
        modules.append(module)
    for module in modules:
        task = kernel.add_task(module.name, module.job, priority=10, rate_hz=10.0)
        module.bind(bus, task)
        assert module.task is task
        assert module.kernel is kernel
    assert list(Derived.ports()) == ['value', 'other']
    kernel.run(S // 2)
    assert isinstance(modules[0].value, Publisher)
    assert isinstance(modules[1].other, Subscription)
    assert [bus.topic(f'{name}/value').head for name in ('first', 'second')] == [5, 5]
    assert modules[1].other.topic is bus.topic('first/value')
    assert [s.name for s in bus.topic('first/value').statistics().subscribers] == [
        'first', 'second']


@pytest.mark.parametrize(('stamp_offset_ns', 'moving'), [
    (0, 5), (3600 * S, 6), (-200 * MS, 3), (-S, 0)], ids=['now', 'future', 'older', 'old'])
def test_no_stamp_keeps_the_guard_from_stopping_the_robot(
        kernel: Kernel, stamp_offset_ns: int, moving: int) -> None:
    bus = Bus(kernel)
    bus.declare('cmd_vel', 'geometry_msgs/msg/Twist')
    guard = TwistGuard('guard', settings_of(TwistGuard))
    guard.declare(bus, 10.0)
    guard.bind(bus, kernel.add_task('guard', guard.job, priority=40, rate_hz=10.0))
    command = bus.publisher('cmd_vel')
    safe = bus.subscribe('cmd_vel_safe', 'wheels')

    def steer() -> None:
        command.msg.linear.x = 0.5
        command.publish(max(1, kernel.now_ns() + stamp_offset_ns))

    kernel.add_task('steer', steer, priority=50, rate_hz=0.01, phase_ns=290 * MS)
    kernel.run(1600 * MS)
    speeds = []
    while safe.take():
        speeds.append(safe.msg.linear.x)
    # It came at 0.29 s and the guard, which looks each 0.1 s, saw it at 0.3 s. It is too old from
    # 0.8 s on; where its own stamp is of no use, from 0.9 s.
    assert speeds == [0.0] * 3 + [0.5] * moving + [0.0] * (13 - moving)


@pytest.mark.parametrize(('stamp_age_ns', 'moves'), [
    (0, True), (300 * MS, True), (2 * S, False), (-2 * S, True)])
def test_the_guard_goes_by_the_age_of_the_stamp_and_says_when_it_is_too_old(
        kernel: Kernel, stamp_age_ns: int, moves: bool) -> None:
    bus = Bus(kernel)
    bus.declare('cmd_vel', 'geometry_msgs/msg/Twist')
    guard = TwistGuard('guard', {f.name: f.default for f in TwistGuard.fields()})
    guard.declare(bus, 50.0)
    guard.bind(bus, kernel.add_task('guard', guard.job, priority=40, rate_hz=50.0))
    command = bus.publisher('cmd_vel')
    command.msg.linear.x = 0.5
    steering = True

    def steer() -> None:
        if steering:
            # As the link does: what is stamped in the future has come now.
            command.publish(min(kernel.now_ns(), kernel.now_ns() - stamp_age_ns))

    kernel.run(3 * S)
    kernel.add_task('steer', steer, priority=50, rate_hz=20.0)
    kernel.run(S)
    result = bus.subscribe('cmd_vel_safe', 'test', initial=True)
    assert result.latest() and (result.msg.linear.x == 0.5) is moves
    warning = guard.statistics()['warning']
    assert ('stamps are 2.0 s old' in warning) is not moves
    assert (guard.statistics()['too_old'] > 0) is not moves
    steering = False
    kernel.run(S)
    assert guard.statistics()['warning'] == ''
