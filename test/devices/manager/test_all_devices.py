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

"""The configuration of all devices runs, and what the simulated ones measure makes sense."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rt_robot_os.devices.registry import DRIVERS
from rt_robot_os.devices.serial.device import SerialDevice
from rt_robot_os.devices.state import DeviceState
from rt_robot_os.settings import load
from serial_bench import SerialBench

pytest.importorskip('sensor_msgs.msg', reason='ROS 2 messages are not installed')

CONFIG = Path(__file__).resolve().parents[3] / 'config' / 'all_devices.yaml'
GRAVITY = 9.80665


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> SerialBench:
    return SerialBench(monkeypatch)


def collect(bench: SerialBench, topic: str, pick: Any) -> list[Any]:
    found: list[Any] = []
    bench.watch[topic] = lambda msg, stamp_ns: found.append(pick(msg))
    return found


def test_the_configuration_has_every_serial_driver_and_all_become_active(
        bench: SerialBench) -> None:
    robot = load([CONFIG])
    assert all(device.sim is not None for device in robot.devices)
    serial = [d for d in robot.devices if issubclass(DRIVERS.load(d.type), SerialDevice)]
    assert {d.type for d in serial} == {
        name for name in DRIVERS.names() if issubclass(DRIVERS.load(name), SerialDevice)}
    for device in serial:
        settings = {**device.settings, 'port': device.name}
        bench.add(device.name, device.type, settings, dict(device.sim or {}),
                  rate_hz=max(device.rate_hz, 200.0), timeout_s=device.timeout_s)
    bench.run(5)
    for name, managed in bench.devices.items():
        counters = managed.statistics().device
        assert (managed.state, managed.faults) == (DeviceState.ACTIVE, 0), name
        assert (counters.lost_samples, counters.contradicted_samples) == (0, 0), name
    mirrored = {mirror.topic for mirror in robot.mirrors}
    assert set(bench.readers) <= mirrored
    assert all(bench.take(topic) for topic in bench.readers)


@pytest.mark.parametrize('kind', ['xsens', 'bno055'])
def test_the_parts_of_an_imu_agree_with_each_other(bench: SerialBench, kind: str) -> None:
    bench.add('dut', kind, {}, {'noise': 0.0})
    attitudes: list[Any] = []
    forces: list[Any] = []
    rates: list[Any] = []

    def both(message: Any, stamp_ns: int) -> None:
        attitudes.append(tuple(message.orientation))
        forces.append(tuple(message.linear_acceleration))
        rates.append(tuple(message.angular_velocity))

    bench.watch['dut/imu/data'] = both
    bench.run(3)
    x, y, z, w = np.array(attitudes).T
    matrix = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]).transpose(2, 0, 1)
    up = np.einsum('nij,nj->ni', matrix, np.array(forces))
    assert len(up) > 200
    assert np.abs(up - (0, 0, GRAVITY)).max() < 0.02
    change = np.einsum('nji,njk->nik', matrix[:-1], matrix[1:])
    turned = np.array([change[:, 2, 1] - change[:, 1, 2], change[:, 0, 2] - change[:, 2, 0],
                       change[:, 1, 0] - change[:, 0, 1]]).T / 2 / 0.01
    mean = (np.array(rates)[1:] + np.array(rates)[:-1]) / 2
    assert np.abs(mean).max() > 0.3
    # A sample may come a step of the simulation late, so compare the middle of the deviations.
    assert np.median(np.abs(turned - mean)) < 0.02


def test_both_receivers_are_at_the_same_place(bench: SerialBench) -> None:
    for name, kind in (('nmea', 'nmea'), ('ublox', 'ublox')):
        bench.add(name, kind, {'baud': 38400, 'output_rate_hz': 5.0}, {'rate_hz': 5.0})
    places = {name: collect(bench, f'{name}/gps/fix', lambda m: (m.latitude, m.longitude,
                                                                 m.altitude))
              for name in ('nmea', 'ublox')}
    velocity = collect(bench, 'ublox/gps/velocity', lambda m: tuple(m.twist.twist.linear))
    times = {name: collect(bench, f'{name}/gps/time', lambda m: (m.time_ref.sec,
                                                                 m.time_ref.nanosec))
             for name in ('nmea', 'ublox')}
    bench.run(4)
    count = min(len(places['nmea']), len(places['ublox']))
    assert count >= 18
    nmea, ublox = (np.array(places[name][-count + 2:-2]) for name in ('nmea', 'ublox'))
    assert np.abs(nmea - ublox)[:, :2].max() < 1e-6
    assert np.abs(nmea - ublox)[:, 2].max() < 0.02
    assert times['nmea'][3] in times['ublox']
    assert np.hypot(*np.array(velocity)[:, :2].T) == pytest.approx(1.0, abs=0.002)
    north = np.diff(ublox[:, 0]) * 111_200 / 0.2
    assert north == pytest.approx(np.array(velocity)[-len(north) - 2:-2, 1], abs=0.1)


def test_range_finders_see_the_wall_come_and_go(bench: SerialBench) -> None:
    bench.add('sonar', 'maxbotix', {}, {'period_s': 4.0})
    bench.add('infrared', 'sharp', {'median': 1}, {'period_s': 4.0})
    sonar = collect(bench, 'sonar/range', lambda m: m.range)
    infrared = collect(bench, 'infrared/range', lambda m: m.range)
    bench.run(8)
    for name, found, low, high in (('sonar', sonar, 0.3, 5.0), ('infrared', infrared, 0.1, 0.8)):
        assert {-math.inf, math.inf} < set(found), name
        near = [v for v in found if math.isfinite(v)]
        assert low < min(near) < 1.5 * low and 0.9 * high < max(near) <= high, name


def test_the_scanner_sees_the_room(bench: SerialBench) -> None:
    bench.add('laser', 'hokuyo', {}, {'turn_rad_s': 0.0, 'noise': 0.0})
    scans = collect(bench, 'laser/scan', lambda m: (m.angle_min, m.angle_increment,
                                                    m.ranges.copy()))
    bench.run(1.5)
    first, step, ranges = scans[-1]

    def at(degrees: float) -> float:
        return float(ranges[round((math.radians(degrees) - first) / step)])

    # Walls 3 m ahead, 2 m to both sides; a pillar ahead on the left.
    assert [at(0), at(90), at(-90)] == pytest.approx([3.0, 2.0, 2.0], abs=0.002)
    assert at(math.degrees(math.atan2(0.5, 1.5))) == pytest.approx(
        math.hypot(0.5, 1.5) - 0.2, abs=0.01)
    assert at(-math.degrees(math.atan2(0.5, 1.5))) == pytest.approx(3.16, abs=0.02)
