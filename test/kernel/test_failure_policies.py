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


"""What becomes of a task whose job failed: it goes on, restarts, stops, or is made safe."""

from __future__ import annotations

from collections.abc import Callable

from kernel_tools import balance
from kernel_tools import MS
from kernel_tools import S
import pytest

from rt_robot_os.base.errors import TaskError
from rt_robot_os.kernel import FailurePolicy
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import Task
from rt_robot_os.kernel import TaskState
from rt_robot_os.kernel import VirtualClock


class Machine:
    """A task that fails on request, and records the calls of its functions."""

    def __init__(self, rate_hz: float | None = 100.0, **declared: object) -> None:
        self.kernel = Kernel(VirtualClock())
        self.calls: list[tuple[int, str]] = []
        self.bad: Callable[[int], bool] = lambda now_ns: False
        self.bad_restart = False
        self.task = self.kernel.add_task(
            'machine', self.job, priority=50, rate_hz=rate_hz, on_restart=self.restart,
            on_safe_state=self.safe, **declared)
        self.other = self.kernel.add_task('other', lambda: None, priority=10, rate_hz=100.0)

    def note(self, what: str) -> int:
        now_ns = self.kernel.now_ns()
        self.calls.append((now_ns // MS, what))
        return now_ns

    def job(self) -> None:
        if self.bad(self.note('job')):
            raise ValueError('broken')

    def restart(self) -> None:
        self.note('restart')
        if self.bad_restart:
            raise OSError('still broken')

    def safe(self) -> None:
        self.note('safe')

    def what(self) -> list[str]:
        return [what for _, what in self.calls]

    def run(self, duration_ns: int) -> Task:
        self.kernel.run(duration_ns)
        assert self.other.runs == duration_ns // (10 * MS)
        assert not any(map(balance, self.kernel.tasks))
        return self.task


def test_continue_makes_the_next_job_as_if_nothing_had_happened() -> None:
    machine = Machine()
    machine.bad = lambda now_ns: True
    task = machine.run(100 * MS)
    assert (task.runs, task.failures, task.state) == (10, 10, TaskState.ACTIVE)


def test_stop_ends_the_task_for_good() -> None:
    machine = Machine(failure=FailurePolicy.STOP)
    machine.bad = lambda now_ns: now_ns == 50 * MS
    task = machine.run(200 * MS)
    assert machine.what() == ['job'] * 6
    assert (task.state, task.missed) == (TaskState.STOPPED, 14)


def test_safe_state_is_brought_about_once_and_then_held() -> None:
    machine = Machine(failure=FailurePolicy.SAFE_STATE)
    machine.bad = lambda now_ns: now_ns == 50 * MS
    task = machine.run(200 * MS)
    assert machine.what() == ['job'] * 6 + ['safe']
    assert machine.calls[-1] == (50, 'safe')  # immediately, not at the next release
    assert task.state is TaskState.SAFE


def test_a_safe_state_that_fails_is_reported_and_held_all_the_same() -> None:
    machine = Machine(failure=FailurePolicy.SAFE_STATE)
    machine.bad = lambda now_ns: now_ns == 50 * MS
    machine.task.on_safe_state = lambda: 1 / 0
    task = machine.run(200 * MS)
    assert [f.error for f in machine.kernel.failures] == [
        'ValueError: broken', 'ZeroDivisionError: division by zero']
    assert (task.state, task.failures) == (TaskState.SAFE, 2)


@pytest.mark.parametrize('policy,state', [
    (FailurePolicy.STOP, TaskState.STOPPED), (FailurePolicy.SAFE_STATE, TaskState.SAFE)])
def test_a_held_task_that_is_rearmed_begins_with_its_restart(
        policy: FailurePolicy, state: TaskState) -> None:
    machine = Machine(failure=policy)
    machine.bad = lambda now_ns: now_ns == 50 * MS

    def mend() -> None:
        assert machine.task.state is state
        machine.task.rearm()
        machine.task.rearm()  # once more does nothing

    machine.kernel.add_task('mender', mend, priority=5, rate_hz=1.0, phase_ns=105 * MS)
    machine.run(200 * MS)
    after = machine.calls[6 + (state is TaskState.SAFE):]
    assert after == [(105, 'restart'), *((n, 'job') for n in range(110, 200, 10))]
    assert machine.task.state is TaskState.ACTIVE


def test_restart_pauses_longer_with_each_failure_up_to_the_limit() -> None:
    machine = Machine(failure=FailurePolicy.RESTART, restart_ns=20 * MS,
                      restart_maximum_ns=70 * MS)
    machine.bad = lambda now_ns: True
    task = machine.run(S)
    restarts = [at for at, what in machine.calls if what == 'restart']
    jobs = [at for at, what in machine.calls if what == 'job']
    pauses = [after - before for before, after in zip(jobs, restarts)]
    assert pauses == [20, 40, 70] + [70] * (len(pauses) - 3)
    assert len(pauses) > 8
    assert task.failures == len(jobs)


def test_the_pause_is_short_again_after_a_long_time_without_failures() -> None:
    machine = Machine(failure=FailurePolicy.RESTART, restart_ns=20 * MS,
                      restart_maximum_ns=100 * MS)
    machine.bad = lambda now_ns: now_ns < 100 * MS or now_ns == 500 * MS
    machine.run(600 * MS)
    restarts = [at for at, what in machine.calls if what == 'restart']
    assert restarts == [20, 70, 160, 520]  # each the pause after the next job


def test_a_restart_that_fails_is_a_failure_like_any_other() -> None:
    machine = Machine(failure=FailurePolicy.RESTART, restart_ns=20 * MS,
                      restart_maximum_ns=S)
    machine.bad = lambda now_ns: now_ns == 0
    machine.bad_restart = True
    machine.run(500 * MS)
    assert machine.calls == [(0, 'job'), (20, 'restart'), (60, 'restart'), (140, 'restart'),
                             (300, 'restart')]
    assert [f.error for f in machine.kernel.failures][1:] == ['OSError: still broken'] * 4


def test_events_do_not_run_a_held_task_and_are_counted_as_missed() -> None:
    machine = Machine(rate_hz=None, failure=FailurePolicy.STOP)
    machine.bad = lambda now_ns: now_ns >= 30 * MS
    machine.kernel.add_task('source', lambda: machine.kernel.release(machine.task), priority=20,
                            rate_hz=100.0)
    task = machine.run(100 * MS)
    assert (task.runs, task.missed, task.releases, task.coalesced) == (4, 6, 10, 0)


def test_an_event_that_comes_while_the_failing_job_runs_is_not_served() -> None:
    machine = Machine(rate_hz=None, failure=FailurePolicy.STOP)

    def job() -> None:
        machine.note('job')
        machine.kernel.release(machine.task)
        raise ValueError

    machine.task.body = job
    machine.kernel.add_task('source', lambda: machine.kernel.release(machine.task), priority=20,
                            rate_hz=1.0)
    task = machine.run(100 * MS)
    assert (task.runs, task.missed, task.releases) == (1, 1, 2)


def test_a_task_is_held_from_outside_after_its_job_has_ended() -> None:
    machine = Machine()
    machine.task.body = lambda: machine.kernel.clock.spend(4 * MS) or machine.note('job')

    def trip() -> None:
        machine.kernel.hold(machine.task, FailurePolicy.SAFE_STATE, 'tripped')
        machine.note('tripped')

    machine.kernel.add_task('trip', trip, priority=90, rate_hz=1.0, phase_ns=32 * MS)
    machine.run(100 * MS)
    assert machine.calls[3:] == [(32, 'tripped'), (34, 'job'), (34, 'safe')]
    assert machine.kernel.failures[0].error == 'tripped'


def test_an_idle_task_is_held_from_outside_immediately() -> None:
    machine = Machine()
    machine.kernel.add_task(
        'trip', lambda: machine.kernel.hold(machine.task, FailurePolicy.SAFE_STATE, 'tripped'),
        priority=20, rate_hz=1.0, phase_ns=32 * MS)
    machine.run(100 * MS)
    assert machine.calls[4:] == [(32, 'safe')]


@pytest.mark.parametrize('policy', [FailurePolicy.STOP, FailurePolicy.RESTART])
def test_a_task_that_is_held_already_can_be_made_safe_without_running_again(
        policy: FailurePolicy) -> None:
    machine = Machine(failure=policy, restart_ns=50 * MS)
    machine.bad = lambda now_ns: now_ns == 20 * MS
    machine.kernel.add_task(
        'trip', lambda: machine.kernel.hold(machine.task, FailurePolicy.SAFE_STATE, 'tripped'),
        priority=20, rate_hz=1.0, phase_ns=32 * MS)
    task = machine.run(200 * MS)
    assert machine.what() == ['job'] * 3 + ['safe']
    assert task.state is TaskState.SAFE


def test_the_kernel_can_be_run_again_and_the_task_is_active_then() -> None:
    machine = Machine(failure=FailurePolicy.STOP)
    machine.bad = lambda now_ns: now_ns == 0
    machine.kernel.run(50 * MS)
    assert machine.task.state is TaskState.STOPPED
    machine.kernel.run(50 * MS)
    assert machine.what() == ['job'] * 6


def test_a_safe_state_needs_to_be_given() -> None:
    kernel = Kernel(VirtualClock())
    with pytest.raises(TaskError, match="task 'arm': failure safe_state needs on_safe_state"):
        kernel.add_task('arm', print, priority=5, failure=FailurePolicy.SAFE_STATE)


def test_an_unknown_declaration_names_those_there_are() -> None:
    kernel = Kernel(VirtualClock())
    with pytest.raises(TaskError, match='unknown keyword budget; the keywords are: budget_ns, '):
        kernel.add_task('arm', print, priority=5, budget=3)


@pytest.mark.parametrize('policy', FailurePolicy)
def test_a_task_that_is_held_before_the_first_run_starts_like_the_others(
        policy: FailurePolicy) -> None:
    machine = Machine()
    machine.kernel.hold(machine.task, policy, 'the emergency stop is pressed')
    machine.kernel.run(15 * MS)
    assert machine.calls == [(0, 'job'), (10, 'job')]
    assert [f.error for f in machine.kernel.failures] == ['the emergency stop is pressed']
    assert not any(map(balance, machine.kernel.tasks))
