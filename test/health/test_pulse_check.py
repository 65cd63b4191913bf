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

"""Does the second opinion on a pulse agree, suspect, and say nothing where it knows nothing."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.health.pulse_check import PulseCheck
from rt_robot_os.testing import ModuleBench

pytest.importorskip('std_msgs.msg', reason='ROS 2 messages are not installed')

PACKET = 25


def wave(rate_per_min: float, number: int) -> Any:
    """Return a packet of a wave without end."""
    phase = (np.arange(PACKET) + PACKET * number) / 75.0 * rate_per_min / 60.0 % 1.0
    return 30_000 + 9_000 * np.exp(-((phase - 0.2) / 0.1) ** 2) - 1_000 * phase


def verdicts(rates: list[tuple[float, float]], seconds: float, missing: tuple[int, ...] = (),
             **settings: Any) -> tuple[list[str], list[float], Any]:
    """
    Return what is told each second, the rates of the wave, and the statistics.

    :param rates: of the wave and of the device, one after the other, each for its part of the
        time; NaN is a device without a value, or a wave that is noise.
    """
    chance = np.random.default_rng(4)
    with ModuleBench() as bench:
        pleth = bench.topic('oximeter/pleth', 'std_msgs/msg/UInt16MultiArray', {
            'layout.dim': 0, 'data': PACKET})
        device = bench.topic('oximeter/pulse_per_min', 'std_msgs/msg/Float64')
        dut = bench.add(PulseCheck, **settings)
        told = bench.watch('oximeter/pulse_check')
        own = bench.watch('oximeter/wave_pulse_per_min')
        texts: list[str] = []
        found: list[float] = []
        count = round(3 * seconds)
        for number in range(count):
            of_wave, of_device = rates[number * len(rates) // count]
            if number in missing:
                continue
            stamp_ns = NS_PER_S + number * NS_PER_S // 3

            def send(number: int = number, stamp_ns: int = stamp_ns, of_wave: float = of_wave,
                     of_device: float = of_device) -> None:
                if not math.isnan(of_device):
                    device.msg.data = of_device
                    device.publish(stamp_ns)
                pleth.msg.data[:] = chance.integers(0, 65535, PACKET) if math.isnan(
                    of_wave) else wave(of_wave, number)
                pleth.publish(stamp_ns)

            bench.at(0.01, send)
            bench.run(1.0 / 3.0)
            while told.take():
                texts.append(told.msg.data)
            while own.take():
                found.append(own.msg.data)
        return texts, found, dut.statistics()


def test_a_device_that_is_right_is_agreed_with() -> None:
    texts, rates, statistics = verdicts([(72, 72)], 16)
    assert len(texts) == 16
    assert texts[0] == 'unknown' and set(texts[10:]) == {'agrees'}
    assert rates == pytest.approx([72.0] * len(rates), abs=1.0) and len(rates) > 5
    assert statistics['warning'] == ''


def test_a_device_that_is_wrong_is_suspect_after_a_while_and_trusted_again() -> None:
    texts, _, _ = verdicts([(80, 40), (80, 80)], 48)
    suspect = 'suspect: the device reports 40/min and its wave shows 80/min'
    assert suspect not in texts[:18] and texts[22] == suspect
    assert texts[-1] == 'agrees'
    _, _, statistics = verdicts([(80, 40)], 24)
    assert statistics['warning'] == suspect.partition(': ')[2]


def test_a_wave_without_a_pulse_says_nothing_against_the_device() -> None:
    texts, rates, statistics = verdicts([(math.nan, 72)], 24)
    assert rates == [] and statistics['believed'] == 0
    assert all(each.startswith('unknown') for each in texts)
    assert texts[-1].partition(': ')[2] != ''


def test_a_device_without_a_value_is_no_disagreement() -> None:
    texts, rates, _ = verdicts([(72, math.nan)], 24)
    assert len(rates) > 10
    assert texts[-1] == 'unknown: the device reports no pulse'


def test_a_wave_with_a_gap_is_begun_anew() -> None:
    _, rates, statistics = verdicts([(72, 72)], 24, missing=(36, 37))
    assert statistics['gaps'] == 1
    # Ten seconds until it has a whole window, twice.
    assert len(rates) < 8
    assert rates == pytest.approx([72.0] * len(rates), abs=1.0)
