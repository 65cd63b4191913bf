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


"""Declarations of tasks that contradict themselves or each other are refused, all at once."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest

from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import PartTopics
from rt_robot_os.base.schema import TopicRead
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.settings import Catalogue
from rt_robot_os.settings import check_change
from rt_robot_os.settings import parameters
from rt_robot_os.settings import PartKind
from rt_robot_os.settings import RobotParameters
from rt_robot_os.settings import RobotSettings
from rt_robot_os.settings.installed import installed

Loader = Callable[..., RobotSettings]
Judge = Callable[..., tuple[str, ...]]

TWIST = 'geometry_msgs/msg/Twist'
GUARD = """\
robot:
  ros__parameters:
    modules: [guard]
    topics: [cmd_vel]
    cmd_vel: {message: geometry_msgs/msg/Twist}
    guard:
      type: twist_guard
      rate_hz: 100.0
"""


def relay_topics(name: str, values: Mapping[str, Any]) -> PartTopics:
    return PartTopics((TopicSpec(values['out'], TWIST),),
                      (TopicRead(values['into'], wake=values['wake']),))


@pytest.fixture(scope='session')
def catalogue(catalogue: Catalogue) -> Catalogue:
    """Add a module that is woken and one with a safe state."""
    kinds = {name: catalogue.modules.find(name) for name in catalogue.modules.names()}
    relay = PartKind((Field('out', str, 'b', 'output'), Field('into', str, 'a', 'input'),
                      Field('wake', bool, True, 'whether it wakes')), relay_topics)
    waits = replace(relay, is_coroutine=True)
    safe = replace(kinds['twist_guard'], has_safe_state=True)
    lookup = type(catalogue.modules)({**kinds, 'relay': relay, 'waits': waits, 'safe_guard': safe})
    return replace(catalogue, modules=lookup)


@pytest.mark.parametrize(('lines', 'problems'), [
    (['budget_us: 20000', 'on_budget: abort'],
     ['9: guard.budget_us = 20000.0: is above the period, 10000 us at 100 Hz: a job loses its '
      'next release before it is aborted: make it smaller']),
    (['budget_us: 5000', 'on_budget: abort', 'deadline_us: 4000'],
     ['11: guard.deadline_us = 4000.0: is below budget_us, 5000 (us): a job may miss it within '
      'its budget: make the budget smaller']),
    (['budget_us: 5000', 'on_budget: abort', 'execution_us: 6000'],
     ['11: guard.execution_us = 6000.0: is above budget_us, 5000 (us): such a job is aborted: '
      'make the budget larger']),
    (['deadline_us: 10001'],
     ['9: guard.deadline_us = 10001.0: is above the period, 10000 us at 100 Hz: with overrun: '
      'skip such a job loses its next release: make it smaller, or choose overrun: catch_up']),
    (['catch_up: 3'],
     ['9: guard.catch_up = 3: is used with overrun: catch_up only, not skip: delete it']),
    (['overrun: skipp'],
     ["9: guard.overrun = 'skipp': must be one of skip, rephase, catch_up, stop"]),
    (['overrun: stop', 'overrun_limit: 3', 'failure: stop'],
     ['10: guard.overrun_limit = 3: is never reached: overrun: stop ends the task with its first '
      'overrun: choose another policy or delete the limit']),
    (['overrun_limit: 3'],
     ['9: guard.overrun_limit = 3: has no effect with failure: continue: choose '
      'restart, stop or safe_state']),
    (['on_budget: abort'],
     ["9: guard.on_budget = 'abort': has no budget: set budget_us or delete it"]),
    (['failure: restart', 'restart_s: 5', 'restart_max_s: 1'],
     ['11: guard.restart_max_s = 1.0: must be at least restart_s, 5 (s)']),
    (['restart_s: 20'],
     ['6: guard.restart_max_s = 10.0: must be at least restart_s, 20 (s)']),
    (['failure: safe_state'],
     ["9: guard.failure = 'safe_state': 'twist_guard' has no method safe_state(): choose restart "
      'or stop, or add one']),
    (['resources: [arm, "2"]'],
     ["9: guard.resources = ['arm', '2']: '2': a name must be letters, digits and '_', not "
      'beginning with a digit']),
    (['resources: [arm, arm]'],
     ["9: guard.resources = ['arm', 'arm']: a name is twice in this list: delete one"]),
    (['logical_execution: true', 'overrun: catch_up', 'deadline_us: 20000'],
     ["10: guard.overrun = 'catch_up': must be skip with logical_execution: an output that is "
      'not ready at its deadline is not published']),
    (['logical_execution: true', 'overrun_limit: 5', 'failure: stop'],
     ['10: guard.overrun_limit = 5: is never reached with logical_execution: delete it']),
    # several at once, and those of a wrong value not on top
    (['budget_us: 20000', 'on_budget: abort', 'catch_up: 3', 'restart_max_s: x', 'restart_s: 50'],
     ['9: guard.budget_us = 20000.0: is above the period, 10000 us at 100 Hz: a job loses its '
      'next release before it is aborted: make it smaller',
      '11: guard.catch_up = 3: is used with overrun: catch_up only, not skip: delete it',
      "12: guard.restart_max_s = 'x': must be a number from 0.001 to 3600 (s)"]),
])
def test_a_contradiction_is_told_with_its_remedy(
    lines: list[str], problems: list[str], problems_of: Judge,
) -> None:
    text = GUARD + ''.join(f'      {line}\n' for line in lines)
    assert problems_of(text) == tuple(f'robot.yaml:{each}' for each in problems)


def test_a_wrong_rate_hides_nothing_that_has_no_rate_in_it(problems_of: Judge) -> None:
    text = GUARD.replace('rate_hz: 100.0', 'rate_hz: fast')
    assert text != GUARD
    assert problems_of(text + '      on_budget: abort\n      deadline_us: 1e6\n') == (
        "robot.yaml:8: guard.rate_hz = 'fast': must be a number from 0 to 10000 (Hz)",
        "robot.yaml:9: guard.on_budget = 'abort': has no budget: set budget_us or delete it")


@pytest.mark.parametrize('lines', [
    ['budget_us: 20000'],
    ['budget_us: 10000', 'on_budget: abort', 'deadline_us: 10000', 'execution_us: 9000'],
    ['deadline_us: 25000', 'overrun: catch_up', 'catch_up: 3'],
    ['on_budget: warn', 'catch_up: 1'],
    ['critical: true'],
    ['resources: [arm]'],
    ['overrun_limit: 3', 'failure: restart', 'restart_s: 0.2'],
    ['type: safe_guard', 'failure: safe_state'],
])
def test_what_looks_odd_but_works_is_allowed(lines: list[str], load_text: Loader) -> None:
    text = GUARD + ''.join(f'      {line}\n' for line in lines if 'type' not in line)
    load_text(text.replace('type: twist_guard', next((x for x in lines if 'type' in x),
                                                     'type: twist_guard')))


@pytest.mark.parametrize(('lines', 'key', 'reason'), [
    (['phase_us: 5'], 'phase_us',
     '5.0: needs a rate_hz: without one only its inputs release the task'),
    (['overrun: rephase'], 'overrun',
     "'rephase': needs a rate_hz: a task that its inputs release never overruns"),
    (['overrun_limit: 5', 'failure: stop'], 'overrun_limit',
     '5: needs a rate_hz: a task that its inputs release never overruns'),
    (['logical_execution: true'], 'logical_execution',
     'true: needs a rate_hz: without one there are no instants for inputs and outputs'),
    (['critical: true'], 'critical',
     'true: needs a deadline_us without a rate_hz: otherwise the task is never late'),
])
def test_what_needs_a_rate(
    lines: list[str], key: str, reason: str, problems_of: Judge,
) -> None:
    text = GUARD.replace('twist_guard', 'relay').replace('100.0', '0').replace(
        'geometry_msgs/msg/Twist}', 'geometry_msgs/msg/Twist, topic: a}')
    text += ''.join(f'      {line}\n' for line in lines)
    assert problems_of(text) == (f'robot.yaml:9: guard.{key} = {reason}',)


def test_a_module_may_leave_its_rate_to_its_inputs(load_text: Loader) -> None:
    text = GUARD.replace('twist_guard', 'relay').replace('100.0', '0').replace(
        'geometry_msgs/msg/Twist}', 'geometry_msgs/msg/Twist, topic: a}')
    robot = load_text(text + '      deadline_us: 500\n      critical: true\n')
    assert robot.modules[0].rate_hz == 0.0


def test_a_coroutine_has_no_rate(load_text: Loader, problems_of: Judge) -> None:
    text = GUARD.replace('twist_guard', 'waits').replace(
        'geometry_msgs/msg/Twist}', 'geometry_msgs/msg/Twist, topic: a}')
    assert problems_of(text) == (
        'robot.yaml:8: guard.rate_hz = 100.0: has no effect on a coroutine run(), '
        'which awaits its releases: delete it, or await kernel.every(hz).next()',)
    text = text.replace('      rate_hz: 100.0\n', '')
    assert load_text(text).modules[0].rate_hz == 0.0
    assert problems_of(text + '      logical_execution: true\n') == (
        'robot.yaml:8: guard.logical_execution = true: needs a rate_hz: without one there are no '
        'instants for inputs and outputs',)


RELAYS = """\
robot:
  ros__parameters:
    modules: [first, second, third]
    topics: [go]
    go: {message: geometry_msgs/msg/Twist}
    first: {type: relay, into: r, out: p}
    second: {type: relay, into: p, out: q}
    third: {type: relay, into: q, out: r}
