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


"""
Run a scenario on the virtual clock and tell everything that can be seen of it, as plain values.

What happens, in order, is one list (``timeline``): starts and ends of jobs, each operation with
its result, the calls of the clock, and those of observers and the idle hook. The
rest is what can be asked when a run has ended.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from collections.abc import Iterable
from dataclasses import fields
from dataclasses import is_dataclass
from enum import Enum
import os
from pathlib import Path
import sys
from typing import Any

from differential_clock import ScenarioClock
from differential_operations import Operations
from differential_scenario import Scenario

from rt_robot_os.kernel import BudgetPolicy
from rt_robot_os.kernel import Event
from rt_robot_os.kernel import FailurePolicy
from rt_robot_os.kernel import FailureReport
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import OverrunPolicy
from rt_robot_os.kernel import Task
from rt_robot_os.topics import Bus

PACKAGE = str(Path(sys.modules['rt_robot_os'].__file__ or '').parent)
# Of the calls that led to a failure the last ones: those of the kernel are Python in one build.
CALLS_TOLD = 3
MESSAGES = {'fixed': ('std_msgs/msg/Int64', None), 'tail': ('std_msgs/msg/String', 40),
            'large': ('std_msgs/msg/UInt8MultiArray', 70_000)}
ENTRIES_MOST = 1500
JOBS_MOST = 250

Observation = dict[str, Any]

OF_A_TASK = (
    'name', 'priority', 'period_ns', 'rate_hz', 'deadline_ns', 'pending', 'busy', 'inside',
    'follow_up', 'start_ns', 'release_ns', 'interval_ns', 'releases', 'runs', 'missed',
    'coalesced', 'failures', 'overruns', 'aborted', 'budget_exceeded', 'deadline_missed',
    'last_miss', 'state', 'execution_total_ns', 'gap_maximum_ns', 'blocked_maximum_ns',
    'response_maximum_ns', 'limit_ns', 'restart_ns', 'resume_ns', 'rephasing', 'backlog',
    'next_ns', 'next_period_ns', 'held', 'abort_pending', 'grace_used', 'containing',
    'aborts_raised')
OF_A_READER = ('seq', 'stamp_ns', 'length', 'lost', 'skipped', 'reads', 'next_seq', 'unread',
               'age_ns', 'status')


class Runner(Operations):
    """A scenario with all that it is made of."""

    def __init__(self, scenario: Scenario) -> None:
        super().__init__()
        self.scenario = scenario
        self.timeline: list[Any] = []
        self.clock = ScenarioClock(scenario.clock, bool(scenario.kernel.spin_ns), self.note)
        data = scenario.kernel
        self.kernel = Kernel(self.clock, spin_ns=data.spin_ns, black_box_records=data.records)
        if data.stop_grace_ns is not None:
            self.kernel.stop_grace_ns = data.stop_grace_ns
        if data.trace:
            self.kernel.trace = self.trace
        if data.idle is not None:
            self.kernel.on_idle = self.idle
        self.traced = 0
        self.run_kernel = self.kernel.run
        for fails_at in data.observers:
            self.kernel.add_observer(self.observer(fails_at))
        self.resources = [self.kernel.resource(f'r{n}') for n in range(scenario.resources)]
        self.declare_tasks()
        self.timers = [self.kernel.timer(self.nth(self.tasks, n)) for n in scenario.timers]
        self.events = [Event(self.kernel) for _ in range(scenario.events)]
        self.declare_topics()
        self.pipes = [os.pipe() for _ in scenario.pipes]
        for (reading, writing), pipe in zip(self.pipes, scenario.pipes):
            os.set_blocking(reading, False)
            os.set_blocking(writing, False)
            self.kernel.add_interrupt(reading, self.nth(self.tasks, pipe.task),
                                      separation_ns=pipe.separation_ns, name='pipe')

    # ---- declaring ---------------------------------------------------------------------------

    def declare_tasks(self) -> None:
        for index, data in enumerate(self.scenario.tasks):
            declared: dict[str, Any] = {
                key: getattr(data, key) for key in (
                    'phase_ns', 'deadline_ns', 'budget_ns', 'catch_up', 'overrun_limit',
                    'overrun_leak', 'restart_ns', 'restart_maximum_ns', 'logical')}
            declared.update(
                on_budget=BudgetPolicy[data.on_budget], overrun=OverrunPolicy[data.overrun],
                failure=FailurePolicy[data.failure],
                resources=[self.nth(self.resources, n) for n in set(data.resources)
                           if self.resources])
            for key in ('on_restart', 'on_safe_state'):
                program = getattr(data, key)
                if program is not None:
                    declared[key] = self.calling(index, key, program)
            if data.is_async:
                task = self.kernel.add_async_task(
                    f't{index}', self.coroutine(index), priority=data.priority, **declared)
            else:
                task = self.kernel.add_task(
                    f't{index}', self.job(index), priority=data.priority,
                    rate_hz=1e9 / data.period_ns if data.period_ns else None,
                    after=[self.tasks[n % index] for n in data.after if index], **declared)
            self.tasks.append(task)

    def declare_topics(self) -> None:
        scenario = self.scenario
        bus = self.bus = Bus(self.kernel)
        for index, data in enumerate(scenario.topics):
            message, tail = MESSAGES[data.kind]
            self.topics.append(bus.declare(f'p{index}', message, tail=tail, depth=data.depth))
        if not self.topics:
            return
        for task in self.tasks:
            self.publishers.append([bus.publisher(topic.name, task) for topic in self.topics])
        for reader in scenario.readers:
            topic, task = self.nth(self.topics, reader.topic), self.nth(self.tasks, reader.task)
            if task.logical is not None:
                made = bus.subscribe_logically(topic.name, task, initial=reader.initial)
            else:
                made = bus.subscribe(topic.name, task.name, initial=reader.initial,
                                     newest=reader.newest, task=task if reader.wakes else None)
            self.readers.append(made)
        for trigger in scenario.triggers:
            names = list(dict.fromkeys(
                self.nth(self.topics, n).name for n in trigger.topics or (0,)))
            if trigger.every:
                bus.release_every(names[0], self.nth(self.tasks, trigger.task), trigger.every)
            else:
                bus.release_on_all(names, self.nth(self.tasks, trigger.task))

    def job(self, index: int) -> Callable[[], None]:
        programs = self.scenario.tasks[index].programs

        def run() -> None:
            number = self.jobs[index]
            self.jobs[index] += 1
            if sum(self.jobs.values()) > JOBS_MOST or len(self.timeline) > ENTRIES_MOST:
                self.kernel.stop('enough')
                return
            self.perform(index, programs[number % len(programs)])

        return run

    def coroutine(self, index: int) -> Callable[[], Any]:
        async def body() -> None:
            self.jobs[index] += 1
            if self.jobs[index] > JOBS_MOST:
                self.kernel.stop('enough')
            for program in self.scenario.tasks[index].programs:
                for operation in program:
                    await self.perform_async(index, operation)

        return body

    def calling(self, index: int, what: str, program: Any) -> Callable[[], None]:
        def call() -> None:
            self.note(what, index)
            self.perform(index, program)

        return call

    # ---- the report --------------------------------------------------------------------------

    def note(self, *what: Any) -> None:
        if len(self.timeline) < 2 * ENTRIES_MOST:
            self.timeline.append((self.clock.time_ns, *map(plain, what)))

    def trace(self, at_ns: int, kind: str, task: str) -> None:
        self.clock.reads = 0
        self.note('trace', kind, task, at_ns)
        self.traced += 1
        if self.traced == self.scenario.kernel.trace_fails_at:
            raise ValueError('the hook of the trace failed')

    def observer(self, fails_at: int) -> Callable[[tuple[Any, ...]], None]:
        told = []

        def observe(record: tuple[Any, ...]) -> None:
            self.note('observed', record)
            told.append(None)
            if len(told) == fails_at:
                raise ValueError('the observer failed')

        return observe

    def idle(self, slack_ns: int) -> None:
        self.note('idle', slack_ns)
        self.clock.reads = 0
        self.idled += 1
        if self.idled > JOBS_MOST:
            self.kernel.stop('idle for long enough')
        self.perform(-1, self.scenario.kernel.idle or ())

    # ---- running -----------------------------------------------------------------------------

    def run(self) -> Observation:
        """Run it as often as it says; give what was seen."""
        found: Observation = {'timeline': self.timeline}
        try:
            for number, duration_ns in enumerate(self.scenario.runs):
                self.note('run', number)
                found[f'end of run {number}'] = self.run_once(duration_ns)
                for name, value in self.seen():
                    found[f'{name} after run {number}'] = value
        finally:
            for ends in self.pipes:
                for fd in ends:
                    self.kernel.remove_interrupt(fd)
                    os.close(fd)
        return found

    def run_once(self, duration_ns: int | None) -> Any:
        try:
            return self.run_kernel(duration_ns)
        except BaseException as error:
            return (type(error).__name__, str(error).partition('\n')[0])

    def seen(self) -> Iterable[tuple[str, Any]]:
        kernel = self.kernel
        yield 'kernel', [
            (name, plain(getattr(kernel, name))) for name in (
                'running', 'locked', 'pending', 'current', 'ended', 'failures_total', 'wakeups',
                'overhead_ns', 'polled_ns', 'start_ns')]
        yield 'time', self.clock.time_ns
        yield 'failures', [plain(failure) for failure in kernel.failures]
        yield 'black box', [plain(record) for record in kernel.black_box.records]
        yield 'dump', plain(kernel.black_box_dump('end'))
        for task in kernel.tasks:
            yield f'task {task.name}', [(key, plain(getattr(task, key))) for key in OF_A_TASK]
            for kind in ('latency', 'execution', 'jitter'):
                histogram = getattr(task, kind)
                counts = [(n, count) for n, count in enumerate(histogram.counts) if count]
                yield f'{kind} of {task.name}', [('maximum', histogram.maximum_ns), *counts]
        yield 'statistics', plain(kernel.statistics())
        for topic in self.topics:
            kept = range(max(0, topic.head - topic.depth), topic.head)
            yield f'topic {topic.name}', [
                plain(topic.statistics()), topic.head,
                *((n, topic.stamp_of(n), topic.length_of(n),
                   bytes(topic.slots[n % topic.depth][:topic.length_of(n)])[:100]) for n in kept)]
        for index, reader in enumerate(self.readers):
            yield f'reader {index}', [(key, plain(getattr(reader, key))) for key in OF_A_READER]
            yield f'message of reader {index}', bytes(reader.buffer[:reader.length])[:100]
        yield 'publishers', [(p.published, getattr(p, 'discarded', None))
                             for row in self.publishers for p in row]
        yield 'timers', [timer.started for timer in self.timers]
        yield 'events', [event.is_set for event in self.events]
        yield 'ticks', [(key, ticks.missed) for key, ticks in sorted(self.ticks.items())]


def plain(value: Any) -> Any:
    """Make something of which equal ones are equal in another process, too."""
    if isinstance(value, Task):
        return value.name
    if isinstance(value, FailureReport):
        own = [(Path(path).name, line, name) for path, line, name in value.trace
               if not path.startswith(PACKAGE)]
        return ('FailureReport', value.task, value.at_ns, value.error.partition('\n')[0],
                own[-CALLS_TOLD:])
    if isinstance(value, Enum):
        return value.name
    if is_dataclass(value) and not isinstance(value, type):
        return [(field.name, plain(getattr(value, field.name))) for field in fields(value)]
    if isinstance(value, tuple):
        return tuple(map(plain, value))
    if isinstance(value, list | deque):
        return list(map(plain, value))
    return value
