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

"""Budgets: warn counts; abort ends any job, and no other task is affected."""

from __future__ import annotations

from collections.abc import Callable
import contextlib
import gc
import sys
import time

from kernel_tools import balance
from kernel_tools import CLOCKS
from kernel_tools import MS
from kernel_tools import S
from kernel_tools import US
import pytest

from rt_robot_os.kernel import BudgetPolicy
from rt_robot_os.kernel import Clock
from rt_robot_os.kernel import FailurePolicy
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import MonotonicClock
from rt_robot_os.kernel import TaskAborted
from rt_robot_os.kernel import TaskState
from rt_robot_os.kernel import VirtualClock

ABORT = BudgetPolicy.ABORT


def test_warn_counts_and_lets_the_job_end(kernel: Kernel, clock: VirtualClock) -> None:
    task = kernel.add_task('task', lambda: clock.spend(300 * US if task.runs % 2 else 100 * US),
                           priority=50, rate_hz=1000.0, budget_ns=200 * US)
    kernel.run(10 * MS)
    assert (task.runs, task.budget_exceeded, task.aborted, task.failures) == (10, 5, 0, 0)
    assert not kernel.failures


def test_abort_comes_when_the_budget_ends_and_the_next_job_is_as_usual(
        kernel: Kernel, clock: VirtualClock) -> None:
    ends: list[int] = []

    def job() -> None:
        try:
            clock.spend(900 * US)
        finally:
            ends.append(clock.now_ns())

    task = kernel.add_task('task', job, priority=50, rate_hz=1000.0, budget_ns=200 * US,
                           on_budget=ABORT)
    kernel.run(3 * MS)
    assert ends == [200 * US, 1200 * US, 2200 * US]
    assert (task.aborted, task.runs, task.failures, task.budget_exceeded) == (3, 3, 0, 0)
    assert [f.error for f in kernel.failures] == [
        "TaskAborted: task 'task' used 200 us of its budget of 200 us"] * 3


def test_a_job_within_its_budget_is_left_alone(kernel: Kernel, clock: VirtualClock) -> None:
    task = kernel.add_task('task', lambda: clock.spend(199 * US), priority=50, rate_hz=1000.0,
                           budget_ns=200 * US, on_budget=ABORT)
    kernel.run(100 * MS)
    assert (task.runs, task.aborted, task.state) == (100, 0, TaskState.ACTIVE)


def test_what_preempts_a_job_is_not_charged_to_it(kernel: Kernel, clock: VirtualClock) -> None:
    high = kernel.add_task('high', lambda: clock.spend(500 * US), priority=90, rate_hz=1000.0)
    task = kernel.add_task('task', lambda: clock.spend(1900 * US), priority=50, rate_hz=100.0,
                           budget_ns=2 * MS, on_budget=ABORT)
    kernel.run(100 * MS)
    assert (task.aborted, task.runs, high.runs) == (0, 10, 100)
    assert task.response_maximum_ns > 3 * MS


def test_an_abort_hits_the_task_that_overspent_and_none_that_lies_below_or_above(
        kernel: Kernel, clock: VirtualClock) -> None:
    """The middle one of three on the stack overspends while the others are in the middle."""
    seen: list[str] = []

    def job(name: str, duration_ns: int) -> Callable[[], None]:
        def run() -> None:
            try:
                clock.spend(duration_ns)
            except TaskAborted:
                seen.append(name)
                raise
        return run

    low = kernel.add_task('low', job('low', 9 * MS), priority=10, rate_hz=10.0,
                          budget_ns=10 * MS, on_budget=ABORT)
    mid = kernel.add_task('mid', job('mid', 5 * MS), priority=50, rate_hz=10.0, phase_ns=MS,
                          budget_ns=2 * MS, on_budget=ABORT)
    high = kernel.add_task('high', job('high', 300 * US), priority=90, rate_hz=1000.0,
                           budget_ns=400 * US, on_budget=ABORT)
    kernel.run(90 * MS)
    assert seen == ['mid']
    assert (low.aborted, mid.aborted, high.aborted) == (0, 1, 0)
    assert high.runs == 90


