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

"""Values that make no sense, too much work, and releases that nobody can follow."""

from __future__ import annotations

import json
from pathlib import Path

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
from plan_tools import task
import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.tools.plan.analysis import analyse
from rt_robot_os.tools.plan.measured import Measured
from rt_robot_os.tools.plan.measured import MeasuredTask
from rt_robot_os.tools.plan.measured import read_measured
from rt_robot_os.tools.plan.result import Verdict
from rt_robot_os.tools.plan.task import Event
from rt_robot_os.tools.plan.task import Overhead
from rt_robot_os.tools.plan.task import PlannedTask


def problems(tasks: list[PlannedTask], overhead: Overhead = Overhead()) -> tuple[str, ...]:
    with pytest.raises(ConfigError) as caught:
        analyse(tasks, overhead)
    return caught.value.problems


def test_every_wrong_value_is_told_at_once() -> None:
    assert problems([
        task('a', 0, 0, 10), task('a', 2, -5, 10, jitter_ns=-1),
        task('b', 1, 5, 10, sections={'r': 9}), PlannedTask('c', 1, execution_ns=1),
        PlannedTask('d', 1, execution_ns=1, events=(Event('x'), Event()))], Overhead(-1)) == (
        "task 'a' is there twice; names are unique",
        "task 'a': priority 0 must be an integer from 1; the higher runs first",
        "task 'a': execution_ns 0 must be an integer above 0, or None when it "
        'is unknown',
        "task 'a': jitter_ns -1 must be an integer, 0 or more",
        "task 'a': execution_ns -5 must be an integer above 0, or None when it "
        'is unknown',
        "task 'b': section on 'r' of 9 ns is longer than the whole job, 5 ns: correct one of them",
        "task 'c': nothing releases it: give it a period_ns or events",
        "task 'd': is released by 'x', which is no task of this set",
        "task 'd': an event from outside needs a period_ns: the least time between two",
        'overhead: job_ns -1 must be an integer, 0 or more')


def test_more_work_than_time_is_said_of_the_first_level_that_has_it() -> None:
    found = analyse([task('a', 3, 5, 10), task('b', 2, 6, 10), task('c', 1, 1, 1000)])
    assert [r.verdict for r in found.tasks] == [Verdict.OK, Verdict.OVERLOAD, Verdict.OVERLOAD]
    assert found.task('b').reason == ('the tasks of its priority and above want 110.0% of the '
                                      'processor')


def test_a_load_of_all_but_nothing_ends() -> None:
    tasks = [task('a', 3, 333_333_333, 10 ** 9), task('b', 2, 666_666_665, 10 ** 9 + 7),
             task('c', 1, 1, 10 ** 9 + 9, jitter_ns=10 ** 9)]
    assert analyse(tasks).task('c').verdict in (
        Verdict.OK, Verdict.LATE, Verdict.UNBOUNDED, Verdict.OVERLOAD)


def test_full_load_with_blocking_has_no_bound_and_ends() -> None:
    tasks = [task('a', 2, 5, 10), task('b', 1, 5, 10), task('low', 1, 1, 10 ** 9, native_ns=1)]
    assert analyse(tasks).task('b').verdict is Verdict.OVERLOAD


def test_tasks_that_release_one_another_in_a_circle_are_named() -> None:
    found = analyse([
        PlannedTask('a', 3, execution_ns=1, period_ns=10, events=(Event('b'),)),
        PlannedTask('b', 2, execution_ns=1, events=(Event('a'),)), task('low', 1, 1, 10)])
    assert found.task('a').reason == 'it is released in a circle: a -> b -> a'
    assert found.task('b').verdict is Verdict.UNKNOWN
    assert found.task('low').reason.startswith("it may wait for 'a'")


def test_an_unknown_time_hides_what_lies_below_and_nothing_above() -> None:
    found = analyse([task('top', 9, 1, 10), PlannedTask('x', 5, period_ns=100),
                     task('equal', 5, 1, 100), task('low', 1, 1, 100)])
    assert {r.task.name: r.verdict for r in found.tasks} == {
        'top': Verdict.OK, 'x': Verdict.UNKNOWN, 'equal': Verdict.UNKNOWN, 'low': Verdict.UNKNOWN}


