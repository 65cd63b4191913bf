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


"""On a quiet day all causes are technical; the rules are those that docs/rules.md offers."""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path
import re
from typing import Any

import pytest
from quiet_day import PEOPLE
from quiet_day import play
from quiet_day import QuietDay
from quiet_day import ROOMS
from quiet_day import Sample
from rt_robot_os.features.alarms.watch import Watch
from rt_robot_os.features.health.rule import RuleModule
from rt_robot_os.features.health.whereabouts import Whereabouts
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import Level
from rt_robot_os.testing.module_bench import ModuleBench
import yaml

ROOT = Path(__file__).resolve().parents[2]
BROAD = bool(os.environ.get('RT_ROBOT_OS_BROAD'))
HOUR_S = 3600.0


def rules_to_copy() -> dict[str, dict[str, Any]]:
    """Return the rules of the second block of the page, and one for buttons."""
    page = (ROOT / 'docs' / 'rules.md').read_text(encoding='utf-8')
    block = re.findall(r'^```yaml\n(.*?)^```', page, re.MULTILINE | re.DOTALL)[1]
    found = {name: {key: value for key, value in section.items()
                    if key not in ('type', 'priority')}
             for name, section in yaml.safe_load(block).items() if isinstance(section, dict)}
    assert len(found) >= 6
    return {**found, 'help': {'when': 'wsn/*/alarm.data == 1', 'kind': 'help', 'subject': '*',
                              'level': 'critical'}}


def causes_of(day: QuietDay, restarts_h: tuple[float, ...] = (),
              change: Callable[[Sample], Sample] = lambda sample: sample) -> list[Cause]:
    """Return what is told on a day; at each restart all begins anew."""
    samples = list(day.samples())
    found: list[Cause] = []
    for begin_h, end_h in zip((0.0, *restarts_h), (*restarts_h, day.hours)):
        with ModuleBench() as bench:
            play(bench, day, samples, begin_h * HOUR_S, change)
            for name, settings in rules_to_copy().items():
                bench.add(RuleModule, name, priority=30, **settings)
            bench.add(Watch, 'watch', priority=10, node_silent_s=600.0)
            for person in PEOPLE:  # they look at each other
                bench.bus.declare(f'health/{person}/place', 'geometry_msgs/msg/PoseStamped',
                                  {'header.frame_id': 'map'})
            for person in PEOPLE:
                bench.add(
                    Whereabouts, f'{person}_is', priority=28, person=person, nodes=day.survey,
                    rooms=ROOMS, others=[each for each in PEOPLE if each != person],
                    movement=[f'wsn/{person}_wrist/acceleration_g.data moves 0.2 within 5 min'],
                    still_s=2 * HOUR_S, still=['sleeping 4 h', 'study 4 h'],
                    stay=['bath 2 h'], exits=['hall'], away_s=4 * HOUR_S, blind_s=1200.0)
            read = bench.watch('alarms/causes')

            def collect() -> None:
                while read.take():
                    cause = Cause.from_json(read.msg.data)
                    if cause.active:
                        found.append(cause)
            bench.kernel.add_task('collect', collect, priority=1, rate_hz=0.1)
            bench.run((end_h - begin_h) * HOUR_S)
            assert read.lost == 0
    return found


@pytest.mark.parametrize('seed', range(20 if BROAD else 1))
def test_twenty_four_quiet_hours_with_restarts_give_nothing_but_technical_causes(
        seed: int) -> None:
    told = causes_of(QuietDay(seed, 10.0 if BROAD else 450.0), (7.4, 15.2))
    assert {cause.kind for cause in told if cause.level is not Level.TECHNICAL} == set()
    assert 'node_silent' in {cause.kind for cause in told}


def test_what_happens_on_such_a_day_is_told() -> None:
    def change(sample: Sample) -> Sample:
        """Burn in the kitchen from three o'clock on, and lie on the floor from nine."""
        if sample.topic == 'wsn/kitchen/temperature' and sample.time_s > 3 * HOUR_S:
            return sample._replace(value=60.0)
        if sample.topic == 'wsn/kitchen/smoke' and sample.time_s > 3 * HOUR_S:
            return sample._replace(value=0.9)
        if sample.time_s > HOUR_S and sample.topic.endswith('presence'):
            return sample._replace(value=0.0)
        if sample.time_s > HOUR_S and sample.topic.endswith('acceleration_g'):
            return sample._replace(value=1.0)
        if sample.time_s > HOUR_S and sample.topic.endswith('nearest_node'):
            return sample._replace(value=2.0)
        return sample
    told = causes_of(QuietDay(1, 180.0, 4.0), change=change)
    assert {(cause.kind, cause.subject) for cause in told
            if cause.level is not Level.TECHNICAL} == {
        ('smoke', 'kitchen'), ('heat', 'kitchen'), ('heat_rising', 'kitchen'),
        ('no_movement', 'anna'), ('no_movement', 'bob')}


def test_a_day_is_the_same_each_time() -> None:
    first, again = (list(QuietDay(3, 600.0).samples()) for _ in range(2))
    assert repr(first) == repr(again) and len(first) > 1000
    assert repr(first) != repr(list(QuietDay(4, 600.0).samples()))
