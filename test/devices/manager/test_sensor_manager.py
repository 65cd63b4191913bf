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

"""Devices that fail in every way, under the SensorManager, on the virtual clock."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.reports import Reports
from rt_robot_os.base.reports import Severity
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.devices.device import Device
from rt_robot_os.devices.device import DeviceStatistics
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


class FakeDevice(Device):
    """A device that does what its script says for the present time."""

    def __init__(self, name: str, clock: VirtualClock, mood: Callable[[int], str],
                 open_ns: int = 0) -> None:
        super().__init__(name, {})
        self.clock = clock
        self.mood = mood
        self.open_ns = open_ns
        self.log: list[tuple[int, str]] = []
        self.bytes = 0
        self.frame_ns = 0
        self.is_open = False

    def publications(self) -> tuple[TopicSpec, ...]:
        return (TopicSpec(f'{self.name}/value', 'std_msgs/msg/Int64', {}, 64, 100.0),)

    def open(self) -> None:  # noqa: A003
        self.log.append((self.clock.now_ns(), 'open'))
        self.clock.spend(self.open_ns)
        if self.mood(self.clock.now_ns()) == 'missing':
            raise DeviceError(f'{self.name}: port is not there: check the cable')
        self.is_open = True

    def close(self) -> None:
        if self.is_open:
            self.log.append((self.clock.now_ns(), 'close'))
        self.is_open = False

    def read(self, now_ns: int) -> int:
        assert self.is_open, 'read while closed'
        self.log.append((now_ns, 'read'))
        mood = self.mood(now_ns)
        if mood in ('missing', 'unplugged'):
            raise DeviceError(f'{self.name}: port is gone: check the cable')
        if mood == 'silent':
            return 0
        self.bytes += 10
        if mood == 'garbage':
            return 0
        self.frame_ns = now_ns
        if mood == 'other frames':
            return 0
        self._publishers[0].msg.data = now_ns
        self._publishers[0].publish(now_ns)
        return 1

    def statistics(self) -> DeviceStatistics:
        return DeviceStatistics(bytes_read=self.bytes, last_frame_ns=self.frame_ns)

    def times(self, what: str) -> list[int]:
        return [at for at, did in self.log if did == what]


class Bench:
    """A kernel, a bus and a manager with fake devices."""

    def __init__(self) -> None:
        self.clock = VirtualClock()
        self.kernel = Kernel(self.clock)
        self.bus = Bus(self.kernel)
        self.reports = Reports()
        self.manager = SensorManager(self.kernel, self.bus, self.reports)

    def add(self, name: str, mood: Callable[[int], str], **more: Any) -> FakeDevice:
        device = FakeDevice(name, self.clock, mood, **more)
        self.manager.add(device, rate_hz=100.0, priority=50, recovery=RECOVERY)
        return device

    def state(self, name: str) -> Any:
        return next(s for s in self.manager.statistics() if s.name == name)


@pytest.fixture
def bench() -> Bench:
    return Bench()


def good(now_ns: int) -> str:
    return 'good'


def test_a_good_device_becomes_active_and_its_samples_are_published(bench: Bench) -> None:
    bench.add('imu', good)
    reader = bench.bus.subscribe('imu/value', 'test')
    bench.kernel.run(S)
    assert bench.state('imu').state is DeviceState.ACTIVE
    assert reader.take() and reader.msg.data == reader.stamp_ns
    assert [str(r) for r in bench.reports.since(0)[2]] == ['[INFO] imu: active']


def test_a_device_whose_frames_are_not_samples_is_active_too(bench: Bench) -> None:
    bench.add('gps', lambda now: 'other frames')
    bench.kernel.run(3 * S)
    assert bench.state('gps').state is DeviceState.ACTIVE


@pytest.mark.parametrize(('mood', 'reason'), [
    ('missing', 'is not there'), ('unplugged', 'is gone'), ('silent', 'silent for 1 s'),
    ('garbage', 'no valid frame for 1 s')])
def test_a_dead_device_is_in_fault_with_the_reason_and_told_once(
        bench: Bench, mood: str, reason: str) -> None:
    bench.add('imu', lambda now: mood)
    bench.kernel.run(9 * S)
    fared = bench.state('imu')
    assert reason in fared.reason or fared.state is DeviceState.OPENING
    told = [r for r in bench.reports.since(0)[2] if r.severity is Severity.ERROR]
    assert told and reason in told[0].text and not told[0].text.startswith('imu: ')
    assert len(told) <= fared.faults


def test_retries_pause_twice_as_long_each_time_up_to_the_limit(bench: Bench) -> None:
    device = bench.add('imu', lambda now: 'missing')
    bench.kernel.run(20 * S)
    opened = device.times('open')
    pauses = [b - a for a, b in zip(opened, opened[1:])]
    # Looked at 20 times a second: each pause is at most 50 ms longer than asked.
    for pause, wanted in zip(pauses, [S // 2, S, 2 * S, 2 * S, 2 * S]):
        assert wanted <= pause <= wanted + 50 * MS
    assert bench.state('imu').faults == len(opened)


def test_a_device_that_comes_back_recovers_and_its_pause_starts_over(bench: Bench) -> None:
    def mood(now_ns: int) -> str:
        return 'missing' if now_ns < 5 * S else 'unplugged' if 8 * S < now_ns < 9 * S else 'good'

    device = bench.add('imu', mood)
    bench.kernel.run(12 * S)
    fared = bench.state('imu')
    assert fared.state is DeviceState.ACTIVE and fared.reason == ''
    again = [at for at in device.times('open') if at > 8 * S]
    assert again[0] - 8 * S <= S // 2 + 70 * MS  # the first pause again, not the longest
    texts = [r.text for r in bench.reports.since(0)[2]]
    assert sum('active again' in text for text in texts) == 2


def test_a_faulty_port_is_closed_before_it_is_opened_again(bench: Bench) -> None:
    device = bench.add('imu', lambda now: 'silent')
    bench.kernel.run(6 * S)
    steps = [did for _, did in device.log if did != 'read']
    assert steps[:4] == ['open', 'close', 'open', 'close']


def test_a_dead_device_whose_port_takes_seconds_to_open_never_delays_another(
        bench: Bench) -> None:
    bench.add('dead', lambda now: 'missing', open_ns=3 * S)
    alive = bench.add('alive', good)
    bench.kernel.run(10 * S)
    reads = alive.times('read')
    assert {b - a for a, b in zip(reads, reads[1:])} == {10 * MS}
    task = bench.kernel.task('alive')
    assert task.missed == 0 and task.latency.maximum_ns == 0


def test_close_closes_every_port_and_may_be_called_twice(bench: Bench) -> None:
    device = bench.add('imu', good)
    bench.kernel.run(S)
    bench.manager.close()
    bench.manager.close()
    assert not device.is_open and bench.state('imu').state is DeviceState.CLOSED


def test_the_same_faults_happen_at_the_same_times_in_every_run() -> None:
    def one() -> list[tuple[int, str]]:
        bench = Bench()
        device = bench.add('imu', lambda now: 'silent' if now % (4 * S) > 2 * S else 'good')
        bench.kernel.run(20 * S)
        return device.log

    assert one() == one()