def test_a_job_that_resists_is_aborted_again_and_its_task_stopped(
        kernel: Kernel, clock: VirtualClock) -> None:
    raised: list[int] = []

    def stubborn() -> None:
        while True:
            try:
                clock.spend(S)
            except TaskAborted as error:
                raised.append(error.used_ns)
                if len(raised) == 2:
                    raise

    task = kernel.add_task('task', stubborn, priority=50, rate_hz=10.0, budget_ns=MS,
                           on_budget=ABORT)
    other = kernel.add_task('other', lambda: None, priority=5, rate_hz=20.0)
    kernel.run(S)
    assert raised == [MS, 21 * MS]
    assert (task.runs, task.aborted, task.state) == (1, 1, TaskState.STOPPED)
    assert 'never catch BaseException' in kernel.failures[-1].error
    assert other.runs == 20
    assert balance(task) == 0


def test_clean_up_in_finally_has_its_time(kernel: Kernel, clock: VirtualClock) -> None:
    cleaned: list[int] = []

    def job() -> None:
        try:
            clock.spend(5 * MS)
        finally:
            clock.spend(900 * US)
            cleaned.append(clock.now_ns())

    task = kernel.add_task('task', job, priority=50, rate_hz=100.0, budget_ns=MS, on_budget=ABORT)
    kernel.run(50 * MS)
    assert len(cleaned) == 5
    assert (task.aborted, task.state) == (5, TaskState.ACTIVE)


def test_an_abort_waits_until_the_resource_is_left(kernel: Kernel, clock: VirtualClock) -> None:
    inner, outer = kernel.resource('inner'), kernel.resource('outer')
    seen: list[str] = []

    def job() -> None:
        with outer:
            with inner:
                clock.spend(1500 * US)
                seen.append('inside the inner')
            seen.append('inside the outer')
        seen.append('outside')

    task = kernel.add_task('task', job, priority=50, rate_hz=100.0, budget_ns=MS,
                           on_budget=ABORT, resources=[inner, outer])
    kernel.run(10 * MS)
    assert seen == ['inside the inner', 'inside the outer']
    assert (task.aborted, task.execution.maximum_ns) == (1, 1500 * US)


@pytest.mark.parametrize('policy,state,runs', [
    (FailurePolicy.CONTINUE, TaskState.ACTIVE, 10), (FailurePolicy.STOP, TaskState.STOPPED, 1)])
def test_the_failure_policy_applies_to_aborts(
        kernel: Kernel, clock: VirtualClock, policy: FailurePolicy, state: TaskState, runs: int
) -> None:
    task = kernel.add_task('task', lambda: clock.spend(S), priority=50, rate_hz=100.0,
                           budget_ns=MS, on_budget=ABORT, failure=policy)
    kernel.run(100 * MS)
    assert (task.state, task.runs, task.aborted) == (state, runs, runs)


def endless() -> None:
    while True:
        pass


def swallowing() -> None:
    while True:
        with contextlib.suppress(Exception):
            while True:
                time.monotonic_ns()


def sleeping() -> None:
    while True:
        time.sleep(60.0)


def recursing() -> None:
    recursing()


def resisting() -> None:
    while True:
        try:
            while True:
                pass
        except BaseException:
            continue


@pytest.mark.parametrize('job', [endless, swallowing, sleeping, resisting])
def test_on_the_real_clock_a_job_without_end_is_ended_and_the_others_go_on(
        job: Callable[[], None]) -> None:
    kernel = Kernel(MonotonicClock())
    task = kernel.add_task('runaway', job, priority=50, rate_hz=20.0, budget_ns=5 * MS,
                           on_budget=ABORT)
    lower = kernel.add_task('lower', lambda: kernel.stop('enough') if lower.runs > 4 else None,
                            priority=10, rate_hz=20.0)
    # As in the core: an abort that fell into the end of older garbage would be lost there.
    gc.collect()
    gc.disable()
    try:
        assert kernel.run(60 * S) == 'enough'
    finally:
        gc.enable()
    assert task.aborted >= 1
    assert task.state is (TaskState.STOPPED if job is resisting else TaskState.ACTIVE)


