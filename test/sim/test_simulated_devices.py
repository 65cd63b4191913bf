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

"""Do simulated devices behave like the real ones, seen through the real drivers and ptys."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rt_robot_os.base import plugins
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.core.simulator_command import build_devices
from rt_robot_os.devices.nmea.driver import NmeaGps
from rt_robot_os.devices.nmea.simulated import SimulatedNmea
from rt_robot_os.devices.simulators import SIMULATORS
from rt_robot_os.devices.witmotion.driver import WitMotion
from rt_robot_os.devices.witmotion.simulated import SimulatedWitMotion
from rt_robot_os.sim.device import SimulatedDevice
from rt_robot_os.sim.pty_port import PtyPort
from rt_robot_os.sim.world import EARTH_FIELD_T
from sim_harness import MS
from sim_harness import rig
from sim_harness import START_NS

GRAVITY = 9.80665
BOTH = [(SimulatedWitMotion, WitMotion, None), (SimulatedNmea, NmeaGps, 115200)]


def rows(publisher: Any, name: str) -> Any:
    return np.array([tuple(vars(getattr(s, name)).values()) for s in publisher.samples])


def rotations(publisher: Any) -> Any:
    """Give the matrix from the device's axes to east, north, up, for each sample."""
    x, y, z, w = rows(publisher, 'orientation').T
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]).transpose(2, 0, 1)


# --- what they send ------------------------------------------------------------------------------

def test_the_frames_of_the_imu_agree_with_each_other(tmp_path: Path) -> None:
    with rig(tmp_path, SimulatedWitMotion, WitMotion, sim={'noise': 0.0}) as made:
        made.run(2000)
        imu, mag = made.publishers
        assert 199 <= len(imu.samples) <= 201
        matrix = rotations(imu)
        up = np.einsum('nij,nj->ni', matrix, rows(imu, 'linear_acceleration'))
        assert np.abs(up - (0, 0, GRAVITY)).max() < 0.01
        field = np.einsum('nij,nj->ni', matrix[:len(mag.samples)], rows(mag, 'magnetic_field'))
        assert np.abs(field - EARTH_FIELD_T).max() < 2e-7
        # Turning by the mean of two rates for 10 ms leads from one attitude to the next.
        rate = rows(imu, 'angular_velocity')
        change = np.einsum('nji,njk->nik', matrix[:-1], matrix[1:])
        turned = np.array([change[:, 2, 1] - change[:, 1, 2], change[:, 0, 2] - change[:, 2, 0],
                           change[:, 1, 0] - change[:, 0, 1]]).T / 2 / 0.01
        assert np.abs(turned - (rate[1:] + rate[:-1]) / 2).max() < 0.03
        assert np.abs(rate).max() > 0.3
        assert made.device.statistics().rejected_bytes == 0


def test_the_receiver_goes_round_in_a_circle(tmp_path: Path) -> None:
    settings = {'rate_hz': 5.0, 'radius_m': 10.0, 'speed_m_s': 2.0}
    with rig(tmp_path, SimulatedNmea, NmeaGps, sim=settings, baud=115200) as made:
        made.run(10_100, step_ms=10)
        fixes, times = made.publishers
        assert len(fixes.samples) == len(times.samples) == 51
        simulated: Any = made.simulated
        latitude = np.array([f.latitude for f in fixes.samples])
        longitude = np.array([f.longitude for f in fixes.samples])
        north = (latitude - simulated.settings['latitude_deg']) * 111_200
        east = (longitude - simulated.settings['longitude_deg']) * 111_300 * math.cos(
            math.radians(simulated.settings['latitude_deg']))
        assert np.hypot(north, east) == pytest.approx(10.0, abs=0.1)
        steps = np.hypot(np.diff(north), np.diff(east))
        assert steps == pytest.approx(0.4, abs=0.05)
        assert [t.time_ref.nanosec for t in times.samples[:3]] == [0, 200_000_000, 400_000_000]
        assert fixes.samples[0].altitude == pytest.approx(81.0)
        assert fixes.samples[1].position_covariance[[0, 4, 8]].tolist() == pytest.approx(
            [0.49, 0.64, 2.25])


def test_the_course_of_the_receiver_is_where_it_goes(tmp_path: Path) -> None:
    receiver = SimulatedNmea('x', {}, PtyPort(tmp_path / 'x'))
    for time_s in range(0, 130, 7):
        latitude, longitude, course = receiver.position(time_s)
        later, east_of, _ = receiver.position(time_s + 0.01)
        east = (east_of - longitude) * math.cos(math.radians(latitude))
        assert math.sin(math.radians(course) - math.atan2(east, later - latitude)) == (
            pytest.approx(0.0, abs=0.01))
        assert math.cos(math.radians(course) - math.atan2(east, later - latitude)) > 0
    assert b',1.94,' in receiver.sample(0.0)  # knots


@pytest.mark.parametrize('kind', [SimulatedWitMotion, SimulatedNmea])
def test_equal_seeds_give_equal_bytes(kind: type[SimulatedDevice], tmp_path: Path) -> None:
    def record(seed: int) -> list[bytes]:
        device = kind('x', {'seed': seed}, PtyPort(tmp_path / 'x'), 0)
        return [device.sample(i / 10) for i in range(20)]
    assert record(1) == record(1)
    assert kind is SimulatedNmea or record(1) != record(2)


