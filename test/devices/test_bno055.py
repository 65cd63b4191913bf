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

"""Does the BNO055 driver set the device up, ask one thing at a time, and publish in SI units."""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import Any

from driver_contract import DriverContract
from driver_fakes import scripted
import pytest
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.bno055 import wire
from rt_robot_os.devices.bno055.driver import Bno055
from rt_robot_os.devices.bno055.wire import Bno055Decoder

MS = 1_000_000
CHIP = wire.data_answer(b'\xa0')
DONE = wire.status_answer(1)
SETUP = CHIP + 6 * DONE


def answer(number: int, **other: Any) -> bytes:
    return wire.data_answer(wire.block(
        (1.0, 2.0, 9.0 + number / 100), (2e-5, -1e-5, 4e-5), (10.0, -20.0, 30.0),
        other.pop('quaternion', (0.5, 0.5, -0.5, 0.5)), **other))


class TestBno055(DriverContract):
    driver = Bno055
    stream = SETUP + b''.join(answer(n) for n in range(4))
    samples = 12
    tokens = (b'\xbb', b'\xbb\x2e', b'\xee', CHIP, DONE, wire.status_answer(7),
              wire.status_answer(4), answer(5))
    # As the device sends it: 16 bits each, little-endian, 1/100 m/s^2, 1/16 uT, 1/16 deg/s, 2^-14.
    vectors = ((SETUP + wire.data_answer(bytes.fromhex(
        '9CFF C800 D503  A000 60FF 4001  1000 E0FF 3000  0000 0000 0000  0020 00E0 0020 0020'
        '0000 0000 0000  0000 0000 0000  19 FF')), {
            'linear_acceleration.x': -1.0, 'linear_acceleration.y': 2.0,
            'linear_acceleration.z': 9.81, 'magnetic_field.x': 1e-5, 'magnetic_field.y': -1e-5,
            'magnetic_field.z': 2e-5, 'angular_velocity.x': math.radians(1),
            'angular_velocity.y': math.radians(-2), 'angular_velocity.z': math.radians(3),
            'orientation.w': 0.5, 'orientation.x': -0.5, 'orientation.y': 0.5,
            'orientation.z': 0.5}),)

    def decoder(self) -> Any:
        return Bno055Decoder()

    def frame_size(self, frame: Any) -> int:
        return 2 + len(frame.data)

    def covered(self, frame: bytes) -> tuple[int, ...]:
        return ()  # it has no checksum


def test_units_and_covariances() -> None:
    with scripted(Bno055, [SETUP + answer(0, temperature_c=-4)], acceleration_stddev=0.5,
                  yaw_stddev=2.0, roll_pitch_stddev=0.1) as (device, (imu, mag, temperature)):
        assert device.read(1) == 3
    message = imu.samples[0]
    a, w, q = message.linear_acceleration, message.angular_velocity, message.orientation
    assert (a.x, a.y, a.z) == pytest.approx((1.0, 2.0, 9.0))
    assert (w.x, w.y, w.z) == pytest.approx([math.radians(v) for v in (10, -20, 30)])
    assert (q.x, q.y, q.z, q.w) == (0.5, -0.5, 0.5, 0.5)
    m = mag.samples[0].magnetic_field
    assert (m.x, m.y, m.z) == pytest.approx((2e-5, -1e-5, 4e-5))
    assert (temperature.samples[0].temperature, temperature.samples[0].variance) == (-4.0, 1.0)
    assert message.orientation_covariance == pytest.approx([.01, 0, 0, 0, .01, 0, 0, 0, 4])
    assert message.linear_acceleration_covariance[0] == 0.25


@pytest.mark.parametrize('mode, calibration, variance', [
    ('ndof', 0x3F, math.pi ** 2), ('ndof', 0x40, 0.01), ('imu', 0x00, 0.01)])
def test_heading_is_unknown_until_the_device_is_calibrated(
        mode: str, calibration: int, variance: float) -> None:
    with scripted(Bno055, [SETUP + answer(0, calibration=calibration)], mode=mode,
                  yaw_stddev=0.1) as (device, (imu, *_)):
        device.read(1)
        assert imu.samples[0].orientation_covariance[8] == pytest.approx(variance)


def test_before_fusion_begins_there_is_no_orientation() -> None:
    chunks = [SETUP + answer(0, quaternion=(0, 0, 0, 0), calibration=0)]
    with scripted(Bno055, chunks) as (device, (imu, *_)):
        device.read(1)
        assert imu.samples[0].orientation_covariance.tolist() == [-1] + [0] * 8


