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

"""What becomes of releases that find the job before unfinished, policy by policy."""

from __future__ import annotations

from kernel_tools import balance
from kernel_tools import MS
from kernel_tools import StallingClock
from kernel_tools import starts
from kernel_tools import US
import pytest

from rt_robot_os.base.errors import TaskError
from rt_robot_os.kernel import FailurePolicy
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import OverrunPolicy
from rt_robot_os.kernel import Task
from rt_robot_os.kernel import TaskState
from rt_robot_os.kernel import TraceLog


@pytest.fixture
def clock() -> StallingClock:
    return StallingClock()


def stalled(kernel: Kernel, clock: StallingClock, where: str, **declared: object) -> Task:
    """Let a 1 kHz task meet five periods without a preemption point, of its own or below it."""
    stalls = [10]

    def job() -> None:
        if where == 'inside' and task.runs == 2:
            clock.stall(5 * MS)

    def low_job() -> None:
        if where == 'below' and stalls.pop():
            clock.stall(5 * MS)

    task = kernel.add_task('task', job, priority=50, rate_hz=1000.0, **declared)
    kernel.add_task('low', low_job, priority=10, rate_hz=1.0, phase_ns=2500 * US)
    return task


BOTH = pytest.mark.parametrize('where', ['inside', 'below'])


@BOTH
def test_skip_stays_on_the_grid_and_counts(
        kernel: Kernel, clock: StallingClock, log: TraceLog, where: str) -> None:
    task = stalled(kernel, clock, where)
    kernel.run(12 * MS)
    late = 7 * MS if where == 'inside' else 7500 * US
    first = [0, MS, 2 * MS]
    if where == 'inside':  # 2 ms began late by nothing and took until 7 ms
        assert starts(log, 'task') == [*first, *range(8 * MS, 12 * MS, MS)]
        assert (task.overruns, task.missed) == (5, 5)
    else:  # the release of 3 ms is served at 7.5 ms, those of 4 to 7 ms are missed
        assert starts(log, 'task') == [*first, late, *range(8 * MS, 12 * MS, MS)]
        assert (task.overruns, task.missed) == (4, 4)
    assert balance(task) == 0


@BOTH
def test_catch_up_serves_as_many_as_it_may_keep(
        kernel: Kernel, clock: StallingClock, log: TraceLog, where: str) -> None:
    task = stalled(kernel, clock, where, overrun=OverrunPolicy.CATCH_UP, catch_up=3)
    kernel.run(12 * MS)
    if where == 'inside':
        assert starts(log, 'task') == [0, MS, 2 * MS, *[7 * MS] * 3, *range(8 * MS, 12 * MS, MS)]
        assert (task.overruns, task.missed) == (5, 2)
        assert task.latency.maximum_ns == 4 * MS  # the release of 3 ms at 7 ms
    else:
        assert starts(log, 'task') == [
            0, MS, 2 * MS, *[7500 * US] * 4, *range(8 * MS, 12 * MS, MS)]
        assert (task.overruns, task.missed) == (4, 1)
    assert balance(task) == 0


def test_catch_up_never_keeps_more_than_it_may_under_a_lasting_overload(
        kernel: Kernel, clock: StallingClock) -> None:
    task = kernel.add_task('task', lambda: clock.spend(1500 * US), priority=50, rate_hz=1000.0,
                           overrun=OverrunPolicy.CATCH_UP, catch_up=2)
    kernel.run(300 * MS)
    assert task.runs == 200
    assert task.missed == 100
    # A job waits for the one that runs and for one that waits before it.
    assert 1500 * US < task.latency.maximum_ns <= 2 * 1500 * US
    assert balance(task) == 0


@BOTH
def test_rephase_restarts_the_grid_where_the_late_job_ended(
        kernel: Kernel, clock: StallingClock, log: TraceLog, where: str) -> None:
    task = stalled(kernel, clock, where, overrun=OverrunPolicy.REPHASE)
    kernel.run(12 * MS)
    if where == 'inside':
        assert starts(log, 'task') == [0, MS, 2 * MS, *range(7 * MS, 12 * MS, MS)]
        assert (task.overruns, task.missed) == (5, 4)
    else:
        again = range(7500 * US, 12 * MS, MS)
        assert starts(log, 'task') == [0, MS, 2 * MS, 7500 * US, *again]
        assert (task.overruns, task.missed) == (4, 3)
    assert balance(task) == 0