"""


def test_a_circle_of_releases_is_told_whole(problems_of: Judge) -> None:
    assert problems_of(RELAYS) == (
        'robot.yaml:6: first: these modules release each other endlessly: first -> topic p -> '
        'second -> topic q -> third -> topic r -> first. Let one of them read without wake, at '
        'its rate',)


def test_logical_execution_and_an_input_that_wakes_contradict(problems_of: Judge) -> None:
    found = problems_of(RELAYS.replace('into: r', 'logical_execution: true, into: go'))
    assert found == (
        'robot.yaml:6: first.logical_execution = true: one of its inputs wakes it, between the '
        'instants at which inputs are read: let it read without wake',)


def test_logical_execution_and_reading_on_interrupt_contradict(
        good: str, problems_of: Judge) -> None:
    found = problems_of(good.replace('rate_hz: 20, p', 'read: interrupt, logical_execution: true, '
                                     'rate_hz: 20, p'))
    assert found == (
        'robot.yaml:14: gps.logical_execution = true: with read: interrupt its samples are '
        'published as they arrive, not at the deadline: choose read: poll',)


def test_a_module_that_releases_itself_is_a_circle(problems_of: Judge) -> None:
    found = problems_of(RELAYS.replace('into: r, out: p', 'into: p, out: p'))
    assert found == (
        'robot.yaml:6: first: these modules release each other endlessly: first -> topic p -> '
        'first. Let one of them read without wake, at its rate',)


def test_a_circle_that_one_member_breaks_is_allowed(load_text: Loader) -> None:
    load_text(RELAYS.replace('into: q,', 'into: q, wake: false,'))


def test_a_misspelt_resource_is_found(problems_of: Judge, load_text: Loader) -> None:
    shared = RELAYS.replace('into: r', 'into: go').replace('{type: relay', '{XX, type: relay')
    good = shared.replace('XX, ', 'resources: [gripper], ')
    assert load_text(good).modules[2].task.resources == ('gripper',)
    found = problems_of(good.replace('[gripper], type: relay, into: q', '[griper], type: relay, '
                                     'into: q'))
    assert found == (
        "robot.yaml:8: third.resources = ['griper']: only third names 'griper', so it has no "
        "effect: did you mean 'gripper', as in first?",)


@pytest.mark.parametrize(('watchdog', 'problem'), [
    ('{timeout_s: 0.05}', 'watchdog.timeout_s = 0.05: must be at least 0.1 (s), or 0 for no '
     'watchdog'),
    ('{device: /dev/watchdog}', "watchdog.device = '/dev/watchdog': is not fed while "
     'watchdog.timeout_s is 0: set a time-out'),
    ('{timeout_s: 1, action: safe_state}', "watchdog.action = 'safe_state': no device and no "
     'module of this robot has a safe_state(): choose log or exit'),
    ('{timeout_s: 1, exit_code: 2}', 'watchdog.exit_code = 2: must be an integer from 3 to '
     '125'),
    ('5', 'watchdog = 5: must be a section'),
])
def test_a_wrong_watchdog(watchdog: str, problem: str, problems_of: Judge) -> None:
    text = GUARD.replace('modules:', f'watchdog: {watchdog}\n    modules:')
    assert problems_of(text) == (f'robot.yaml:3: {problem}',)


def test_nothing_is_aborted_without_preemption(problems_of: Judge) -> None:
    text = GUARD.replace('modules:', 'core: {dispatcher: cooperative}\n    modules:')
    assert problems_of(f'{text}      budget_us: 500\n      on_budget: abort\n') == (
        "robot.yaml:11: guard.on_budget = 'abort': core.dispatcher (robot.yaml:3) is cooperative: "
        'no job can be aborted: choose warn, or dispatcher: preemptive',)


def test_a_rate_that_would_contradict_is_refused_while_it_runs(
    load_text: Loader, catalogue: Catalogue,
) -> None:
    robot = load_text(GUARD + '      budget_us: 5000\n      on_budget: abort\n')
    assert check_change(robot, 'guard.rate_hz', 200.0, catalogue) is None
    assert check_change(robot, 'guard.rate_hz', 400, catalogue) == (
        'guard.rate_hz = 400: guard.budget_us = 5000.0 does not fit: it is above the period, '
        '2500 us at 400 Hz: a job loses its next release before it is aborted: make it '
        'smaller')
    assert check_change(robot, 'guard.rate_hz', 0, catalogue) == (
        'guard.rate_hz = 0: must be a number from 0.1 to 10000 (Hz)')
    now = RobotParameters(robot, catalogue)
    now.set('guard.rate_hz', 150)
    assert now.settings.modules[0].rate_hz == 150.0


def test_a_task_without_rate_gets_none_while_it_runs(
    load_text: Loader, catalogue: Catalogue,
) -> None:
    robot = load_text(RELAYS.replace('into: r', 'rate_hz: 0, into: go'))
    reason = check_change(robot, 'first.rate_hz', 10.0, catalogue)
    assert reason is not None and reason.startswith('first.rate_hz is read at the start only')


def test_what_a_task_declares_is_a_parameter(load_text: Loader, catalogue: Catalogue) -> None:
    robot = load_text(GUARD + '      budget_us: 5000\n      resources: [arm]\n')
    found = {each.name: each for each in parameters(robot, catalogue)}
    assert found['guard.budget_us'].value == 5000.0 and found['guard.budget_us'].read_only
    assert found['guard.resources'].value == ['arm']
    assert found['guard.failure'].value == 'continue'
    assert found['watchdog.timeout_s'].value == 0.0
    assert found['core.dispatcher'].value == 'preemptive'


def test_the_guard_that_is_installed_wakes_nobody_in_a_circle() -> None:
    topics = installed().modules.find('twist_guard').topics('guard', {})
    assert [each.wake for each in topics.read] == [False]
