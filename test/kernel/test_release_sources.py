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


"""Releases by timers, by other tasks, and by sources that must not flood the kernel."""

from __future__ import annotations

from collections.abc import Iterator
import gc
import os

from kernel_tools import balance
from kernel_tools import MS
from kernel_tools import names
from kernel_tools import S
from kernel_tools import spin_until
from kernel_tools import starts
from kernel_tools import US
import pytest

from rt_robot_os.base.errors import TaskError
from rt_robot_os.kernel import BudgetPolicy
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import MonotonicClock
from rt_robot_os.kernel import TraceLog


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    ends = os.pipe()
    os.set_blocking(ends[1], False)
    yield ends
    for end in ends:
        os.close(end)


# ---- one-shot timers -----------------------------------------------------------------------

def test_a_timer_releases_its_task_once_at_its_time(kernel: Kernel) -> None:
    log = kernel.trace = TraceLog()
    late = kernel.add_task('late', lambda: None, priority=80)
    timer = kernel.timer(late)
    kernel.add_task('starter', lambda: timer.start(2500 * US), priority=50, rate_hz=100.0)
    kernel.run(30 * MS)
    assert starts(log, 'late') == [2500 * US, 12500 * US, 22500 * US]
    assert late.latency.maximum_ns == 0 and not timer.started


def test_a_timer_preempts_a_job_that_started_it(kernel: Kernel) -> None:
    log = kernel.trace = TraceLog()
    timer = kernel.timer(kernel.add_task('high', lambda: None, priority=80))

    def job() -> None:
        timer.start(MS)
        kernel.clock.spend(3 * MS)

    kernel.add_task('low', job, priority=10, rate_hz=100.0)
    kernel.run(10 * MS)
    assert log.text() == 'low start\n  high start\n  high end\nlow end\n'
    assert starts(log, 'high') == [MS]


def test_a_timer_started_again_forgets_its_first_time(kernel: Kernel) -> None:
    task = kernel.add_task('timeout', lambda: None, priority=80)
    timer = kernel.timer(task)
    kernel.add_task('feeder', lambda: timer.start(15 * MS), priority=50, rate_hz=100.0)
    kernel.run(S)
    assert task.runs == 0  # fed each 10 ms
    fires = [each for each in gc.get_objects() if getattr(each, '__self__', None) is timer]
    assert len(fires) <= 1  # the kernel has forgotten all but the last start


def test_a_cancelled_timer_releases_nothing_and_cancelling_twice_is_fine(kernel: Kernel) -> None:
    task = kernel.add_task('task', lambda: None, priority=80)
    timer = kernel.timer(task)
    seen = []

    def job() -> None:
        timer.start(MS)
        seen.append(timer.started)
        timer.cancel()
        timer.cancel()
        seen.append(timer.started)

    kernel.add_task('job', job, priority=50, rate_hz=1.0)
    kernel.run(10 * MS)
    assert task.runs == 0 and seen == [True, False]


def test_a_time_that_has_passed_releases_at_once(kernel: Kernel) -> None:
    log = kernel.trace = TraceLog()
    timer = kernel.timer(kernel.add_task('high', lambda: None, priority=80))
    kernel.add_task('low', lambda: timer.start_at(0), priority=10, rate_hz=100.0, phase_ns=MS)
    kernel.run(10 * MS)
    assert names(log) == ['low', 'high']
    assert log.text() == 'low start\n  high start\n  high end\nlow end\n'


def test_a_timer_with_a_negative_delay_or_without_a_running_kernel_is_an_error(
        kernel: Kernel) -> None:
    timer = kernel.timer(kernel.add_task('task', lambda: None, priority=80))
    with pytest.raises(TaskError, match="timer of task 'task': the kernel is not running"):
        timer.start(MS)
    with pytest.raises(TaskError, match='delay_ns -1 is negative'):
        timer.start(-1)


def test_on_the_real_clock_a_timer_ends_the_wait() -> None:
    kernel = Kernel(MonotonicClock())
    timer = kernel.timer(kernel.add_task('end', lambda: kernel.stop('timer'), priority=80))
    kernel.add_task('starter', lambda: timer.start(3 * MS), priority=50, rate_hz=0.01)
    assert kernel.run(60 * S) == 'timer'


# ---- after another task --------------------------------------------------------------------

def test_a_task_is_released_when_a_job_of_another_has_ended(kernel: Kernel) -> None:
    log = kernel.trace = TraceLog()
    first = kernel.add_task('first', lambda: kernel.clock.spend(MS), priority=50, rate_hz=100.0)
    second = kernel.add_task('second', lambda: kernel.clock.spend(MS), priority=70, after=[first])
    kernel.add_task('third', lambda: None, priority=20, after=[second, first])
    kernel.run(20 * MS)
    assert names(log) == ['first', 'second', 'third'] * 2
    assert starts(log, 'second') == [MS, 11 * MS]
    assert kernel.task('third').coalesced == 2  # once by each, served by one job
    assert not any(map(balance, kernel.tasks))


