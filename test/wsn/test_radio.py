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

"""Compare the model of the radio with what was measured, and its times with the standard."""

from __future__ import annotations

import json
from random import Random
from statistics import fmean
from statistics import pstdev

import pytest

from rt_robot_os.features.wsn.radio.cc2420 import air_time_ns
from rt_robot_os.features.wsn.radio.cc2420 import is_received
from rt_robot_os.features.wsn.radio.cc2420 import lqi
from rt_robot_os.features.wsn.radio.cc2420 import reception_rate
from rt_robot_os.features.wsn.radio.cc2420 import transmit_current_ma
from rt_robot_os.features.wsn.radio.mac import TINYOS1
from rt_robot_os.features.wsn.radio.mac import TINYOS2
from rt_robot_os.features.wsn.radio.noise import closest_pattern
from rt_robot_os.features.wsn.radio.noise import heavy
from rt_robot_os.features.wsn.radio.noise import quiet
from rt_robot_os.features.wsn.radio.noise import read_trace
from rt_robot_os.features.wsn.radio.path_loss import Fading
from rt_robot_os.features.wsn.simulator.energy import Battery
from rt_robot_os.features.wsn.simulator.energy import PowerModel


def test_frames_take_as_long_as_250_kbit_per_second_needs():
    assert air_time_ns(31) == 1_184_000
    assert TINYOS1.air_time_ns(20, True) == 1_184_000
    assert TINYOS2.air_time_ns(27, True) == 1_472_000
    assert TINYOS2.ack_air_ns == 352_000


def test_reception_follows_the_signal_to_noise_ratio():
    assert reception_rate(4.6) == pytest.approx(0.5, abs=0.03)
    assert reception_rate(5.3) == pytest.approx(0.9, abs=0.02)
    assert reception_rate(6.0) == pytest.approx(0.99, abs=0.01)
    random = Random(1)
    for snr_db in (3.5, 4.6, 5.3, 7.0):
        share = fmean(is_received(snr_db, random.random()) for _ in range(4000))
        assert share == pytest.approx(reception_rate(snr_db), abs=0.03)
    assert is_received(8.0, 0.999999) and not is_received(2.9, 0.0)


def test_lqi_has_the_mean_and_the_spread_that_were_measured(data_dir):
    measured = json.loads((data_dir / 'wsn' / 'snr_to_lqi.json').read_text())['percent']
    for snr_db, percent in measured.items():
        total = sum(percent.values())
        mean = sum(int(value) * share for value, share in percent.items()) / total
        variance = sum((int(value) - mean) ** 2 * share
                       for value, share in percent.items()) / total
        values = [lqi(float(snr_db), step / 1000) for step in range(1000)]
        assert fmean(values) == pytest.approx(mean, abs=0.5), snr_db
        assert pstdev(values) == pytest.approx(variance ** 0.5, abs=0.6), snr_db


@pytest.mark.parametrize('name', ['casino-lab', 'meyer-heavy'])
def test_closest_patterns_are_as_loud_as_their_trace(data_dir, name):
    trace = read_trace(data_dir / 'wsn' / f'noise_{name}.txt.gz')[:20_000]
    series = closest_pattern(trace, Random(1), 20_000)
    for share in (0.1, 0.5, 0.9):
        place = int(share * 20_000)
        assert sorted(series)[place] == pytest.approx(sorted(trace)[place], abs=2)
    assert set(series) <= set(trace)


def test_noise_without_a_trace_is_quiet_or_heavy():
    still, loud = sorted(quiet(Random(1), 20_000)), sorted(heavy(Random(1), 20_000))
    assert still[10_000] == -98 and still[19_000] <= -96
    assert -95 <= loud[10_000] <= -84 and loud[19_600] > -60


@pytest.mark.parametrize(('text', 'message'), [
    ('-98\nx\n', 'line 2'), ('-98\n12\n', 'line 2'), ('-98\n' * 5, 'more than 20')])
def test_a_trace_that_is_none_is_refused(tmp_path, text, message):
    path = tmp_path / 'noise.txt'
    path.write_text(text)
    with pytest.raises(ValueError, match=message):
        read_trace(path)


def test_fading_stays_for_a_moment_and_is_another_later():
    fading = Fading(4.0, 10.0, Random(1))
    first = fading.at(1, 2, 0)
    assert fading.at(2, 1, 1_000_000) == first
    later = [fading.at(1, 2, step * 100_000_000_000) for step in range(1, 2000)]
    assert pstdev(later) == pytest.approx(4.0, abs=0.4)
    assert abs(fmean(later)) < 0.4


def test_sending_costs_what_the_data_sheet_says():
    assert transmit_current_ma(0) == 17.4
    assert transmit_current_ma(-25) == 8.5
    assert 8.5 < transmit_current_ma(-20) < 9.9


class Silent:
    """A radio that has sent nothing."""

    air_ns = sent_frames = received_frames = 0
    power_dbm = 0.0


def test_a_mote_that_always_listens_lives_for_about_115_hours():
    battery = Battery(PowerModel())
    battery.switch_on(0)
    hour_ns = 3_600_000_000_000
    assert battery.account(114 * hour_ns, Silent()) > 0
    assert battery.account(115 * hour_ns, Silent()) == 0
    assert battery.is_empty and battery.voltage_v == pytest.approx(1.8)


def test_low_power_listening_makes_it_months():
    battery = Battery(PowerModel(listening_share=0.03))
    battery.switch_on(0)
    day_ns = 24 * 3_600_000_000_000
    left = battery.account(100 * day_ns, Silent())
    assert 2500 * 50 / 158 < left < 2500 * 65 / 158
    assert 2.4 < battery.voltage_v < 2.7
    assert battery.raw_voltage == int(battery.voltage_v / 3 * 4096)