NUMBERS = st.integers(0, 60)


@settings(max_examples=150)
@given(st.lists(st.builds(
    PlannedTask, st.sampled_from('abcdef'), st.integers(1, 4), period_ns=NUMBERS,
    execution_ns=st.none() | st.integers(1, 20), jitter_ns=NUMBERS, native_ns=NUMBERS,
    deadline_ns=NUMBERS, backlog=st.integers(0, 2), logical=st.booleans(),
    preemptible=st.booleans(), judged=st.booleans(),
    sections=st.dictionaries(st.sampled_from('rs'), st.none() | st.integers(0, 9), max_size=2),
    events=st.lists(st.builds(Event, st.sampled_from(['', 'a', 'b', 'c']), NUMBERS, NUMBERS),
                    max_size=2).map(tuple)), max_size=6), st.integers(0, 3), st.integers(0, 3))
def test_any_set_is_analysed_or_refused(
        tasks: list[PlannedTask], job_ns: int, tick_ns: int) -> None:
    try:
        found = analyse(tasks, Overhead(job_ns, tick_ns))
    except ConfigError as error:
        assert error.problems
        return
    assert len(found.tasks) == len(tasks)
    for result in found.tasks:
        if result.response_ns is not None:
            assert result.response_ns >= (result.task.execution_ns or 0)
        else:
            assert result.reason


# ---- the file of a measurement -----------------------------------------------------------------

MEASURED_TASK = MeasuredTask(80, 5_000_000, 200, 200, 90_000, 4000, 60_000, 200_000)
MEASURED = Measured(10 ** 9, {'imu': MEASURED_TASK}, 26_000, {'map': 7000},
                    {'gps': 'silent'}, ('SCHED_FIFO priority 80',), True)


def test_what_is_saved_is_read_back(tmp_path: Path) -> None:
    path = tmp_path / 'm.json'
    MEASURED.save(path)
    assert read_measured(path) == MEASURED


def test_a_file_that_is_not_there_names_the_remedy(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match='cannot be read: No such file.*--save-measured FILE'):
        read_measured(tmp_path / 'none.json')
    with pytest.raises(ConfigError, match='cannot be written'):
        MEASURED.save(tmp_path / 'no' / 'folder.json')


@pytest.mark.parametrize(('change', 'expected'), [
    ({'format': 2}, 'not a measurement of format 1'),
    ({'elapsed_ns': 0}, 'elapsed_ns = 0: must be an integer from 1'),
    ({'tasks': {'imu': {'priority': 'x'}}}, "tasks: 'imu': priority = 'x': must be"),
    ({'tasks': {'imu': 5}}, "tasks: 'imu' must be an object"),
    ({'tasks': {'imu': {'colour': 1}}}, "tasks: 'imu': unknown colour; known: priority,"),
    ({'resources': {'map': -1}}, 'resources: map = -1: must be an integer from 0'),
    ({'idle': 3, 'refused': 'x', 'fed': 1}, 'fed must be true or false')])
def test_a_file_with_something_else_is_refused(
        tmp_path: Path, change: dict[str, object], expected: str) -> None:
    path = tmp_path / 'm.json'
    MEASURED.save(path)
    path.write_text(json.dumps({**json.loads(path.read_text()), **change}))
    with pytest.raises(ConfigError) as caught:
        read_measured(path)
    assert any(expected in problem for problem in caught.value.problems), caught.value.problems


@settings(max_examples=100)
@given(text=st.text() | st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(
        st.sampled_from(['format', 'tasks', 'idle', 'imu', 'runs']), inner)).map(json.dumps))
def test_any_file_is_read_or_refused(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    path = tmp_path_factory.getbasetemp() / 'any.json'
    path.write_bytes(text.encode(errors='surrogatepass'))
    with pytest.raises(ConfigError):
        read_measured(path)
