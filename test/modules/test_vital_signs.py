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

"""The module of vital signs: which readings are values, which sensor counts, and what is told."""

from __future__ import annotations

import json
import math
from typing import Any

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.health.assessment import Assessment
from rt_robot_os.features.health.sensor_source import Change
from rt_robot_os.features.health.sensor_source import SensorSource
from rt_robot_os.features.health.sensor_source import Times
from rt_robot_os.features.health.vital_signs import VitalSigns
from rt_robot_os.messages.cause import Level
from rt_robot_os.messages.signs import SIGNS
from rt_robot_os.testing.fakes import settings_of
from rt_robot_os.testing.module_bench import ModuleBench
from sensed_person import every_second
from sensed_person import Person

PULSE = 'wsn/wrist/pulse_per_min'
SPO2 = 'wsn/wrist/spo2_percent'


def test_a_value_has_its_moment_its_quality_and_its_source() -> None:
    with ModuleBench() as bench:
        anna = Person(bench, PULSE, 'wsn/wrist/body_temperature')
        pulse, temperature = anna.watch('pulse_per_min'), anna.watch('body_temperature')
        anna.says(1.5, PULSE, 72.0)
        anna.says(2.5, 'wsn/wrist/body_temperature', 36.6)
        bench.run(4.0)
        assert pulse.all == [(1.5, 72.0)], 'a value is published once'
        assert temperature.all == [(2.5, 36.6)]
        assert anna.qualities('pulse_per_min') == [
            (0.0, 'missing', '', ''), (1.5, 'good', '72', 'wrist')]
        last = json.loads(anna.signs.all[-1][1])['status'][0]
        assert last['values']['age_s'] == '1.5' and last['values']['unit'] == '1/min'
        assert last['values']['stamp_ns'] == '1500000000'
        assert (last['level'], last['message'], last['hardware_id']) == (0, '72 1/min', 'wrist')


@pytest.mark.parametrize('nothing, kind', [
    (0.0, 'sensor_off'), (math.nan, 'sensor_off'), (-1.0, 'sensor_implausible'),
    (511.0, 'sensor_implausible'), (math.inf, 'sensor_implausible')])
def test_what_is_no_value_is_never_published_and_told_after_a_minute(
        nothing: float, kind: str) -> None:
    with ModuleBench() as bench:
        anna = Person(bench, PULSE)
        pulse = anna.watch('pulse_per_min')
        every_second(anna, PULSE, 1, 100, nothing)
        every_second(anna, PULSE, 100, 120, 70.0)
        bench.run(120.0)
        told = anna.told()
        assert [(time_s, cause.kind, cause.subject, cause.active) for time_s, cause in told] == [
            (61.0, kind, 'wrist', True), (110.0, kind, 'wrist', False)]
        assert {cause.level for _, cause in told} == {Level.TECHNICAL}
        assert [state[:3] for state in anna.qualities('pulse_per_min')] == [
            (0.0, 'missing', ''), (61.0, 'off', ''), (100.0, 'off', '70'), (110.0, 'good', '70')]
        assert pulse.all[0] == (100.0, 70.0)


def test_a_loose_clip_is_one_fault_and_not_a_flood() -> None:
    with ModuleBench() as bench:
        anna = Person(bench, PULSE)
        for time_s in range(300):
            anna.says(1 + time_s, PULSE, 0.0 if time_s % 2 else 72.0)
        every_second(anna, PULSE, 301, 320, 72.0)
        bench.run(320.0)
        assert [(time_s, cause.active) for time_s, cause in anna.told()] == [
            (62.0, True), (311.0, False)]


def test_a_short_gap_is_no_fault_and_the_last_value_counts_meanwhile() -> None:
    with ModuleBench() as bench:
        anna = Person(bench, PULSE)
        every_second(anna, PULSE, 1, 30, 72.0)
        every_second(anna, PULSE, 30, 80, 0.0)
        every_second(anna, PULSE, 80, 100, 75.0)
        bench.run(100.0)
        assert not anna.told()
        assert [state[1:3] for state in anna.qualities('pulse_per_min')] == [
            ('missing', ''), ('good', '72'), ('good', '75')]


