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

"""Does the Hokuyo driver publish scans by the rules of REP 103 and 117, and check the device."""

from __future__ import annotations

import math
from typing import Any

from driver_contract import DriverContract
from driver_fakes import scripted
from driver_fakes import settings_of
import numpy as np
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.hokuyo import wire
from rt_robot_os.devices.hokuyo.driver import Hokuyo
from rt_robot_os.devices.hokuyo.wire import checksum
from rt_robot_os.devices.hokuyo.wire import ScipDecoder

MS = 1_000_000
SMALL = {'first_step': 380, 'last_step': 403}
ECHO = wire.scan_command(380, 403)


def scan(number: int, count: int = 24) -> bytes:
    return wire.scan(ECHO, number * 100, [1000 + number * 100 + i for i in range(count)])


def parameters(**changes: Any) -> bytes:
    values: dict[str, Any] = {
        'first_step': 44, 'last_step': 725, 'steps_per_turn': 1024, 'front_step': 384,
        'minimum_mm': 20, 'maximum_mm': 5600, 'rpm': 600, 'model': 'URG-04LX'}
    return wire.parameters(**{**values, **changes})


SETUP = wire.answer(b'QT') + parameters() + wire.answer(ECHO)


class TestHokuyo(DriverContract):
    driver = Hokuyo
    changes = SMALL
    stream = SETUP + b''.join(scan(n) for n in range(4))
    samples = 4
    tokens = (b'\n', b'\n\n', b'MD', ECHO, b'\n99b\n', b'00P\n', scan(5), scan(6, 23),
              wire.answer(b'QT'), wire.answer(ECHO, 4), parameters(front_step=1))
    pending_limit = 6001
    unknown = ('ranges',)  # REP 117

    def decoder(self) -> Any:
        return ScipDecoder()

    def frame_size(self, frame: Any) -> int:
        return int(frame.size)

    def covered(self, frame: bytes) -> range:
        return range(frame.index(b'\n') + 1, len(frame))  # the echo has no sum

    def test_it_finds_its_way_out_of_garbage(self) -> None:
        values, _, statistics = self.run([b'\x00\xff' * 250 + self.stream + b'\x00\xff' * 250
                                          + scan(1) + scan(2)])
        # Rubbish before an echo is passed over; behind an answer it is part of the next block.
        assert len(values[0]) == 6
        assert statistics.rejected_bytes == 1000


def test_angles_times_and_ranges() -> None:
    distances = [0, 1, 7, 19, 20, 1000, 5600, 5601, 65533] + [2000] * 673
    data = SETUP + wire.scan(wire.scan_command(44, 725), 5, distances)
    with scripted(Hokuyo, [data]) as (device, (publisher,)):
        assert device.read(1) == 1
        message = publisher.samples[0]
    assert message.angle_increment == pytest.approx(2 * math.pi / 1024)
    assert message.angle_min == pytest.approx(math.radians(-119.53), abs=1e-4)
    assert message.angle_max == pytest.approx(math.radians(119.88), abs=1e-4)
    assert message.angle_min + 340 * message.angle_increment == pytest.approx(0.0, abs=1e-9)
    assert (message.scan_time, message.time_increment) == pytest.approx((0.1, 0.1 / 1024))
    assert (message.range_min, message.range_max) == (0.02, 5.6)
    assert message.ranges.size == 682
    expected = [math.inf, math.nan, math.nan, math.nan, 0.02, 1.0, 5.6, math.inf, math.inf, 2.0]
    assert np.allclose(message.ranges[:10], expected, equal_nan=True)


@pytest.mark.parametrize(('changes', 'no_echo'), [
    ({}, {0}), ({'steps_per_turn': 1440}, {1}), ({'no_echo_codes': [0, 1, 6]}, {0, 1, 6})])
