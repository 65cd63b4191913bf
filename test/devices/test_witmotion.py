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

"""Does the WitMotion driver publish each instant once, at once, and in SI units."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from driver_contract import DriverContract
from driver_fakes import bind
from driver_fakes import read_all
from driver_fakes import scripted
from driver_fakes import settings_of
from imu_streams import ACC
from imu_streams import ACC_HALF
from imu_streams import ANGLE
from imu_streams import GYRO
from imu_streams import GYRO_HALF
from imu_streams import instant
from imu_streams import MAG
from imu_streams import MAG_SCALE_T
from imu_streams import numbers
from imu_streams import QUAT
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.devices.witmotion import wire
from rt_robot_os.devices.witmotion.driver import quaternion_from_angles
from rt_robot_os.devices.witmotion.driver import WitMotion
from rt_robot_os.devices.witmotion.wire import WitMotionDecoder
from rt_robot_os.sim.pty_port import PtyPort

MASKS = [(ACC, GYRO), (ACC, GYRO, ANGLE), (ACC, GYRO, ANGLE, MAG), (ACC, GYRO, MAG),
         (ACC, GYRO, ANGLE, MAG, QUAT), (ACC, GYRO, QUAT), (0x50, ACC, GYRO, ANGLE, 0x56, QUAT),
         (ANGLE,), (ACC,), (GYRO, ANGLE), (QUAT,)]


class TestWitMotion(DriverContract):
    driver = WitMotion
    stream = b''.join(b''.join(instant(n)) for n in range(1, 5))
    samples = 8
    tokens = (b'\x55', b'\x55\x51', *instant(7), bytes(instant(9)[2][:9]))
    # An eighth of the full scale is 2 g, 250 degrees a second and 22.5 degrees.
    vectors = ((2 * (wire.frame(ACC, 4096, -4096, 8192, 0)
                     + wire.frame(GYRO, -4096, 4096, 2048, 0)
                     + wire.frame(MAG, 100, -200, 300, 0)
                     + wire.frame(QUAT, 16384, -16384, 16384, 16384)), {
        'linear_acceleration.x': 19.6133, 'linear_acceleration.y': -19.6133,
        'linear_acceleration.z': 39.2266, 'angular_velocity.x': -4.36332,
        'angular_velocity.y': 4.36332, 'angular_velocity.z': 2.18166, 'magnetic_field.x': 1.5e-5,
        'magnetic_field.y': -3e-5, 'magnetic_field.z': 4.5e-5, 'orientation.w': 0.5,
        'orientation.x': -0.5, 'orientation.y': 0.5, 'orientation.z': 0.5}),)

    def decoder(self) -> Any:
        return WitMotionDecoder()

    def frame_size(self, frame: Any) -> int:
        return 11


@pytest.mark.parametrize('kinds', MASKS, ids=lambda k: '-'.join(f'{i:x}' for i in k))
def test_each_output_mask_gives_each_instant_once(kinds: tuple[int, ...]) -> None:
    count = 12
    stream = [b''.join(instant(n, kinds)) for n in range(1, count + 1)]
    with scripted(WitMotion, stream) as (device, (imu, mag)):
        read_all(device, count)
        # An instant that does not begin with 0x51 may be a rest when it is the first.
        first = 1 if ACC in kinds else 2
        assert numbers(imu) == list(range(first, count + 1))
        assert len(mag.samples) == (count if MAG in kinds else 0)
        assert device.statistics().lost_samples == 0


def test_a_sample_is_published_with_its_last_frame_and_not_later() -> None:
    chunks = [b''.join(instant(1) + instant(2)), *instant(3)]
    with scripted(WitMotion, chunks) as (device, (imu, _)):
        device.read(1)
        assert numbers(imu) == [1, 2]
        for _ in range(4):
            device.read(1)
            assert len(imu.samples) == 2
        device.read(1)
        assert numbers(imu) == [1, 2, 3]


def test_the_stamp_is_the_arrival_of_the_first_frame_of_the_instant() -> None:
    with scripted(WitMotion, [b''.join(instant(1)), *instant(2)]) as (device, (imu, mag)):
        for now in range(100, 700, 100):
            device.read(now)
        assert imu.stamps == [100, 200]
        assert mag.stamps == [100, 200]


def test_units_axes_and_covariances() -> None:
    data = b''.join((
        wire.acceleration_frame(1.0, -2.0, 9.8), wire.angular_velocity_frame(0.1, -0.2, 3.0),
        wire.angle_frame(0.1, -0.2, 3.0),
        wire.magnetic_field_frame(2e-5, -1e-6, -4e-5, MAG_SCALE_T)))
    with scripted(WitMotion, [data * 2], acceleration_stddev=0.5, angular_velocity_stddev=0.25,
                  roll_pitch_stddev=0.1, yaw_stddev=2.0,
                  mag_stddev_t=1e-6) as (device, publishers):
        device.read(1)
        sample, field = publishers[0].samples[-1], publishers[1].samples[-1]
    acceleration = sample.linear_acceleration
    assert (acceleration.x, acceleration.y, acceleration.z) == pytest.approx(
        (1.0, -2.0, 9.8), abs=ACC_HALF)
    rate = sample.angular_velocity
    assert (rate.x, rate.y, rate.z) == pytest.approx((0.1, -0.2, 3.0), abs=GYRO_HALF)
    q = sample.orientation
    assert (q.x, q.y, q.z, q.w) == pytest.approx(quaternion_from_angles(0.1, -0.2, 3.0), abs=1e-4)
    assert (field.magnetic_field.x, field.magnetic_field.y, field.magnetic_field.z) == (
        pytest.approx((2e-5, -1e-6, -4e-5), abs=MAG_SCALE_T / 2))
    assert sample.linear_acceleration_covariance.tolist() == [.25, 0, 0, 0, .25, 0, 0, 0, .25]
    assert sample.angular_velocity_covariance.tolist() == [.0625, 0, 0, 0, .0625, 0, 0, 0, .0625]
    assert sample.orientation_covariance == pytest.approx([.01, 0, 0, 0, .01, 0, 0, 0, 4])
    assert field.magnetic_field_covariance == pytest.approx(
        [1e-12, 0, 0, 0, 1e-12, 0, 0, 0, 1e-12])


def test_angles_turn_in_the_order_yaw_pitch_roll() -> None:
    # Yaw by 90 degrees, then pitch: the device's x axis points north and then down.
    x, y, z, w = quaternion_from_angles(0.0, math.radians(30), math.radians(90))
    ahead = (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y))
    assert ahead == pytest.approx((0.0, math.cos(math.radians(30)), -0.5), abs=1e-12)


def test_without_orientation_its_covariance_says_so() -> None:
    with scripted(WitMotion, [b''.join(instant(1, (ACC, GYRO)) * 2)]) as (device, (imu, _)):
        device.read(1)
        sample = imu.samples[0]
        assert sample.orientation_covariance.tolist() == [-1] + [0] * 8
        q = sample.orientation
        assert (q.x, q.y, q.z, q.w) == (0, 0, 0, 1)


@pytest.mark.parametrize('order, expected', [
    ('wxyz', (0.5, -0.5, 0.5, 0.5)), ('xyzw', (0.5, 0.5, -0.5, 0.5))])
def test_the_order_of_the_quaternion_is_a_setting(order: str, expected: Any) -> None:
    frames = [*instant(1, (ACC, GYRO)), wire.frame(QUAT, 16384, 16384, -16384, 16384)]
    with scripted(WitMotion, [b''.join(frames * 2)], quaternion_order=order) as (device, (imu, _)):
        device.read(1)
        q = imu.samples[0].orientation
        assert (q.x, q.y, q.z, q.w) == pytest.approx(expected)


def test_an_empty_quaternion_is_no_orientation() -> None:
    frames = [*instant(1, (ACC, GYRO)), wire.frame(QUAT, 0, 0, 0, 0)]
    with scripted(WitMotion, [b''.join(frames * 2)]) as (device, (imu, _)):
        device.read(1)
        assert imu.samples[0].orientation_covariance[0] == -1


def test_without_a_mag_topic_nothing_but_imu_is_published() -> None:
    with scripted(WitMotion, [b''.join(instant(1) * 3)], mag_topic='') as (device, publishers):
        assert device.read(1) == 3
        assert len(publishers) == 1
        assert device.statistics().ignored_frames == 3


def test_configuring_sends_unlock_outputs_and_rate_one_at_a_time() -> None:
    with scripted(WitMotion, [], configure=True, baud=115200, output_rate_hz=200.0) as (device, _):
        port: Any = device._port
        device.write(0)
        device.write(1)
        assert port.written == [bytes.fromhex('ffaa6988b5')]
        for now in range(100_000_000, 1_000_000_000, 100_000_000):
            device.write(now)
        assert port.written[1:] == [bytes.fromhex('ffaa021e02'), bytes.fromhex('ffaa030b00')]


def test_nothing_is_sent_to_the_device_by_default(tmp_path: Path) -> None:
    port = PtyPort(tmp_path / 'imu')
    port.plug()
    device = WitMotion('imu', settings_of(WitMotion, port=str(port.link)))
    bind(device)
    device.open()
    device.write(1)
    assert port.read() == b''
    device.close()
    port.unplug()


def test_a_line_too_slow_for_the_rate_is_refused_with_both_numbers() -> None:
    with pytest.raises(ConfigError, match='imu: output_rate_hz 200 needs 110000 .* has 9600'):
        WitMotion('imu', settings_of(
            WitMotion, port='x', baud=9600, output_rate_hz=200.0, configure=True))


def test_the_frames_used_are_those_of_the_format() -> None:
    assert (wire.ACCELERATION, wire.ANGULAR_VELOCITY, wire.ANGLE, wire.MAGNETIC_FIELD,
            wire.QUATERNION) == (ACC, GYRO, ANGLE, MAG, QUAT)
