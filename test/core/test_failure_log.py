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


"""Failures are told, each kind once and then summed up, and none is forgotten."""

from __future__ import annotations

from collections.abc import Callable

from rt_robot_os.core.failure_log import FailureLog
from rt_robot_os.kernel import BudgetPolicy
from rt_robot_os.kernel import FailureReport
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock

MS = 1_000_000
S = 1_000_000_000


class World:
    """A kernel whose failures are looked at ten times a second."""

    def __init__(self) -> None:
        self.clock = VirtualClock()
        self.kernel = Kernel(self.clock)
        self.told: list[str] = []
        self.all: list[FailureReport] = []
        self.log = FailureLog(self.kernel, lambda task, text: self.told.append(text),
                              self.all.append)
        self.kernel.add_task('core/watch', self.log.watch, priority=1, rate_hz=10.0)

    def fail(self, rate_hz: float) -> None:
        steps = [0]

        def job() -> None:
            steps[0] += 1
            raise ValueError(f'step {steps[0]}')

        self.kernel.add_task('it', job, priority=5, rate_hz=rate_hz)

    def run(self, seconds: float) -> list[str]:
        self.kernel.run(round(seconds * S))
        return [text.partition('\n')[0] for text in self.told]


def test_a_task_that_fails_in_each_job_is_told_ever_more_seldom() -> None:
    world = World()
    world.fail(10.0)
    told = world.run(16.0)
    assert told[0] == "task 'it': ValueError: step 1"
    assert '\n  ' in world.told[0]  # where it came from
    assert told[1:] == [
        'the same 10 more times in 1 s, the last: ValueError: step 11',
        'the same 20 more times in 2 s, the last: ValueError: step 31',
        'the same 40 more times in 4 s, the last: ValueError: step 71',
        'the same 80 more times in 8 s, the last: ValueError: step 151']
    assert len(world.all) == 160


def test_what_comes_again_after_a_while_is_told_whole_again() -> None:
    world = World()

    def job() -> None:
        if world.kernel.now_ns() in (0, 3 * S):
            raise ValueError('now and then')

    world.kernel.add_task('it', job, priority=5, rate_hz=1.0)
    assert world.run(4.0) == ["task 'it': ValueError: now and then"] * 2


def test_two_kinds_are_told_apart() -> None:
    world = World()

    def job() -> None:
        if world.kernel.now_ns() % (200 * MS):
            raise ValueError('odd')
        raise KeyError('even')

    world.kernel.add_task('it', job, priority=5, rate_hz=10.0)
    assert world.run(0.5) == ["task 'it': KeyError: 'even'", "task 'it': ValueError: odd"]


def test_jobs_that_are_aborted_anywhere_are_one_kind() -> None:
    world = World()

    def job() -> None:
        world.clock.spend(MS)
        for _ in range(world.kernel.task('it').runs % 3):
            world.clock.spend(MS)
        world.clock.spend(5 * MS)

    world.kernel.add_task('it', job, priority=5, rate_hz=20.0, budget_ns=3 * MS,
                          on_budget=BudgetPolicy.ABORT)
    told = world.run(1.5)
    assert len(told) == 2
    assert 'TaskAborted' in told[0] and told[1].startswith('the same ')


def test_failures_that_come_too_fast_to_be_kept_are_counted() -> None:
    world = World()
    world.fail(1000.0)
    told = world.run(0.25)
    assert told[0] == "task 'it': ValueError: step 1"
    assert told[1] == '68 failures came too fast to be logged; /diagnostics counts them by task'


def test_what_is_remembered_is_bounded() -> None:
    world = World()
    for number in range(100):
        namespace: dict[str, Callable[[], None]] = {}
        exec('\n' * number + 'def job(): raise ValueError()', namespace)
        world.kernel.add_task(f'{number}', namespace['job'], priority=5, rate_hz=1.0,
                              phase_ns=(1 + number // 20 * 100) * MS)
    world.run(0.9)
    assert len(world.all) == 100 and len(world.log._kinds) <= 64