def test_only_the_code_without_an_echo_is_free(changes: dict[str, Any], no_echo: set[int]) -> None:
    codes = list(range(20))
    settings = {**SMALL, 'last_step': SMALL['first_step'] + 19, 'configure': False, **changes}
    data = wire.scan(wire.scan_command(settings['first_step'], settings['last_step']), 1, codes)
    with scripted(Hokuyo, [data], **settings) as (device, (publisher,)):
        assert device.read(1) == 1
        found = publisher.samples[0].ranges
    assert {code for code in codes if found[code] == math.inf} == no_echo
    assert {code for code in codes if math.isnan(found[code])} == {*codes} - no_echo


def test_the_latency_is_taken_off_the_stamp() -> None:
    with scripted(Hokuyo, [SETUP + scan(1)], latency_s=0.05, **SMALL) as (device, (publisher,)):
        device.read(1000 * MS)
        assert publisher.stamps == [950 * MS]


def test_scans_of_another_size_are_counted_and_not_published() -> None:
    with scripted(Hokuyo, [SETUP + scan(1, 23) + scan(2)], **SMALL) as (device, (publisher,)):
        assert device.read(1) == 1
        assert device.statistics().contradicted_samples == 1


def drive(chunks: list[bytes], **changes: Any) -> list[bytes]:
    with scripted(Hokuyo, chunks, **{**SMALL, **changes}) as (device, _):
        port: Any = device._port
        for now in range(0, (len(chunks) + 1) * 100 * MS, 100 * MS):
            device.write(now)
            device.read(now + 1)
        return list(port.written)


def test_the_device_is_stopped_checked_and_told_to_scan() -> None:
    # It scans still when it is told to stop.
    chunks = [scan(1) + wire.answer(b'QT'), parameters(), wire.answer(ECHO), scan(2)]
    assert drive(chunks) == [b'QT\n', b'PP\n', b'MD0380040300000\n']


def test_without_configure_nothing_is_sent_and_scans_are_published() -> None:
    with scripted(Hokuyo, [scan(1)], configure=False, **SMALL) as (device, (publisher,)):
        device.write(0)
        assert device.read(1) == 1
        port: Any = device._port
        assert port.written == []


@pytest.mark.parametrize('changes, message', [
    ({'steps_per_turn': 1440, 'front_step': 540, 'model': 'UTM-30LX'},
     'it is UTM-30LX, so set steps_per_turn: 1440, front_step: 540'),
    ({'last_step': 400}, 'it is URG-04LX, so set last_step: 400'),
    ({'first_step': 390}, 'it is URG-04LX, so set first_step: 390')])
def test_settings_of_another_product_are_told(changes: Any, message: str) -> None:
    with pytest.raises(DeviceError, match=f'dut: the settings do not fit: {message}'):
        drive([wire.answer(b'QT'), parameters(**changes), b''])


def test_a_refused_scan_is_told() -> None:
    with pytest.raises(DeviceError, match='dut: it refuses MD with status 04: check first_step'):
        drive([wire.answer(b'QT'), parameters(), wire.answer(ECHO, 4), b''])


def test_a_scanner_that_stops_is_told() -> None:
    with pytest.raises(DeviceError, match='dut: it stopped with status 52: it may be blocked'):
        drive([SETUP, scan(1), wire.answer(ECHO, 52), b''])


@pytest.mark.parametrize('changes', [
    {'first_step': 10, 'last_step': 10}, {'first_step': 0, 'last_step': 1024}])
def test_steps_that_cannot_be_are_refused(changes: Any) -> None:
    with pytest.raises(ConfigError, match='laser: first_step .* and last_step .*: the last must'):
        Hokuyo('laser', settings_of(Hokuyo, port='x', **changes))


@pytest.mark.parametrize('digits', [10, 4301, 5000])
def test_a_parameter_of_thousands_of_digits_is_none(digits: int) -> None:
    # Python refuses to read a number of more than 4300 digits.
    line = b'AMIN:' + b'9' * digits + b';'
    line += bytes((checksum(line[:-1]),))
    answer = b'PP\n00P\n' + line + b'\n\n'
    with scripted(Hokuyo, [wire.answer(b'QT') + answer + wire.answer(ECHO) + scan(1)],
                  **SMALL) as (device, (publisher,)):
        assert device.read(1) == 1
        assert device.statistics().frames == 4
