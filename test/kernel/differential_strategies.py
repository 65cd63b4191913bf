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
Make scenarios at random, for hypothesis: what comes first is what it makes a failing one of.

Each scenario uses some kinds of operations only, and more of them: what is rare among all of them
would hardly ever meet what else is rare.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from differential_scenario import ClockData
from differential_scenario import KernelData
from differential_scenario import Operation
from differential_scenario import PipeData
from differential_scenario import Program
from differential_scenario import ReaderData
from differential_scenario import Scenario
from differential_scenario import TaskData
from differential_scenario import TopicData
from differential_scenario import TriggerData
from hypothesis import strategies as st

US = 1_000
MS = 1_000_000

numbers = st.integers(0, 5)
policies = st.sampled_from(['CONTINUE', 'RESTART', 'STOP', 'SAFE_STATE'])
durations = st.one_of(
    st.integers(0, 60).map(lambda n: n * 10 * US), st.integers(0, 400 * US),
    st.integers(0, 8).map(lambda n: n * MS))
periods = st.one_of(
    st.integers(1, 20).map(lambda n: n * 100 * US), st.integers(1, 100).map(lambda n: n * 10 * US),
    st.integers(10 * US, 5 * MS))
stamps = st.sampled_from([0, 0, 7])

# Of each kind of operation: what its arguments are.
SIMPLE: dict[str, tuple[st.SearchStrategy[Any], ...]] = {
    'release': (numbers,),
    'publish': (numbers, stamps),
    'take': (numbers,),
    'latest': (numbers,),
    'raise': (numbers,),
    'start_timer': (numbers, durations),
    'cancel_timer': (numbers,),
    'set_event': (numbers,),
    'clear_event': (numbers,),
    'stall': (durations,),
    'set_rate': (numbers, periods),
    'reset_statistics': (numbers,),
    'account': (numbers,),
    'hold': (numbers, policies),
    'rearm': (numbers,),
    'write': (numbers, st.booleans()),
    'drain': (numbers,),
    'settle': (),
    'steal': (durations,),
    'stop_process': (durations,),
    'publish_cdr': (numbers, stamps),
    'put_back': (numbers,),
    'rewind': (numbers,),
    'skip': (numbers, st.booleans()),
    'unsubscribe': (numbers,),
    'stop_releasing': (numbers,),
    'remove_interrupt': (numbers,),
    'add_interrupt': (numbers, numbers, durations),
    'mark': (),
    'observe': (),
    'statistics': (),
    'dump': (),
    'drop': (),
    'enter': (numbers,),
    'leave': (numbers,),
    'abort_self': (),
    'publish_nonsense': (numbers,),
    'add_task': (),
    'stop': (),
    'break': (),
}
COMPOUND = ('within', 'swallow', 'finally', 'lock')
ASYNC = ('wait', 'wait_finally', 'wait_inside', 'wait_wrongly')
# What ends a run early, or a job: in few scenarios only.
ENDING = frozenset({'stop', 'break', 'raise', 'abort_self', 'enter', 'leave'})
ALWAYS = ('spend', 'spend', 'spend')


ARGUMENTS = {kind: st.tuples(st.just(kind), *arguments) for kind, arguments in SIMPLE.items()}
SPEND = st.tuples(st.just('spend'), durations)
# Of three operations one is to spend time.
SPENDS = st.integers(0, 2)
WAIT = st.one_of(
    *(st.tuples(st.just(kind), durations) for kind in ('sleep', 'until', 'tick')),
    *(st.tuples(st.just(kind), numbers) for kind in ('event', 'sample')))
WAITS = st.lists(WAIT, min_size=1, max_size=3).map(tuple)
LENGTHS = {most: st.integers(0, most) for most in (1, 3, 5, 8)}
NUMBERS = {count: st.integers(0, count - 1) for count in range(1, 20)}


