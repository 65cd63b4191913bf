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


"""The right reason for each fault, told once; defective drivers hurt only themselves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from dataclasses import field
from typing import Any
from typing import NoReturn

import pytest

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.reports import Reports
from rt_robot_os.base.reports import Severity
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.devices.device import Device
from rt_robot_os.devices.device import DeviceStatistics
from rt_robot_os.devices.managed import ManagedDevice
from rt_robot_os.devices.manager import SensorManager
from rt_robot_os.devices.state import DeviceState
from rt_robot_os.devices.state import RecoverySettings
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.topics import Bus

pytest.importorskip('std_msgs', reason='ROS 2 messages are not installed')

MS = 1_000_000
S = 1_000_000_000
RECOVERY = RecoverySettings(timeout_ns=S, retry_ns=S // 2, retry_maximum_ns=2 * S)


def nothing() -> None:
    """Do nothing."""


@dataclass
class Script:
    """What a device does; each may raise."""

    on_open: Callable[[], None] = nothing
    on_read: Callable[[int], tuple[int, int]] = lambda now_ns: (10, 1)  # bytes, samples
    on_write: Callable[[], None] = nothing
    on_close: Callable[[], None] = nothing
    on_diagnosis: Callable[[], None] = nothing
    log: list[str] = field(default_factory=list)


class Scripted(Device):
    """A device that follows its script."""

    def __init__(self, name: str, script: Script, topic_hz: float = 100.0) -> None:
        super().__init__(name, {})
        self.script = script
        self.topic_hz = topic_hz
        self.counters = [0, 0]

    def publications(self) -> tuple[TopicSpec, ...]:
        return (TopicSpec(f'{self.name}/value', 'std_msgs/msg/Int64', {}, 16, self.topic_hz),)

    def open(self) -> None:  # noqa: A003
        self.script.log.append('open')
        self.script.on_open()

    def close(self) -> None:
        self.script.log.append('close')
        self.script.on_close()

    def write(self, now_ns: int) -> None:
        self.script.on_write()

    def read(self, now_ns: int) -> int:
        count, samples = self.script.on_read(now_ns)
        self.counters[0] += count
        if samples:
            self.counters[1] = now_ns
        return samples

    def statistics(self) -> DeviceStatistics:
        return DeviceStatistics(bytes_read=self.counters[0], last_frame_ns=self.counters[1])


class Robot:
    """A kernel with a manager, and what it reports."""

    def __init__(self) -> None:
        self.clock = VirtualClock(start_ns=S)
        self.kernel = Kernel(self.clock)
        self.bus = Bus(self.kernel)
        self.reports = Reports()
        self.manager = SensorManager(self.kernel, self.bus, self.reports)

    def add(self, name: str, script: Script, priority: int = 50,
            rate_hz: float = 100.0, topic_hz: float = 100.0) -> ManagedDevice:
        return self.manager.add(Scripted(name, script, topic_hz), rate_hz=rate_hz,
                                priority=priority, recovery=RECOVERY)

    def texts(self, severity: Severity = Severity.ERROR) -> list[str]:
        return [f'{r.source}: {r.text}' for r in self.reports.since(0)[2]
                if r.severity is severity]


@pytest.fixture
def robot() -> Robot:
    return Robot()


class Strange(Scripted):
    """A device whose diagnosis takes long."""

    def diagnosis(self) -> str:
        self.script.log.append('diagnosis')
        self.script.on_diagnosis()
        return 'these are sonar frames'


def gone() -> NoReturn:
    raise DeviceError('d: port is gone')


def defective() -> NoReturn:
    raise ZeroDivisionError('in the driver')


@pytest.mark.parametrize(('after', 'reason'), [
    ((0, 0), 'silent for 1 s'),
    ((7, 0), 'bytes but no valid frame for 1 s'),
])
@pytest.mark.parametrize('delivered_s', [0, 5])
def test_the_reason_is_what_happens_now_and_not_what_was_before(
        robot: Robot, delivered_s: int, after: tuple[int, int], reason: str) -> None:
    def read(now_ns: int) -> tuple[int, int]:
        return (10, 1) if now_ns < (1 + delivered_s) * S else after

    device = robot.add('d', Script(on_read=read))
    robot.kernel.run((delivered_s + 2) * S)
    assert device.faults == 1
    assert reason in robot.texts()[0]


def test_a_slow_device_is_not_taken_for_a_silent_one(robot: Robot) -> None:
    device = robot.add('d', Script(on_read=lambda now_ns: (10, int(now_ns % (S - 10 * MS) == 0))))
    robot.kernel.run(20 * S)
    assert (device.state, device.faults) == (DeviceState.ACTIVE, 0)


@pytest.mark.parametrize('read', [(0, 0), (7, 0)], ids=['silent', 'garbage'])
def test_the_same_fault_after_each_opening_is_told_once(
        robot: Robot, read: tuple[int, int]) -> None:
    device = robot.add('d', Script(on_read=lambda now_ns: read))
    robot.kernel.run(20 * S)
    assert device.faults > 5
    assert len(robot.texts()) == 1


def test_a_fault_after_a_recovery_is_told_again(robot: Robot) -> None:
    device = robot.add('d', Script(on_read=lambda now_ns: (0, int(now_ns // S % 4 < 2))))
    robot.kernel.run(19 * S)
    assert device.faults >= 4
    assert len(robot.texts()) == device.faults
    assert len([t for t in robot.texts(Severity.INFO) if 'active again after' in t]) >= 4


@pytest.mark.parametrize('step', ['on_open', 'on_read', 'on_write'])
def test_a_defective_driver_is_in_fault_with_the_place_and_hurts_no_other(
        robot: Robot, step: str) -> None:
    # First in the list, so that it is opened before the others.
    bad = robot.add('bad', Script(**{step: lambda *_: defective()}))
    good = robot.add('good', Script())
    robot.kernel.run(10 * S)
    assert bad.state is DeviceState.FAULT
    assert bad.faults >= 4, 'it is tried again'
    text = robot.texts()[0]
    assert text.startswith('bad: its driver is defective: ZeroDivisionError: in the driver (')
    assert f'{__file__}:{defective.__code__.co_firstlineno + 1})' in text
    assert good.state is DeviceState.ACTIVE
    task = robot.kernel.task('good')
    assert (task.missed, task.failures, robot.kernel.failures_total) == (0, 0, 0)


def test_a_driver_that_cannot_close_keeps_no_other_from_being_closed(robot: Robot) -> None:
    scripts = [Script(on_close=defective), Script()]
    bad, good = (robot.add(name, script) for name, script in zip(('bad', 'good'), scripts))
    robot.kernel.run(S)
    robot.manager.close()
    assert [s.log[-1] for s in scripts] == ['close', 'close']
    assert (bad.state, good.state) == (DeviceState.CLOSED, DeviceState.CLOSED)
    assert 'could not be closed' in robot.texts()[0]


@pytest.mark.parametrize('priority', [1, 50])
def test_a_fault_pauses_also_when_recovery_is_the_more_urgent_task(
        robot: Robot, priority: int) -> None:
    opened: list[int] = []

    def slow_failure(now_ns: int) -> NoReturn:
        robot.clock.spend(200 * MS)
        gone()

    robot.add('d', Script(on_open=lambda: opened.append(robot.clock.now_ns()),
                          on_read=slow_failure), priority=priority, rate_hz=50.0)
    robot.kernel.run(10 * S)
    pauses = [b - a for a, b in zip(opened, opened[1:])]
    assert len(pauses) >= 3
    assert all(pause >= S // 2 for pause in pauses)
    assert not robot.kernel.failures


def test_no_device_delays_another_whatever_it_does(robot: Robot) -> None:
    def slow(*arguments: object) -> None:
        robot.clock.spend(2 * S)

    def slow_and_missing() -> NoReturn:
        slow()
        gone()

    robot.add('never_opens', Script(on_open=slow_and_missing), priority=20)
    robot.add('opens_slowly', Script(on_open=slow, on_close=slow, on_read=lambda now_ns: (0, 0)),
              priority=20)
    good = robot.add('good', Script(), priority=60)
    robot.kernel.run(30 * S)
    task = robot.kernel.task('good')
    assert (task.runs, task.missed, task.latency.maximum_ns) == (3000, 0, 0)
    assert good.statistics().device.last_frame_ns == 31 * S - 10 * MS
    assert [good.faults, good.opened] == [0, 1]


def test_statistics_before_the_first_frame_say_so(robot: Robot) -> None:
    device = robot.add('d', Script(on_read=lambda now_ns: (0, 0)))
    assert device.statistics().age_ns == -1
    assert device.statistics().state is DeviceState.CLOSED
    robot.kernel.run(S // 2)
    fared, = robot.manager.statistics()
    assert (fared.name, fared.state, fared.reason, fared.opened) == (
        'd', DeviceState.OPENING, '', 1)


@pytest.mark.parametrize('begin_s', [0, 4])
def test_valid_frames_without_a_sample_are_a_warning_with_a_remedy_told_once(
        robot: Robot, begin_s: int) -> None:
    def read(now_ns: int) -> tuple[int, int]:
        device.device.counters[1] = now_ns  # a valid frame in each round
        return 10, int(now_ns < (1 + begin_s) * S)

    device: Any = robot.add('d', Script(on_read=read))
    robot.kernel.run((begin_s + 10) * S)
    assert (device.state, device.faults) == (DeviceState.ACTIVE, 0)
    assert robot.texts() == []
    text, = robot.texts(Severity.WARN)
    assert text.startswith(
        'd: 0 valid frames, but no sample for 1 s: check which messages the device is')
    assert device.statistics().reason == text.removeprefix('d: ')


def test_a_sample_ends_the_warning(robot: Robot) -> None:
    def read(now_ns: int) -> tuple[int, int]:
        device.device.counters[1] = now_ns
        return 10, int(now_ns > 6 * S)

    device: Any = robot.add('d', Script(on_read=read))
    robot.kernel.run(10 * S)
    assert len(robot.texts(Severity.WARN)) == 1
    assert device.statistics().reason == ''
    assert 'active again after' in robot.texts(Severity.INFO)[-1]


def test_a_device_that_sends_seldom_is_not_warned_of(robot: Robot) -> None:
    def read(now_ns: int) -> tuple[int, int]:
        device.device.counters[1] = now_ns
        return 10, int(now_ns % (4 * S) < 10 * MS)

    device: Any = robot.add('d', Script(on_read=read), topic_hz=0.3)
    robot.kernel.run(30 * S)
    assert robot.texts(Severity.WARN) == []


# --- whose bytes came: found out where it holds up nobody --------------------------------------

def add_strange(robot: Robot, on_diagnosis: Callable[[], None]) -> ManagedDevice:
    """Add a device that sends nothing valid."""
    script = Script(on_read=lambda now_ns: (7, 0), on_diagnosis=on_diagnosis)
    return robot.manager.add(Strange('d', script), rate_hz=100.0, priority=50, recovery=RECOVERY)


def test_a_diagnosis_is_paid_by_the_recovery_and_by_no_device(robot: Robot) -> None:
    device: Any = add_strange(robot, lambda: robot.clock.spend(30 * MS))
    other = robot.kernel.add_task('other', nothing, priority=10, rate_hz=1000.0)
    robot.kernel.run(2 * S)
    longest = {name: robot.kernel.task(name).statistics().response_maximum_ns
               for name in ('d', 'other', 'sensors/recovery')}
    assert device.task is not None and device.device.script.log.count('diagnosis') == 1
    assert longest['d'] == longest['other'] == 0, 'someone waited for the diagnosis'
    assert longest['sensors/recovery'] >= 30 * MS
    assert other.statistics().missed == 0
    assert robot.texts() == ['d: 728 bytes but no valid frame for 1 s: these are sonar frames']


def test_a_device_is_in_fault_with_a_reason_before_its_bytes_are_looked_at(robot: Robot) -> None:
    seen = []
    device: Any = add_strange(robot, lambda: seen.append((device.state, device.reason)))
    robot.kernel.run(2 * S)
    assert seen == [(DeviceState.FAULT, '728 bytes but no valid frame for 1 s: check the baud '
                     'rate, and that the connected device is the configured one')]
    # What it moves is at rest, and its port closed, before.
    assert device.device.script.log[:3] == ['open', 'close', 'diagnosis']


def test_a_defective_diagnosis_hurts_no_other_device(robot: Robot) -> None:
    add_strange(robot, defective)
    robot.add('e', Script())
    robot.kernel.run(3 * S)
    assert robot.texts() == ['d: 728 bytes but no valid frame for 1 s: check the baud rate, and '
                             'that the connected device is the configured one']
    assert ('d: could not be diagnosed: its driver is defective: ZeroDivisionError'
            in robot.texts(Severity.WARN)[0])
    assert [each.state for each in robot.manager.statistics()][1] is DeviceState.ACTIVE


def test_what_was_not_yet_looked_at_is_told_at_the_end(robot: Robot) -> None:
    device = add_strange(robot, nothing)
    robot.kernel.run(1045 * MS)  # given up just now, and the recovery is due in 5 ms
    assert device.state is DeviceState.FAULT and robot.texts() == []
    robot.manager.close()
    assert robot.texts() == ['d: 728 bytes but no valid frame for 1 s: these are sonar frames']