def test_topics_may_be_left_out() -> None:
    with scripted(Bno055, [SETUP + answer(0)], mag_topic='') as (device, publishers):
        assert device.read(1) == 2
        assert [p.publication.message for p in publishers] == [
            'sensor_msgs/msg/Imu', 'sensor_msgs/msg/Temperature']
    with scripted(Bno055, [SETUP + answer(0)], temperature_topic='') as (device, publishers):
        assert device.read(1) == 2
        assert publishers[1].publication.message == 'sensor_msgs/msg/MagneticField'


def drive(
    answers: Callable[[int, bytes], bytes], times: range, **changes: Any,
) -> tuple[Any, list[tuple[int, str]]]:
    """
    Write and read at each time; what is asked is answered before the next time.

    :return: the device, and what it sent when, in hex.
    """
    sent: list[tuple[int, str]] = []
    with scripted(Bno055, [], **changes) as (device, _):
        port: Any = device._port
        for now in times:
            device.write(now)
            device.read(now + 1)
            for data in port.written:
                sent.append((now // MS, data.hex()))
                port._left.append(answers(len(sent), data))
            port.written.clear()
        return device, sent


def handle_command(number: int, request: bytes) -> bytes:
    """Answer as the device does."""
    if request[1] == wire.WRITE:
        return DONE
    return CHIP if request[2] == 0 else answer(number)


def test_the_set_up_is_one_step_at_a_time_with_the_pauses_of_the_data_sheet() -> None:
    _, sent = drive(handle_command, range(0, 300 * MS, 5 * MS), mode='imu')
    assert [data for _, data in sent[:8]] == [
        'aa010001', 'aa003d0100', 'aa00070100', 'aa003b0180', 'aa003e0100', 'aa003f0100',
        'aa003d0108', 'aa01082e']
    times = [at for at, _ in sent]
    assert times[2] - times[1] >= 19  # to configuration mode
    assert times[7] - times[6] >= 7  # and back
    assert {b - a for a, b in zip(times[7:], times[8:])} == {10}


def test_at_most_one_request_is_under_way() -> None:
    def mute(number: int, request: bytes) -> bytes:
        return b'' if number > 7 else handle_command(number, request)

    device, sent = drive(mute, range(0, 500 * MS, 5 * MS))
    # Each is given up after its time, and counted.
    asked = [at for at, data in sent if data == 'aa01082e']
    assert len(asked) > 3
    assert all(b - a >= 50 for a, b in zip(asked, asked[1:]))
    assert device.statistics().lost_samples == len(asked) - 1


def test_an_overrun_is_asked_again_at_once_and_the_grid_stays() -> None:
    def overrun(number: int, request: bytes) -> bytes:
        return wire.status_answer(7) if number == 9 else handle_command(number, request)

    device, sent = drive(overrun, range(0, 200 * MS, 5 * MS))
    times = [at for at, data in sent if data == 'aa01082e']
    assert [b - a for a, b in zip(times, times[1:])][:5] == [10, 5, 5, 10, 10]
    assert device.statistics().lost_samples == 0


def test_an_overrun_while_it_is_set_up_is_asked_again() -> None:
    def overrun(number: int, request: bytes) -> bytes:
        return wire.status_answer(7) if number in (1, 3, 4) else handle_command(number, request)

    _, sent = drive(overrun, range(0, 300 * MS, 5 * MS))
    assert [data for _, data in sent[:5]] == [
        'aa010001', 'aa010001', 'aa003d0100', 'aa003d0100', 'aa003d0100']
    assert 'aa01082e' in [data for _, data in sent]


def test_another_refusal_is_counted_and_asked_again_in_time() -> None:
    def refuse(number: int, request: bytes) -> bytes:
        return wire.status_answer(2) if number == 9 else handle_command(number, request)

    device, sent = drive(refuse, range(0, 200 * MS, 5 * MS))
    times = [at for at, data in sent if data == 'aa01082e']
    assert {b - a for a, b in zip(times, times[1:])} == {10}
    assert device.statistics().contradicted_samples == 1


def test_a_wrong_chip_id_is_told() -> None:
    with pytest.raises(DeviceError, match='dut: chip id 0x55 is not that of a BNO055 .0xa0.'):
        drive(lambda number, request: wire.data_answer(b'\x55'), range(0, 500 * MS, 10 * MS))


def test_a_device_that_refuses_is_told_with_what_it_said() -> None:
    def refuse(number: int, request: bytes) -> bytes:
        return CHIP if number == 1 else wire.status_answer(3)

    with pytest.raises(DeviceError, match='dut: it does not do configuration mode .write failed, '
                                          '0x03; 5 tries.: check both wires'):
        drive(refuse, range(0, 5000 * MS, 10 * MS))


def test_a_device_that_does_not_answer_is_told() -> None:
    with pytest.raises(DeviceError, match='dut: it does not answer the request for its chip id'):
        drive(lambda number, request: b'', range(0, 5000 * MS, 10 * MS))
