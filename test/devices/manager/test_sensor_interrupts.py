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


"""Devices that are read as their bytes arrive, on the virtual clock and on real ptys."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
import os
from pathlib import Path

import pytest

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.reports import Reports
from rt_robot_os.base.reports import Severity
from rt_robot_os.base.schema import REQUIRED
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.devices.device import Device
from rt_robot_os.devices.device import DeviceStatistics
from rt_robot_os.devices.manager import SensorManager
from rt_robot_os.devices.state import DeviceState
from rt_robot_os.devices.state import RecoverySettings
from rt_robot_os.devices.witmotion import wire
from rt_robot_os.devices.witmotion.driver import WitMotion
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import MonotonicClock
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.sim.pty_port import PtyPort
from rt_robot_os.topics import Bus

pytest.importorskip('sensor_msgs', reason='ROS 2 messages are not installed')

MS = 1_000_000
S = 1_000_000_000
RECOVERY = RecoverySettings(timeout_ns=S, retry_ns=S // 2, retry_maximum_ns=2 * S)
FRAMES = b''.join((wire.acceleration_frame(0.0, 0.0, 9.8),
                   wire.angular_velocity_frame(0.1, 0.2, 0.3)))


class Piped(Device):
    """A device at the end of a pipe; each byte is a sample."""

    def __init__(self, name: str) -> None:
        super().__init__(name, {})
        self.ends: tuple[int, ...] = ()
        self.writes: list[int] = []
        self.reads: list[int] = []
        self.counters = [0, 0]

    def publications(self) -> tuple[TopicSpec, ...]:
        return (TopicSpec(f'{self.name}/value', 'std_msgs/msg/Int64', {}, 64, 100.0),)

    def open(self) -> None:  # noqa: A003
        self.ends = os.pipe()
        os.set_blocking(self.ends[0], False)

    def close(self) -> None:
        ends, self.ends = self.ends, ()
        for end in ends:
            os.close(end)

    def fileno(self) -> int | None:
        return self.ends[0] if self.ends else None

    def write(self, now_ns: int) -> None:
        self.writes.append(now_ns)

    def read(self, now_ns: int) -> int:
        self.reads.append(now_ns)
        try:
            data = os.read(self.ends[0], 100)
        except BlockingIOError:
            return 0
        if b'x' in data:
            raise DeviceError('port is gone')
        self.counters[0] += len(data)
        self.counters[1] = now_ns
        for _ in data:
            self._publishers[0].msg.data = now_ns
            self._publishers[0].publish(now_ns)
        return len(data)

    def statistics(self) -> DeviceStatistics:
        return DeviceStatistics(bytes_read=self.counters[0], last_frame_ns=self.counters[1])


class Robot:
    """A kernel on the virtual clock with a device that is read on interrupt."""

    def __init__(self, device: Piped, sent_at: tuple[int, ...] = (), what: bytes = b'.') -> None:
        self.device = device
        self.kernel = Kernel(VirtualClock())
        self.bus = Bus(self.kernel)
        self.reports = Reports()
        self.manager = SensorManager(self.kernel, self.bus, self.reports)
        self.managed = self.manager.add(
            device, rate_hz=10.0, priority=50, recovery=RECOVERY, interrupt=True)
        self.left = sorted(sent_at)
        # A line that is idle until a byte is due: below all others.
        self.what = what
        self.kernel.add_task('line', lambda: self.send(self.what), priority=1, rate_hz=1000.0)

    def send(self, what: bytes) -> None:
        if self.left and self.kernel.now_ns() >= self.left[0] and self.device.ends:
            self.left.pop(0)
            os.write(self.device.ends[1], what)

    def texts(self, severity: Severity) -> list[str]:
        return [r.text for r in self.reports.since(0)[2] if r.severity is severity]


@pytest.fixture
def device() -> Iterator[Piped]:
    made = Piped('imu')
    yield made
    made.close()


def test_it_is_read_when_bytes_arrive_and_not_at_the_next_poll(device: Piped) -> None:
    sent = (203 * MS, 204 * MS, 277 * MS, 451 * MS)
    robot = Robot(device, sent)
    reader = robot.bus.subscribe('imu/value', 'test')
    robot.kernel.run(S)
    stamps = []
    while reader.take():
        stamps.append(reader.stamp_ns)
    # On the virtual clock descriptors are looked at when all are idle, here each millisecond.
    assert [stamp - at for stamp, at in zip(stamps, sent)] == [MS] * 4
    assert robot.managed.state is DeviceState.ACTIVE


def test_commands_stay_on_the_grid_of_the_rate(device: Piped) -> None:
    robot = Robot(device, tuple(range(100 * MS, 900 * MS, 7 * MS)))
    robot.kernel.run(S)
    assert {b - a for a, b in zip(device.writes, device.writes[1:])} == {100 * MS}
    assert len(device.reads) > 100
    task = robot.kernel.task('imu')
    assert (task.missed, task.failures) == (0, 0)


def test_an_interrupt_that_gets_lost_is_made_good_by_the_next_poll(device: Piped) -> None:
    robot = Robot(device, (203 * MS,))
    robot.kernel.add_task('lose it', lambda: robot.kernel.remove_interrupt(device.ends[0])
                          if device.ends else None, priority=2, rate_hz=100.0)
    robot.kernel.run(S)
    assert device.counters == [1, 300 * MS]


def test_a_fault_on_interrupt_is_a_fault_and_the_new_port_interrupts_again(device: Piped) -> None:
    robot = Robot(device, (203 * MS,), b'x')
    robot.kernel.run(400 * MS)
    assert robot.managed.state is DeviceState.FAULT and robot.managed.faults == 1
    assert 'port is gone' in robot.managed.reason
    robot.left = [1777 * MS]
    robot.what = b'.'
    robot.kernel.run(2 * S)
    assert robot.managed.state is DeviceState.ACTIVE
    assert device.counters == [1, 1778 * MS]


def test_a_device_without_a_descriptor_is_polled_and_that_is_said_once(
        device: Piped, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(device, 'fileno', lambda: None)
    robot = Robot(device, (203 * MS,))
    robot.kernel.run(6 * S)
    assert robot.managed.faults > 1
    assert robot.texts(Severity.WARN) == [
        'cannot be read on interrupt, so it is polled: it has no file descriptor; set read: poll']
    assert device.counters[1] == 300 * MS


def test_the_same_arrivals_give_the_same_reads_in_every_run() -> None:
    def one() -> list[int]:
        device = Piped('imu')
        Robot(device, tuple(range(100 * MS, 900 * MS, 7 * MS))).kernel.run(S)
        device.close()
        return device.reads

    assert one() == one()


# --- real ptys on the real clock -----------------------------------------------------------------

class Line:
    """A WitMotion on a pty that a task of the same kernel plugs, feeds and unplugs."""

    def __init__(self, folder: Path, rate_hz: float) -> None:
        self.port = PtyPort(folder / 'imu')
        self.kernel = Kernel(MonotonicClock())
        self.bus = Bus(self.kernel)
        self.reports = Reports()
        self.manager = SensorManager(self.kernel, self.bus, self.reports)
        values = {f.name: f.default for f in WitMotion.SETTINGS}
        values.update(port=str(self.port.link), baud=0)
        assert REQUIRED not in values.values()
        self.managed = self.manager.add(
            WitMotion('imu', values), rate_hz=rate_hz, priority=50, interrupt=True,
            recovery=RecoverySettings(timeout_ns=60 * S, retry_ns=MS, retry_maximum_ns=MS))
        self.reader = self.bus.subscribe('imu/data', 'test')

    def run(self, job: Callable[[], None], seconds: int = 60) -> str:
        self.kernel.add_task('line', job, priority=1, rate_hz=200.0)
        return self.kernel.run(seconds * S)


@pytest.fixture
def line(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Line]:
    made = Line(tmp_path, request.param)
    made.port.plug()
    yield made
    made.manager.close()
    made.port.unplug()


# Polled so rarely that within the test only interrupts read.
@pytest.mark.parametrize('line', [0.1], indirect=True)
def test_bytes_on_a_pty_are_read_without_a_poll(line: Line) -> None:
    sent: list[int] = []
    stamps: list[int] = []

    def job() -> None:
        while line.reader.take():
            stamps.append(line.reader.stamp_ns)
        # Linux hands on what is written to a pty later: several writes may arrive as one.
        if len(stamps) >= 10 and line.kernel.task('imu/arrival').runs >= 10:
            line.kernel.stop('enough')
        if line.managed.state in (DeviceState.OPENING, DeviceState.ACTIVE):
            sent.append(line.kernel.now_ns())
            line.port.write(FRAMES)

    assert line.run(job) == 'enough'
    assert line.managed.state is DeviceState.ACTIVE
    assert line.kernel.task('imu').runs < 10
    assert stamps == sorted(stamps) and stamps[0] >= sent[0]
    assert not line.kernel.failures


# A device in fault is opened again at a poll.
@pytest.mark.parametrize('line', [5.0], indirect=True)
def test_a_pty_that_goes_away_and_comes_back_interrupts_again(line: Line) -> None:
    steps: list[str] = []

    def job() -> None:
        state, opened = line.managed.state, line.managed.opened
        if opened == 1 and state is DeviceState.ACTIVE:
            steps.append('unplug')
            line.port.unplug()
        elif state is DeviceState.FAULT:
            steps.append('plug')
            line.port.plug()
        elif opened >= 2 and state is DeviceState.ACTIVE:
            line.kernel.stop('back')
        elif state is DeviceState.OPENING:
            line.port.write(FRAMES)

    assert line.run(job) == 'back'
    assert steps[0] == 'unplug' and 'plug' in steps
    assert line.managed.faults >= 1
    assert not line.kernel.failures
