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


"""Missed deadlines, and the records of the black box."""

from __future__ import annotations

from functools import partial
import json
from typing import Any

from kernel_tools import MS
from kernel_tools import S
from kernel_tools import StallingClock
from kernel_tools import US
import pytest

from rt_robot_os.kernel import black_box
from rt_robot_os.kernel import fault_handling
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import OverrunPolicy
from rt_robot_os.kernel import VirtualClock


@pytest.fixture
def kernel() -> Kernel:
    return Kernel(StallingClock(start_ns=5 * S))


def records(kernel: Kernel, kind: int) -> list[tuple[object, ...]]:
    return [record[1:] for record in kernel.black_box.records if record[0] == kind]


def test_the_latest_miss_says_which_job_how_late_and_who_ran_instead(kernel: Kernel) -> None:
    hog = kernel.add_task('hog', lambda: kernel.clock.spend(7 * MS if hog.runs == 2 else MS),
                          priority=80, rate_hz=100.0)
    task = kernel.add_task('task', lambda: kernel.clock.spend(MS), priority=50, rate_hz=100.0,
                           deadline_ns=5 * MS)
    kernel.add_task('below', lambda: kernel.clock.spend(MS), priority=20, rate_hz=100.0)
    kernel.run(100 * MS)
    assert task.deadline_missed == 1 and hog.deadline_missed == 0
    miss = task.statistics().last_miss
    assert miss is not None
    assert (miss.job, miss.release_ns, miss.late_ns) == (3, 5 * S + 20 * MS, 3 * MS)
    assert miss.ran_instead == ('hog',)
    assert records(kernel, black_box.MISS) == [(task, 5 * S + 28 * MS, 3 * MS)]
    assert task.response_maximum_ns == 8 * MS


def test_the_deadline_is_the_period_and_follows_it(kernel: Kernel) -> None:
    task = kernel.add_task('task', lambda: kernel.clock.spend(8 * MS), priority=50,
                           rate_hz=100.0, overrun=OverrunPolicy.CATCH_UP)
    kernel.run(50 * MS)
    assert task.deadline_missed == 0
    task.set_rate_hz(200.0)
    assert task.deadline_ns == 5 * MS


def test_an_event_released_task_has_the_deadline_that_it_declares(kernel: Kernel) -> None:
    free = kernel.add_task('free', lambda: kernel.clock.spend(MS), priority=50)
    bound = kernel.add_task('bound', lambda: kernel.clock.spend(MS), priority=40,
                            deadline_ns=1500 * US)

    def source() -> None:
        kernel.release(bound)
        kernel.release(free)

    kernel.add_task('source', source, priority=90, rate_hz=100.0)
    kernel.run(30 * MS)
    assert (free.deadline_missed, bound.deadline_missed) == (0, 3)


def test_misses_without_end_are_all_counted(kernel: Kernel) -> None:
    task = kernel.add_task('task', lambda: kernel.clock.spend(US), priority=50, rate_hz=10_000.0,
                           deadline_ns=1)
    kernel.run(50 * MS)
    assert task.deadline_missed == 500
    assert task.last_miss is not None and task.last_miss.job == 500


def test_an_overload_is_not_made_worse_by_looking_for_suspects(
        kernel: Kernel, monkeypatch: pytest.MonkeyPatch) -> None:
    looks: list[int] = []

    def look(*arguments: object) -> tuple[str, ...]:
        looks.append(kernel.now_ns())
        return ('someone',)

    monkeypatch.setattr(fault_handling, 'blame', look)
    tasks = [kernel.add_task(f'task_{n}', lambda: kernel.clock.spend(50 * US), priority=50,
                             rate_hz=1000.0, deadline_ns=US) for n in range(10)]
    kernel.run(100 * MS)
    assert sum(task.deadline_missed for task in tasks) == 1000
    # Once in 10 ms for the whole kernel, not for each task: it costs as much as many jobs.
    assert len(looks) <= 10 and all(b - a >= 10 * MS for a, b in zip(looks, looks[1:]))


def test_a_job_is_one_record_and_nesting_shows_preemption(kernel: Kernel) -> None:
    low = kernel.add_task('low', lambda: kernel.clock.spend(5 * MS), priority=10, rate_hz=10.0)
    high = kernel.add_task('high', lambda: kernel.clock.spend(MS), priority=90, rate_hz=10.0,
                           phase_ns=2 * MS)
    kernel.run(50 * MS)
    t = 5 * S
    assert records(kernel, black_box.JOB) == [
        (high, t + 2 * MS, t + 2 * MS, t + 3 * MS, black_box.OK),
        (low, t, t, t + 6 * MS, black_box.OK)]


