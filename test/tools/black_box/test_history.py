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


"""What a dump says of who waited for whom."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rt_robot_os.kernel import BlackBoxDump
from rt_robot_os.kernel import TaskFacts
from rt_robot_os.kernel.black_box import ABORT
from rt_robot_os.kernel.black_box import BLOCKED
from rt_robot_os.kernel.black_box import CEILING
from rt_robot_os.kernel.black_box import INTERRUPT
from rt_robot_os.kernel.black_box import JOB
from rt_robot_os.kernel.black_box import MARK
from rt_robot_os.kernel.black_box import MISS
from rt_robot_os.kernel.black_box import OVERRUN
from rt_robot_os.kernel.black_box import PUBLISH
from rt_robot_os.tools.black_box import History
from rt_robot_os.tools.black_box import Outcome
from rt_robot_os.tools.black_box import show
from rt_robot_os.tools.black_box import understand

MS = 1_000_000
IMU, CONTROL, PLANNER, LOGGER = range(4)
TASKS = (TaskFacts('imu', 80, 5 * MS), TaskFacts('control', 60, 10 * MS),
         TaskFacts('planner', 20, 0), TaskFacts('logger', 5, 0))


def _history(records: Sequence[tuple[Any, ...]], at_ns: int = 100 * MS, full: bool = False,
             running: tuple[tuple[int, int, int], ...] = ()) -> History:
    return understand(BlackBoxDump('a fault', at_ns, 0, TASKS, running, tuple(records), full))


def _blocking() -> History:
    """Let a native call of the planner hold up imu and control until 14 ms."""
    return _history([
        (BLOCKED, PLANNER, 14 * MS, 3 * MS),
        (JOB, IMU, 11 * MS, 14 * MS, 15 * MS, 0),
        (JOB, CONTROL, 12 * MS, 15 * MS, 16 * MS, 0),
        (JOB, PLANNER, 8 * MS, 8 * MS, 20 * MS, 1),
        (JOB, LOGGER, 13 * MS, 20 * MS, 21 * MS, 0)])


def test_victims_are_the_higher_tasks_released_meanwhile() -> None:
    blocked, = _blocking().blocked
    assert (blocked.from_ns, blocked.at_ns) == (11 * MS, 14 * MS)
    assert [TASKS[v].name for v in blocked.victims] == ['imu', 'control']


def test_who_was_held_up_and_has_not_ended_is_not_called_nobody() -> None:
    history = _history([(BLOCKED, PLANNER, 14 * MS, 3 * MS)])
    assert history.held_up_by(history.blocked[0]) == 'one that did not end yet'
    assert 'planner for 3.0 ms: one that did not end yet' in show(history)
    assert history.held_up_by(_blocking().blocked[0]) == 'imu, control'


def test_only_lower_tasks_block() -> None:
    history = _blocking()
    waits = {TASKS[j.task].name: dict(history.blocked_by(j)) for j in history.jobs}
    assert waits == {'imu': {PLANNER: 3 * MS}, 'control': {PLANNER: 2 * MS}, 'planner': {},
                     'logger': {}}


def test_a_miss_belongs_to_the_job_that_was_late() -> None:
    history = _history([
        (JOB, IMU, 0, 1 * MS, 2 * MS, 0), (JOB, IMU, 5 * MS, 5 * MS, 12 * MS, 0),
        (MISS, IMU, 12 * MS, 2 * MS), (JOB, IMU, 15 * MS, 15 * MS, 16 * MS, 2)])
    assert [job.late_ns for job in history.jobs] == [0, 2 * MS, 0]
    assert history.jobs[2].outcome is Outcome.ABORTED


def test_a_miss_whose_job_is_gone_is_nobodys() -> None:
    history = _history([(MISS, IMU, 12 * MS, 2 * MS), (JOB, IMU, 15 * MS, 15 * MS, 16 * MS, 0)])
    assert [job.late_ns for job in history.jobs] == [0]


def test_jobs_that_still_run_are_there_with_what_preempted_them() -> None:
    history = _history([(JOB, IMU, 12 * MS, 12 * MS, 13 * MS, 0)], at_ns=20 * MS,
                       running=((LOGGER, 5 * MS, 6 * MS), (PLANNER, 7 * MS, 10 * MS)))
    found = {TASKS[j.task].name: (j.outcome, j.slices, j.depth) for j in history.jobs}
    assert found == {
        'logger': (Outcome.RUNNING, ((6 * MS, 10 * MS),), 0),
        'planner': (Outcome.RUNNING, ((10 * MS, 12 * MS), (13 * MS, 20 * MS)), 1),
        'imu': (Outcome.OK, ((12 * MS, 13 * MS),), 2)}


def test_a_job_that_was_released_again_while_it_runs_does_not_start_before_its_release() -> None:
    job, = _history([], at_ns=20 * MS, running=((PLANNER, 15 * MS, 10 * MS),)).jobs
    assert job.latency_ns == 0


def test_an_empty_black_box_is_understood() -> None:
    history = _history([])
    assert history.jobs == history.moments == history.blocked == ()
    assert 'a fault' in show(history)


def test_a_full_black_box_says_from_when_on_it_is_complete() -> None:
    history = _history([(JOB, IMU, 40 * MS, 41 * MS, 42 * MS, 0),
                        (JOB, PLANNER, 10 * MS, 11 * MS, 50 * MS, 0)], full=True)
    assert history.from_ns == 42 * MS
    assert [job.slices for job in history.jobs] == [((42 * MS, 50 * MS),), ()]


def test_the_text_tells_who_blocked_whom_and_what_failed() -> None:
    text = show(_blocking(), facts={'robot': 'arm'})
    assert 'black box: a fault' in text and 'robot arm' in text
    assert 'native call of planner blocked imu, control for 3.0 ms' in text
    assert 'imu starts, 3.0 ms after its release (blocked by planner 3.0 ms)' in text
    assert 'planner FAILS, response 12.0 ms, preempted 1 x' in text
    row = next(line for line in text.splitlines() if ' imu ' in line)
    assert row.split()[:3] == ['80', 'imu', '1'] and 'planner 3.0 ms' in row


def test_the_text_tells_every_kind_of_record() -> None:
    text = show(_history([
        (PUBLISH, IMU, 1 * MS, 'imu/data', 7), (PUBLISH, -1, 2 * MS, 'cmd', 1),
        (INTERRUPT, CONTROL, 3 * MS, 'uart'), (OVERRUN, IMU, 4 * MS, 2),
        (ABORT, PLANNER, 5 * MS, 6 * MS), (CEILING, CONTROL, 5 * MS, 7 * MS, 'map'),
        (MISS, CONTROL, 8 * MS, 1 * MS), (MARK, -1, 9 * MS, 'hello'), (77, 1, 2, 3)]))
    for expected in ('imu publishes imu/data #7', 'no task publishes cmd #1',
                     'interrupt uart releases control', 'imu OVERRUN: 2 releases found',
                     'planner ABORTED after 6.0 ms', 'control leaves map after 2.0 ms',
                     'control MISSED its deadline by 1.0 ms', 'mark: hello', '1 x kind 77'):
        assert expected in text


def test_no_more_events_than_asked_for() -> None:
    records = [(PUBLISH, IMU, n * MS, 'imu/data', n) for n in range(50)]
    text = show(_history(records), last=3)
    assert 'last 3 of 50 events' in text
    assert '#46' not in text and '#47' in text and '#49' in text
    assert 'events' not in show(_history(records), last=0)
