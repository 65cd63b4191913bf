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

"""Does the Xsens driver publish what the device measured, and set it up when asked."""

from __future__ import annotations

import math
import struct
from typing import Any

from driver_contract import DriverContract
from driver_fakes import read_all
from driver_fakes import scripted
from driver_fakes import settings_of
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.xsens import mtdata2
from rt_robot_os.devices.xsens import wire
from rt_robot_os.devices.xsens.driver import Xsens
from rt_robot_os.devices.xsens.wire import XbusDecoder
from test_xsens_decoder import RECORDED

MS = 1_000_000


def sample(counter: int, *, status: int = 3, **other: Any) -> bytes:
    """Make a measurement; a value of None leaves its item out."""
    values = {'quaternion': (0.5, 0.5, 0.5, 0.5), 'acceleration': (1.0, 2.0, 3.0 + counter),
              'rate': (0.1, 0.2, 0.3), 'field': (0.5, -0.25, 1.0), **other}
    items = [(mtdata2.PACKET_COUNTER, struct.pack('>H', counter)),
             (mtdata2.STATUS_WORD, struct.pack('>I', status))]
    kinds = {'quaternion': mtdata2.QUATERNION, 'acceleration': mtdata2.ACCELERATION,
             'rate': mtdata2.RATE_OF_TURN, 'field': mtdata2.MAGNETIC_FIELD}
    items += [(kinds[name], wire.reals(v)) for name, v in values.items() if v is not None]
    return wire.mtdata2(items)


class TestXsens(DriverContract):
    driver = Xsens
    # The recorded counter is far from those of the samples: the device began anew.
    stream = b''.join(sample(n) for n in range(1, 5)) + RECORDED
    samples = 10
    tokens = (b'\xfa', b'\xfa\xff', b'\xfa\xff\x36', sample(7), wire.message(0x36, bytes(9)),
              wire.message(wire.ERROR, b'\x21'), wire.message(0x31))
    pending_limit = 2100
    vectors = ((sample(1, quaternion=(0.5, -0.5, 0.5, 0.5)), {
        'linear_acceleration.x': 1.0, 'linear_acceleration.y': 2.0, 'linear_acceleration.z': 4.0,
        'angular_velocity.x': 0.1, 'angular_velocity.y': 0.2, 'angular_velocity.z': 0.3,
        'magnetic_field.x': 0.5 * 4.9e-5, 'magnetic_field.y': -0.25 * 4.9e-5,
        'magnetic_field.z': 4.9e-5, 'orientation.w': 0.5, 'orientation.x': -0.5,
        'orientation.y': 0.5, 'orientation.z': 0.5}),)

    def decoder(self) -> Any:
        return XbusDecoder()

    def frame_size(self, frame: Any) -> int:
        return int(frame.size)


def test_units_axes_and_covariances() -> None:
    with scripted(Xsens, [sample(1)], acceleration_stddev=0.5, mag_unit_t=4e-5,
                  roll_pitch_stddev=0.1, yaw_stddev=2.0) as (device, (imu, mag)):
        assert device.read(1) == 2
        message, field = imu.samples[0], mag.samples[0]
    q, a, w = message.orientation, message.linear_acceleration, message.angular_velocity
    assert (q.x, q.y, q.z, q.w) == (0.5, 0.5, 0.5, 0.5)
    assert (a.x, a.y, a.z) == (1.0, 2.0, 4.0)
    assert (w.x, w.y, w.z) == pytest.approx((0.1, 0.2, 0.3))
    m = field.magnetic_field
    assert (m.x, m.y, m.z) == pytest.approx((2e-5, -1e-5, 4e-5))
    assert message.linear_acceleration_covariance.tolist() == [.25, 0, 0, 0, .25, 0, 0, 0, .25]
    assert message.orientation_covariance == pytest.approx([.01, 0, 0, 0, .01, 0, 0, 0, 4])


@pytest.mark.parametrize('changes', [
    {'quaternion': None}, {'status': 1}, {'quaternion': (0, 0, 0, 0)},
    {'quaternion': (math.nan, 0, 0, 1)}], ids=['none', 'filter not valid', 'empty', 'nan'])
def test_without_an_orientation_to_rely_on_its_covariance_says_so(changes: Any) -> None:
    with scripted(Xsens, [sample(1, **changes)]) as (device, (imu, _)):
        device.read(1)
        assert imu.samples[0].orientation_covariance.tolist() == [-1] + [0] * 8
        assert imu.samples[0].linear_acceleration_covariance[0] > 0


@pytest.mark.parametrize('status, valid', [(0x00, False), (0x01, False), (0x02, True),
                                           (0x07, True), (0xFD, False)])
def test_a_status_byte_says_as_much_as_a_status_word(status: int, valid: bool) -> None:
    data = wire.mtdata2([
        (mtdata2.STATUS_BYTE, bytes((status,))),
        (mtdata2.QUATERNION, wire.reals((1.0, 0.0, 0.0, 0.0))),
        (mtdata2.ACCELERATION, wire.reals((0.0, 0.0, 9.81)))])
    with scripted(Xsens, [data]) as (device, (imu, _)):
        assert device.read(1) == 1
    assert (imu.samples[0].orientation_covariance[0] > 0) == valid
    assert imu.samples[0].linear_acceleration_covariance[0] > 0