def test_a_native_call_that_holds_up_an_interrupt_is_named(kernel: Kernel) -> None:
    clock = kernel.clock
    assert isinstance(clock, StallingClock)
    low = kernel.add_task('low', lambda: clock.stall(4 * MS), priority=10, rate_hz=10.0)
    kernel.add_task('high', lambda: None, priority=90, rate_hz=10.0, phase_ns=MS)
    kernel.run(50 * MS)
    (task, at_ns, late_ns), = records(kernel, black_box.BLOCKED)
    assert task is low and late_ns == 3 * MS + 0 and at_ns == 5 * S + 4 * MS
    assert low.blocked_maximum_ns == 3 * MS


def test_overruns_failures_sections_and_marks_are_there(kernel: Kernel) -> None:
    shared = kernel.resource('shared')

    def job() -> None:
        with shared:
            kernel.clock.spend(MS)
        kernel.clock.spend(11 * MS)
        kernel.black_box.mark(kernel.now_ns(), 'here')
        raise ValueError

    task = kernel.add_task('task', job, priority=50, rate_hz=100.0, resources=[shared])
    kernel.run(15 * MS)
    t = 5 * S
    assert [record[0] for record in kernel.black_box.records] == [
        black_box.CEILING, black_box.MARK, black_box.JOB, black_box.MISS, black_box.OVERRUN]
    assert records(kernel, black_box.CEILING) == [(task, t, t + MS, 'shared')]
    assert records(kernel, black_box.OVERRUN) == [(task, t + 10 * MS, 1)]
    assert records(kernel, black_box.MARK) == [(None, t + 12 * MS, 'here')]
    assert records(kernel, black_box.JOB) == [(task, t, t, t + 12 * MS, black_box.FAILED)]


def test_a_dump_is_plain_data_with_the_jobs_that_still_run() -> None:
    kernel = Kernel(VirtualClock(), black_box_records=4)
    dumps = []

    def high_job() -> None:
        kernel.clock.spend(MS)
        dumps.append(kernel.black_box_dump('test'))

    kernel.add_task('tick', lambda: None, priority=95, rate_hz=1000.0)
    kernel.add_task('low', lambda: kernel.clock.spend(20 * MS), priority=10, rate_hz=1.0,
                    phase_ns=100 * US)
    kernel.add_task('high', high_job, priority=90, rate_hz=1.0, phase_ns=8500 * US)
    kernel.run(30 * MS)
    dump, = dumps
    assert (dump.reason, dump.at_ns, dump.start_ns) == ('test', 9500 * US, 0)
    assert [(t.name, t.priority, t.period_ns) for t in dump.tasks] == [
        ('tick', 95, MS), ('low', 10, S), ('high', 90, S)]
    assert dump.running == ((1, 100 * US, 100 * US), (2, 8500 * US, 8500 * US))
    assert dump.full and len(dump.records) == 4
    assert [record[0:2] for record in dump.records] == [(black_box.JOB, 0)] * 4
    assert json.loads(json.dumps(dump.records)) == [list(record) for record in dump.records]


def test_the_box_is_bounded() -> None:
    kernel = Kernel(VirtualClock(), black_box_records=100)
    kernel.add_task('tick', lambda: None, priority=95, rate_hz=10_000.0)
    kernel.run(S)
    assert len(kernel.black_box.records) == 100
    assert kernel.black_box.records[-1][3] == S - 100 * US


def test_observers_are_told_what_is_recorded_in_the_order_in_which_they_came() -> None:
    kernel = Kernel(VirtualClock())
    told: list[tuple[str, int, str]] = []

    def note(who: str, record: tuple[Any, ...]) -> None:
        assert kernel.locked and kernel.black_box.records[-1] == record
        told.append((who, record[0], record[1].name))

    kernel.add_observer(partial(note, 'first'))
    kernel.add_observer(partial(note, 'second'))
    kernel.add_task('task', lambda: None, priority=50, rate_hz=100.0)
    kernel.run(15 * MS)
    assert told == [('first', black_box.JOB, 'task'), ('second', black_box.JOB, 'task')] * 2


def test_an_observer_that_raises_is_reported_and_told_no_more() -> None:
    kernel = Kernel(VirtualClock())
    told: list[int] = []

    def bad(record: tuple[Any, ...]) -> None:
        raise ValueError('not prepared for that')

    kernel.add_observer(bad)
    kernel.add_observer(lambda record: told.append(record[0]))
    task = kernel.add_task('task', lambda: None, priority=50, rate_hz=100.0)
    kernel.run(25 * MS)
    assert told == [black_box.JOB] * 3 and task.failures == 0 and task.runs == 3
    report, = kernel.failures
    assert report.task == 'observer' and report.error == 'ValueError: not prepared for that'