class Programs:
    """
    Make programs of some kinds of operations.

    Building the strategies again for each scenario would take longer than its runs.

    :param kinds: which.
    """

    def __init__(self, draw: st.DrawFn, kinds: list[str]) -> None:
        self._draw = draw
        self._simple = [kind for kind in kinds if kind in SIMPLE]
        self._all = [kind for kind in kinds if kind not in ASYNC]
        self._async = ['wait', *kinds, 'wait']

    def _one(self, kinds: list[str]) -> Operation:
        draw = self._draw
        if not kinds or not draw(SPENDS):
            return draw(SPEND)
        kind = kinds[draw(NUMBERS[len(kinds)])]
        if kind in SIMPLE:
            return draw(ARGUMENTS[kind])
        if kind == 'wait':
            return kind, draw(WAITS)
        if kind == 'wait_finally':
            return kind, draw(WAITS), self._inner()
        if kind == 'wait_inside':
            return kind, draw(numbers), draw(WAITS)
        if kind == 'wait_wrongly':
            return (kind,)
        if kind == 'within':
            return kind, draw(numbers), self._inner()
        if kind == 'finally':
            return kind, self._inner(), self._inner()
        return kind, self._inner()

    def _inner(self) -> Program:
        return self._many(self._simple, 3)

    def _many(self, kinds: list[str], most: int) -> Program:
        return tuple(self._one(kinds) for _ in range(self._draw(LENGTHS[most])))

    def program(self) -> Program:
        """Make one."""
        return self._many(self._all, 5)

    def sometimes(self) -> Program | None:
        """Make one, or none."""
        return self.program() if self._draw(LENGTHS[1]) else None

    def several(self) -> tuple[Program, ...]:
        """Make those of a task."""
        return (self.program(), *(self.program() for _ in range(self._draw(LENGTHS[1]))))

    def asynchronous(self) -> Program:
        """Make that of a coroutine."""
        return self._many(self._async, 8)


PRIORITIES = st.one_of(st.integers(1, 6), st.integers(1, 99))
NONE_OR = {key: st.one_of(st.just(0), strategy) for key, strategy in (
    ('duration', durations), ('limit', st.integers(1, 5)))}
SEVERAL = st.lists(numbers, max_size=2).map(tuple)
RESTARTS = st.sampled_from([(100 * US, 3 * MS), (0, 3 * MS), (3 * MS, 10 * MS)])
FAILURES_OF_COROUTINES = st.sampled_from(['RESTART', 'STOP'])
PERIODS_OR_NONE = st.one_of(periods, periods, st.just(0))
OVERRUNS = st.sampled_from(['SKIP', 'SKIP', 'CATCH_UP', 'REPHASE', 'STOP'])
LEAKS = st.sampled_from([100, 1, 3])
RARELY = st.integers(0, 5)


def make_task(draw: st.DrawFn, programs: Programs) -> TaskData:
    """Make a task; what contradicts what was drawn before is left as by default."""
    restart_ns, restart_maximum_ns = draw(RESTARTS)
    common: dict[str, Any] = {
        'priority': draw(PRIORITIES), 'phase_ns': draw(NONE_OR['duration']),
        'resources': draw(SEVERAL), 'restart_ns': restart_ns,
        'restart_maximum_ns': restart_maximum_ns,
        'on_restart': programs.sometimes()}
    budget_ns = draw(NONE_OR['duration'])
    aborts = budget_ns > 0 and bool(draw(LENGTHS[1]))
    common.update(budget_ns=budget_ns, on_budget='ABORT' if aborts else 'WARN')
    if draw(RARELY) == 5:
        failure = draw(FAILURES_OF_COROUTINES)
        return TaskData(is_async=True, failure=failure, programs=(programs.asynchronous(),),
                        **common)
    period_ns = draw(PERIODS_OR_NONE)
    failure = draw(policies)
    overrun = draw(OVERRUNS)
    deadline_ns = draw(NONE_OR['duration'])
    limit = draw(NONE_OR['limit'])
    if not period_ns:
        overrun, limit = 'SKIP', 0
    elif overrun not in ('CATCH_UP', 'REPHASE') and deadline_ns > period_ns:
        deadline_ns = 0
    if overrun == 'STOP' or failure == 'CONTINUE':
        limit = 0
    if aborts and (period_ns and budget_ns > period_ns or deadline_ns and budget_ns > deadline_ns):
        common['on_budget'] = 'WARN'
    safe = programs.program() if failure == 'SAFE_STATE' else None
    return TaskData(
        period_ns=period_ns, deadline_ns=deadline_ns, overrun=overrun, overrun_limit=limit,
        overrun_leak=draw(LEAKS), catch_up=1 + draw(NUMBERS[3]),
        failure=failure, on_safe_state=safe, programs=programs.several(),
        logical=bool(period_ns) and draw(RARELY) == 5,
        after=draw(SEVERAL), **common)


