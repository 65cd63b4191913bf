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

"""Who is not granted is not even named: neither in signals, nor in alarms, nor in any text."""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import Any

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies
import pytest
from rt_robot_os.monitor.live.fan_out import WatchGroup
from rt_robot_os.monitor.live.hub import Hub
from rt_robot_os.monitor.live.media_connection import may_view_cameras
from rt_robot_os.monitor.live.rights import Rights
from rt_robot_os.monitor.live.rights import without
from rt_robot_os.monitor.live.robot_state import RobotState

ANNA = Rights(frozenset({'anna'}), True)
TEXTS = strategies.lists(strategies.sampled_from(
    ['bob', 'Bob', 'BOB', 'anna', ' ', '_', '/', 'lies near', 'bobsleigh', '"', 'é']),
    max_size=6).map(''.join)
VALUES = strategies.recursive(
    TEXTS | strategies.integers() | strategies.none(),
    lambda inner: strategies.lists(inner, max_size=3) | strategies.dictionaries(
        TEXTS, inner, max_size=3), max_leaves=8)


def robot_of_two() -> RobotState:
    """Return a robot that lives with Anna and Bob."""
    robot = RobotState('robot', "bob's robot")
    robot.lives_with(['anna', 'bob'])
    return robot


def names_bob(text: str) -> bool:
    """Return whether the person is named, rather than something that is spelled alike."""
    return 'bob' in text.lower().replace('bobsleigh', '')


@settings(max_examples=60, deadline=None)
@given(values=strategies.dictionaries(TEXTS, VALUES, max_size=5))
def test_no_frame_names_somebody_who_is_not_granted(values: dict[str, Any]) -> None:
    robot = robot_of_two()
    robot.take(1, 1, {'health/anna/pulse': [1, 60], 'health/bob/pulse': [1, 70],
                      'wsn/bob_bed/motion': [1, 1], **{
                          f'agent/{name}': [1, value] for name, value in values.items()}})
    frame = WatchGroup(robot, ANNA, ('*',), 5.0).frame(0)
    assert frame is not None
    assert 'health/anna/pulse' in json.loads(frame)['signals']
    text = json.dumps(json.loads(frame), ensure_ascii=False)
    # What has a letter on either side is another word.
    assert not [word for word in text.replace('_', ' ').split() if word.strip(
        '"\\/:,{}[]').lower() == 'bob']
    everything = WatchGroup(robot, Rights(None, True), ('*',), 5.0).frame(0)
    assert everything is not None and 'health/bob/pulse' in everything


def test_an_alarm_of_another_is_nobodys_business_and_a_text_names_nobody_else() -> None:
    robot = robot_of_two()
    for alarm, subject, text in (('1', 'bob', 'bob lies in the hall'),
                                 ('2', 'anna', 'anna calls; robot is 1.0 m from Bob')):
        robot.take_alarm({'alarm': alarm, 'seq': int(alarm), 'state': 'raised',
                          'subject': subject, 'text': text}, 5)
    shown = {each['id']: robot.alarm_shown(each, ANNA) for each in robot.alarms.values()}
    assert shown['1'] is None
    assert shown['2'] is not None
    assert shown['2']['text'] == 'anna calls; robot is 1.0 m from (somebody)'
    assert not names_bob(json.dumps(robot.shown(ANNA)))


def test_a_robot_without_anybody_granted_does_not_exist() -> None:
    hub = Hub(2.0, 1.0)
    for name, people in (('r1', ['bob']), ('r2', ['anna']), ('r3', []), ('r4', None)):
        hub.get_or_create(name).lives_with(people)  # of the last nobody has confirmed them
    assert [each.id for each in hub.seen(ANNA)] == ['r2']
    assert [each.id for each in hub.seen(Rights(None, False))] == ['r1', 'r2', 'r3', 'r4']
    actor = SimpleNamespace(people=frozenset({'anna'}), may=lambda permission: True)
    # A robot of nobody is no robot of everybody.
    for robot in ('r1', 'r3', 'r4'):
        assert not hub.may_see_robot(actor, robot)  # type: ignore[arg-type]
    assert hub.people(ANNA) == [{'person': 'anna', 'robots': ['r2']}]


@pytest.mark.parametrize('people', [None, frozenset(), frozenset({'anna', 'bob'})])
def test_who_is_not_granted_everybody_does_not_look_through_a_camera(
        people: frozenset[str] | None) -> None:
    robot = RobotState('r1', 'r1', people)
    assert not may_view_cameras(frozenset(), robot)
    assert not may_view_cameras(frozenset({'anna'}), robot)
    assert may_view_cameras(None, robot)
    assert may_view_cameras(frozenset({'anna', 'bob'}), robot) is bool(people)


def test_who_may_not_see_health_sees_where_somebody_is_and_no_sign_of_theirs() -> None:
    robot = robot_of_two()
    robot.take(1, 1, {'health/anna/pulse': [1, 60], 'health/anna/place': [1, {'x': 1}]})
    frame = WatchGroup(robot, Rights(None, False), ('*',), 5.0).frame(0)
    assert frame is not None
    assert list(json.loads(frame)['signals']) == ['health/anna/place']


def test_somebody_who_has_moved_away_is_still_not_named() -> None:
    robot = robot_of_two()
    robot.lives_with(['anna'], ever=['anna', 'bob'])
    robot.take(1, 1, {'agent/state': [1, 'looks for bob']})
    frame = WatchGroup(robot, ANNA, ('*',), 5.0).frame(0)
    assert frame is not None and not names_bob(frame)


def test_nothing_is_replaced_for_who_may_see_all() -> None:
    value = {'text': 'bob and anna', 'bob': [1.5, None, True]}
    assert without(value, frozenset()) is value
    assert without(value, frozenset({'bob'})) == {
        'text': '(somebody) and anna', '(somebody)': [1.5, None, True]}


def test_the_list_of_all_alarms_is_for_who_may_see_all() -> None:
    robot = robot_of_two()
    robot.take(1, 1, {'alarms/list': [1, {'alarms': [{'text': 'bob lies in the hall'}]}],
                      'battery': [1, {}]})
    frame = WatchGroup(robot, ANNA, ('*',), 5.0).frame(0)
    assert frame is not None
    assert list(json.loads(frame)['signals']) == ['battery']
