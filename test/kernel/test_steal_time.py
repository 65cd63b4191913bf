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


"""Steal time is counted as such and charged to no task."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

from kernel_tools import MS
from kernel_tools import ROOT
from kernel_tools import run_program
from kernel_tools import S
from kernel_tools import US
import pytest

from rt_robot_os.kernel import BudgetPolicy
from rt_robot_os.kernel import FailurePolicy
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import TaskState
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.kernel.black_box import ABORT
from rt_robot_os.kernel.black_box import BLOCKED
from rt_robot_os.kernel.black_box import MARK
from rt_robot_os.kernel.steal_time import StealTime


class SharedClock(VirtualClock):
    """A virtual clock of a CPU that others use as well."""

    def __init__(self) -> None:
        super().__init__()
        self.others_ns = 0
        self.queued_ns = 0
        self.computed_ns = lambda: self._now_ns - self.others_ns

    def wait_masked(self) -> bool:
        before_ns = self._now_ns
        found = super().wait_masked()
        self.others_ns += self._now_ns - before_ns  # idle
        return found

    def waited_ns(self) -> int:
        return self.queued_ns

    def take(self, duration_ns: int, stopped: bool = False) -> None:
        """Let others compute, or the process be stopped: no interrupt is served meanwhile."""
        self._now_ns += duration_ns
        self.others_ns += duration_ns
        if stopped:
            self.was_stopped = True
        else:
            self.queued_ns += duration_ns
        self.hear()

    def block(self, duration_ns: int) -> None:
        """Wait in a system call that no signal ends, as for a disk."""
        self._now_ns += duration_ns
        self.others_ns += duration_ns
        self.hear()

    def sleep(self, duration_ns: int) -> None:
        """Wait in a system call that alarms interrupt and that goes on then, as for a pipe."""
        for _ in range(duration_ns // (10 * US)):
            self.others_ns += 10 * US
            self.spend(10 * US)

    def call(self, duration_ns: int) -> None:
        """Compute in a native call."""
        self._now_ns += duration_ns
        self.hear()

    def hear(self) -> None:
        self.spend(1)
        self._now_ns -= 1


@pytest.fixture
def clock() -> SharedClock:
    return SharedClock()


def test_a_job_is_not_aborted_for_time_that_it_did_not_have(
        kernel: Kernel, clock: SharedClock) -> None:
    ended: list[int] = []

    def job() -> None:
        clock.spend(MS)
        clock.take(4 * MS + 50 * US)  # the CPU is back just when the budget would have ended
        clock.spend(2 * MS)
        ended.append(clock.now_ns())
        clock.spend(10 * MS)

    task = kernel.add_task('task', job, priority=50, rate_hz=10.0, budget_ns=5 * MS,
                           on_budget=BudgetPolicy.ABORT)
    kernel.run(50 * MS)
    assert len(ended) == 1
    assert task.aborted == 1  # for its own time, in the end
    assert 4900 * US < task.execution_maximum_ns < 5200 * US


def test_a_job_without_end_is_aborted_also_where_linux_takes_nearly_all_time(
        kernel: Kernel, clock: SharedClock) -> None:
    def job() -> None:
        while True:
            clock.spend(10 * US)
            clock.take(MS)

    task = kernel.add_task('task', job, priority=50, rate_hz=1.0, budget_ns=5 * MS,
                           on_budget=BudgetPolicy.ABORT)
    kernel.run(S)
    assert (task.runs, task.aborted) == (1, 1)
    at_ns, = (r[2] for r in kernel.black_box.records if r[0] == ABORT)
    assert 500 * MS < at_ns - task.start_ns < 510 * MS  # its budget of computing time is 5 ms


@pytest.mark.parametrize('lost_ns', [2 * MS, 4 * MS, 8 * MS, 200 * MS])
def test_what_a_job_lost_is_known_also_when_one_above_it_loses_time_next(
        kernel: Kernel, clock: SharedClock, lost_ns: int) -> None:
    def low() -> None:
        clock.spend(500 * US)
        clock.take(lost_ns)
        clock.spend(3 * MS)

    def high() -> None:  # comes in time just after that
        clock.spend(50 * US)
        clock.take(MS)

    kernel.add_task('high', high, priority=90, rate_hz=1.0, phase_ns=lost_ns + 600 * US)
    task = kernel.add_task('low', low, priority=50, rate_hz=1.0, budget_ns=5 * MS,
                           on_budget=BudgetPolicy.ABORT)
    kernel.run(S)
    assert (task.runs, task.aborted, task.budget_exceeded) == (1, 0, 0)
    assert task.execution.maximum_ns == 3500 * US


def test_neither_small_losses_nor_what_preempts_a_job_add_up_to_an_abort(
        kernel: Kernel, clock: SharedClock) -> None:
    def low() -> None:
        for _ in range(400):
            clock.spend(10 * US)
            clock.take(900 * US)

    def high() -> None:
        clock.spend(10 * US)
        clock.take(300 * US)

    kernel.add_task('high', high, priority=90, rate_hz=500.0)
    task = kernel.add_task('low', low, priority=50, rate_hz=1.0, budget_ns=5 * MS,
                           on_budget=BudgetPolicy.ABORT)
    kernel.run(S)
    assert (task.runs, task.aborted) == (1, 0)
    assert task.execution.maximum_ns < 5 * MS


def test_time_for_finally_is_computing_time_as_well(kernel: Kernel, clock: SharedClock) -> None:
    def job() -> None:
        try:
            clock.spend(10 * MS)
        finally:
            for _ in range(400):
                clock.spend(10 * US)
                clock.take(190 * US)

    def high() -> None:
        clock.spend(10 * US)
        clock.take(300 * US)

    kernel.add_task('high', high, priority=90, rate_hz=500.0)
    task = kernel.add_task('task', job, priority=50, rate_hz=1.0, budget_ns=5 * MS,
                           on_budget=BudgetPolicy.ABORT, failure=FailurePolicy.CONTINUE)
    kernel.run(S)
    assert (task.runs, task.aborted, task.state) == (1, 1, TaskState.ACTIVE)


def test_waiting_in_a_system_call_is_not_computing(kernel: Kernel, clock: SharedClock) -> None:
    def low() -> None:
        clock.spend(3 * MS)
        clock.sleep(40 * MS)
        clock.spend(MS)

    high = kernel.add_task('high', lambda: clock.spend(100 * US), priority=90, rate_hz=200.0)
    task = kernel.add_task('low', low, priority=50, rate_hz=10.0, budget_ns=5 * MS,
                           on_budget=BudgetPolicy.ABORT)
    kernel.run(S)
    assert (task.runs, task.aborted, task.budget_exceeded, high.missed) == (10, 0, 0, 0)
    assert task.execution.maximum_ns == 44 * MS  # nothing below it ran meanwhile
    assert kernel.statistics().stolen.count == 0
    marks = [str(r[3]) for r in kernel.black_box.records if r[0] == MARK]
    assert marks
    assert all(mark.startswith('low waited for ') for mark in marks)


def test_a_job_that_computes_on_after_waiting_is_aborted_in_time(
        kernel: Kernel, clock: SharedClock) -> None:
    ends: list[int] = []

    def low() -> None:
        try:
            clock.sleep(40 * MS)
            clock.spend(S)
        finally:
            ends.append(clock.now_ns())

    task = kernel.add_task('low', low, priority=50, rate_hz=1.0, budget_ns=5 * MS,
                           on_budget=BudgetPolicy.ABORT)
    kernel.run(S)
    assert task.aborted == 1
    assert 45 * MS <= ends[0] <= 46 * MS


def test_a_job_that_hangs_in_a_system_call_is_aborted_after_twenty_budgets(
        kernel: Kernel, clock: SharedClock) -> None:
    ends: list[int] = []

    def low() -> None:
        try:
            clock.sleep(10 * S)
        finally:
            ends.append(clock.now_ns())

    task = kernel.add_task('low', low, priority=50, rate_hz=1.0, budget_ns=5 * MS,
                           on_budget=BudgetPolicy.ABORT)
    kernel.run(S)
    assert (task.runs, task.aborted) == (1, 1)
    assert 100 * MS <= ends[0] <= 106 * MS
    assert [f.error for f in kernel.failures] == [
        "TaskAborted: task 'low' waited for 100 ms, 20 times its budget"]


@pytest.mark.parametrize('stopped', [False, True])
def test_a_job_that_lost_time_to_linux_is_charged_with_its_own_time(
        kernel: Kernel, clock: SharedClock, stopped: bool) -> None:
    def job() -> None:
        clock.spend(300 * US)
        if task.runs == 3:
            clock.take(700 * MS, stopped)
        clock.spend(300 * US)

    kernel.add_task('fast', lambda: None, priority=90, rate_hz=1000.0, phase_ns=500 * US)
    task = kernel.add_task('imu', job, priority=50, rate_hz=100.0)
    kernel.run(S)
    assert task.blocked_maximum_ns < 50 * US
    assert 500 * US < task.execution.maximum_ns < 700 * US
    assert task.execution_total_ns < task.runs * 700 * US
    assert sum(task.execution.counts) == task.runs
    statistics = kernel.statistics()
    assert statistics.stolen.count == 1
    assert 699 * MS < statistics.stolen.maximum_ns <= 700 * MS
    assert statistics.stolen_total_ns == statistics.stolen.maximum_ns
    assert [r[3] for r in kernel.black_box.records if r[0] == MARK] == [
        'Linux took the CPU from imu for 700.0 ms']
    assert [r for r in kernel.black_box.records if r[0] == BLOCKED] == []


def test_a_job_that_nothing_interrupts_is_charged_with_its_own_time_as_well(
        kernel: Kernel, clock: SharedClock) -> None:
    def job() -> None:
        clock.spend(300 * US)
        if task.runs == 3:
            clock.take(4 * MS)

    task = kernel.add_task('imu', job, priority=50, rate_hz=100.0)
    kernel.run(S)
    assert task.execution.maximum_ns == 300 * US
    assert task.execution.summary().maximum_ns == 300 * US
    assert task.execution_total_ns == 100 * 300 * US
    assert kernel.statistics().stolen.maximum_ns == 4 * MS


def test_native_calls_and_waiting_for_a_disk_remain_the_jobs_own(
        kernel: Kernel, clock: SharedClock) -> None:
    kernel.add_task('fast', lambda: None, priority=90, rate_hz=1000.0)
    native = kernel.add_task('native', lambda: clock.call(20 * MS), priority=50, rate_hz=5.0,
                             phase_ns=500 * US)
    disk = kernel.add_task('disk', lambda: clock.block(30 * MS), priority=40, rate_hz=5.0,
                           phase_ns=100 * MS + 500 * US)
    kernel.run(S)
    assert native.blocked_maximum_ns == 19500 * US
    assert disk.blocked_maximum_ns == 29500 * US
    assert native.execution.maximum_ns == 20 * MS
    assert kernel.statistics().stolen.count == 0


def test_a_stop_after_a_job_has_ended_belongs_to_what_comes_next(clock: SharedClock) -> None:
    account = StealTime(clock)
    account.start(clock.now_ns())
    clock.spend(2 * MS)
    ended_ns = clock.now_ns()
    clock.take(400 * MS, stopped=True)
    assert account.attribute(ended_ns, 2 * MS) == 0
    clock.spend(MS)
    assert account.attribute(clock.now_ns(), 401 * MS) == 400 * MS
    clock.block(30 * MS)  # the stop is not counted twice
    assert account.attribute(clock.now_ns(), 30 * MS) == 0


def test_a_stop_within_the_kernel_is_not_charged_to_the_job_that_it_interrupted(
        kernel: Kernel, clock: SharedClock) -> None:
    def traced(now_ns: int, kind: str, name: str) -> None:
        if kind == 'end' and name == 'fast' and task.busy and task.runs == 3:
            clock.take(40 * MS, stopped=True)

    kernel.add_task('fast', lambda: None, priority=90, rate_hz=1000.0, phase_ns=500 * US)
    task = kernel.add_task('imu', lambda: clock.spend(2 * MS), priority=50, rate_hz=100.0)
    kernel.trace = traced
    kernel.run(S)
    assert task.blocked_maximum_ns < 50 * US
    assert task.execution.maximum_ns == 2 * MS


def test_a_budget_is_computing_time(kernel: Kernel, clock: SharedClock) -> None:
    def job() -> None:
        clock.spend(MS)
        clock.take(50 * MS)
        clock.spend(MS)

    task = kernel.add_task('task', job, priority=50, rate_hz=10.0, budget_ns=3 * MS,
                           on_budget=BudgetPolicy.ABORT)
    kernel.run(S)
    assert (task.runs, task.aborted, task.budget_exceeded) == (10, 0, 0)


def test_a_late_wake_up_is_charged_to_no_task(
        kernel: Kernel, clock: SharedClock, monkeypatch: pytest.MonkeyPatch) -> None:
    wait = clock.wait_masked

    def late() -> bool:
        wait()
        if task.runs == 5:
            clock._now_ns += 40 * MS
            clock.others_ns += 40 * MS
            clock.queued_ns += 40 * MS
        return True

    monkeypatch.setattr(clock, 'wait_masked', late)
    task = kernel.add_task('imu', lambda: clock.spend(300 * US), priority=50, rate_hz=100.0)
    kernel.run(S)
    assert (task.blocked_maximum_ns, task.execution.maximum_ns) == (0, 300 * US)
    assert kernel.statistics().stolen.maximum_ns == 40 * MS


STOPPED = """
from rt_robot_os.kernel import Kernel

