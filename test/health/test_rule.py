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


"""Rules of a user's own on the topics of a robot."""

from __future__ import annotations

from collections.abc import Callable
import functools
import math
from pathlib import Path
from typing import Any

import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.health.rule import RuleModule
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import Level
from rt_robot_os.settings import load
from rt_robot_os.testing.fakes import settings_of
from rt_robot_os.testing.module_bench import ModuleBench
from rt_robot_os.topics import Publisher
from rt_robot_os.topics import Subscription

S = 10**9
FLOAT = 'std_msgs/msg/Float64'
TEMPERATURE = 'sensor_msgs/msg/Temperature'
SMOKE = {'when': 'wsn/kitchen/smoke.data > 0.5 for 3 s', 'kind': 'smoke', 'subject': 'kitchen',
         'level': 'critical', 'text': 'Smoke in the kitchen ({value})', 'node': 'kitchen'}


def put(publisher: Publisher, **fields: Any) -> Callable[[], None]:
    def publish() -> None:
        for name, value in fields.items():
            setattr(publisher.msg, name, value)
        publisher.publish()
    return publish


def causes(read: Subscription) -> list[tuple[float, Cause]]:
    """Return what was told, without what was only told again."""
    found: list[tuple[float, Cause]] = []
    active: dict[tuple[str, str], bool] = {}
    while read.take():
        cause = Cause.from_json(read.msg.data)
        key = cause.kind, cause.subject
        if active.get(key) != cause.active:
            active[key] = cause.active
            found.append((read.stamp_ns / S, cause))
    return found


def test_a_rule_is_a_cause_from_its_deadline_to_the_sample_that_ends_it() -> None:
    with ModuleBench() as bench:
        smoke = bench.topic('wsn/kitchen/smoke', FLOAT)
        rule = bench.add(RuleModule, 'kitchen_smoke', rate_hz=1.0, **SMOKE)
        read = bench.watch('alarms/causes')
        bench.at(1.25, put(smoke, data=0.75))
        bench.at(9.0, put(smoke, data=0.0))
        bench.run(20.0)
        (began, cause), (ended, over) = causes(read)
        # The stamp is the deadline, whenever the task came to run.
        assert (began, ended) == (4.25, 9.0)
        assert cause == Cause('smoke', 'kitchen', Level.CRITICAL, True,
                              'Smoke in the kitchen (0.75)', 'kitchen_smoke', 'kitchen',
                              cause.x, cause.y, 0.75)
        assert math.isnan(cause.x) and not over.active
        statistics = rule.statistics()
        assert statistics['rule'] == 'wsn/kitchen/smoke.data > 0.5 for 3 s'
        assert statistics['state'] == 'false: wsn/kitchen/smoke.data 0'
        assert (statistics['began'], statistics['active']) == (1, 0)


def test_a_cause_that_lasts_is_told_again() -> None:
    with ModuleBench() as bench:
        smoke = bench.topic('wsn/kitchen/smoke', FLOAT)
        bench.add(RuleModule, rate_hz=1.0, **SMOKE)
        read = bench.watch('alarms/causes')
        bench.at(1.0, put(smoke, data=1.0))
        bench.run(30.0)
        stamps = []
        while read.take():
            stamps.append(read.stamp_ns / S)
        assert stamps == [4.0, 14.0, 24.0]


def test_a_star_is_any_of_them_or_each_by_itself() -> None:
    with ModuleBench() as bench:
        hall, bed = (bench.topic(f'wsn/{name}/temperature', TEMPERATURE) for name in (
            'hall', 'bed'))
        when = 'wsn/*/temperature.temperature > 45 degC'
        bench.add(RuleModule, 'any', rate_hz=1.0, when=when, kind='heat', subject='flat', node='*')
        bench.add(RuleModule, 'each', rate_hz=1.0, when=when, kind='hot', subject='*',
                  text='{name} is hot')
        read = bench.watch('alarms/causes')
        bench.at(1.0, put(bed, temperature=50.0))
        bench.at(2.0, put(hall, temperature=60.0))
        bench.at(3.0, put(bed, temperature=20.0))
        bench.at(4.0, put(hall, temperature=20.0))
        bench.run(6.0)
        told = [(stamp, cause.kind, cause.subject, cause.node, cause.active)
                for stamp, cause in causes(read)]
        assert sorted(told) == [
            (1.0, 'heat', 'flat', 'bed', True), (1.0, 'hot', 'bed', '', True),
            (2.0, 'hot', 'hall', '', True), (3.0, 'hot', 'bed', '', False),
            (4.0, 'heat', 'flat', 'hall', False), (4.0, 'hot', 'hall', '', False)]