CLOCKS = st.builds(
    ClockData, start_ns=st.sampled_from([0, 1_000_000_007]),
    wake_ns=st.sampled_from([0, 0, 20 * US, 3 * US]), arm_ns=st.sampled_from([0, 0, 0, 1500]),
    late_ns=st.sampled_from([0, 0, 0, 4 * US, 300 * US]), signal=st.booleans())


KERNELS = st.builds(
    KernelData, spin_ns=st.sampled_from([0, 0, 0, 0, 30 * US]),
    records=st.sampled_from([2048, 4, 16]),
    stop_grace_ns=st.sampled_from([None, None, 0, 200 * US]),
    trace=st.sampled_from([True, True, True, False]),
    trace_fails_at=st.integers(-300, 20).map(lambda n: max(n, 0)),
    observers=st.one_of(st.just(()), st.just(()),
                        st.lists(st.sampled_from([0, 3, 10]), max_size=2).map(tuple)))
# The idle hook is no task, and cannot do what only one can.
IDLING = ('release', 'set_event', 'stop', 'start_timer', 'raise', 'account', 'statistics', 'take')


@st.composite
def scenarios(draw: st.DrawFn) -> Scenario:
    """Make a scenario."""
    focus = draw(FOCUS)
    kinds = [*focus, *(kind for kind in draw(KINDS) if kind not in focus)]
    if draw(RARELY) >= 4:
        kinds = kinds + draw(ENDING_KINDS)
    programs = Programs(draw, kinds)
    kernel = draw(KERNELS)
    if draw(RARELY) >= 4:
        idle = Programs(draw, [kind for kind in kinds if kind in IDLING])
        kernel = replace(kernel, idle=idle.program())
    return Scenario(
        tasks=(make_task(draw, programs),
               *(make_task(draw, programs) for _ in range(draw(LENGTHS[5])))),
        runs=draw(RUNS), resources=draw(NUMBERS[3]) or int('within' in focus),
        timers=draw(SEVERAL) or (0,) * ('start_timer' in focus),
        events=draw(NUMBERS[3]) or int('set_event' in focus),
        topics=draw(TOPICS) or (TopicData(),) * ('publish' in focus),
        readers=draw(READERS) or (ReaderData(),) * ('publish' in focus),
        triggers=draw(TRIGGERS), pipes=draw(PIPES) or (PipeData(),) * ('write' in focus),
        kernel=kernel, clock=draw(CLOCKS))


MILD = [kind for kind in (*SIMPLE, *COMPOUND, *ASYNC) if kind not in ENDING]
KINDS = st.lists(st.sampled_from(MILD), max_size=8, unique=True)
# What does little without each other, and without something that it is done with.
FOCUS = st.sampled_from([
    (), ('publish', 'take'), ('publish', 'publish_cdr', 'latest', 'take', 'skip'),
    ('within', 'release'), ('start_timer', 'cancel_timer'), ('set_event', 'clear_event', 'wait'),
    ('hold', 'rearm', 'raise'), ('write', 'drain'), ('steal', 'stall', 'stop_process'), ()])
ENDING_KINDS = st.lists(st.sampled_from(sorted(ENDING)), max_size=2, unique=True)
RUNS = st.sampled_from([
    (10 * MS,), (3 * MS,), (25 * MS,), (7_777_777,), (0,), (10 * MS, 3 * MS), (3 * MS, 7_777_777)])
TOPICS = st.lists(st.builds(
    TopicData, kind=st.sampled_from(['fixed', 'fixed', 'tail', 'fixed', 'tail', 'large']),
    depth=st.sampled_from([1, 2, 4])), max_size=2).map(tuple)
READERS = st.lists(st.builds(
    ReaderData, topic=numbers, task=numbers, wakes=st.booleans(), initial=st.booleans(),
    newest=st.booleans()), max_size=4).map(tuple)
TRIGGERS = st.lists(st.builds(
    TriggerData, task=numbers, every=st.integers(0, 3),
    topics=st.lists(numbers, min_size=1, max_size=2).map(tuple)), max_size=2).map(tuple)
PIPES = st.lists(st.builds(
    PipeData, task=numbers, separation_ns=st.sampled_from([0, 100 * US, MS])),
    max_size=2).map(tuple)