def work():
    kernel.clock.spend(2_000_000)

kernel = Kernel()
kernel.add_task('fast', lambda: None, priority=90, rate_hz=1000.0)
task = kernel.add_task('imu', work, priority=50, rate_hz=250.0)
print('begins', flush=True)
kernel.run(3_000_000_000)
statistics = kernel.statistics()
print(task.blocked_maximum_ns, task.execution.maximum_ns, statistics.stolen.maximum_ns)
"""


def test_a_process_that_is_stopped_blames_none_of_its_tasks() -> None:
    process = subprocess.Popen(
        [sys.executable, '-c', STOPPED], stdout=subprocess.PIPE, text=True,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join([str(ROOT), *sys.path])})
    assert process.stdout is not None
    with process.stdout:
        assert process.stdout.readline() == 'begins\n'
        for _ in range(4):
            time.sleep(0.1)
            process.send_signal(signal.SIGSTOP)
            time.sleep(0.4)
            process.send_signal(signal.SIGCONT)
        blocked_ns, execution_ns, stolen_ns = map(int, process.stdout.read().split())
    assert process.wait() == 0
    assert stolen_ns > 300 * MS
    assert blocked_ns < 200 * MS
    assert execution_ns < 200 * MS


WAITING = """
import os
import select
from rt_robot_os.kernel import BudgetPolicy
from rt_robot_os.kernel import Kernel

def wait():
    select.select([reading], [], [], 0.06)  # nobody writes

def compute():
    while True:
        pass

reading, writing = os.pipe()
kernel = Kernel()
limits = dict(rate_hz=5.0, budget_ns=20_000_000, on_budget=BudgetPolicy.ABORT)
waits = kernel.add_task('waits', wait, priority=50, **limits)
computes = kernel.add_task('computes', compute, priority=40, **limits)
kernel.run(1_000_000_000)
print(waits.runs > 0, waits.aborted, computes.runs > 0, computes.aborted == computes.runs)
"""


def test_on_the_real_clock_waiting_does_not_use_up_a_budget_and_computing_does() -> None:
    result = run_program(WAITING)
    assert (result.returncode, result.stdout) == (0, 'True 0 True True\n'), result.stderr
