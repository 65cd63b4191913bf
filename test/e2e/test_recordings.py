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

"""Recorded bytes go through a pty, the core and DDS, and arrive complete and unchanged."""

from __future__ import annotations

from collections.abc import Callable
import csv
import math
from pathlib import Path
from typing import Any

from processes import TIMEOUT_S
import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from rclpy.qos import QoSDurabilityPolicy  # noqa: E402, I100
from rclpy.qos import QoSProfile  # noqa: E402
from rt_robot_os.devices.witmotion.wire import acceleration_frame  # noqa: E402
from rt_robot_os.devices.witmotion.wire import angular_velocity_frame  # noqa: E402
from rt_robot_os.devices.witmotion.wire import magnetic_field_frame  # noqa: E402
from rt_robot_os.link import LinkClient  # noqa: E402
from rt_robot_os.sim.pty_port import PtyPort  # noqa: E402
from sensor_msgs.msg import Imu  # noqa: E402
from sensor_msgs.msg import MagneticField  # noqa: E402
from sensor_msgs.msg import NavSatFix  # noqa: E402
from sensor_msgs.msg import NavSatStatus  # noqa: E402

pytestmark = pytest.mark.one_build

Until = Callable[..., Any]
G = 9.80665
HALF = 0.51  # of a least significant bit, with room for the rounding of floats

STATUS = {0: NavSatStatus.STATUS_NO_FIX, 1: NavSatStatus.STATUS_FIX,
          2: NavSatStatus.STATUS_SBAS_FIX, 3: NavSatStatus.STATUS_FIX,
          4: NavSatStatus.STATUS_GBAS_FIX, 5: NavSatStatus.STATUS_GBAS_FIX,
          9: NavSatStatus.STATUS_SBAS_FIX}


def robot_yaml(device: str, mirrors: str) -> str:
    return f"""
robot:
  ros__parameters:
    core: {{cpu: -2, scheduler_priority: 0}}
    devices: [recorded]
    recorded: {{{device}}}
    mirrors: [{', '.join(line.split(':')[0].strip() for line in mirrors.splitlines())}]
    {mirrors}
"""


def valid_sentences(path: Path) -> list[list[str]]:
    """Split a log into the fields of its sentences, by plain string handling."""
    found = []
    for line in path.read_text(errors='replace').splitlines():
        body, star, check = line.strip().removeprefix('$').partition('*')
        value = 0
        for character in body:
            value ^= ord(character)
        if line.startswith('$') and star and check.strip().upper() == f'{value:02X}':
            found.append(body.split(','))
    return found


def degrees(text: str, hemisphere: str) -> float:
    value = int(float(text) / 100)
    value_deg = value + (float(text) - 100 * value) / 60
    return -value_deg if hemisphere in 'SW' else value_deg


def expected_fixes(path: Path) -> list[tuple[int, float, float]]:
    """Give status, latitude and longitude of each GGA; of no satellites is no fix."""
    fixes = []
    for fields in valid_sentences(path):
        if fields[0][2:] != 'GGA':
            continue
        quality = int(fields[6] or 0) if int(fields[7] or 0) else 0  # no satellite, no fix
        status = STATUS.get(quality, NavSatStatus.STATUS_NO_FIX)
        if status == NavSatStatus.STATUS_NO_FIX:
            fixes.append((status, math.nan, math.nan))
        else:
            fixes.append((status, degrees(fields[2], fields[3]), degrees(fields[4], fields[5])))
    return fixes


def same(a: float, b: float) -> bool:
    return math.isclose(a, b, abs_tol=1e-9) or (math.isnan(a) and math.isnan(b))