def test_rephase_under_a_lasting_overload_runs_without_a_pause(
        kernel: Kernel, clock: StallingClock, log: TraceLog) -> None:
    task = kernel.add_task('task', lambda: clock.spend(1500 * US), priority=50, rate_hz=1000.0,
                           overrun=OverrunPolicy.REPHASE)
    kernel.run(30 * MS)
    assert starts(log, 'task') == list(range(0, 30 * MS, 1500 * US))
    assert balance(task) == 0


@BOTH
def test_stop_ends_the_task_and_no_other(
        kernel: Kernel, clock: StallingClock, log: TraceLog, where: str) -> None:
    task = stalled(kernel, clock, where, overrun=OverrunPolicy.STOP)
    other = kernel.add_task('other', lambda: None, priority=5, rate_hz=1000.0)
    kernel.run(12 * MS)
    served = [0, MS, 2 * MS, 7500 * US] if where == 'below' else [0, MS, 2 * MS]
    assert starts(log, 'task') == served
    assert task.state is TaskState.STOPPED
    assert other.runs > 5
    assert 'overrun: stop' in kernel.failures[0].error and kernel.failures[0].task == 'task'
    assert balance(task) == 0


@pytest.mark.parametrize('policy', OverrunPolicy)
def test_without_a_stall_all_policies_are_the_same(
        kernel: Kernel, clock: StallingClock, log: TraceLog, policy: OverrunPolicy) -> None:
    task = kernel.add_task('task', lambda: clock.spend(900 * US), priority=50, rate_hz=1000.0,
                           overrun=policy)
    kernel.run(20 * MS)
    assert starts(log, 'task') == list(range(0, 20 * MS, MS))
    assert (task.overruns, task.missed, task.deadline_missed) == (0, 0, 0)


def overrunning(kernel: Kernel, clock: StallingClock, every: int, **declared: object) -> Task:
    """Let each n-th job of a 1 kHz task take two periods and a half."""
    def job() -> None:
        clock.spend(2500 * US if task.runs % every == every - 1 else 100 * US)

    task = kernel.add_task('task', job, priority=50, rate_hz=1000.0, **declared)
    return task


def test_overruns_that_leak_away_do_not_escalate(kernel: Kernel, clock: StallingClock) -> None:
    task = overrunning(kernel, clock, 20, overrun_limit=3, overrun_leak=9,
                       failure=FailurePolicy.STOP)
    kernel.run(500 * MS)
    assert task.state is TaskState.ACTIVE
    assert task.overruns > 40


def test_overruns_that_come_faster_than_they_leak_escalate_once(
        kernel: Kernel, clock: StallingClock) -> None:
    task = overrunning(kernel, clock, 10, overrun_limit=3, overrun_leak=9,
                       failure=FailurePolicy.STOP)
    kernel.run(500 * MS)
    # Each ten jobs bring two overruns and take one away: 2, 3, 4, which is above 3.
    assert task.state is TaskState.STOPPED
    assert task.runs == 30
    assert [f.error.split(';')[0] for f in kernel.failures] == ['4 overruns']
    assert balance(task) == 0


def test_an_escalation_runs_the_safe_state_after_the_late_job(
        kernel: Kernel, clock: StallingClock, log: TraceLog) -> None:
    safe: list[int] = []
    task = overrunning(kernel, clock, 2, overrun_limit=1, failure=FailurePolicy.SAFE_STATE,
                       on_safe_state=lambda: safe.append(clock.now_ns()))
    kernel.run(20 * MS)
    assert safe == [3500 * US]
    assert task.state is TaskState.SAFE
    assert starts(log, 'task') == [0, MS, 3500 * US]


def test_contradictions_are_refused_all_at_once(kernel: Kernel) -> None:
    with pytest.raises(TaskError) as caught:
        kernel.add_task('t', print, priority=5, rate_hz=100.0, deadline_ns=20 * MS,
                        overrun=OverrunPolicy.STOP, overrun_limit=3, restart_maximum_ns=5)
    text = str(caught.value)
    assert text.count("task 't'") == 4
    for part in ('deadline_ns 20000000 is above the period', 'overrun_limit 3 has no effect',
                 'the failure policy, which is continue', 'restart_maximum_ns 5 is below'):
        assert part in text
    assert not kernel.tasks
