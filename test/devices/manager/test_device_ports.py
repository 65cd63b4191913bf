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


"""Devices that read topics: what they declare, what they get, and what makes a round of theirs."""

from __future__ import annotations

import pytest

from rt_robot_os.base.errors import TopicError
from rt_robot_os.base.reports import Reports
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.devices.device import Device
from rt_robot_os.devices.device import DeviceStatistics
from rt_robot_os.devices.manager import SensorManager
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.topics import Bus
from rt_robot_os.topics.ports import Input
from rt_robot_os.topics.ports import Output

pytest.importorskip('std_msgs', reason='ROS 2 messages are not installed')

MS = 1_000_000
INT = 'std_msgs/msg/Int64'


class Heater(Device):
    """A heater with a set-point; it says what it was set to."""

    setpoint = Input('setpoint', wake=True, message=INT)
    level = Output('level', INT)
    SETTINGS = (Field('output_rate_hz', float, 20.0, 'samples a second', 'Hz'),)
    hold_ns = due_ns = 0

    def __init__(self, name: str, **settings: str) -> None:
        super().__init__(name, {'output_rate_hz': 20.0, **settings})
        self.calls: list[tuple[str, int]] = []
        self.made = 0

    def open(self) -> None:  # noqa: A003
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""

    def receive(self, now_ns: int, polled: bool) -> int:
        self.calls.append(('polled' if polled else 'woken', now_ns // MS))
        if self.setpoint.latest():
            self.level.msg.data = self.setpoint.msg.data
            self.due_ns = now_ns + self.hold_ns
        return self.due_ns if self.due_ns > now_ns else 0

    def write(self, now_ns: int) -> None:
        self.calls.append(('write', now_ns // MS))

    def read(self, now_ns: int) -> int:
        self.level.publish(now_ns)
        self.made += 1
        return 1

    def statistics(self) -> DeviceStatistics:
        return DeviceStatistics(samples=self.made, last_frame_ns=1)


class Robot:
    """A heater that is polled at 10 Hz, and what sets it, on the virtual clock."""

    def __init__(self, device: Heater) -> None:
        self.device = device
        self.kernel = Kernel(VirtualClock())
        self.bus = Bus(self.kernel)
        self.manager = SensorManager(self.kernel, self.bus, Reports(), recovery_priority=90)
        self.managed = self.manager.add(device, rate_hz=10.0, priority=50)

    def run(self, milliseconds: int, at: tuple[int, ...] = ()) -> None:
        """Let time pass; the set-point becomes the time at these milliseconds."""
        if 'setpoint' not in [topic.name for topic in self.bus.topics]:
            self.bus.declare('setpoint', INT)
        self.manager.connect()
        setpoint = self.bus.publisher('setpoint')
        for moment in at:
            def publish(moment: int = moment) -> None:
                if self.kernel.now_ns() == moment * MS:
                    setpoint.msg.data = moment
                    setpoint.publish()
            self.kernel.add_task(f'at {moment}', publish, priority=10, rate_hz=1.0,
                                 phase_ns=moment * MS)
        self.kernel.run(milliseconds * MS)


def test_a_publication_makes_a_round_at_once_without_the_periodic_command() -> None:
    robot = Robot(Heater('heater'))
    level = robot.bus.subscribe('level', 'test')
    robot.run(210, at=(130,))
    calls = robot.device.calls
    assert ('woken', 130) in calls and ('write', 130) not in calls
    assert [at for what, at in calls if what == 'write'] == [
        at for what, at in calls if what == 'polled']
    seen = []
    while level.take():
        seen.append((level.stamp_ns // MS, level.msg.data))
    assert seen[-3:] == [(100, 0), (130, 130), (200, 130)]


def test_a_round_comes_when_the_device_wants_one() -> None:
    device = Heater('heater')
    device.hold_ns = 25 * MS
    robot = Robot(device)
    robot.run(290, at=(110, 120))
    woken = [at for what, at in device.calls if what == 'woken']
    # The second set-point wants its round later than the first one, whose timer runs already.
    assert woken == [110, 120, 135, 145]


def test_a_device_declares_its_ports_as_a_module_does() -> None:
    device = Heater('heater', level_topic='left/level')
    assert [field.name for field in Heater.fields()] == [
        'output_rate_hz', 'setpoint_topic', 'level_topic']
    assert device.publications() == (TopicSpec('left/level', INT, rate_hz=20.0),)
    assert device.subscriptions() == ('setpoint',)


def test_an_input_cannot_be_used_before_it_is_connected() -> None:
    with pytest.raises(TopicError, match=r"device 'heater': the input 'setpoint' can be used from "
                                         r'open\(\) on'):
        Heater('heater').setpoint.take()


def test_an_input_that_nobody_declares_is_told() -> None:
    with pytest.raises(TopicError, match="no topic 'setpoint'; there are: level"):
        Robot(Heater('heater')).manager.connect()


def test_an_input_of_another_type_is_told() -> None:
    robot = Robot(Heater('heater'))
    robot.bus.declare('setpoint', 'std_msgs/msg/Float64')
    with pytest.raises(TopicError, match="device 'heater': its input 'setpoint' must be a std_msgs"
                                         '/msg/Int64, but that topic is a std_msgs/msg/Float64'):
        robot.manager.connect()


def test_an_output_that_is_left_out_is_told() -> None:
    class Other(Heater):
        def publications(self) -> tuple[TopicSpec, ...]:
            return ()

    with pytest.raises(TopicError, match="heater: its publications.. leave out 'level', its out"
                                         'put level'):
        Robot(Other('heater'))
