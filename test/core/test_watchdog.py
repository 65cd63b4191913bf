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


"""The watchdog on the virtual clock: when it acts, what it does, whom it feeds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from rt_robot_os.base.reports import Reports
from rt_robot_os.base.reports import Severity
from rt_robot_os.core.app import Core
from rt_robot_os.core.watchdog import Watchdog
from rt_robot_os.kernel import FailurePolicy
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import OverrunPolicy
from rt_robot_os.kernel import TaskState
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.settings import WatchdogSettings

MakeCore = Callable[[str], Core]
MS = 1_000_000
S = 1_000_000_000


class Handle:
    """Note what it is told."""

    def __init__(self) -> None:
        self.deadline_ns = 0
        self.released = False

    def push(self, deadline_ns: int) -> None:
        self.deadline_ns = deadline_ns

    def release(self) -> None:
        self.released = True


class Robot:
    """A kernel with one critical task that a test can stall, and a watchdog of 0.4 s."""

    def __init__(self, action: str = 'log', rate_hz: float | None = 100.0,
                 **declared: Any) -> None:
        self.clock = VirtualClock(start_ns=S)
        self.kernel = Kernel(self.clock)
        self.reports = Reports()
        self.trouble: Callable[[], object] = lambda: None
        self.safe = 0
        self.fed: list[int] = []
        self.task = self.kernel.add_task(
            'drive', lambda: self.trouble(), priority=50, rate_hz=rate_hz, critical=True,
            on_safe_state=self.rest, **declared)
        self.watchdog = Watchdog(self.kernel, WatchdogSettings(0.4, action, 70), self.reports)
        self.watchdog.handle = self.handle = Handle()
        self.watchdog.feeders.append(lambda: self.fed.append(self.kernel.now_ns()))

    def rest(self) -> None:
        self.safe += 1

    def run(self, seconds: float) -> str:
        return self.kernel.run(round(seconds * S))

    def texts(self, severity: Severity = Severity.INFO) -> list[str]:
        return [r.text for r in self.reports.since(0)[2] if r.severity >= severity]


def fail() -> None:
    raise ValueError('no')


def test_while_all_is_well_everybody_is_fed() -> None:
    robot = Robot()
    robot.run(1.0)
    assert robot.texts() == []
    assert robot.watchdog.healthy
    assert len(robot.fed) == 20  # eight checks a timeout
    assert robot.handle.deadline_ns == robot.fed[-1] + 800 * MS


def test_a_task_that_fails_for_the_timeout_is_told_once() -> None:
    robot = Robot()
    robot.trouble = fail
    robot.run(1.0)
    assert robot.texts() == [
        "task 'drive' has ended no job well for 0.450 s; its period and deadline are 0.020 s"]
    assert not robot.watchdog.healthy
    assert robot.fed == [S]  # only before the first job was due
    assert robot.handle.deadline_ns > 2 * S  # it is only told of, so the process lives


def test_one_that_recovers_in_time_is_not_told_of() -> None:
    robot = Robot()
    robot.trouble = lambda: robot.kernel.now_ns() < S + 300 * MS and fail()
    robot.run(1.0)
    assert robot.texts() == [] and robot.watchdog.healthy


def test_that_it_recovered_is_told_too() -> None:
    robot = Robot()
    robot.trouble = lambda: robot.kernel.now_ns() < S + 700 * MS and fail()
    robot.run(1.0)
    assert robot.texts()[1:] == ['all critical tasks are healthy again']
    assert robot.fed[-1] > S + 900 * MS


def test_a_job_that_does_not_end_is_noticed_from_above() -> None:
    robot = Robot('exit')
    robot.trouble = lambda: robot.clock.spend(5 * S)
    assert robot.run(20.0).startswith("watchdog: task 'drive' has ended no job well for")
    assert robot.watchdog.tripped
    assert robot.texts(Severity.FATAL)[0].endswith('the core ends with exit code 70')
    # It may leave in order for a timeout; then the handle ends it.
    tripped_ns = next(r.at_ns for r in robot.reports.since(0)[2])
    assert robot.handle.deadline_ns == tripped_ns + 400 * MS
    robot.watchdog.leave()
    assert not robot.handle.released


def test_the_handle_is_let_go_when_the_core_ends_in_order() -> None:
    robot = Robot('exit')
    robot.run(0.2)
    robot.watchdog.leave()
    assert robot.handle.released


def test_before_an_exit_the_handle_is_not_pushed() -> None:
    robot = Robot('exit')
    robot.trouble = fail
    robot.run(0.3)
    assert robot.handle.deadline_ns == S + 800 * MS  # of the only healthy check


def test_all_tasks_with_a_safe_state_go_there() -> None:
    robot = Robot('safe_state')
    calls: list[str] = []
    other = robot.kernel.add_task('arm', lambda: None, priority=5, rate_hz=50.0,
                                  on_safe_state=lambda: calls.append('arm'))
    plain = robot.kernel.add_task('log', lambda: None, priority=4, rate_hz=50.0)
    robot.trouble = fail
    robot.run(1.0)
    assert (robot.safe, calls) == (1, ['arm'])
    assert robot.task.state is other.state is TaskState.SAFE
    assert plain.state is TaskState.ACTIVE
    assert robot.fed[-1] > S + 900 * MS  # what is safe is fed


@pytest.mark.parametrize('failure', list(FailurePolicy))
def test_a_task_that_pauses_or_was_stopped_goes_to_its_safe_state_too(
        failure: FailurePolicy) -> None:
    robot = Robot('safe_state', failure=failure, restart_ns=5 * S, restart_maximum_ns=5 * S)
    robot.trouble = lambda: robot.kernel.now_ns() > S + 100 * MS and fail()
    robot.run(1.0)
    assert robot.task.state is TaskState.SAFE
    assert robot.safe == 1
    assert robot.fed[-1] > S + 900 * MS


def test_rearmed_tasks_are_judged_anew() -> None:
    robot = Robot('safe_state')
    robot.trouble = lambda: robot.kernel.now_ns() < S + 600 * MS and fail()
    robot.kernel.add_task('operator', lambda: robot.kernel.rearm(robot.task), priority=1,
                          rate_hz=1.0, phase_ns=900 * MS)
    robot.run(1.5)
    assert robot.task.state is TaskState.ACTIVE and robot.safe == 1
    assert robot.texts()[-1] == 'all critical tasks are healthy again'
    assert robot.watchdog.healthy


def test_a_job_that_ends_too_late_for_the_safe_state_ends_the_core() -> None:
    robot = Robot('safe_state')
    robot.trouble = lambda: robot.clock.spend(5 * S)
    assert robot.run(20.0) == (
        'watchdog: drive did not reach the safe state: a job does not end')
    assert robot.safe == 0 and robot.watchdog.tripped


def test_a_task_that_is_held_is_not_healthy() -> None:
    robot = Robot(overrun=OverrunPolicy.STOP)
    robot.trouble = lambda: robot.kernel.now_ns() < S + 50 * MS and robot.clock.spend(25 * MS)
    robot.run(1.0)
    assert robot.texts() == ["task 'drive' is held (stopped)"]


def test_a_slower_rate_needs_no_other_watchdog() -> None:
    robot = Robot()
    robot.kernel.add_task('tuner', lambda: robot.task.set_rate_hz(1.0), priority=1, rate_hz=1.0,
                          phase_ns=500 * MS)
    robot.run(5.0)
    assert robot.texts() == [] and robot.watchdog.healthy


def test_counters_that_are_reset_hurt_nobody() -> None:
    robot = Robot()
    robot.kernel.add_task('reset', robot.task.reset_statistics, priority=1, rate_hz=7.0)
    robot.run(2.0)
    assert robot.texts() == []


def test_a_task_that_nothing_releases_is_healthy() -> None:
    robot = Robot(rate_hz=None, deadline_ns=5 * MS)
    robot.run(2.0)
    assert robot.texts() == [] and robot.watchdog.healthy


@pytest.mark.parametrize('trouble', ['slow', 'fail'])
def test_one_that_events_release_must_keep_its_deadline(trouble: str) -> None:
    robot = Robot(rate_hz=None, deadline_ns=5 * MS)
    robot.trouble = fail if trouble == 'fail' else lambda: robot.clock.spend(S)
    robot.kernel.add_task('source', lambda: robot.kernel.release(robot.task), priority=1,
                          rate_hz=100.0)
    robot.run(2.0)
    text, = set(robot.texts(Severity.ERROR))
    assert text.startswith("task 'drive' has ended no job well for")
    assert text.endswith('its deadline is 0.005 s')


def test_without_critical_tasks_the_process_is_watched_all_the_same() -> None:
    kernel = Kernel(VirtualClock(start_ns=S))
    watchdog = Watchdog(kernel, WatchdogSettings(1.0), Reports())
    watchdog.handle = handle = Handle()
    kernel.run(S)
    assert handle.deadline_ns > 3 * S


def test_a_service_manager_that_waits_for_less_is_fed_in_time() -> None:
    kernel = Kernel(VirtualClock())
    watchdog = Watchdog(kernel, WatchdogSettings(10.0), Reports(), manager_ns=S)
    assert watchdog.interval_ns == S // 4


YAML = """\
watchdog: {{timeout_s: 0.4, action: {action}}}
modules: [it]
it: {{type: 'core_modules:Safe', rate_hz: 100.0, critical: true, raises: 20}}
"""


def test_a_core_that_its_watchdog_ends_says_so(make_core: MakeCore) -> None:
    core = make_core(YAML.format(action='exit'))
    assert core.run().startswith("watchdog: task 'it' has ended no job well")
    assert core.tripped
    assert core.modules[0].calls[-1] == 'deactivate'  # type: ignore[attr-defined]


def test_the_black_box_is_saved_when_it_acts(make_core: MakeCore) -> None:
    core = make_core(YAML.format(action='log'))
    faults: list[str] = []
    assert core.watchdog is not None
    core.watchdog.on_fault = faults.append
    core.run(S)
    fault, = faults
    assert fault.startswith("watchdog: task 'it'")
    assert not core.tripped
