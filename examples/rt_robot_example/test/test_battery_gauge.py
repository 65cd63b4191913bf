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

"""Tests of the driver: the bytes of the gauge, and any others on the line."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from rt_robot_example.battery_gauge.driver import BatteryGauge
from rt_robot_example.battery_gauge.simulated import SimulatedBatteryGauge
from rt_robot_example.battery_gauge.wire import encode
from rt_robot_example.battery_gauge.wire import FRAME_BYTES
from rt_robot_example.battery_gauge.wire import GaugeDecoder
from rt_robot_example.battery_gauge.wire import is_gauge
from rt_robot_example.battery_gauge.wire import Reading
from rt_robot_os.testing import DriverContract
from rt_robot_os.testing import rig
from rt_robot_os.testing import scripted


class TestBatteryGauge(DriverContract):
    """The contract of all drivers: every split of the stream, any bytes, unplugging."""

    driver = BatteryGauge
    stream = encode(12.34, 1.2, 73) + encode(11.0, -2.5, 40) + encode(9.9, -10.0, 3)
    samples = 3
    tokens = (b'$', b'$B12.34,', b'*5A\r\n', b'\r\n')
    vectors = ((b'$B12.34,-01.20,073*5C\r\n', {'voltage': 12.34, 'current': -1.2}),)

    def decoder(self) -> GaugeDecoder:
        return GaugeDecoder()

    def frame_size(self, frame: Reading) -> int:
        return FRAME_BYTES


def test_a_reading_of_the_data_sheet() -> None:
    with scripted(BatteryGauge, [b'$B12.34,-01.20,073*5C\r\n'], capacity_ah=2.2) as (
            device, (publisher,)):
        assert device.read(1_000_000_000) == 1
    message = publisher.samples[0]
    assert message.voltage == pytest.approx(12.34)
    assert message.current == pytest.approx(-1.2)
    assert message.percentage == pytest.approx(0.73)
    assert message.design_capacity == pytest.approx(2.2)
    assert math.isnan(message.temperature)
    assert message.power_supply_status == 2


def test_a_wrong_checksum_is_counted_and_not_published() -> None:
    with scripted(BatteryGauge, [b'$B12.34,-01.20,073*5D\r\n']) as (device, (publisher,)):
        assert device.read(1_000_000_000) == 0
        assert device.statistics().rejected_frames == 1


def test_other_drivers_identify_its_bytes() -> None:
    assert is_gauge(encode(12.34, 1.2, 73)[5:] + encode(11.0, -2.5, 40))
    assert not is_gauge(b'$GPGSV,1,1,00*79\r\n' * 3)


def test_the_simulated_gauge_is_discharged(tmp_path: Path) -> None:
    with rig(tmp_path, SimulatedBatteryGauge, BatteryGauge,
             sim={'period_s': 4.0, 'rate_hz': 10.0}) as test:
        test.run(2000)
        voltages = [sample.voltage for sample in test.publishers[0].samples]
    assert len(voltages) == 20
    assert voltages[0] == pytest.approx(12.6, abs=0.1)
    assert voltages[-1] == pytest.approx(9.6, abs=0.1)


def test_it_resynchronises_after_garbage_on_the_line(tmp_path: Path) -> None:
    with rig(tmp_path, SimulatedBatteryGauge, BatteryGauge,
             sim={'faults': ['garbage at 0.5 for 0.5']}) as test:
        test.run(2000)
        statistics = test.device.statistics()
    assert statistics.rejected_bytes > 0
    assert statistics.samples >= 14