def test_the_signs_of_one_sensor_are_one_fault() -> None:
    with ModuleBench() as bench:
        anna = Person(bench, PULSE, SPO2)
        for topic in (PULSE, SPO2):
            every_second(anna, topic, 1, 90, 0.0)
        bench.run(90.0)
        (_, cause), = anna.told()
        assert cause.text == 'wrist of anna measures nothing: pulse off'
        last = anna.module._reports.active('sensor_off', 'wrist')
        assert last is not None and last.text == (
            'wrist of anna measures nothing: pulse off, SpO2 off')


def test_silence_makes_a_value_old_and_is_told() -> None:
    with ModuleBench() as bench:
        anna = Person(bench, PULSE, 'wsn/wrist/body_temperature')
        every_second(anna, PULSE, 1, 11, 72.0)
        anna.says(1.0, 'wsn/wrist/body_temperature', 36.5)
        bench.run(200.0)
        assert [(time_s, cause.kind, cause.text) for time_s, cause in anna.told()] == [
            (70.0, 'sensor_off', 'wrist of anna measures nothing: pulse silent')]
        assert [state[:2] for state in anna.qualities('pulse_per_min')] == [
            (0.0, 'missing'), (1.0, 'good'), (131.0, 'stale')]
    with ModuleBench() as bench:
        anna = Person(bench, 'wsn/wrist/body_temperature',
                      stale_limits=['body_temperature 30 min'])
        anna.says(1.0, 'wsn/wrist/body_temperature', 36.5)
        bench.run(1900.0)
        assert not anna.told(), 'a thermometer speaks when somebody uses it'
        assert [state[:2] for state in anna.qualities('body_temperature')] == [
            (0.0, 'missing'), (1.0, 'good'), (1802.0, 'stale')]


def test_a_sensor_that_speaks_every_five_minutes_is_not_silent_between() -> None:
    with ModuleBench() as bench:
        anna = Person(bench, PULSE)
        for place in range(12):
            anna.says(1.0 + 300.0 * place, PULSE, 72.0)
        bench.run(3600.0)
        times = [time_s for time_s, cause in anna.told() if cause.active]
        assert times == [121.0, 421.0, 721.0], 'until its period is known'


def test_the_preferred_sensor_counts_and_another_while_it_is_off() -> None:
    with ModuleBench() as bench:
        anna = Person(bench, 'pulse_per_min ecg/hr.data', PULSE)
        pulse = anna.watch('pulse_per_min')
        every_second(anna, PULSE, 1, 200, 70.0)
        every_second(anna, 'ecg/hr', 1, 30, 72.0)
        every_second(anna, 'ecg/hr', 30, 130, 0.0)
        every_second(anna, 'ecg/hr', 130, 200, 74.0)
        bench.run(200.0)
        states = anna.qualities('pulse_per_min')
        assert [(state[0], state[3]) for state in states] == [
            (0.0, ''), (1.0, 'ecg'), (30.0, 'wrist'), (140.0, 'ecg')]
        assert {state[1] for state in states[1:]} == {'good'}
        assert [(time_s, cause.subject) for time_s, cause in anna.told()] == [
            (90.0, 'ecg'), (140.0, 'ecg')]
        assert {value for _, value in pulse.all} == {70.0, 72.0, 74.0}


def test_sensors_that_contradict_each_other_make_a_sign_suspect() -> None:
    with ModuleBench() as bench:
        anna = Person(bench, 'pulse_per_min ecg/hr.data', PULSE)
        every_second(anna, PULSE, 1, 200, 70.0)
        every_second(anna, 'ecg/hr', 1, 100, 140.0)
        every_second(anna, 'ecg/hr', 100, 200, 72.0)
        bench.run(200.0)
        told = anna.told()
        assert [(time_s, cause.kind, cause.subject, cause.active) for time_s, cause in told] == [
            (61.0, 'sensor_implausible', 'anna pulse', True),
            (110.0, 'sensor_implausible', 'anna pulse', False)]
        assert 'ecg and wrist contradict each other' in told[0][1].text
        assert (61.0, 'suspect', '140', 'ecg') in anna.qualities('pulse_per_min')


def test_one_reading_far_from_all_others_is_not_believed_but_a_change_that_lasts_is() -> None:
    with ModuleBench() as bench:
        anna = Person(bench, PULSE)
        pulse = anna.watch('pulse_per_min')
        every_second(anna, PULSE, 1, 10, 70.0)
        anna.says(10.0, PULSE, 190.0)
        every_second(anna, PULSE, 11, 20, 71.0)
        every_second(anna, PULSE, 20, 40, 20.0)
        bench.run(40.0)
        seen = [each for before, each in zip([(0.0, 0.0), *pulse.all], pulse.all)
                if before[1] != each[1]]
        assert seen == [(1.0, 70.0), (11.0, 71.0), (30.0, 20.0)]
        assert anna.module.statistics()['jumped'] == 11
        assert not anna.told()