# Whoever is found late gets what came before: discovery is not what is tested here.
KEPT = QoSProfile(depth=20000, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
IN_FLIGHT_BYTES = 3000  # a pty holds 4095, and a full one loses what comes then


def device_of(core: LinkClient) -> dict[str, Any]:
    device, = core.statistics().devices
    return device


def feed(port: PtyPort, data: bytes, until: Until, core: LinkClient,
         arrived: Callable[[], int]) -> None:
    """Send bytes through a pty as fast as they arrive on the other side, on any machine."""
    port.plug()
    until(lambda: device_of(core)['state'] == 'opening' and port.has_reader(), 'an open port')
    sent = 0
    while sent < len(data):
        room = until(lambda: IN_FLIGHT_BYTES - (sent - arrived()), 'room for more bytes')
        port.write(data[sent:sent + room])
        sent = min(len(data), sent + room)
    assert port.bytes_dropped == 0


@pytest.mark.parametrize('log', ['ublox-neo-m9n-nmea.log', 'haicom-305N.log', 'telit-he910.log'])
def test_a_gps_log_arrives_with_the_same_positions_status_and_count(
        world: Any, until: Until, data_dir: Path, log: str) -> None:
    expected = expected_fixes(data_dir / 'gps' / log)
    fixes = world.listen(NavSatFix, '/gps/fix', KEPT)
    port = PtyPort(world.folder / 'gps')
    robot = world.robot(robot_yaml(
        f'type: nmea, port: {port.link}, baud: 0, rate_hz: 200.0, timeout_s: 60.0, depth: 1024, '
        'retry_s: 0.05, retry_max_s: 0.1',
        'gps_fix: {topic: gps/fix, depth: 1000, durability: transient_local}'))
    robot.wait_for_line('connected to the core')
    with LinkClient(world.folder / 'robot.sock', 'feeder', timeout_s=TIMEOUT_S) as core:
        feed(port, (data_dir / 'gps' / log).read_bytes(), until, core,
             lambda: device_of(core)['device']['bytes_read'])
    until(lambda: len(fixes) >= len(expected), f'{len(expected)} fixes')
    port.unplug()
    got = [(m.status.status, m.latitude, m.longitude) for m in list(fixes)]
    assert len(got) == len(expected)
    for ours, theirs in zip(got, expected):
        assert ours[0] == theirs[0] and same(ours[1], theirs[1]) and same(ours[2], theirs[2])


Sample = tuple[float, ...]


def recorded_imu(path: Path, count: int) -> list[Sample]:
    """Give acceleration in m/s^2, angular velocity in rad/s and field in T."""
    with path.open() as lines:
        rows = list(csv.reader(lines))[1:count + 1]
    return [
        (*(float(v) * G for v in row[4:7]), *(math.radians(float(v)) for v in row[1:4]),
         *(float(v) * 1e-6 for v in row[7:10])) for row in rows]


SAMPLE_BYTES = 33
RESOLUTION = (16 * G / 32768, math.radians(2000 / 32768), 1.5e-7)


def near(a: Any, b: Sample, resolution: float) -> bool:
    return all(abs(x - y) <= HALF * resolution for x, y in zip((a.x, a.y, a.z), b))


def imu_yaml(port: Path) -> str:
    kept = 'depth: 10000, durability: transient_local'
    return robot_yaml(
        f'type: witmotion, port: {port}, baud: 0, rate_hz: 400.0, depth: 1024, timeout_s: 60.0, '
        f'retry_s: 0.05, retry_max_s: 0.1, output_rate_hz: 100.0',
        f'imu_data: {{topic: imu/data, {kept}}}\n    imu_mag: {{topic: imu/mag, {kept}}}')


def imu_bytes(recorded: list[Sample]) -> bytes:
    return b''.join(
        acceleration_frame(*r[:3]) + angular_velocity_frame(*r[3:6])
        + magnetic_field_frame(*r[6:], scale_t=1.5e-7) for r in recorded)


@pytest.mark.parametrize(('count', 'played'), [(150, True), (5000, False)],
                         ids=['played at 100 Hz', 'as fast as it arrives'])
def test_the_imu_recording_arrives_in_order_with_no_sample_lost(
        world: Any, until: Until, data_dir: Path, count: int, played: bool) -> None:
    recorded = recorded_imu(data_dir / 'imu' / 'xio_sensor_data.csv', count)
    imu = world.listen(Imu, '/imu/data', KEPT)
    mag = world.listen(MagneticField, '/imu/mag', KEPT)
    port = PtyPort(world.folder / 'imu')
    robot = world.robot(imu_yaml(port.link))
    robot.wait_for_line('connected to the core')
    if played:
        log = world.folder / 'imu.yaml'  # whatever its name, the leftovers do not count it
        log.write_bytes(imu_bytes(recorded))
        world.play(log, port.link, '--baud', str(100 * SAMPLE_BYTES * 10))
    else:
        with LinkClient(world.folder / 'robot.sock', 'feeder', timeout_s=TIMEOUT_S) as core:
            feed(port, imu_bytes(recorded), until, core,
                 lambda: SAMPLE_BYTES * min(len(imu), len(mag)))
    until(lambda: len(imu) >= len(recorded) and len(mag) >= len(recorded),
          f'{len(recorded)} samples')
    port.unplug()
    assert len(imu) == len(mag) == len(recorded)
    for message, sample in zip(list(imu), recorded):
        assert near(message.linear_acceleration, sample[:3], RESOLUTION[0])
        assert near(message.angular_velocity, sample[3:6], RESOLUTION[1])
        assert message.orientation_covariance[0] == -1
    for field, sample in zip(list(mag), recorded):
        assert near(field.magnetic_field, sample[6:], RESOLUTION[2])
