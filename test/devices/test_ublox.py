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

"""Does the u-blox driver publish position, velocity and time by the rules of the messages."""

from __future__ import annotations

from datetime import datetime
from datetime import timezone
import math
from typing import Any

from driver_contract import DriverContract
from driver_fakes import scripted
import pytest
from rt_robot_os.devices.nmea import wire as nmea
from rt_robot_os.devices.ublox import wire
from rt_robot_os.devices.ublox.driver import Ublox
from rt_robot_os.devices.ublox.wire import SYNC
from rt_robot_os.devices.ublox.wire import UbxDecoder
from test_ublox_decoder import FROM_PYUBX2

NOON = datetime(2026, 1, 1, 12, tzinfo=timezone.utc)
NOON_S = int(NOON.timestamp())


def pvt(number: int = 0, **changes: Any) -> bytes:
    values: dict[str, Any] = {'velocity_m_s': (1.0, -2.0, 0.5), **changes}
    return wire.make_nav_pvt(values.pop('time', NOON), 52.5 + number / 1000, 13.25, 81.0, **values)


class TestUblox(DriverContract):
    driver = Ublox
    stream = nmea.sentence('GPGSV,1,1,00').join(pvt(n) for n in range(4))
    samples = 12
    tokens = (b'\xb5', SYNC, SYNC + b'\x01\x07\x5c\x00', pvt(7), wire.acknowledge(6, 1), b'$GP',
              nmea.sentence('GPGSV,1,1,00'), wire.message(1, 7, bytes(84)))
    pending_limit = 3000
    # The receiver tells its velocity north, east, down.
    vectors = ((FROM_PYUBX2, {
        'latitude': 52.5163456, 'longitude': -13.3777123, 'altitude': 81.234,
        'twist.twist.linear.x': 2.5, 'twist.twist.linear.y': -1.5,
        'twist.twist.linear.z': 0.3}),)
    # The message says so where there is no fix.
    unknown = ('latitude', 'longitude', 'altitude')

    def decoder(self) -> Any:
        return UbxDecoder()

    def frame_size(self, frame: Any) -> int:
        return int(frame.size)


def publish(data: bytes, **changes: Any) -> Any:
    with scripted(Ublox, [data], **changes) as (device, publishers):
        device.read(1)
        return [p.samples for p in publishers]


def test_position_velocity_and_time_of_one_epoch() -> None:
    fix, velocity, time = publish(
        pvt(horizontal_m=2.0, vertical_m=3.0, speed_accuracy_m_s=0.25),
        services=['gps', 'galileo'])
    assert (fix[0].status.status, fix[0].status.service) == (0, 1 | 8)
    assert (fix[0].latitude, fix[0].longitude, fix[0].altitude) == pytest.approx(
        (52.5, 13.25, 81.0))
    assert fix[0].position_covariance.tolist() == pytest.approx([4, 0, 0, 0, 4, 0, 0, 0, 9])
    assert fix[0].position_covariance_type == 2
    linear = velocity[0].twist.twist.linear
    assert (linear.x, linear.y, linear.z) == pytest.approx((1.0, -2.0, 0.5))
    assert velocity[0].twist.covariance[[0, 7, 14, 21, 28, 35]].tolist() == pytest.approx(
        [0.0625] * 3 + [-1] * 3)
    assert (time[0].time_ref.sec, time[0].time_ref.nanosec) == (NOON_S, 0)


@pytest.mark.parametrize('changes', [
    {'flags': 0}, {'fix_type': 0}, {'fix_type': 1}, {'fix_type': 5}, {'flags3': 1}],
    ids=['not ok', 'none', 'dead reckoning', 'time only', 'invalid'])
def test_what_is_no_fix(changes: Any) -> None:
    fix, velocity, time = publish(pvt(**changes))
    assert fix[0].status.status == -1
    assert all(math.isnan(v) for v in (fix[0].latitude, fix[0].longitude, fix[0].altitude))
    assert (fix[0].position_covariance_type, fix[0].position_covariance.any()) == (0, False)
    assert (velocity, len(time)) == ([], 1)


@pytest.mark.parametrize('flags, status', [(0x01, 0), (0x03, 1), (0x43, 2), (0x81, 2)])
def test_the_quality_of_a_fix(flags: int, status: int) -> None:
    assert publish(pvt(flags=flags))[0][0].status.status == status


def test_a_fix_of_two_dimensions_has_no_altitude() -> None:
    fix = publish(pvt(fix_type=2))[0][0]
    assert fix.latitude == pytest.approx(52.5) and math.isnan(fix.altitude)


@pytest.mark.parametrize('horizontal_m', [0.0, 4294967.295])
def test_an_accuracy_that_is_not_known(horizontal_m: float) -> None:
    fix = publish(pvt(horizontal_m=horizontal_m))[0][0]
    assert (fix.position_covariance_type, fix.position_covariance.any()) == (0, False)


@pytest.mark.parametrize('changes, expected', [
    ({'nano': -250}, (NOON_S - 1, 999_999_750)),
    ({'nano': 999_999_999}, (NOON_S, 999_999_999)),
    ({'valid': 0x03}, None), ({'valid': 0}, None),
    ({'time': datetime(2106, 3, 1, tzinfo=timezone.utc)}, None)])
def test_the_time(changes: Any, expected: Any) -> None:
    times = publish(pvt(**changes))[2]
    assert [(t.time_ref.sec, t.time_ref.nanosec) for t in times] == [expected] * (
        expected is not None)


def test_a_date_that_does_not_exist_is_none() -> None:
    frame, = UbxDecoder().feed(pvt())
    payload = bytearray(frame.payload)
    payload[6] = 13
    fix, _, time = publish(wire.message(1, 7, bytes(payload)))
    assert (len(fix), time) == (1, [])


def test_topics_may_be_left_out() -> None:
    assert len(publish(pvt(), time_topic='', velocity_topic='')) == 1
    fix, time = publish(pvt(), velocity_topic='')
    assert len(time) == 1 and hasattr(time[0], 'time_ref')
