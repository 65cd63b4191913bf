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


"""Releases lie on an absolute grid; what is missed is counted; rates change at a release."""

from __future__ import annotations

from kernel_tools import balance
from kernel_tools import CLOCKS
from kernel_tools import MS
from kernel_tools import names
from kernel_tools import S
from kernel_tools import StallingClock
from kernel_tools import starts
from kernel_tools import US
import pytest

from rt_robot_os.base.errors import TaskError
from rt_robot_os.kernel import Clock
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import Task
from rt_robot_os.kernel import TraceLog
from rt_robot_os.kernel import VirtualClock


@pytest.fixture
def clock() -> StallingClock:
    return StallingClock(start_ns=7 * S)


def test_releases_do_not_drift(kernel: Kernel, log: TraceLog) -> None:
    task = kernel.add_task('third', lambda: kernel.clock.spend(task.runs % 7 * 100 * US),
                           priority=50, rate_hz=300.0, phase_ns=123)
    kernel.run(10 * S)
    assert task.period_ns == 3_333_333
    assert starts(log, 'third') == [7 * S + 123 + n * 3_333_333 for n in range(3001)]
    assert task.jitter.maximum_ns == task.latency.maximum_ns == 0


def test_a_run_for_a_time_has_exactly_the_releases_of_that_time(kernel: Kernel) -> None:
    tasks = [kernel.add_task(f'{rate}', lambda: None, priority=rate // 10, rate_hz=rate)
             for rate in (10, 100, 500)]
    assert kernel.run(S) == 'duration'
    assert [task.runs for task in tasks] == [10, 100, 500]
    assert [task.releases for task in tasks] == [10, 100, 500]


def test_a_stall_of_five_periods_gives_one_late_job_and_counts_the_others(
        kernel: Kernel, clock: StallingClock) -> None:
    def low_job() -> None:
        clock.spend(2500 * US)
        clock.stall(5 * MS)

    task = kernel.add_task('task', lambda: None, priority=50, rate_hz=1000.0)
    low = kernel.add_task('low', low_job, priority=10, rate_hz=1.0)
    kernel.run(20 * MS)
    # Releases at 0, 1, 2 ms in time; that of 3 ms runs at 7.5 ms; 4, 5, 6, 7 ms are missed.
    assert (task.releases, task.runs, task.missed) == (20, 16, 4)
    assert task.latency.maximum_ns == 4500 * US
    assert task.gap_maximum_ns == 5500 * US
    assert task.jitter.maximum_ns == 4500 * US
    assert low.blocked_maximum_ns == 4500 * US
    assert task.blocked_maximum_ns == 0


def test_a_stall_beyond_the_end_adds_no_releases(
        kernel: Kernel, clock: StallingClock) -> None:
    def low_job() -> None:
        clock.spend(6500 * US)
        clock.stall(20 * MS)

    task = kernel.add_task('task', lambda: None, priority=50, rate_hz=1000.0)
    kernel.add_task('low', low_job, priority=10, rate_hz=1.0)
    assert kernel.run(10 * MS) == 'duration'
    assert (task.releases, task.runs, task.missed) == (10, 7, 3)


def test_a_job_that_overruns_skips_releases_and_stays_on_the_grid(
        kernel: Kernel, log: TraceLog) -> None:
    task = kernel.add_task('task', lambda: kernel.clock.spend(2500 * US), priority=50,
                           rate_hz=1000.0)
    kernel.run(9 * MS)
    assert [at - 7 * S for at in starts(log, 'task')] == [0, 3 * MS, 6 * MS]
    assert (task.releases, task.runs, task.missed) == (9, 3, 6)


def test_a_changed_rate_takes_effect_after_the_next_release_and_keeps_the_grid(
        kernel: Kernel, log: TraceLog) -> None:
    rates = iter([50.0, 200.0])
    task = kernel.add_task('task', lambda: None, priority=50, rate_hz=100.0)
    kernel.add_task('tuner', lambda: task.set_rate_hz(next(rates)), priority=10, rate_hz=1e3 / 30,
                    phase_ns=15 * MS)
    kernel.run(60 * MS)
    # 100 Hz; 50 Hz from 20 ms on, asked for at 15; 200 Hz from 60 ms on, asked for at 45.
    assert [(at - 7 * S) // MS for at in starts(log, 'task')] == [0, 10, 20, 40]
    assert task.rate_hz == 200.0
    assert task.jitter.maximum_ns == 0, 'the period that counts is the one that was in force'


def test_a_task_may_change_its_own_rate(kernel: Kernel, log: TraceLog) -> None:
    task = kernel.add_task('task', lambda: task.set_rate_hz(1000.0 / (task.runs + 1)),
                           priority=50, rate_hz=1000.0)
    kernel.run(20 * MS)
    assert [at - 7 * S for at in starts(log, 'task')] == [n * MS for n in (0, 1, 2, 4, 7, 11, 16)]
    assert task.jitter.maximum_ns == 0
    assert task.releases == task.runs


def test_phases_shift_the_grid(kernel: Kernel, log: TraceLog) -> None:
    for name, phase_ns in (('a', 0), ('b', 3 * MS), ('c', 25 * MS)):
        kernel.add_task(name, lambda: None, priority=50, rate_hz=100.0, phase_ns=phase_ns)
    kernel.run(30 * MS)
    assert ''.join(names(log)) == 'ababab' + 'c'


@pytest.mark.parametrize('clock_class', CLOCKS.values(), ids=CLOCKS)
def test_a_kernel_runs_again_and_goes_on_counting(clock_class: type[Clock]) -> None:
    kernel = Kernel(clock_class())

    def job() -> None:
        if task.runs % 5 == 4:
            kernel.stop(f'after {task.runs + 1}')

    task = kernel.add_task('task', job, priority=50, rate_hz=1000.0)
    assert kernel.run() == 'after 5'
    first_start = kernel.start_ns
    assert kernel.run() == 'after 10'
    assert kernel.start_ns > first_start or clock_class is VirtualClock
    assert task.runs == 10
    assert balance(task) == 0


def test_the_pause_between_two_runs_is_no_gap(kernel: Kernel, clock: StallingClock) -> None:
    task = kernel.add_task('task', lambda: None, priority=50, rate_hz=100.0)
    kernel.run(50 * MS)
    clock.stall(S)
    kernel.run(50 * MS)
    assert task.gap_maximum_ns == 10 * MS
    assert task.jitter.maximum_ns == 0


def test_stop_inside_nested_jobs_lets_them_end_and_starts_no_other(
        kernel: Kernel, log: TraceLog) -> None:
    def low_job() -> None:
        kernel.clock.spend(2 * MS)
        ended.append('low')

    def high_job() -> None:
        kernel.stop('enough')
        kernel.release(top)
        kernel.clock.spend(5 * MS)
        ended.append('high')

    ended: list[str] = []
    low = kernel.add_task('low', low_job, priority=10, rate_hz=100.0)
    high = kernel.add_task('high', high_job, priority=50, rate_hz=100.0, phase_ns=MS)
    top = kernel.add_task('top', lambda: None, priority=90)
    waiting = kernel.add_task('waiting', lambda: None, priority=5, rate_hz=100.0)
    assert kernel.run() == 'enough'
    assert ended == ['high', 'low']
    assert names(log) == ['low', 'high']
    assert (waiting.releases, waiting.runs, waiting.missed) == (1, 0, 1)
    assert (top.releases, top.runs, top.missed) == (1, 0, 1)
    assert not any(map(balance, (low, high)))


def test_stop_before_run_is_not_forgotten(kernel: Kernel) -> None:
    task = kernel.add_task('task', lambda: None, priority=50, rate_hz=100.0)
    kernel.stop('SIGTERM while starting')
    assert kernel.run(S) == 'SIGTERM while starting'
    assert task.runs == 0
    assert kernel.run(S) == 'duration'
    assert task.runs == 100


def test_a_kernel_with_nothing_to_wait_for_says_so_on_the_virtual_clock(kernel: Kernel) -> None:
    kernel.add_task('event', lambda: None, priority=50)
    with pytest.raises(TaskError, match='nothing to wait for'):
        kernel.run()
    assert kernel.run(MS) == 'duration', 'and is as good as new'


def test_running_a_kernel_that_runs_is_refused(kernel: Kernel) -> None:
    errors: list[str] = []

    def job() -> None:
        with pytest.raises(TaskError) as caught:
            kernel.run(MS)
        errors.append(str(caught.value))
        with pytest.raises(TaskError) as caught:
            kernel.add_task('late', lambda: None, priority=1)
        errors.append(str(caught.value))

    kernel.add_task('task', job, priority=50, rate_hz=10.0)
    kernel.run(MS)
    assert not kernel.failures
    assert errors == ['the kernel runs already',
                      "task 'late': the kernel is running; add all tasks before run()"]


@pytest.mark.parametrize(('arguments', 'words'), [
    ({'priority': 0}, "'bad': priority 0 must be an integer from 1 to 99"),
    ({'priority': 100}, 'priority 100'),
    ({'priority': 5.0}, 'priority 5.0'),
    ({'priority': True}, 'priority True'),
    ({'priority': 5, 'phase_ns': -1}, 'phase_ns -1'),
    ({'priority': 5, 'rate_hz': 0}, 'rate_hz 0 must be above 0'),
    ({'priority': 5, 'rate_hz': -1.0}, 'rate_hz -1.0'),
    ({'priority': 5, 'rate_hz': float('nan')}, 'rate_hz nan'),
    ({'priority': 5, 'rate_hz': float('inf')}, 'rate_hz inf'),
    ({'priority': 5, 'rate_hz': 10 ** 400}, 'at most 100000 Hz'),
    ({'priority': 5, 'rate_hz': 100_001.0}, 'at most 100000 Hz'),
    ({'priority': 5, 'rate_hz': '10'}, "rate_hz '10'"),
    ({'priority': 5, 'rate_hz': True}, 'rate_hz True'),
])
def test_a_wrong_declaration_names_task_value_and_range(
        kernel: Kernel, arguments: dict[str, object], words: str) -> None:
    with pytest.raises(TaskError) as caught:
        kernel.add_task('bad', lambda: None, **arguments)  # type: ignore[arg-type]
    assert words in str(caught.value)
    assert "'bad'" in str(caught.value)
    assert kernel.tasks == ()


def test_a_duration_may_be_a_whole_number_of_any_type(kernel: Kernel) -> None:
    # As of 1e9 or numpy, which a function that was compiled for int refuses.
    np = pytest.importorskip('numpy')
    task = kernel.add_task('task', lambda: None, priority=50, rate_hz=np.float64(100.0))
    assert kernel.run(np.int64(50 * MS)) == 'duration' and task.runs == 5
    assert kernel.run(5e7) == 'duration' and task.runs == 10  # type: ignore[arg-type]


def test_a_name_is_taken_once_and_a_function_is_called(kernel: Kernel) -> None:
    kernel.add_task('task', lambda: None, priority=5)
    with pytest.raises(TaskError, match="'task' exists already"):
        kernel.add_task('task', lambda: None, priority=6)
    with pytest.raises(TaskError, match='is not callable'):
        kernel.add_task('other', 'step', priority=6)  # type: ignore[arg-type]
    with pytest.raises(TaskError, match="no task 'other'; there are: task"):
        kernel.task('other')


def test_a_task_without_a_period_has_no_rate_to_change(kernel: Kernel) -> None:
    task: Task = kernel.add_task('event', lambda: None, priority=5)
    assert task.rate_hz == 0.0
    with pytest.raises(TaskError, match="'event' has no period"):
        task.set_rate_hz(10.0)


def test_the_order_of_declaration_decides_at_the_same_moment(
        kernel: Kernel, log: TraceLog) -> None:
    for index in range(20):
        kernel.add_task(f'{index}', lambda: None, priority=50, rate_hz=10.0)
    kernel.run(MS)
    assert names(log) == [f'{index}' for index in range(20)]
