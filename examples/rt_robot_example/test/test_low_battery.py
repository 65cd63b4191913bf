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

"""Tests of the report of a low battery, on the virtual clock, without waiting."""

from __future__ import annotations

from rt_robot_example.low_battery import LowBattery
from rt_robot_os.testing import ModuleBench

BATTERY = ('battery', 'sensor_msgs/msg/BatteryState')


def published(voltages: list[float], **settings: float) -> list[bool]:
    """Return what the module publishes after each of some readings, one per second."""
    with ModuleBench() as bench:
        gauge = bench.topic(*BATTERY)
        bench.add(LowBattery, rate_hz=1.0, **settings)
        low = bench.watch('battery/low')
        for second, voltage in enumerate(voltages):
            def publish(voltage: float = voltage) -> None:
                gauge.msg.voltage = voltage
                gauge.publish()

            bench.at(second, publish)
        bench.run(len(voltages))
        found = []
        while low.take():
            found.append(bool(low.msg.data))
        return found


def test_nothing_is_published_before_the_first_reading() -> None:
    assert published([]) == []


def test_a_short_dip_is_not_an_empty_battery() -> None:
    assert published([12.0, 9.0, 9.0, 12.0, 9.0], hold_s=3.0) == [False] * 5


def test_a_battery_that_stays_low_is_reported_and_that_remains() -> None:
    assert published([12.0, 9.0, 9.0, 9.0, 12.0], hold_s=2.0) == [False, False, True, True, True]


def test_the_limit_changes_while_it_runs() -> None:
    with ModuleBench() as bench:
        gauge = bench.topic(*BATTERY)
        module = bench.add(LowBattery, rate_hz=10.0, limit_v=9.0, hold_s=0.0)
        low = bench.watch('battery/low')
        gauge.msg.voltage = 10.0
        for second in range(3):
            bench.at(second, gauge.publish)
        bench.at(1.5, lambda: module.change('limit_v', 11.0))
        bench.run(1.9)
        assert low.latest() and not low.msg.data
        bench.at(0.0, gauge.publish)
        bench.run(1.0)
        assert low.latest() and low.msg.data
