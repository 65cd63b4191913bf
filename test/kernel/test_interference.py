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


"""Who used the CPU while a task waited: against a model that looks at each nanosecond."""

from __future__ import annotations

from collections import Counter
from collections import deque
from typing import Any

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest

from rt_robot_os.kernel import Task
from rt_robot_os.kernel import TaskSpec
from rt_robot_os.kernel.interference import blame
from rt_robot_os.kernel.interference import RECORDS_MAXIMUM
from rt_robot_os.kernel.interference import SUSPECTS_MAXIMUM

JOB, PUBLISH, CEILING, BLOCKED = 0, 1, 5, 6
Record = tuple[Any, ...]
NAMES = ('idle talk', 'planner', 'logger', 'camera', 'control')


def _task(name: str, index: int = 0) -> Task:
    return Task(TaskSpec(name, 10 + index), print, index)


def _job(task: Task, start_ns: int, end_ns: int) -> Record:
    return (JOB, task, start_ns, start_ns, end_ns, 0)


@pytest.fixture
def tasks() -> dict[str, Task]:
    return {name: _task(name, index) for index, name in enumerate(NAMES)}


def test_who_used_most_comes_first_and_the_task_itself_never(tasks: dict[str, Task]) -> None:
    records = [_job(tasks['planner'], 0, 100), _job(tasks['logger'], 100, 400),
               _job(tasks['camera'], 400, 450), _job(tasks['control'], 450, 2000)]
    assert blame(reversed(records), tasks['control'], 0, 2000) == (
        'logger', 'planner', 'camera')


def test_what_preempted_a_job_is_not_charged_to_it(tasks: dict[str, Task]) -> None:
    records = [_job(tasks['camera'], 100, 900), _job(tasks['planner'], 0, 1000)]
    assert blame(reversed(records), tasks['control'], 0, 1000) == ('camera', 'planner')


def test_only_the_part_after_the_release_counts(tasks: dict[str, Task]) -> None:
    records = [_job(tasks['planner'], 0, 1000), _job(tasks['camera'], 1000, 1100)]
    assert blame(reversed(records), tasks['control'], 950, 1100) == ('camera', 'planner')
    assert blame(reversed(records), tasks['control'], 1000, 1100) == ('camera',)


def test_a_native_call_of_a_job_that_still_runs_counts(tasks: dict[str, Task]) -> None:
    records = [(BLOCKED, tasks['planner'], 900, 800), _job(tasks['camera'], 900, 1000)]
    assert blame(reversed(records), tasks['control'], 100, 1100) == ('planner', 'camera')


def test_a_resource_held_by_a_job_that_still_runs_counts(tasks: dict[str, Task]) -> None:
    records = [_job(tasks['camera'], 200, 500),
               (CEILING, tasks['planner'], 100, 600, 'map')]
    assert blame(reversed(records), tasks['control'], 100, 700) == ('camera', 'planner')


def test_a_native_call_of_an_ended_job_counts_once(tasks: dict[str, Task]) -> None:
    records = [(BLOCKED, tasks['planner'], 250, 200), (CEILING, tasks['planner'], 10, 260, 'map'),
               _job(tasks['planner'], 0, 300), _job(tasks['camera'], 300, 650)]
    assert blame(reversed(records), tasks['control'], 0, 700) == ('camera', 'planner')


def test_no_other_task_ran(tasks: dict[str, Task]) -> None:
    assert blame((), tasks['control'], 0, 10) == ()
    records = [_job(tasks['planner'], 0, 100), (PUBLISH, None, 120, 'imu', 1)]
    assert blame(reversed(records), tasks['control'], 100, 200) == ()


def test_no_more_records_are_taken_than_promised(tasks: dict[str, Task]) -> None:
    source = iter([_job(tasks['planner'], 1000 - n, 1001 - n) for n in range(1000)])
    blame(source, tasks['control'], 0, 1001)
    assert len(list(source)) == 1000 - RECORDS_MAXIMUM


class Story:
    """A random schedule: nested jobs on one CPU, and who had it in each nanosecond."""

    def __init__(self) -> None:
        self.now_ns = 0
        self.records: list[Record] = []
        self.owner: list[str] = []

    def compute(self, name: str, duration_ns: int) -> None:
        self.owner += [name] * duration_ns
        self.now_ns += duration_ns

    def job(self, tasks: list[Task], level: int, plan: list[Any]) -> None:
        start_ns = self.now_ns
        for part in plan:
            if isinstance(part, int):
                before_ns = self.now_ns
                self.compute(tasks[level].name, part)
                if part % 3 == 0:
                    self.records.append(
                        (BLOCKED, tasks[level], self.now_ns, self.now_ns - before_ns))
            elif level + 1 < len(tasks):
                self.job(tasks, level + 1, part)
        self.records.append((JOB, tasks[level], start_ns, start_ns, self.now_ns, 0))


PLANS = st.recursive(
    st.lists(st.integers(0, 9), max_size=3),
    lambda inner: st.lists(st.integers(0, 9) | inner, max_size=4), max_leaves=12)


@settings(max_examples=150, deadline=None)
@given(st.lists(PLANS, min_size=1, max_size=4), st.integers(0, 4), st.data())
def test_the_suspects_are_those_of_a_model(
    plans: list[Any], late: int, data: st.DataObject,
) -> None:
    tasks = [_task(name, index) for index, name in enumerate(NAMES)]
    story = Story()
    for plan in plans:
        story.job(tasks, 0, plan)
        story.compute('', 1)
    release_ns = data.draw(st.integers(0, story.now_ns))
    end_ns = data.draw(st.integers(release_ns, story.now_ns))
    records = deque(story.records, maxlen=8192)
    got = blame(reversed(records), tasks[late], release_ns, end_ns)
    used = Counter(story.owner[release_ns:end_ns])
    del used[''], used[tasks[late].name]
    if len(records) <= RECORDS_MAXIMUM:
        assert got == tuple(sorted(used, key=lambda name: (-used[name], name)))[:SUSPECTS_MAXIMUM]
    assert len(got) <= SUSPECTS_MAXIMUM
    assert set(got) <= {task.name for task in tasks} - {tasks[late].name}