def test_numbers_that_are_none_count_as_absent() -> None:
    with scripted(Xsens, [sample(1, rate=(math.inf, 0, 0))]) as (device, (imu, _)):
        device.read(1)
        assert imu.samples[0].angular_velocity_covariance[0] == -1


def test_lost_messages_are_counted_by_the_packet_counter() -> None:
    numbers = (65534, 65535, 0, 1, 4, 5, 30000, 30001)
    with scripted(Xsens, [b''.join(map(sample, numbers))]) as (device, _):
        device.read(1)
        assert device.statistics().lost_samples == 2


def test_field_alone_and_messages_without_use() -> None:
    alone = sample(1, quaternion=None, acceleration=None, rate=None)
    nothing = sample(2, quaternion=None, acceleration=None, rate=None, field=None)
    with scripted(Xsens, [alone + nothing]) as (device, (imu, mag)):
        assert device.read(1) == 1
        assert (len(imu.samples), len(mag.samples)) == (0, 1)
        assert device.statistics().ignored_frames == 1


# --- set-up --------------------------------------------------------------------------------------

ACKS = {name: wire.message(mid + 1) for name, mid in (
    ('config', wire.GO_TO_CONFIG), ('outputs', wire.SET_OUTPUT_CONFIGURATION),
    ('measure', wire.GO_TO_MEASUREMENT))}


def outputs(rate: int, *left_out: int) -> bytes:
    kinds = (mtdata2.QUATERNION, mtdata2.ACCELERATION, mtdata2.RATE_OF_TURN,
             mtdata2.MAGNETIC_FIELD)
    return wire.message(wire.SET_OUTPUT_CONFIGURATION + 1, wire.output_configuration(
        [(k, rate) for k in kinds if k not in left_out]))


def test_setting_up_waits_for_each_acknowledgement_and_then_publishes() -> None:
    chunks = [sample(1), b'', ACKS['config'], outputs(100), sample(2) + ACKS['measure'], sample(3)]
    with scripted(Xsens, chunks, configure=True) as (device, _):
        port: Any = device._port
        published = []
        for now in range(0, 600 * MS, 100 * MS):
            device.write(now)
            published.append(device.read(now + 1))
        sent = [data[2] for data in port.written]
        assert sent == [0x30, 0x30, 0xC0, 0x10]
        assert published == [0, 0, 0, 0, 0, 2]
        assert wire.read_output_configuration(port.written[2][4:-1]) == (
            (0x1020, 0xFFFF), (0x1060, 0xFFFF), (0xE020, 0xFFFF),
            (0x2010, 100), (0x4020, 100), (0x8020, 100), (0xC020, 100))


@pytest.mark.parametrize('answer, message', [
    (outputs(50), 'of orientation at 100 Hz it sends 50 Hz: set output_rate_hz: 50'),
    (outputs(100, mtdata2.QUATERNION), 'has no orientation: set orientation: false'),
    (outputs(100, mtdata2.MAGNETIC_FIELD), 'sends 0 Hz: choose another product'),
    (wire.message(wire.ERROR, b'\x21'), 'refuses SetOutputConfiguration with error 0x21'),
    (wire.message(wire.ERROR), 'error 0x00')])
def test_what_the_product_cannot_do_is_told_with_the_remedy(answer: bytes, message: str) -> None:
    with scripted(Xsens, [ACKS['config'], answer], configure=True) as (device, _):
        device.write(0)
        device.read(1)
        device.write(2)
        device.read(3)
        assert not device.is_set_up()
        with pytest.raises(DeviceError, match=f'dut: .*{message}'):
            device.write(4)


def test_no_answer_at_all_is_told_after_some_tries() -> None:
    with scripted(Xsens, [sample(n) for n in range(9)], configure=True) as (device, _):
        with pytest.raises(DeviceError, match='dut: it does not answer GoToConfig .5 tries.: '
                                              'check the wire'):
            for now in range(0, 2000 * MS, 100 * MS):
                device.write(now)
                device.read(now)


def test_nothing_is_sent_by_default() -> None:
    with scripted(Xsens, [sample(1)] * 3) as (device, _):
        for now in range(0, 1000 * MS, 100 * MS):
            device.write(now)
        port: Any = device._port
        assert port.written == []
        assert read_all(device, 3) == 6


@pytest.mark.parametrize('changes, message', [
    ({'output_rate_hz': 400.0}, 'output_rate_hz 400 needs 352000 baud and the line has 115200'),
    ({'output_rate_hz': 12.5}, 'output_rate_hz 12.5 cannot be configured: .* integer')])
def test_rates_that_cannot_be_are_refused(changes: Any, message: str) -> None:
    with pytest.raises(ConfigError, match=f'imu: {message}'):
        Xsens('imu', settings_of(Xsens, port='x', configure=True, **changes))
    Xsens('imu', settings_of(Xsens, port='x', **changes))
