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


"""Random task sets under the virtual clock, against a simulator that is simple enough to trust."""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import field
import itertools

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st

from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import TraceLog
from rt_robot_os.kernel import VirtualClock

UNIT_NS = 10_000

Events = list[tuple[int, str, int]]


@dataclass(frozen=True)
class Declared:
    """A task; all times in units. Without a period the task ``woken`` by others is meant."""

    priority: int
    period: int
    phase: int
    execution: tuple[int, ...]
    wakes: int | None


@dataclass
class State:
    """What the reference knows of a task."""

    declared: Declared
    index: int
    started: int = 0
    releases: int = 0
    missed: int = 0
    coalesced: int = 0
    waiting_since: int | None = None
    left: list[int] = field(default_factory=list)
    busy: bool = False


def reference(tasks: list[Declared], end: int) -> tuple[Events, list[State]]:
    """
    Step through time, unit by unit.

    At each moment: releases; then, until nothing changes, the best waiting job starts if it is
    above the one on top of the stack, else the one on top goes on: at its end it wakes its task.
    Best is the highest; among equals the one released first, where releases by time at the same
    moment come in the order of declaration.
    """
    sequence = itertools.count()
    states = [State(declared, index) for index, declared in enumerate(tasks)]
    stack: list[State] = []
    events: Events = []

    def release(state: State) -> None:
        state.releases += 1
        if not state.declared.period and state.waiting_since is not None:
            state.coalesced += 1
        elif state.declared.period and (state.busy or state.waiting_since is not None):
            state.missed += 1
        else:
            state.waiting_since = next(sequence)

    def settle(now: int, may_start: bool) -> None:
        while True:
            waiting = [s for s in states if s.waiting_since is not None]
            best = min(waiting, default=None, key=lambda s: (
                -s.declared.priority, s.waiting_since))
            if may_start and best and (
                    not stack or best.declared.priority > stack[-1].declared.priority):
                cost = best.declared.execution
                best.left = [cost[best.started % len(cost)], 1]
                best.started += 1
                best.waiting_since, best.busy = None, True
                stack.append(best)
                events.append((now, 'start', best.index))
            elif stack and stack[-1].left[0] == 0 and stack[-1].left[1]:
                stack[-1].left[1] = 0
                if stack[-1].declared.wakes is not None:
                    release(states[stack[-1].declared.wakes])
            elif stack and stack[-1].left[0] == 0:
                done = stack.pop()
                done.busy = False
                events.append((now, 'end', done.index))
            else:
                return

    now = 0
    while now < end or stack:
        if now < end:
            for state in states:
                since = now - state.declared.phase
                if state.declared.period and since >= 0 and since % state.declared.period == 0:
                    release(state)
        settle(now, now < end)
        if stack:
            stack[-1].left[0] -= 1
        now += 1
    for state in states:  # released, and not served before the end
        state.missed += state.waiting_since is not None
    return events, states


def kernel_run(tasks: list[Declared], end: int) -> tuple[Events, Kernel]:
    kernel = Kernel(VirtualClock())
    log = TraceLog()
    kernel.trace = log

    def job(index: int) -> None:
        declared, task = tasks[index], kernel.tasks[index]
        execution = declared.execution
        kernel.clock.spend(execution[task.runs % len(execution)] * UNIT_NS)
        if declared.wakes is not None:
            kernel.release(kernel.tasks[declared.wakes])

    for index, declared in enumerate(tasks):
        rate_hz = 1e9 / (declared.period * UNIT_NS) if declared.period else None
        kernel.add_task(str(index), lambda i=index: job(i), priority=declared.priority,
                        rate_hz=rate_hz, phase_ns=declared.phase * UNIT_NS)
    kernel.run(end * UNIT_NS)
    assert not kernel.failures
    return [(e.at_ns // UNIT_NS, e.kind, int(e.task)) for e in log.events()], kernel


@st.composite
def task_sets(draw: st.DrawFn) -> list[Declared]:
    events = draw(st.integers(0, 2))
    periodic = draw(st.integers(1, 5))
    executions = st.lists(st.integers(0, 12), min_size=1, max_size=3).map(tuple)
    tasks = []
    for index in range(events + periodic):
        wakes = draw(st.one_of(st.none(), st.integers(0, events - 1))) if (
            events and index >= events) else None
        tasks.append(Declared(
            draw(st.integers(1, 4)), draw(st.integers(1, 25)) if index >= events else 0,
            draw(st.integers(0, 30)) if index >= events else 0, draw(executions), wakes))
    return tasks


@settings(max_examples=300)
@given(task_sets(), st.integers(0, 120))
def test_jobs_start_and_end_as_in_the_reference(tasks: list[Declared], end: int) -> None:
    expected, states = reference(tasks, end)
    found, kernel = kernel_run(tasks, end)
    assert found == expected
    assert [(t.releases, t.missed, t.coalesced) for t in kernel.tasks] == [
        (s.releases, s.missed, s.coalesced) for s in states]


@settings(max_examples=50)
@given(task_sets(), st.integers(1, 120))
def test_execution_times_leave_out_what_preempted_the_job(
        tasks: list[Declared], end: int) -> None:
    _, kernel = kernel_run(tasks, end)
    for declared, task in zip(tasks, kernel.tasks):
        cost = declared.execution
        spent = [cost[n % len(cost)] * UNIT_NS for n in range(task.runs)]
        assert task.execution_total_ns == sum(spent)
        assert task.execution.maximum_ns == max(spent, default=0)
        assert task.releases == task.runs + task.missed + task.coalesced
