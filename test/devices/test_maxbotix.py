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

"""Does the MaxBotix driver publish distances in metres, by the rules of REP 117."""

from __future__ import annotations

import math
from typing import Any

from driver_contract import DriverContract
from driver_fakes import scripted
from driver_fakes import settings_of
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.maxbotix.driver import MaxBotix
from rt_robot_os.devices.maxbotix.wire import MaxBotixDecoder
from rt_robot_os.devices.maxbotix.wire import reading


class TestMaxBotix(DriverContract):
    driver = MaxBotix
    stream = b'R0480\rR1234 P1\rR0300 \rR5000\rR9999 P0\r' + b''.join(
        reading(1000 + n) for n in range(4))
    samples = 9
    tokens = (b'R', b'\r', b'R1234', b'R12', b'R1234 P0\r', b'R123\r', b' P')
    unknown = ('range',)  # REP 117

    def decoder(self) -> Any:
        return MaxBotixDecoder()

    def frame_size(self, frame: Any) -> int:
        return int(frame.size)

    def covered(self, frame: bytes) -> tuple[int, ...]:
        return ()  # it has no checksum

    def test_it_finds_its_way_out_of_garbage(self) -> None:
        # Readings are so short that garbage before one takes it along when it ends in R.
        decoder = MaxBotixDecoder()
        frames = decoder.feed(b'R\xffR12R\r\x00R0480\rR048R0500\r0500\r')
        assert [f.value for f in frames] == [480, 500]


def ranges(data: bytes, **changes: Any) -> list[float]:
    with scripted(MaxBotix, [data], **changes) as (device, (publisher,)):
        device.read(1)
        return [s.range for s in publisher.samples]


def test_a_reading_of_the_data_sheet() -> None:
    with scripted(MaxBotix, [b'R0480\r'], range_stddev_m=0.5, field_of_view_rad=0.25) as (
            device, (publisher,)):
        device.read(1)
        message = publisher.samples[0]
    assert message.range == pytest.approx(0.48)
    assert (message.radiation_type, message.field_of_view, message.variance) == (0, 0.25, 0.25)
    assert (message.min_range, message.max_range) == (0.3, 5.0)


@pytest.mark.parametrize('unit, data, expected', [
    ('mm', b'R1500\rR0300\rR0301\rR5000\rR9999\r',
     [1.5, -math.inf, 0.301, math.inf, math.inf]),
    ('cm', b'R150\rR020\rR400\rR501\rR765\r', [1.5, -math.inf, 4.0, math.inf, math.inf]),
    ('inch', b'R100\rR006\rR190\rR255\r', [2.54, -math.inf, 4.826, math.inf])])
def test_units_and_what_is_too_near_or_too_far(
        unit: str, data: bytes, expected: list[float]) -> None:
    assert ranges(data, unit=unit) == pytest.approx(expected)


def test_readings_without_a_target_are_a_setting() -> None:
    assert ranges(b'R4000\rR4100\r', no_target=[4100]) == pytest.approx([4.0, math.inf])


def test_readings_of_another_unit_are_none_and_told_when_they_go_on() -> None:
    with scripted(MaxBotix, [b'R123\r', b'R1234\r', b'R123\rR124\rR125\r']) as (device, (out,)):
        for now in range(2):
            device.read(now)
            device.write(now)
        assert len(out.samples) == 1
        device.read(2)
        with pytest.raises(DeviceError, match='dut: it sends 3 digits, which is not mm: '
                                              'set unit: cm or inch'):
            device.write(3)
        assert device.statistics().contradicted_samples == 4


def test_limits_that_contradict_each_other_are_refused() -> None:
    with pytest.raises(ConfigError, match='sonar: maximum_m 1 must be above minimum_m 2'):
        MaxBotix('sonar', settings_of(MaxBotix, port='x', minimum_m=2.0, maximum_m=1.0))


@pytest.mark.parametrize('data', [b'R12\r', b'R12345\r', b'R12a4\r', b'1234\r', b'R1234\n',
                                  b'R1234 P\r', b'R1234 PX\r'])
def test_what_is_no_reading(data: bytes) -> None:
    decoder = MaxBotixDecoder()
    assert decoder.feed(data + bytes(10)) == []
    assert decoder.rejected_bytes == len(data) + 10
