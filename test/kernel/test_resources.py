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

"""Resources: the immediate ceiling protocol, its promises and its errors."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from dataclasses import dataclass

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
from kernel_tools import MS
from kernel_tools import names
from kernel_tools import S
from kernel_tools import US
import pytest

from rt_robot_os.base.errors import TaskError
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import Resource
from rt_robot_os.kernel import TraceLog
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.kernel.black_box import JOB


def test_a_user_of_the_resource_waits_until_it_is_left_and_others_do_not(kernel: Kernel) -> None:
    log = kernel.trace = TraceLog()
    shared = kernel.resource('shared')

    def low_job() -> None:
        with shared:
            kernel.clock.spend(5 * MS)
        kernel.clock.spend(5 * MS)

    def job() -> None:
        with shared:
            kernel.clock.spend(MS)

    kernel.add_task('low', low_job, priority=10, rate_hz=1.0, resources=[shared])
    kernel.add_task('between', lambda: kernel.clock.spend(MS), priority=30, rate_hz=1.0,
                    phase_ns=MS)
    user = kernel.add_task('user', job, priority=50, rate_hz=1.0, phase_ns=2 * MS,
                           resources=[shared])
    above = kernel.add_task('above', lambda: None, priority=70, rate_hz=1.0, phase_ns=3 * MS)
    assert shared.ceiling == 50
    kernel.run(S)
    assert log.text() == (
        'low start\n  above start\n  above end\n  user start\n  user end\n'
        '  between start\n  between end\nlow end\n')
    assert above.latency.maximum_ns == 0
    assert user.latency.maximum_ns == 3 * MS  # until 5 ms: one critical section


def test_statistics_tell_ceiling_users_entries_and_the_longest_hold(kernel: Kernel) -> None:
    shared = kernel.resource('shared')
    assert kernel.resource('shared') is shared

    def job() -> None:
        with shared:
            kernel.clock.spend(2 * MS if task.runs == 3 else MS)

    task = kernel.add_task('task', job, priority=50, rate_hz=10.0, resources=[shared])
    kernel.add_task('other', lambda: None, priority=20, resources=[shared])
    kernel.run(S)
    found, = kernel.statistics().resources
    assert (found.name, found.ceiling, found.users) == ('shared', 50, ('task', 'other'))
    assert (found.entries, found.held_maximum_ns) == (10, 2 * MS)


def error_of(kernel: Kernel, job: Callable[[], object], *resources: Resource) -> str:
    kernel.add_task('task', job, priority=50, rate_hz=1.0, resources=resources)
    kernel.run(10 * MS)
    return kernel.failures[0].error if kernel.failures else ''


def enter(resource: Resource) -> None:
    with resource:
        pass


def test_use_without_declaration_is_an_error_that_names_both(kernel: Kernel) -> None:
    shared = kernel.resource('arm')
    kernel.add_task('owner', lambda: None, priority=5, resources=[shared])
    error = error_of(kernel, lambda: enter(shared))
    assert error == (
        "TaskError: resource 'arm': task 'task' did not declare it; declare it with the task "
        "(resources=...). Declared users: 'owner'")
    assert shared.holder is None


def test_entering_twice_is_an_error_and_the_first_time_still_counts(kernel: Kernel) -> None:
    shared = kernel.resource('arm')

    def job() -> None:
        with shared:
            with pytest.raises(TaskError, match='is inside already'):
                enter(shared)
            assert shared.holder is kernel.task('task')

    assert error_of(kernel, job, shared) == ''
    assert shared.holder is None


def test_outside_of_tasks_it_cannot_be_entered(kernel: Kernel) -> None:
    with pytest.raises(TaskError, match="'arm' can be entered by a running task"):
        enter(kernel.resource('arm'))


def test_a_task_cannot_declare_it_while_the_kernel_runs(kernel: Kernel) -> None:
    shared = kernel.resource('arm')
    error = error_of(kernel, lambda: shared.declare(kernel.task('task')))
    assert "resource 'arm': the kernel is running" in error


def test_an_exception_inside_leaves_the_resource(kernel: Kernel) -> None:
    shared = kernel.resource('arm')

    def job() -> None:
        with shared:
            raise ValueError('inside')

    assert error_of(kernel, job, shared) == 'ValueError: inside'
    assert shared.holder is None and shared.entries == 1


def test_a_job_that_never_leaves_is_reported_and_the_next_one_can_enter(kernel: Kernel) -> None:
    shared = kernel.resource('arm')
    log = kernel.trace = TraceLog()

    def job() -> None:
        shared.__enter__()

    task = kernel.add_task('task', job, priority=50, rate_hz=100.0, resources=[shared])
    kernel.add_task('same', lambda: None, priority=50, rate_hz=100.0, resources=[shared])
    kernel.run(30 * MS)
    assert task.runs == 3 and task.failures == 0
    assert [f.error for f in kernel.failures] == [
        'a job ended inside a resource; use it with `with`'] * 3
    assert names(log) == ['task', 'same'] * 3


def test_to_leave_what_an_earlier_job_was_inside_of_is_an_error_and_nothing_else(
        kernel: Kernel) -> None:
    # As of a generator that holds it over the end of its job.
    shared = kernel.resource('arm')
    inside: list[str] = []

    def hold() -> Iterator[None]:
        with shared:
            yield

    def enter() -> None:
        if not holding:
            holding.append(hold())
            next(holding[0])
        else:
            inside.append('left')
            next(holding[0], None)

    def use() -> None:
        with shared:
            inside.append('used')
            kernel.clock.spend(MS)

    holding: list[Iterator[None]] = []
    kernel.add_task('enter', enter, priority=50, rate_hz=100.0, resources=[shared])
    user = kernel.add_task('use', use, priority=10, rate_hz=100.0, resources=[shared])
    kernel.run(15 * MS)
    assert inside == ['used', 'left', 'used']
    assert [f.error for f in kernel.failures] == [
        'a job ended inside a resource; use it with `with`',
        "TaskError: resource 'arm' is left by a task that is not inside"]
    assert user.failures == 0 and shared.entries == 2 and shared.holder is None


# ---- the promises, for any set of tasks ----------------------------------------------------

@dataclass(frozen=True)
class Section:
    """Work before, inside (with sections inside) and after a resource."""

    resource: int
    before_us: int
    inside_us: int
    nested: tuple[Section, ...] = ()


@dataclass(frozen=True)
class Plan:
    """One task of a random set."""

    priority: int
    period_ms: int
    phase_us: int
    sections: tuple[Section, ...]
    tail_us: int

    def uses(self) -> set[int]:
        return {s.resource for s in walk(self.sections)}


def walk(sections: tuple[Section, ...]) -> list[Section]:
    return [found for s in sections for found in (s, *walk(s.nested))]


def sections(resources: tuple[int, ...], depth: int) -> st.SearchStrategy[tuple[Section, ...]]:
    """Give sections in which no resource lies within itself; the order of nesting is any."""
    if not resources or not depth:
        return st.just(())

    def one(resource: int) -> st.SearchStrategy[Section]:
        rest = tuple(r for r in resources if r != resource)
        return st.builds(Section, st.just(resource), st.integers(0, 200), st.integers(0, 300),
                         sections(rest, depth - 1))

    return st.lists(st.sampled_from(resources).flatmap(one), max_size=2).map(tuple)


PLANS = st.lists(
    st.builds(Plan, st.integers(1, 6), st.sampled_from((4, 5, 8, 10)), st.integers(0, 4000),
              sections((0, 1, 2), 3), st.integers(0, 300)),
    min_size=2, max_size=6)


class Run:
    """A set of tasks on the virtual clock, with the ceilings watched from outside."""

    def __init__(self, plans: list[Plan]) -> None:
        self.clock = VirtualClock()
        self.kernel = Kernel(self.clock)
        self.resources = [self.kernel.resource(f'r{n}') for n in range(3)]
        self.inside = [0, 0, 0]
        self.tasks = [
            self.kernel.add_task(
                f't{n}', lambda plan=plan: self.job(plan), priority=plan.priority * 10,
                rate_hz=1000 / plan.period_ms, phase_ns=plan.phase_us * US,
                resources=[self.resources[r] for r in sorted(plan.uses())])
            for n, plan in enumerate(plans)]

    def job(self, plan: Plan) -> None:
        self.work(plan.sections)
        self.clock.spend(plan.tail_us * US)

    def work(self, sections: tuple[Section, ...]) -> None:
        for section in sections:
            self.clock.spend(section.before_us * US)
            with self.resources[section.resource]:
                self.inside[section.resource] += 1
                assert self.inside[section.resource] == 1, 'two tasks inside'
                self.clock.spend(section.inside_us * US)
                self.work(section.nested)
                self.inside[section.resource] -= 1


def longest_ns(sections: tuple[Section, ...]) -> list[tuple[int, int]]:
    """Give (resource, time inside) of each section, without what preempts it."""
    def inside(section: Section) -> int:
        return section.inside_us * US + sum(
            s.before_us * US + inside(s) for s in section.nested)
    return [(s.resource, inside(s)) for s in walk(sections)]


@settings(max_examples=150, deadline=None)
@given(PLANS)
def test_no_deadlock_and_each_job_is_blocked_at_most_once_for_one_section(
        plans: list[Plan]) -> None:
    run = Run(plans)
    run.kernel.run(80 * MS)
    assert [f.error for f in run.kernel.failures] == []
    for plan, task in zip(plans, run.tasks):
        # Whatever lower or equal tasks do to a job before it starts comes from one section.
        bound_ns = max((length for other in plans if other.priority < plan.priority
                        for resource, length in longest_ns(other.sections)
                        if run.resources[resource].ceiling >= plan.priority * 10), default=0)
        jobs = [r for r in run.kernel.black_box.records if r[0] == JOB]
        mine = [r for r in jobs if r[1] is task]
        for _, _, release_ns, start_ns, _, _ in mine:
            above_ns = sum(min(r[4], start_ns) - max(r[3], release_ns) for r in jobs
                           if r[1].priority >= task.priority and r[3] < start_ns
                           and r[4] > release_ns and r[1] is not task and not any(
                               o is not r and o[1].priority >= task.priority
                               and o[3] <= r[3] and r[4] <= o[4] and o[1] is not task
                               for o in jobs))
            waited_ns = start_ns - release_ns - above_ns
            assert waited_ns <= bound_ns, (task.name, release_ns, waited_ns, bound_ns)


def test_once_started_a_job_is_never_held_up_by_a_lower_one() -> None:
    run = Run([Plan(6, 5, 900, (Section(0, 100, 200, (Section(1, 50, 100),)),), 100),
               Plan(3, 8, 0, (Section(1, 0, 300, (Section(0, 10, 300),)),), 200),
               Plan(1, 10, 0, (Section(0, 700, 300),), 300)])
    run.kernel.run(400 * MS)
    assert not run.kernel.failures
    own_ns = (100 + 200 + 50 + 100 + 100) * US
    jobs = [r for r in run.kernel.black_box.records if r[0] == JOB and r[1] is run.tasks[0]]
    assert len(jobs) == 80
    assert {end - start for _, _, _, start, end, _ in jobs} == {own_ns}