@pytest.mark.parametrize('kind, driver, baud', BOTH)
def test_bytes_come_at_the_speed_of_the_line(
    kind: Any, driver: Any, baud: int | None, tmp_path: Path,
) -> None:
    with rig(tmp_path, kind, driver, baud=baud) as made:
        byte_ns = 10**10 // (baud or kind.BAUD)
        times: list[tuple[int, int]] = []
        made.run(100, each=lambda now: times.append((now, made.simulated.port.bytes_sent)))
        for now, sent in times:
            assert sent <= (now - START_NS) // byte_ns
        first = next(sent for _, sent in times if sent)
        assert first <= MS // byte_ns + 1


@pytest.mark.parametrize('kind, driver, baud', BOTH)
def test_samples_lie_on_a_grid_that_does_not_drift(
    kind: Any, driver: Any, baud: int | None, tmp_path: Path,
) -> None:
    # Called exactly when it says, with a line without a speed.
    with rig(tmp_path, kind, driver, baud=0, sim={'rate_hz': 7.0}) as made:
        due = []
        for _ in range(50):
            made.now_ns = made.simulated.next_event_ns()
            due.append(made.now_ns - START_NS)
            made.simulated.pump(made.now_ns)
            made.sync()
        period = round(10**9 / 7)
        assert due == [period * i for i in range(1, 51)]
        assert made.simulated.statistics().samples == 51


def test_after_a_long_stop_it_goes_on_at_the_present_time(tmp_path: Path) -> None:
    made = []

    class Counting(SimulatedWitMotion):
        def sample(self, time_s: float) -> bytes:
            made.append(time_s)
            return super().sample(time_s)

    device = Counting('x', {}, PtyPort(tmp_path / 'x'))
    device.pump(0)
    device.pump(3600 * 10**9)
    statistics = device.statistics()
    assert len(made) < 200
    assert statistics.samples + statistics.skipped_samples == 360_001
    assert statistics.samples < 200
    assert device.next_event_ns() <= 3600 * 10**9 + 10**7
    device.close()


# --- settings and commands -----------------------------------------------------------------------

def test_the_imu_obeys_the_commands_of_the_driver(tmp_path: Path) -> None:
    with rig(tmp_path, SimulatedWitMotion, WitMotion, sim={'rate_hz': 10.0}, configure=True,
             output_rate_hz=50.0) as made:
        made.run(1000, each=made.device.write)
        before = len(made.publishers[0].samples)
        made.run(1000, each=made.device.write)
        assert 49 <= len(made.publishers[0].samples) - before <= 51


def test_commands_without_unlocking_are_not_obeyed(tmp_path: Path) -> None:
    device = SimulatedWitMotion('x', {}, PtyPort(tmp_path / 'x'))
    device.handle_command(bytes.fromhex('ffaa030b00'))
    assert device.rate_hz == 100.0
    for part in (b'noise\xff', b'\xaa\x69\x88', b'\xb5\xff\xaa', b'\x03\x0b', b'\x00'):
        device.handle_command(part)
    assert device.rate_hz == 200.0
    device.handle_command(bytes.fromhex('ffaa02020 0'.replace(' ', '')))
    assert len(device.sample(0.0)) == 11


def test_a_line_too_slow_for_the_rate_is_refused(tmp_path: Path) -> None:
    device = SimulatedNmea('gps', {'rate_hz': 10.0}, PtyPort(tmp_path / 'x'))
    with pytest.raises(ConfigError, match='gps: rate_hz 10 needs .* has 9600: lower rate_hz'):
        device.pump(0)
    device.close()


def test_every_wrong_setting_is_told_at_once(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        SimulatedWitMotion('imu', {'rate': 3, 'rate_hz': 'fast', 'seed': 1.5},
                           PtyPort(tmp_path / 'x'))
    problems = '\n'.join(caught.value.problems)
    assert "imu: there is no setting 'rate'" in problems
    assert "imu: rate_hz is 'fast': it must be a number from 0.01 to 200" in problems
    assert 'imu: seed is 1.5: it must be an integer' in problems
    with pytest.raises(ConfigError, match='imu: fault .x. is not understood'):
        SimulatedWitMotion('imu', {'faults': ['x']}, PtyPort(tmp_path / 'x'))


def test_each_driver_has_its_simulated_device() -> None:
    assert SIMULATORS.load('witmotion') is SimulatedWitMotion
    assert SIMULATORS.load('nmea') is SimulatedNmea
    assert SIMULATORS.problems() == ()


@pytest.mark.filterwarnings('ignore:type old_imu')
def test_the_simulator_says_which_device_comes_from_a_group_that_goes(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(plugins, 'installed', lambda path: {
        'rt_robot_os.simulators': {'old_imu': 'rt_robot_os.devices.witmotion.simulated:'
                                              'SimulatedWitMotion'}})
    made = build_devices(argparse.Namespace(
        devices=['imu:old_imu'], dir=str(tmp_path), baud=[], rate=[], tcp=[], fault=[], seed=1))
    assert isinstance(made['imu'], SimulatedWitMotion)
    assert 'must name it in rt_robot_os.devices' in capsys.readouterr().err