def test_a_topic_that_never_speaks_is_noticed() -> None:
    with ModuleBench() as bench:
        bench.topic('health/anna/imu', 'sensor_msgs/msg/Imu')
        bench.add(RuleModule, rate_hz=1.0, when='health/anna/imu silent for 60 s',
                  kind='sensor_off', subject='anna', level='technical')
        read = bench.watch('alarms/causes')
        bench.run(61.0)
        assert [(stamp, cause.level) for stamp, cause in causes(read)] == [
            (60.0, Level.TECHNICAL)]


def test_what_is_no_number_is_no_value_and_counted() -> None:
    with ModuleBench() as bench:
        smoke = bench.topic('wsn/kitchen/smoke', FLOAT)
        rule = bench.add(RuleModule, rate_hz=1.0, **SMOKE)
        read = bench.watch('alarms/causes')
        bench.at(1.0, put(smoke, data=1.0))
        bench.at(2.0, put(smoke, data=math.nan))
        bench.run(5.0)
        assert [stamp for stamp, _ in causes(read)] == [4.0]
        assert rule.statistics()['no_values'] == 1


def test_fields_are_found_by_path_and_numbers_taken_in_their_unit() -> None:
    with ModuleBench() as bench:
        imu = bench.topic('imu/data', 'sensor_msgs/msg/Imu')
        scan = bench.topic('scan', 'sensor_msgs/msg/LaserScan', {'ranges': 5})
        state = bench.bus.declare('agent/state', 'std_msgs/msg/String', tail=40)
        estop = bench.topic('estop', 'std_msgs/msg/Bool')
        said = bench.bus.publisher('agent/state')
        for kind, when in {
                'shake': 'imu/data.linear_acceleration.z > 2 g',
                'near': 'scan.ranges[3] < 20 cm',
                'given_up': "agent/state.data begins with 'give_up'",
                'stopped': 'estop.data == true and not scan.ranges[0] > 1'}.items():
            bench.add(RuleModule, kind, rate_hz=1.0, when=when, kind=kind, subject='robot')
        read = bench.watch('alarms/causes')
        bench.at(1.0, put(imu, linear_acceleration=(0.0, 0.0, 19.0)))
        bench.at(2.0, put(imu, linear_acceleration=(0.0, 0.0, 20.0)))
        bench.at(3.0, put(scan, ranges=[0.0, 0.0, 0.0, 0.19, 0.0]))
        bench.at(4.0, put(said, data='approach anna'))
        bench.at(5.0, put(said, data='give_up anna: blocked'))
        bench.at(6.0, put(estop, data=True))
        bench.run(7.0)
        assert state.layout.tail == 'data'
        assert [(stamp, cause.kind) for stamp, cause in causes(read)] == [
            (2.0, 'shake'), (3.0, 'near'), (5.0, 'given_up'), (6.0, 'stopped')]


def test_what_comes_together_is_judged_together_by_its_stamps() -> None:
    with ModuleBench() as bench:
        low, high = bench.topic('low', FLOAT), bench.topic('high', FLOAT)
        bench.add(RuleModule, rate_hz=1.0, when='low.data > high.data', kind='crossed',
                  subject='x')
        read = bench.watch('alarms/causes')

        def both() -> None:
            for publisher, stamp, value in ((high, 1, 5.0), (low, 1, 4.0), (low, 2, 8.0),
                                            (high, 2, 9.0), (low, 3, 10.0)):
                publisher.msg.data = value
                publisher.publish(stamp * S)
        bench.at(3.5, both)
        bench.run(6.0)
        assert [stamp for stamp, _ in causes(read)] == [3.0]


# ---- as it is loaded ----------------------------------------------------------------------------

ROBOT = """
robot:
  ros__parameters:
    devices: [sink]
    sink: {type: sink, port: sim}
    modules: [readings, mine]
    readings:
      type: sensor_readings
      packets_topic: wsn/packets/rest
      nodes: [kitchen 1 2 1 smoke temperature humidity, hall 1 1 2 temperature]
      rate_hz: 0.0
    mine:
      type: rule
      when: WHEN
      kind: smoke
      subject: SUBJECT
"""


def problems(tmp_path: Path, when: str, subject: str = 'kitchen') -> list[str]:
    path = tmp_path / 'robot.yaml'
    path.write_text(ROBOT.replace('WHEN', when).replace('SUBJECT', subject))
    try:
        load([path])
    except ConfigError as error:
        return [line.replace(f'{path}:', '') for line in error.problems]
    return []


@pytest.mark.parametrize('when', [
    'wsn/kitchen/smoke.data > 0.5 for 3 s', '"wsn/*/temperature.temperature > 45 degC"',
    'wsn/kitchen/humidity.relative_humidity > 80 %', 'wsn/hall/temperature silent for 5 min'])
