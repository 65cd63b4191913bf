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


"""What releases a module, and modules that are coroutines or run in logical time."""

from __future__ import annotations

from typing import Any

import pytest

from rt_robot_os.base.errors import TopicError
from rt_robot_os.core.tasks import add_module_task
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import TaskState
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.modules import Field
from rt_robot_os.modules import Input
from rt_robot_os.modules import Module
from rt_robot_os.modules import Output
from rt_robot_os.settings import ModuleSettings
from rt_robot_os.settings import TaskSettings
from rt_robot_os.topics import Bus

pytest.importorskip('std_msgs.msg', reason='needs the ROS 2 message packages')

MS = 1_000_000
INT = 'std_msgs/msg/Int64'


class HasPending(Module):
    """Note when it is released and what it takes."""

    def configure(self) -> None:
        self.seen: list[tuple[int, list[int]]] = []

    def step(self) -> None:
        assert self.kernel is not None
        taken = []
        while self.imu.take():  # type: ignore[attr-defined]
            taken.append(self.imu.msg.data)  # type: ignore[attr-defined]
        self.seen.append((self.kernel.now_ns() // MS, taken))


class Robot:
    """A 100 Hz source on `imu`, a 25 Hz one on `gps`, and one module under test."""

    def __init__(self, kind: type[Module], rate_hz: float = 0.0, **task: Any) -> None:
        self.kernel = Kernel(VirtualClock())
        self.bus = Bus(self.kernel)
        for name, rate, phase in (('imu', 100.0, 0), ('gps', 25.0, 15 * MS)):
            self.bus.declare(name, INT, depth=8)
            publisher = self.bus.publisher(name)

            def job(publisher: Any = publisher) -> None:
                publisher.msg.data += 1
                publisher.publish()

            self.kernel.add_task(name, job, priority=90, rate_hz=rate, phase_ns=phase)
        values = {field.name: field.default for field in kind.fields()}
        self.module = kind('module', values)
        self.module.declare(self.bus, rate_hz)
        entry = ModuleSettings('module', 'type', rate_hz, 50, settings=values,
                               task=TaskSettings(**task))
        self.task = add_module_task(self.kernel, self.module, entry, self.module.activate)
        self.module.bind(self.bus, self.task)
        self.module.configure()


def seen(kind: type[Module]) -> list[tuple[int, list[int]]]:
    robot = Robot(kind)
    robot.kernel.run(90 * MS)
    found: list[tuple[int, list[int]]] = robot.module.seen  # type: ignore[attr-defined]
    return found


def test_each_publication() -> None:
    class Each(HasPending):
        imu = Input('imu', wake=True)

    assert seen(Each) == [(n * 10, [n + 1]) for n in range(9)]


def test_every_third_publication() -> None:
    class Third(HasPending):
        imu = Input('imu', wake=3)

    assert seen(Third) == [(20, [1, 2, 3]), (50, [4, 5, 6]), (80, [7, 8, 9])]


def test_all_of_its_inputs() -> None:
    class Fusion(HasPending):
        imu = Input('imu', wake='all')
        gps = Input('gps', wake='all')

    assert seen(Fusion) == [(15, [1, 2]), (55, [3, 4, 5, 6])]


def test_the_newest_only() -> None:
    class Newest(HasPending):
        imu = Input('imu', newest=True)
        gps = Input('gps', wake=True)

    assert seen(Newest) == [(15, [2]), (55, [6])]


@pytest.mark.parametrize('wake', [-1, 'any', 2.5])
def test_another_wake_is_refused(wake: Any) -> None:
    with pytest.raises(TopicError, match=f"input 'imu': wake {wake!r} must be True, False"):
        Input('imu', wake=wake)


def test_an_input_of_another_type_is_refused() -> None:
    class Wrong(HasPending):
        imu = Input('imu', message='sensor_msgs/msg/Imu')

    with pytest.raises(TopicError) as caught:
        Robot(Wrong)
    assert str(caught.value) == (
        "module 'module': its input 'imu' must be a sensor_msgs/msg/Imu, but that topic is a "
        'std_msgs/msg/Int64; set another topic')


class Sequence(Module):
    """A mission as a coroutine."""

    SETTINGS = (Field('gain', int, 2, 'factor', '', 0, 100, live=True),)
    imu = Input('imu')
    out = Output('out', INT)

    def configure(self) -> None:
        self.notes: list[tuple[int, str]] = []

    async def run(self) -> None:
        assert self.kernel is not None
        self.note('begin')
        ticks = self.ticks()
        for _ in range(2):
            sample = await self.imu.next()
            self.note(f'sample {sample.msg.data * self.settings["gain"]}')
        await ticks.next()
        self.note('tick')
        raise ValueError('broken')

    def changed(self, name: str) -> None:
        self.note(f'{name} {self.settings[name]}')

    def note(self, text: str) -> None:
        assert self.kernel is not None
        self.notes.append((self.kernel.now_ns() // MS, text))


def test_a_module_may_be_a_coroutine_with_settings_that_change_between_its_segments() -> None:
    robot = Robot(Sequence, rate_hz=20.0, restart_s=0.02)
    robot.kernel.add_task('tuner', lambda: robot.module.change('gain', 5), priority=5,
                          rate_hz=1.0, phase_ns=3 * MS)
    robot.kernel.run(75 * MS)
    assert isinstance(robot.module, Sequence)
    assert robot.module.notes == [
        (0, 'begin'), (0, 'sample 2'), (10, 'gain 5'), (10, 'sample 10'), (50, 'tick'),
        (70, 'begin'), (70, 'sample 15'), (70, 'sample 20')]
    assert robot.task.failures == 1 and robot.task.state is TaskState.ACTIVE


class Control(Module):
    """Read the newest, write it."""

    imu = Input('imu')
    out = Output('out', INT)

    def step(self) -> None:
        assert self.kernel is not None
        self.kernel.clock.spend(3 * MS)
        self.imu.latest()
        self.out.msg.data = self.imu.msg.data
        self.out.publish()


def test_a_module_in_logical_time_writes_at_its_deadline() -> None:
    robot = Robot(Control, rate_hz=50.0, logical_execution=True, deadline_us=8000.0)
    watch = robot.bus.subscribe('out', 'test')
    robot.kernel.run(60 * MS)
    written = []
    while watch.take():
        written.append((watch.stamp_ns // MS, watch.msg.data))
    assert written == [(8, 0), (28, 2), (48, 4)]


def test_in_logical_time_a_publication_cannot_release_it() -> None:
    class Waking(Control):
        imu = Input('imu', wake=True)

    with pytest.raises(TopicError, match='its rate releases it, not its input'):
        Robot(Waking, rate_hz=50.0, logical_execution=True)
