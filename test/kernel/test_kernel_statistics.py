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


"""What the kernel says of its tasks adds up, at any time."""

from __future__ import annotations

from kernel_tools import balance
from kernel_tools import MS
from kernel_tools import S
from kernel_tools import US
import pytest

from rt_robot_os.kernel import Histogram
from rt_robot_os.kernel import Kernel


def test_execution_is_exact_without_what_preempted_it(kernel: Kernel) -> None:
    spend = kernel.clock.spend
    low = kernel.add_task('low', lambda: spend(3300 * US), priority=10, rate_hz=100.0)
    mid = kernel.add_task('mid', lambda: spend(370 * US), priority=50, rate_hz=1000.0)
    high = kernel.add_task('high', lambda: spend(11 * US), priority=90, rate_hz=2000.0,
                           phase_ns=100 * US)
    kernel.run(S)
    for task, execution_ns in ((low, 3300 * US), (mid, 370 * US), (high, 11 * US)):
        assert task.execution.maximum_ns == execution_ns
        assert task.execution_total_ns == task.runs * execution_ns
        assert sum(task.execution.counts) == task.runs
    assert (low.runs, mid.runs, high.runs) == (100, 1000, 2000)


def test_a_histogram_that_was_taken_does_not_change_when_the_task_counts_on(
        kernel: Kernel) -> None:
    taken: list[tuple[int, Histogram]] = []
    task = kernel.add_task('task', lambda: kernel.clock.spend(US), priority=10, rate_hz=1000.0)
    kernel.add_task('reader', lambda: taken.append((task.runs, task.execution)), priority=5,
                    rate_hz=100.0)
    kernel.run(600 * MS)
    assert len(taken) == 60 and taken[-1][0] == 591  # more than a byte holds
    assert all(sum(histogram.counts) == runs for runs, histogram in taken)
    assert task.execution.summary().count == 600
    task.reset_statistics()
    assert sum(task.execution.counts) == sum(task.latency.counts) == 0


def test_the_first_interval_of_a_virtual_clock_that_starts_at_0_counts(kernel: Kernel) -> None:
    task = kernel.add_task('task', lambda: None, priority=10, rate_hz=100.0)
    kernel.run(30 * MS)
    assert sum(task.jitter.counts) == 2
    assert task.gap_maximum_ns == 10 * MS


def test_statistics_are_frozen_facts_of_all_tasks(kernel: Kernel) -> None:
    first = kernel.add_task('first', lambda: kernel.clock.spend(2 * MS), priority=10,
                            rate_hz=100.0)
    kernel.add_task('second', lambda: None, priority=5)
    kernel.run(25 * MS)
    statistics = kernel.statistics()
    assert statistics.elapsed_ns == 25 * MS
    assert statistics.wakeups > 0
    assert [task.name for task in statistics.tasks] == ['first', 'second']
    taken = statistics.tasks[0]
    assert (taken.priority, taken.period_ns, taken.runs, taken.missed) == (10, 10 * MS, 3, 0)
    assert taken.execution.count == 3
    assert taken.execution.maximum_ns == 2 * MS
    assert abs(taken.execution.p50_ns - 2 * MS) < 2 * MS / 8
    assert taken == first.statistics()
    with pytest.raises(AttributeError):
        taken.runs = 0  # type: ignore[misc]


def test_after_a_reset_in_the_middle_of_jobs_the_counts_add_up(kernel: Kernel) -> None:
    resets: list[list[int]] = []

    def reset_all() -> None:
        for task in kernel.tasks:
            task.reset_statistics()
        resets.append([balance(task) for task in kernel.tasks])

    def low_job() -> None:
        kernel.release(low)  # once more
        kernel.clock.spend(2500 * US)

    low = kernel.add_task('low', low_job, priority=10, rate_hz=None)
    kernel.add_task('starter', lambda: kernel.release(low), priority=5, rate_hz=100.0)
    kernel.add_task('waiting', lambda: None, priority=8, rate_hz=100.0, phase_ns=100 * US)
    kernel.add_task('reset', reset_all, priority=50, rate_hz=1000.0, phase_ns=500 * US)
    kernel.run(20 * MS)
    # low runs and waits, starter was preempted by it, waiting waits, reset itself runs.
    assert resets[0] == [2, 1, 1, 1]
    assert not any(map(balance, kernel.tasks))
    assert not kernel.failures