def test_a_job_that_failed_has_ended_as_well(kernel: Kernel) -> None:
    first = kernel.add_task('first', lambda: 1 / 0, priority=50, rate_hz=100.0)
    second = kernel.add_task('second', lambda: None, priority=70, after=[first])
    kernel.run(20 * MS)
    assert second.runs == 2


def test_a_circle_is_refused_and_named(kernel: Kernel) -> None:
    a = kernel.add_task('a', print, priority=50)
    b = kernel.add_task('b', print, priority=50, after=[a])
    c = kernel.add_task('c', print, priority=50, after=[b])
    c.successors = (a,)
    with pytest.raises(TaskError, match=r"in a cycle: 'a' -> 'b' -> 'c' -> 'a'"):
        kernel.run(MS)


# ---- floods --------------------------------------------------------------------------------

def test_a_source_releases_no_more_often_than_its_separation_allows(
        kernel: Kernel, pipe: tuple[int, int]) -> None:
    log = kernel.trace = TraceLog()
    reader = kernel.add_task('reader', lambda: os.read(pipe[0], 100), priority=80)
    kernel.add_interrupt(pipe[0], reader, separation_ns=5 * MS, name='line')
    # The virtual clock looks at descriptors whenever all are idle: each millisecond here.
    kernel.add_task('writer', lambda: os.write(pipe[1], b'x'), priority=10, rate_hz=1000.0)
    kernel.run(100 * MS)
    gaps = {b - a for a, b in zip(starts(log, 'reader'), starts(log, 'reader')[1:])}
    assert min(gaps) >= 5 * MS
    assert 15 <= reader.runs <= 20
    source, = kernel.statistics().sources
    assert (source.name, source.task) == ('line', 'reader')
    assert source.deferred > 10 and source.arrivals >= reader.runs
    assert os.read(pipe[0], 1000)  # what came last waits for its time


def test_what_came_too_early_is_served_when_its_time_has_come(
        kernel: Kernel, pipe: tuple[int, int]) -> None:
    log = kernel.trace = TraceLog()
    reader = kernel.add_task('reader', lambda: os.read(pipe[0], 1), priority=80)
    kernel.add_interrupt(pipe[0], reader, separation_ns=20 * MS)
    kernel.add_task('writer', lambda: os.write(pipe[1], b'xx'), priority=10, rate_hz=1.0,
                    phase_ns=3 * MS)
    kernel.add_task('tick', lambda: None, priority=5, rate_hz=1000.0)
    kernel.run(50 * MS)
    assert starts(log, 'reader') == [4 * MS, 24 * MS]


def test_a_deferred_source_can_be_removed_and_closed(kernel: Kernel) -> None:
    ends = os.pipe()
    reader = kernel.add_task('reader', lambda: None, priority=80)  # never reads: always readable
    kernel.add_interrupt(ends[0], reader, separation_ns=5 * MS)
    os.write(ends[1], b'x')

    def close() -> None:
        kernel.remove_interrupt(ends[0])
        for end in ends:
            os.close(end)

    kernel.add_task('closer', close, priority=10, rate_hz=1.0, phase_ns=17 * MS)
    kernel.add_task('tick', lambda: None, priority=5, rate_hz=1000.0)
    kernel.run(100 * MS)
    assert reader.runs == 4  # at 0, 5, 10, 15 ms
    assert not kernel.failures


def test_on_the_real_clock_a_flood_does_not_starve_a_lower_task(pipe: tuple[int, int]) -> None:
    kernel = Kernel(MonotonicClock())
    reader = kernel.add_task('reader', lambda: os.read(pipe[0], 65536), priority=80)
    kernel.add_interrupt(pipe[0], reader, separation_ns=MS)

    def flood() -> None:
        while True:
            try:
                os.write(pipe[1], b'x')
            except BlockingIOError:
                kernel.settle()

    def low_job() -> None:
        spin_until(kernel, lambda: reader.runs > 20)
        kernel.stop('done')

    kernel.add_task('flood', flood, priority=50, rate_hz=50.0, budget_ns=10 * MS,
                    on_budget=BudgetPolicy.ABORT)
    kernel.add_task('low', low_job, priority=10, rate_hz=10.0)
    assert kernel.run(60 * S) == 'done'
    source, = kernel.statistics().sources
    assert reader.runs >= 20 and source.deferred > 0
    # Each millisecond one release, and one arrival that was deferred, at most.
    elapsed_ms = kernel.statistics().elapsed_ns / MS
    assert source.arrivals <= 2 * elapsed_ms + 10