@pytest.mark.parametrize('clock_name', CLOCKS)
def test_a_job_that_recurses_without_end_fails_by_itself_also_with_a_budget(
        clock_name: str) -> None:
    clock: Clock = CLOCKS[clock_name]()
    kernel = Kernel(clock)
    task = kernel.add_task('deep', recursing, priority=50, rate_hz=20.0, budget_ns=20 * MS,
                           on_budget=ABORT)
    kernel.run(200 * MS)
    assert task.failures + task.aborted == task.runs >= 1


class AtOpcode:
    """Let the budget end at the n-th bytecode that a job executes, in whatever file."""

    def __init__(self, step: int, concerned: Callable[[], bool], action: Callable[[], None]
                 ) -> None:
        self.seen = 0
        self.on = False
        self._concerned = concerned
        self._step = step
        self._action = action

    def __call__(self, frame: object, event: str, arg: object) -> AtOpcode:
        frame.f_trace_opcodes = True  # type: ignore[attr-defined]
        if event == 'opcode' and self.on and self._concerned():
            self.seen += 1
            if self.seen == self._step:
                self._action()
        return self


class Reference:
    """A task that publishes, takes, and uses two resources; two others share them."""

    def __init__(self, step: int) -> None:
        from rt_robot_os.topics import Bus
        self.clock = VirtualClock(start_ns=S)
        self.kernel = kernel = Kernel(self.clock)
        bus = Bus(kernel)
        bus.declare('x', 'std_msgs/msg/Int64', depth=4)
        self.publisher = bus.publisher('x')
        self.inner, self.outer = kernel.resource('inner'), kernel.resource('outer')
        both = [self.inner, self.outer]
        self.task = kernel.add_task(
            'task', self.job, priority=50, rate_hz=100.0, budget_ns=MS, on_budget=ABORT,
            resources=both)
        self.top = kernel.add_task('top', self.others, priority=90, rate_hz=200.0,
                                   resources=both)
        self.woken = kernel.add_task('woken', self.drain, priority=60)
        self.low = kernel.add_task('low', self.others, priority=10, rate_hz=200.0,
                                   resources=both)
        self.own = bus.subscribe('x', 'task')
        self.other = bus.subscribe('x', 'woken', task=self.woken)
        self.taken = 0
        self.guarded = [0, 0]
        self.tracer = AtOpcode(step, lambda: kernel.current is self.task, self.abort)

    def job(self) -> None:
        self.tracer.on = self.task.runs == 1
        self.publisher.msg.data = self.task.runs
        self.publisher.publish()
        with self.outer:
            self.guarded[0] += 1
            with self.inner:
                self.publisher.publish()
            self.guarded[1] += 1
        self.own.take()
        self.tracer.on = False

    def abort(self) -> None:
        self.tracer.on = False
        self.clock.spend(1500 * US)

    def drain(self) -> None:
        while self.other.take():
            self.taken += 1

    def others(self) -> None:
        with self.inner, self.outer:
            assert self.guarded[0] == self.guarded[1]

    def check(self) -> None:
        kernel = self.kernel
        assert [f for f in kernel.failures if 'TaskAborted' not in f.error] == []
        assert self.task.runs == 3 and self.task.state is TaskState.ACTIVE
        assert (self.top.runs, self.low.runs) == (6, 6)
        assert self.guarded[0] == self.guarded[1]
        assert self.inner.holder is None and self.outer.holder is None
        assert (self.taken, self.other.lost) == (self.publisher.published, 0)
        assert self.publisher.topic.head == self.publisher.published
        assert not any(map(balance, kernel.tasks))


@pytest.mark.interpreted
def test_an_abort_at_any_bytecode_leaves_everything_whole(untraced: None) -> None:
    pytest.importorskip('std_msgs.msg', reason='needs the ROS 2 message packages')
    step, total, aborted = 1, 1, 0
    while step <= total:
        reference = Reference(step)
        sys._getframe().f_trace_opcodes = True  # before: Python 3.12 looks at it once
        sys.settrace(reference.tracer)  # type: ignore[arg-type]
        try:
            reference.kernel.run(30 * MS)
        finally:
            sys.settrace(None)
        try:
            reference.check()
        except AssertionError as error:
            raise AssertionError(f'abort at bytecode {step}') from error
        aborted += reference.task.aborted
        total = max(total, reference.tracer.seen + 1)
        step += 1
    assert step > 300
    assert aborted > step * 2 // 3  # time in the kernel's own sections is not charged
