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


"""Is the text of a fault schedule understood, or answered with what would be right."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.sim.faults import FaultEvent
from rt_robot_os.sim.faults import FaultPlan
from rt_robot_os.sim.faults import FAULTS
from rt_robot_os.sim.faults import MOTOR_FAULTS
from rt_robot_os.sim.faults import parse_schedule

S = 1_000_000_000


def test_a_schedule() -> None:
    texts = ['unplug at 5 for 2', ' silent  at 0.5 for 1e-3 ; stuck at 0 for 1;']
    assert parse_schedule(texts) == (
        FaultEvent('unplug', 5 * S, 2 * S), FaultEvent('silent', S // 2, 1_000_000),
        FaultEvent('stuck', 0, S))


@pytest.mark.parametrize('text, message', [
    ('unplugged at 5 for 2', "no fault 'unplugged': use one of silent, garbage, corrupt"),
    ('unplug', 'write it like "unplug at 5 for 2"'),
    ('unplug at five for 2', "'five' is not a num"),
    ('unplug at 5 for nan', "'nan' is not a number"), ('unplug at -1 for 2', 'must begin at 0'),
    ('unplug at 5 for 0', 'above 0'), ('unplug at 5 for 1e9', 'at most'),
    ('unplug at 1e7 for 1', 'must begin'), ('unplug for 2 at 5', 'write it like')])
def test_what_is_not_understood(text: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        parse_schedule([text])


def test_all_problems_are_told_at_once() -> None:
    with pytest.raises(ConfigError) as caught:
        parse_schedule(['x at 1 for 1', 'silent at 1', 'silent at 1 for 1'])
    assert len(caught.value.problems) == 2


@given(text=st.text(max_size=40))
def test_no_text_raises_anything_else(text: str) -> None:
    try:
        parse_schedule([text])
    except ConfigError:
        pass


def test_faults_are_active_from_begin_to_end() -> None:
    plan = FaultPlan(parse_schedule(['silent at 1 for 1', 'stuck at 1.5 for 1']))
    assert plan.active(10 * S) == frozenset()
    plan.start(100 * S)
    expected = {100: set(), 101: {'silent'}, 101.5: {'silent', 'stuck'}, 102: {'stuck'},
                102.5: set()}
    for seconds, faults in expected.items():
        assert plan.active(round(seconds * S)) == faults
    assert plan.next_ns(100 * S) == 101 * S
    assert plan.next_ns(102 * S) == round(102.5 * S)
    assert plan.next_ns(103 * S) is None


def test_faults_may_be_asked_for_while_it_runs() -> None:
    plan = FaultPlan(())
    plan.start(0)
    for now in range(1000):
        plan.inject('garbage', 1.0, now)
    assert plan.active(S // 2) == {'garbage'}
    assert plan.active(2 * S) == frozenset()
    with pytest.raises(ConfigError, match='no fault'):
        plan.inject('lightning', 1.0, 0)


def test_a_device_may_have_faults_of_its_own() -> None:
    events = parse_schedule(['reset at 1 for 2'], MOTOR_FAULTS)
    assert [(e.fault, e.start_ns) for e in events] == [('reset', 10**9)]
    with pytest.raises(ConfigError, match='no fault .reset.: use one of silent'):
        parse_schedule(['reset at 1 for 2'])
    assert set(FAULTS) < set(MOTOR_FAULTS)
