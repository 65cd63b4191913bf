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

"""High precision: NAV-HPPOSLLH and NAV-PVT of one epoch are one fix, whatever is missing."""

from __future__ import annotations

from datetime import datetime
from datetime import timedelta
from datetime import timezone
from pathlib import Path
import random
from typing import Any

from driver_fakes import scripted
import pytest
from rt_robot_os.devices.ublox import wire
from rt_robot_os.devices.ublox import wire as ubx
from rt_robot_os.devices.ublox.driver import Ublox
from rt_robot_os.devices.ublox.simulated import SimulatedUblox
from rt_robot_os.testing import rig

MS = 1_000_000
NOON = datetime(2026, 1, 1, 12, tzinfo=timezone.utc)
LATITUDE, LONGITUDE, HEIGHT = 52.123456789, -12.345678912, 81.2343
# Made with pyubx2 1.4.0: iTOW 216600000, hp lon -12, lat 89, height 3, hAcc 14.2, vAcc 21.3 mm.
VECTOR = bytes.fromhex('b5620114240000000000c00de90ceb32a4f88768111f523d0100409c0000'
                       'f45903fc8e000000d5000000eeca')


def pvt(number: int = 0, **changes: Any) -> bytes:
    return wire.make_nav_pvt(
        NOON + timedelta(seconds=number), LATITUDE, LONGITUDE, HEIGHT, **changes)


def precise(number: int = 0, **changes: Any) -> bytes:
    return wire.make_nav_hpposllh(
        NOON + timedelta(seconds=number), LATITUDE, LONGITUDE, HEIGHT, **changes)


def fixes(chunks: list[bytes], step_ns: int = 0, **changes: Any) -> tuple[list[Any], list[int],
                                                                          Any]:
    with scripted(Ublox, chunks, high_precision=True, **changes) as (device, publishers):
        for i in range(len(chunks)):
            device.read(1 + i * step_ns)
        return publishers[0].samples, publishers[0].stamps, device.statistics()


def test_the_message_is_read_as_others_write_it() -> None:
    frame, = ubx.UbxDecoder().feed(VECTOR)
    assert ubx.high_precision(frame.payload) == ubx.HighPrecision(
        216600000, True, -12345678912, 52123456789, 812343, 142, 213)


def test_the_message_is_written_as_it_is_read() -> None:
    chance = random.Random(3)
    for _ in range(200):
        latitude, longitude = chance.uniform(-90, 90), chance.uniform(-180, 180)
        height = chance.uniform(-500, 9000)
        frame, = ubx.UbxDecoder().feed(wire.make_nav_hpposllh(NOON, latitude, longitude, height))
        found = ubx.high_precision(frame.payload)
        assert found is not None
        assert (found.latitude, found.longitude, found.height) == (
            round(latitude * 1e9), round(longitude * 1e9), round(height * 1e4))


@pytest.mark.parametrize('data', [pvt() + precise(), precise() + pvt()], ids=['after', 'before'])
def test_a_fix_has_nine_decimals_and_the_accuracy_of_its_message(data: bytes) -> None:
    fix, = fixes([data])[0]
    assert fix.latitude == pytest.approx(LATITUDE, abs=6e-10)
    assert fix.longitude == pytest.approx(LONGITUDE, abs=6e-10)
    assert fix.altitude == pytest.approx(HEIGHT, abs=6e-5)
    assert fix.position_covariance[[0, 4, 8]].tolist() == pytest.approx(
        [0.014 ** 2] * 2 + [0.021 ** 2])
    assert fix.position_covariance_type == 2


def test_messages_of_different_epochs_are_not_mixed() -> None:
    samples, _, statistics = fixes([pvt(0) + precise(1) + pvt(2) + pvt(3) + precise(3)])
    assert [round(s.position_covariance[0], 6) for s in samples] == [2.25, 2.25, 0.000196]
    assert statistics.more['fixes_without_high_precision'] == 2


def test_a_fix_whose_other_message_is_lost_comes_within_half_a_period() -> None:
    samples, stamps, statistics = fixes([pvt(), b'', b'', b''], step_ns=200 * MS)
    assert (len(samples), stamps) == (1, [1])
    assert samples[0].position_covariance[0] == pytest.approx(2.25)
    assert statistics.samples == 3  # velocity and time did not wait


@pytest.mark.parametrize('data', [pvt() + precise(invalid=True),
                                  pvt() + wire.message(1, 0x14, bytes(35)),
                                  pvt() + wire.message(1, 0x14, b'\1' + bytes(35))],
                         ids=['invalid', 'short', 'version'])
def test_what_is_no_precise_position_does_not_replace_one(data: bytes) -> None:
    samples, _, _ = fixes([data, b'', b'', b''], step_ns=200 * MS)
    assert samples[0].position_covariance[0] == pytest.approx(2.25)


def test_without_a_fix_nothing_is_waited_for() -> None:
    samples, _, _ = fixes([pvt(flags=0)])
    assert samples[0].status.status == -1


def test_the_twin_sends_both_once_it_was_asked(tmp_path: Path) -> None:
    with rig(tmp_path, SimulatedUblox, Ublox, configure=True, high_precision=True,
             output_rate_hz=5.0) as made:
        made.run(4000, each=lambda now_ns: made.device.write(now_ns)
                 if now_ns % (20 * MS) == 0 else None)
        last = made.publishers[0].samples[-5:]
        assert all(s.position_covariance[0] == pytest.approx(0.014 ** 2) for s in last)
        assert len({s.latitude for s in last}) == 5
