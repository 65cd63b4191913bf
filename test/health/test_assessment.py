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

"""What the vital signs of a person mean: scores, limits, trends, and when an alarm is over."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.health.assessment import Assessment
from rt_robot_os.features.health.assessment.settings import limits_text
from rt_robot_os.features.health.assessment.settings import SHOWN_CHARACTERS
from rt_robot_os.messages.cause import Level
from rt_robot_os.testing.fakes import settings_of
from rt_robot_os.testing.module_bench import ModuleBench
from sensed_person import every_second
from sensed_person import Person

NORMAL = {'respiration_per_min': 18.0, 'spo2_percent': 97.0, 'oxygen_l_per_min': 0.0,
          'systolic_mmhg': 120.0, 'pulse_per_min': 70.0, 'consciousness': 0.0,
          'body_temperature': 36.8}
SENSORS = [f'wsn/bed/{sign}' for sign in NORMAL]
PULSE, SPO2 = 'wsn/bed/pulse_per_min', 'wsn/bed/spo2_percent'
CONTINUOUS = ('respiration_per_min', 'spo2_percent', 'pulse_per_min')


def well(person: Person, first_s: int, last_s: int, **changes: float) -> None:
    """Let all sensors say what is normal, but for changes."""
    for sign, value in {**NORMAL, **changes}.items():
        every_second(person, f'wsn/bed/{sign}', first_s,
                     last_s if sign in CONTINUOUS else first_s + 1, value)


def reasons(person: Person) -> list[tuple[float, str, str | None]]:
    """Return the clinical causes: when, which, and the level, None when it is over."""
    return [(time_s, cause.kind, cause.level.name.lower() if cause.active else None)
            for time_s, cause in person.told() if cause.level is not Level.TECHNICAL]


def test_a_complete_set_has_a_score_and_says_how_it_came_about() -> None:
    with ModuleBench() as bench:
        anna = Person(bench, *SENSORS)
        anna.assess()
        well(anna, 1, 30, pulse_per_min=115.0, body_temperature=38.05)
        bench.run(30.0)
        assert anna.news2.all[0][1] == -1 and anna.news2.all[-1][1] == 3
        status, = json.loads(anna.details.all[-1][1])['status']
        assert status['name'] == 'anna/news2' and status['level'] == 0
        assert status['message'] == 'anna: NEWS2 3 (pulse 2, temperature 1)'
        values = status['values']
        assert (values['total'], values['complete'], values['missing'], values['risk']) == (
            '3', 'true', '', 'Low')
        assert (values['pulse_per_min_score'], values['frequency']) == ('2', 'minimum 4-6-hourly')
        assert not reasons(anna)


@pytest.mark.parametrize('changes, level', [
    ({'respiration_per_min': 25.0}, 'urgent'),
    ({'pulse_per_min': 115.0, 'spo2_percent': 94.0, 'respiration_per_min': 22.0}, 'urgent'),
    ({'pulse_per_min': 135.0, 'spo2_percent': 90.0, 'respiration_per_min': 22.0}, 'critical')])
def test_a_high_score_that_lasts_is_a_reason_for_an_alarm_and_a_lower_one_ends_it(
        changes: dict[str, float], level: str) -> None:
    with ModuleBench() as bench:
        anna = Person(bench, *SENSORS)
        anna.assess()
        well(anna, 1, 100, **changes)
        well(anna, 200, 400)
        bench.run(400.0)
        found = [each for each in reasons(anna) if each[1] == 'news2']
        assert found[0] == (61.0, 'news2', level)
        # The pulse and others that jump are believed after ten seconds.
        assert found[-1][1:] == ('news2', None) and 319.0 < found[-1][0] < 335.0


def test_what_a_sensor_says_when_it_is_off_is_never_a_score_and_no_alarm() -> None:
    with ModuleBench() as bench:
        anna = Person(bench, *SENSORS)
        anna.assess(limits=['pulse_per_min < 50', 'spo2_percent < 90', 'spo2_percent falling 4 in '
                            '2 min', 'systolic_mmhg < 100'])
        well(anna, 1, 60)
        well(anna, 60, 400, pulse_per_min=0.0, spo2_percent=0.0, respiration_per_min=0.0,
             systolic_mmhg=0.0, body_temperature=0.0)
        bench.run(400.0)
        assert not reasons(anna)
        (time_s, cause), = anna.told()
        assert (time_s, cause.kind, cause.subject) == (120.0, 'sensor_off', 'bed')
        assert anna.news2.all[-1][1] == -1
        status, = json.loads(anna.details.all[-1][1])['status']
        assert 'missing' in status['message']
        assert status['values']['limits'].split('; ')[-1] == 'systolic_mmhg < 100'


def test_an_old_value_is_missing_and_not_normal() -> None:
    with ModuleBench() as bench:
        anna = Person(bench, *SENSORS, stale_limits=['body_temperature 1 min'])
        anna.assess()
        well(anna, 1, 100)
        bench.run(100.0)
        assert [total for _, total in anna.news2.all if total >= 0][0] == 0
        assert anna.news2.all[-1][1] == -1
        values = json.loads(anna.details.all[-1][1])['status'][0]['values']
        assert (values['missing'], values['total'], values['risk']) == ('body_temperature', '', '')


def test_an_alarm_begins_by_what_is_known_and_is_not_over_because_nothing_is() -> None:
    with ModuleBench() as bench:
        anna = Person(bench, PULSE, SPO2)
        anna.assess()
        every_second(anna, SPO2, 1, 100, 85.0)
        every_second(anna, SPO2, 100, 600, 0.0)
        every_second(anna, PULSE, 1, 900, 70.0)
        every_second(anna, SPO2, 600, 900, 97.0)
        bench.run(900.0)
        assert reasons(anna) == [(61.0, 'news2', 'urgent'), (730.0, 'news2', None)]
        text = next(cause.text for _, cause in anna.told() if cause.kind == 'news2')
        assert text.startswith('anna: NEWS2 at least 3 (SpO2 3); missing: respiration, oxygen')


def test_a_prescription_says_what_is_breathed() -> None:
    for oxygen, total in (('air', 0), ('oxygen', 2)):
        with ModuleBench() as bench:
            anna = Person(bench, *(each for each in SENSORS if 'oxygen' not in each))
            anna.assess(oxygen=oxygen)
            for sign, value in NORMAL.items():
                if 'oxygen' not in sign:
                    anna.says(1.0, f'wsn/bed/{sign}', value)
            bench.run(3.0)
            assert anna.news2.all[-1][1] == total


def test_limits_have_a_duration_a_hysteresis_and_levels() -> None:
    with ModuleBench() as bench:
        anna = Person(bench, PULSE)
        anna.assess(news2=False, limits=[
            'pulse_per_min > 120 for 60 s clear 110', 'pulse_per_min > 140 for 30 s level urgent'])
        for time_s, value in ((1, 100.0), (10, 130.0), (40, 119.0), (50, 125.0), (150, 145.0),
                              (200, 115.0), (400, 110.0), (500, 100.0)):
            every_second(anna, PULSE, time_s, time_s + 100, value)
        bench.run(600.0)
        kinds = reasons(anna)
        assert [each[1] for each in kinds] == ['pulse_per_min_high'] * len(kinds)
        assert [each[2] for each in kinds] == ['warning', 'urgent', 'warning', None]


def test_consciousness_counts_at_once() -> None:
    with ModuleBench() as bench:
        anna = Person(bench, 'ros/consciousness')
        anna.assess(news2=False)
        for time_s, value in ((10, 1.0), (20, 4.0), (30, 0.5), (40, 0.0)):
            anna.says(time_s, 'ros/consciousness', value)
        bench.run(60.0)
        assert reasons(anna) == [
            (10.0, 'consciousness', 'urgent'), (20.0, 'consciousness', 'critical'),
            (40.0, 'consciousness', None)]


def test_a_fall_of_spo2_is_found_through_noise_and_wrong_values_and_none_in_noise() -> None:
    with ModuleBench() as bench:
        anna = Person(bench, SPO2, stale_limits=['spo2_percent 2 min'])
        anna.assess(news2=False, limits=['spo2_percent falling 4 in 10 min level urgent'])
        for time_s in range(3000):
            value = 97.0 - max(0.0, min(time_s - 1200, 900) / 150.0) + (-1) ** (time_s // 7)
            anna.says(1.0 + time_s, SPO2, 60.0 if time_s % 97 == 0 else value)
        bench.run(3001.0)
        found = reasons(anna)
        assert [each[1:] for each in found] == [
            ('spo2_percent_falling', 'urgent'), ('spo2_percent_falling', None)]
        assert 1500 < found[0][0] < 1900 and 2100 < found[1][0] < 2700


def test_vital_signs_that_no_longer_arrive_are_told_and_nothing_is_known() -> None:
    with ModuleBench() as bench:
        anna = Person(bench, *SENSORS)
        assessment = anna.assess()
        well(anna, 1, 60)
        bench.at(30.5, lambda: setattr(anna.module, '_publish', lambda time_ns: None))
        bench.run(60.0)
        assert assessment.statistics()['news2'] == -1
        assert [(time_s, cause.kind, cause.subject) for time_s, cause in anna.told()] == [
            (40.0, 'monitor_silent', 'vital signs of anna')]


@pytest.mark.parametrize('text', [
    '', '{}', '[]', '{"status": [{}]}', '{"status": [{"name": "anna/pulse_per_min"}]}', 'nan',
    '{"status": [{"name": "anna/pulse_per_min", "values": {"quality": "good", "value": "x"}}]}'])
def test_a_message_that_cannot_be_read_is_counted(text: str) -> None:
    with ModuleBench() as bench:
        bench.bus.declare('health/anna/signs', 'std_msgs/msg/String', {}, depth=16, tail=500)
        publisher = bench.bus.publisher('health/anna/signs')
        assessment = bench.add(Assessment, rate_hz=1.0, person='anna')

        def send() -> None:
            publisher.msg.data = text
            publisher.publish()
        bench.at(1.0, send)
        bench.run(2.0)
        assert assessment.statistics()['refused'] == 1
        assert 'could not be read' in assessment.statistics()['warning']


@pytest.mark.parametrize('limit, words', [
    ('pulse_per_min above 120', 'must be SIGN > NUMBER'), ('puls_per_min > 120', 'did you mean'),
    ('pulse_per_min > 120 clear 130', 'must be below it'),
    ('spo2_percent > 100', 'is never > 100'), ('spo2_percent < 0.5', 'is never < 0.5'),
    ('pulse_per_min > 120 for soon', "'for soon' is not valid after 120: must be SIGN"),
    ('pulse > 120', 'did you mean pulse_per_min'), ('temp > 38', 'did you mean body_temperature'),
    ('pulse_per_min >= 120', "'>=' is not valid after the sign, only > <"),
    ('spo2_percent < 90%', "'90%' is not a number; write it without a unit, in %"),
    ('pulse_per_min > 120 clear 110 for 60 s', "'clear 110 for 60 s' is not valid after 120"),
    ('body_temperature rising 1', 'the end is not valid after 1: must be SIGN rising'),
    ('pulse_per_min', 'the end is not valid after the sign'), (' ', 'it is empty'),
    ('pulse_per_min > 120 for 3 weeks', 'is not a duration'),
    ('pulse_per_min > 120 level bad', 'one of technical, warning'),
    ('pulse_per_min > 1..2', 'is not a finite number'),
    ('spo2_percent falling 0 in 10 min', 'above 0'),
    ('spo2_percent falling 4 in 1 s', 'from 30 s to 14 d')])
def test_a_limit_that_cannot_be_meant_is_refused(limit: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        Assessment('a', settings_of(Assessment, person='anna', limits=[limit]))


def test_nothing_is_concluded_while_nothing_is_known() -> None:
    with ModuleBench() as bench:
        anna = Person(bench, *SENSORS)
        anna.assess(limits=['pulse_per_min < 50', 'pulse_per_min > 120'])
        for place, value in enumerate([0.0, math.nan, -3.0, math.inf, 511.0] * 50):
            for topic in SENSORS:
                anna.says(1.0 + place, topic, value)
        bench.run(250.0)
        kinds: set[Any] = {kind for _, kind, _ in reasons(anna)}
        assert kinds <= {'consciousness'} and all(total == -1 for _, total in anna.news2.all)


def test_limits_that_are_shown_are_whole_and_not_too_long() -> None:
    texts = [f'pulse_per_min > {each} for 60 s clear 100 level urgent' for each in range(110, 174)]
    shown = limits_text(texts)
    assert 900 < len(shown) <= SHOWN_CHARACTERS
    assert shown.split('; ') == texts[:len(shown.split('; '))]
    assert limits_text([]) == ''