def test_a_right_rule_has_no_problem_and_runs_by_itself(tmp_path: Path, when: str) -> None:
    assert problems(tmp_path, when) == []
    assert load([tmp_path / 'robot.yaml']).modules[1].rate_hz == 1.0


@pytest.mark.parametrize('when, told', [
    ('wsn/kitchen/smoke.data > 0.5 fro 3 s', [
        "14: mine.when: 'fro' is not a unit, and not valid here: units are degC % s ms min h d m "
        'cm mm m/s m/s2 g rad deg rad/s deg/s V mV A lx /min l/min Pa hPa mmHg; did you mean '
        "'for'?",
        '14: mine.when:   wsn/kitchen/smoke.data > 0.5 fro 3 s',
        '14: mine.when:                                ^^^']),
    ('wsn/kitchen/smoke.value > 0.5', [
        "14: mine.when: std_msgs/msg/Float64 has no field 'value': its fields are data",
        '14: mine.when:   wsn/kitchen/smoke.value > 0.5',
        '14: mine.when:   ^^^^^^^^^^^^^^^^^^^^^^^']),
    ('wsn/kitchen/smoke > 0.5', [
        '14: mine.when: std_msgs/msg/Float64: which field? its fields are data',
        '14: mine.when:   wsn/kitchen/smoke > 0.5',
        '14: mine.when:   ^^^^^^^^^^^^^^^^^']),
    ('wsn/kichen/smoke.data > 0.5', [
        "14: module mine reads 'wsn/kichen/smoke': no part declares this topic, did you mean "
        "'wsn/kitchen/smoke'? Or add it to 'topics'"]),
    ('"wsn/*/smok.data > 0.5"', [
        "14: module mine reads 'wsn/*/smok': no topic matches, did you mean "
        "'wsn/kitchen/smoke'?"]),
    ('wsn/hall/temperature.temperature > 45 V', [
        '14: mine.when: wsn/hall/temperature.temperature and 45 V: V is a unit of voltage, but '
        'this field is in degC',
        '14: mine.when:   wsn/hall/temperature.temperature > 45 V',
        '14: mine.when:   ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^']),
    ("wsn/hall/temperature.header.frame_id == 'hall'", [
        "14: mine.when: sensor_msgs/msg/Temperature: header.frame_id is always 'hall'",
        "14: mine.when:   wsn/hall/temperature.header.frame_id == 'hall'",
        '14: mine.when:   ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^']),
])
def test_what_is_wrong_is_told_with_its_line_and_place(
        tmp_path: Path, when: str, told: list[str]) -> None:
    assert problems(tmp_path, when) == told


@pytest.mark.parametrize('changes, told', [
    ({'kind': 'Smoke!'}, "rule.kind: 'Smoke!' is not a kind of cause"),
    ({'subject': ' '}, 'rule.subject must have 1 to 64 characters'),
    ({'subject': '*'}, r'rule.subject is \*, but the rule has none'),
    ({'text': '{name}'}, r'rule.text has \{name\}, but the rule has no \*'),
    ({'position_m': [1.0]}, 'rule.position_m must be x and y'),
])
def test_settings_that_do_not_go_with_the_rule_are_refused(
        changes: dict[str, Any], told: str) -> None:
    with pytest.raises(ConfigError, match=told):
        RuleModule('rule', settings_of(RuleModule, **{**SMOKE, **changes}))


def test_a_star_must_stand_for_the_same_in_all_of_a_rule() -> None:
    with ModuleBench() as bench:
        bench.topic('wsn/hall/temperature', TEMPERATURE)
        bench.topic('wsn/bed/smoke', FLOAT)
        with pytest.raises(ConfigError, match='\\* matches no name in all of'):
            bench.add(RuleModule,
                      when='wsn/*/temperature.temperature > 45 and wsn/*/smoke.data > 0.5',
                      kind='fire', subject='*')


def test_silence_counts_from_a_moment_that_a_replay_has_as_well() -> None:
    stamps = []
    for late_ns in (0, 9_999_000):
        with ModuleBench() as bench:
            bench.topic('door', FLOAT)
            rule = bench.add(RuleModule, when='door silent for 5 s', kind='sensor_off',
                             subject='door')
            read = bench.watch('alarms/causes')
            assert rule.task is not None
            bench.at(1.0 + late_ns / S, functools.partial(bench.kernel.release, rule.task))
            bench.run(8.0)
            stamps += [stamp for stamp, _ in causes(read)]
            assert 'remove rate_hz' in rule.statistics()['warning']
    assert stamps == [6.0, 6.0]
