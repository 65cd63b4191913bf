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


"""The cooperative kernel: no signals, any thread, priorities only between jobs."""

from __future__ import annotations

from collections.abc import Callable
import os
import signal
import threading

from kernel_tools import balance
from kernel_tools import MS
from kernel_tools import names
from kernel_tools import S
from kernel_tools import spin_until
import pytest

from rt_robot_os.base.errors import TaskError
from rt_robot_os.kernel import BudgetPolicy
from rt_robot_os.kernel import CooperativeClock
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import TraceLog


@pytest.fixture
def kernel() -> Kernel:
    return Kernel(CooperativeClock())


def in_thread(function: Callable[[], object]) -> None:
    """Run something in another thread than the main one."""
    errors: list[BaseException] = []

    def target() -> None:
        try:
            function()
        except BaseException as error:
            errors.append(error)

    thread = threading.Thread(target=target)
    thread.start()
    thread.join(60.0)
    assert not thread.is_alive()
    if errors:
        raise errors[0]


def test_it_runs_in_any_thread_and_touches_no_signal_handler(kernel: Kernel) -> None:
    before = [signal.getsignal(n) for n in range(1, signal.NSIG) if n not in (32, 33)]
    task = kernel.add_task('task', lambda: kernel.stop() if task.runs > 5 else None,
                           priority=50, rate_hz=500.0)
    in_thread(kernel.run)
    assert task.runs == 7
    assert [signal.getsignal(n) for n in range(1, signal.NSIG) if n not in (32, 33)] == before


def test_a_preemptive_kernel_refuses_such_a_thread_and_names_the_way_out() -> None:
    kernel = Kernel()
    with pytest.raises(TaskError, match='Python runs signal handlers in the main thread only'):
        in_thread(lambda: kernel.run(MS))


def test_two_kernels_run_side_by_side_in_two_threads() -> None:
    kernels = [Kernel(CooperativeClock()) for _ in range(2)]
    tasks = [k.add_task('task', lambda: None, priority=5, rate_hz=200.0) for k in kernels]
    threads = [threading.Thread(target=k.run, args=(200 * MS,)) for k in kernels]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60.0)
    assert all(task.releases == 40 and not balance(task) for task in tasks)


def test_a_job_is_not_preempted_but_the_highest_comes_next(kernel: Kernel) -> None:
    log = kernel.trace = TraceLog()

    def low_job() -> None:
        lower.start(50 * MS)
        high.start(100 * MS)
        kernel.clock.spend(150 * MS)

    kernel.add_task('low', low_job, priority=10, rate_hz=0.01)
    lower = kernel.timer(kernel.add_task('lower', kernel.stop, priority=5))
    high = kernel.timer(kernel.add_task('high', lambda: None, priority=90))
    kernel.run(60 * S)
    assert log.text() == ('low start\nlow end\nhigh start\nhigh end\nlower start\nlower end\n')


def test_a_long_job_lets_others_through_where_it_says_so(kernel: Kernel) -> None:
    log = kernel.trace = TraceLog()

    def low_job() -> None:
        timer.start(MS)
        end_ns = kernel.now_ns() + 60 * S
        while not high.runs:
            kernel.settle()
            assert kernel.now_ns() < end_ns
        kernel.stop()

    kernel.add_task('low', low_job, priority=10, rate_hz=0.01)
    high = kernel.add_task('high', lambda: None, priority=90)
    timer = kernel.timer(high)
    kernel.run(60 * S)
    assert log.text() == 'low start\n  high start\n  high end\nlow end\n'


def test_descriptors_release_tasks_here_too(kernel: Kernel) -> None:
    ends = os.pipe()
    reader = kernel.add_task('reader', lambda: os.read(ends[0], 10) and kernel.stop('read'),
                             priority=50)
    kernel.add_interrupt(ends[0], reader)
    kernel.add_task('writer', lambda: os.write(ends[1], b'x'), priority=10, rate_hz=0.01,
                    phase_ns=5 * MS)
    assert kernel.run(60 * S) == 'read'
    for end in ends:
        os.close(end)


def test_budgets_warn_and_abort_is_refused(kernel: Kernel) -> None:
    def compute() -> None:
        computed_ns = kernel.clock.computed_ns  # what others computed meanwhile is not charged
        end_ns = computed_ns() + 3 * MS
        while computed_ns() < end_ns:
            pass
        if task.runs >= 3:
            kernel.stop('enough')

    task = kernel.add_task('task', compute, priority=50, rate_hz=100.0, budget_ns=2 * MS)
    assert kernel.run(60 * S) == 'enough'
    assert task.budget_exceeded == task.runs == 4
    with pytest.raises(TaskError, match="task 'other': on_budget abort needs a preemptive kernel"):
        kernel.add_task('other', lambda: None, priority=50, budget_ns=MS,
                        on_budget=BudgetPolicy.ABORT)


def test_resources_and_publication_order_work_as_ever(kernel: Kernel) -> None:
    shared = kernel.resource('shared')
    log = kernel.trace = TraceLog()

    def low_job() -> None:
        with shared:
            kernel.release(user)
            kernel.release(above)
            assert user.runs == 0 and above.runs == 1
        assert user.runs == 1
        kernel.stop()

    kernel.add_task('low', low_job, priority=10, rate_hz=0.01, resources=[shared])
    user = kernel.add_task('user', lambda: None, priority=50, resources=[shared])
    above = kernel.add_task('above', lambda: spin_until(kernel, lambda: True), priority=70)
    kernel.run(60 * S)
    assert names(log) == ['low', 'above', 'user']
