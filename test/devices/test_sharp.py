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

"""Does the Sharp driver turn voltages into distances, and know what it is connected to."""

from __future__ import annotations

import math
from typing import Any

from driver_contract import DriverContract
from driver_fakes import scripted
from driver_fakes import settings_of
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.nmea.wire import NmeaDecoder
from rt_robot_os.devices.nmea.wire import sentence
from rt_robot_os.devices.sharp.driver import Sharp
from rt_robot_os.devices.sharp.wire import adc


class TestSharp(DriverContract):
    driver = Sharp
    stream = b''.join(adc(0, 500 + 100 * n) for n in range(12))
    samples = 12
    tokens = (b'$', b'$PADC,', adc(0, 1000), adc(1, 1000), adc(0, 99999), b'*00\r\n',
              sentence('PADC,0,-5'), sentence('PADC,0'), sentence('GPGSV,1,1,00'))

    def decoder(self) -> Any:
        return NmeaDecoder()

    def frame_size(self, frame: Any) -> int:
        return len(frame.sentence)


def ranges(data: bytes, **changes: Any) -> list[float]:
    with scripted(Sharp, [data], **{'median': 1, **changes}) as (device, (publisher, *_)):
        device.read(1)
        return [s.range for s in publisher.samples]


def test_the_sentence_is_that_of_the_page() -> None:
    assert adc(0, 1300) == b'$PADC,0,1300*24\r\n'


@pytest.mark.parametrize('model, distance_m', [('gp2y0a21', 0.202), ('gp2y0a02', 0.445)])
def test_the_usual_fits(model: str, distance_m: float) -> None:
    assert ranges(adc(0, 1300), model=model) == pytest.approx([distance_m], abs=0.0006)


def test_a_fit_of_ones_own() -> None:
    assert ranges(adc(0, 2000), model='custom', coefficient_m=0.5, exponent=-1.0) == [0.25]


def test_beyond_its_range_is_infinite() -> None:
    found = ranges(adc(0, 3000) + adc(0, 0) + adc(0, 1) + adc(0, 400) + adc(0, 1000), lowest_mv=0)
    assert found == pytest.approx([-math.inf, math.inf, math.inf, math.inf, 0.27728])


def test_the_message_says_what_it_is() -> None:
    with scripted(Sharp, [adc(0, 1000)], range_stddev_m=0.1) as (device, (publisher,)):
        device.read(1)
        message = publisher.samples[0]
    assert (message.radiation_type, message.min_range, message.max_range) == (1, 0.1, 0.8)
    assert message.variance == pytest.approx(0.01)


def test_the_median_of_the_last_readings_is_published() -> None:
    spikes = b''.join(adc(0, v) for v in (1000, 1000, 3000, 1000, 1000, 500, 500, 500))
    near = ranges(adc(0, 1000))[0]
    found = ranges(spikes, median=3)
    assert found[:6] == [near] * 6
    assert found[6:] == [pytest.approx(0.639, abs=0.001)] * 2


@pytest.mark.parametrize('lowest_mv', [1, 100])
def test_a_broken_wire_is_no_reading(lowest_mv: int) -> None:
    data = adc(0, 0) + adc(0, lowest_mv - 1) + adc(0, lowest_mv)
    with scripted(Sharp, [data], lowest_mv=lowest_mv) as (device, (publisher,)):
        assert device.read(1) == 1
        assert len(publisher.samples) == 1
        assert device.statistics().contradicted_samples == 2


def test_voltages_that_cannot_be_are_counted_and_not_published() -> None:
    with scripted(Sharp, [adc(0, 9000) + adc(0, 1000)]) as (device, (publisher,)):
        assert device.read(1) == 1
        assert device.statistics().contradicted_samples == 1


def test_several_channels_have_topics_and_frames_of_their_own() -> None:
    data = adc(0, 1000) + adc(7, 2000) + adc(1, 500)
    with scripted(Sharp, [data], channels=[7, 0], frame_id='ir') as (device, publishers):
        assert device.read(1) == 2
        assert [p.publication.topic for p in publishers] == ['range_7', 'range_0']
        assert [p.publication.fixed['header.frame_id'] for p in publishers] == ['ir_7', 'ir_0']
        assert [len(p.samples) for p in publishers] == [1, 1]
        assert device.statistics().ignored_frames == 1


@pytest.mark.parametrize('data, message', [
    (adc(3, 1000), 'it sends channel 3 and none of .0.: set channels'),
    (sentence('GPGSV,1,1,00'), 'it sends GPGSV sentences and no readings: it is another device')])
def test_what_is_not_the_converter_is_told(data: bytes, message: str) -> None:
    with scripted(Sharp, [data * 9, data]) as (device, _):
        device.read(1)
        device.write(1)
        assert not device.is_set_up()
        device.read(2)
        with pytest.raises(DeviceError, match=f'dut: {message}'):
            device.write(2)


@pytest.mark.parametrize('channels', [[], [1, 1]])
def test_channels_are_named_once(channels: list[int]) -> None:
    with pytest.raises(ConfigError, match='ir: channels .*: name each channel once'):
        Sharp('ir', settings_of(Sharp, port='x', channels=channels))