@pytest.mark.parametrize('looks_per_s', [0, 1, 7])
def test_it_is_the_same_however_often_somebody_looks(looks_per_s: int) -> None:
    source = SensorSource(SIGNS['pulse_per_min'], 'wrist', Times(
        120 * NS_PER_S, 60 * NS_PER_S, 10 * NS_PER_S), 0)
    found: list[Change] = []
    for time_s in range(200):
        stamp_ns = time_s * NS_PER_S
        for look in range(looks_per_s):
            found += source.advance(stamp_ns - NS_PER_S + look * NS_PER_S // looks_per_s)
        found += source.advance(stamp_ns - 1)
        source.take(0.0 if 20 <= time_s < 150 else 72.0, stamp_ns)
    assert [(each.stamp_ns / NS_PER_S, bool(each.trouble)) for each in found] == [
        (80.0, True), (160.0, False)]


@pytest.mark.parametrize('changes, words', [
    ({'sources': []}, 'sources is empty'),
    ({'sources': ['wsn/wrist/puls_per_min']}, 'did you mean pulse_per_min?'),
    ({'sources': ['pulse_per_min a b c']}, 'must be TOPIC, SIGN TOPIC'),
    ({'sources': [PULSE, PULSE]}, 'it is there twice'),
    ({'sources': [PULSE + ' as 1x']}, 'is no name'),
    ({'sources': [PULSE], 'person': 'anna smith'}, 'must be a letter'),
    ({'sources': [PULSE], 'stale_limits': ['pulse_per_min soon']}, 'is no duration'),
    ({'sources': [PULSE], 'stale_limits': ['pulse_per_min 0 s']}, 'must be 1 s at least'),
    ({'sources': ['spo2_percent ' + PULSE]}, 'by its name pulse_per_min, not spo2_percent'),
    ({'sources': [PULSE], 'stale_limits': ['puls 3 s']}, 'is not a sign')])
def test_what_cannot_be_meant_is_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=words.replace('?', r'\?')):
        VitalSigns('signs', settings_of(VitalSigns, **{'person': 'anna', **changes}))


def test_a_message_without_a_number_is_refused() -> None:
    with ModuleBench() as bench:
        bench.topic('voice', 'std_msgs/msg/Bool')
        bench.add(VitalSigns, rate_hz=1.0, person='anna', sources=['pulse_per_min voice'])
        with pytest.raises(ConfigError, match='is a std_msgs/msg/Bool without a number data'):
            bench.run(1.0)


ANY = st.one_of(st.sampled_from([0.0, math.nan, math.inf, -5.0, 72.0, 180.0]), st.floats())


@settings(max_examples=15)
@given(st.lists(st.tuples(st.integers(0, 40), st.sampled_from(sorted(SIGNS)), ANY), max_size=40))
def test_whatever_sensors_say_only_plausible_values_come_out(
        said: list[tuple[int, str, float]]) -> None:
    with ModuleBench() as bench:
        anna = Person(bench, *(f'wsn/bed/{sign}' for sign in SIGNS))
        outputs = {sign: anna.watch(sign) for sign in SIGNS}
        for time_s, sign, value in said:
            anna.says(1.0 + time_s, f'wsn/bed/{sign}', value)
        bench.run(60.0)
        for sign, read in outputs.items():
            assert all(SIGNS[sign].is_plausible(value) for _, value in read.all)
        for _, text in anna.signs.all:
            for each in json.loads(text)['status']:
                values = each['values']
                assert values['quality'] != 'good' or SIGNS[
                    each['name'].split('/')[1]].is_plausible(float(values['value']))


@pytest.mark.parametrize('kind, changes', [
    (VitalSigns, {'sources': [PULSE]}), (Assessment, {'signs_topic': PULSE})])
def test_a_module_that_no_silence_would_release_is_refused(kind: Any, changes: Any) -> None:
    with ModuleBench() as bench:
        bench.topic(PULSE, 'std_msgs/msg/Float64' if kind is VitalSigns else 'std_msgs/msg/String')
        bench.add(kind, person='anna', **changes)
        with pytest.raises(ConfigError, match='rate_hz is 0: nothing would release it'):
            bench.run(1.0)
