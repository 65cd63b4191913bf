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

"""Plain loops and bare handlers: they do what the kernel does, and lose what it loses."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.cases.kernel import subjects as kernel
from rt_robot_os.tools.bench.cases.overload import case as overload
from rt_robot_os.tools.bench.cases.overload.subjects import OverloadCallbacks
from rt_robot_os.tools.bench.cases.preemption import subjects as preemption
from rt_robot_os.tools.bench.cases.spacing import floor as spacing_floor
from rt_robot_os.tools.bench.cases.stability import subjects as stability
from rt_robot_os.tools.bench.cases.wakeup import subjects as wakeup
from rt_robot_os.tools.bench.result import RunStatus
from rt_robot_os.tools.bench.result import TargetVerdict
from rt_robot_os.tools.bench.subjects import plain_loop as floors
from rt_robot_os.tools.bench.subjects.plain_loop import LoopGroup
from rt_robot_os.tools.bench.subjects.plain_loop import plain_loop

US, MS = 1_000, 1_000_000


class Clock:
    """The time of a loop: it goes on while somebody sleeps or computes."""

    def __init__(self) -> None:
        self.now_ns = 0

    def monotonic_ns(self) -> int:
        """Return the time."""
        return self.now_ns

    def sleep_until_ns(self, deadline_ns: int) -> None:
        """Let it be the deadline."""
        self.now_ns = max(self.now_ns, deadline_ns)


@pytest.fixture(name='clock')
def _clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(floors, 'Sleeper', lambda: clock)
    monkeypatch.setattr(floors, 'time', clock)
    monkeypatch.setattr(spacing_floor, 'time', clock)
    return clock


def _harness(**arguments: Any) -> Any:
    return SimpleNamespace(arguments={'warmup_ns': 0, 'measure_ns': 20 * MS, **arguments},
                           prepare=lambda freeze: None)


def _noting(clock: Clock, name: str, calls: list[tuple[str, int]], takes_ns: int = 0
            ) -> Callable[[], None]:
    def job() -> None:
        calls.append((name, clock.now_ns // US))
        clock.now_ns += takes_ns

    return job


def test_a_plain_loop_calls_each_group_at_its_rate_and_the_first_first(clock: Clock) -> None:
    calls: list[tuple[str, int]] = []
    plain_loop([LoopGroup(500 * US, [_noting(clock, 'fast', calls)]),
                LoopGroup(MS, [_noting(clock, name, calls) for name in 'ab'])], MS, 3 * MS)
    assert calls == [('fast', 1000), ('a', 1000), ('b', 1000), ('fast', 1500),
                     ('fast', 2000), ('a', 2000), ('b', 2000), ('fast', 2500)]


def test_what_it_is_too_late_for_is_left_out_and_counted_and_the_grid_is_kept(clock: Clock
                                                                              ) -> None:
    calls: list[tuple[str, int]] = []
    takes_ns = [3_500 * US, 0, 0, 0, 0]

    def job() -> None:
        calls.append(('x', clock.now_ns // US))
        clock.now_ns += takes_ns.pop(0)

    group = LoopGroup(MS, [job])
    plain_loop([group], 0, 6 * MS)
    assert [moment for _, moment in calls] == [0, 4000, 5000]
    assert group.missed == 3


def test_a_thousand_functions_cost_their_calls(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(spacing_floor, '_STRETCH_NS', 10 * MS)
    assert (spacing_floor.jobs(_harness(tasks=100, rate_hz=200)).samples['cpu_ns'] > 0).all()
    figures = spacing_floor.many(_harness(tasks=10, rate_hz=200)).figures
    for key in ('together', 'spread'):
        # A busy machine may miss all of them.
        missed, reached_hz = figures[f'missed {key}'], figures[f'reached_hz {key}']
        assert reached_hz == 200.0 * (40 - missed) / 40
        assert figures[f'job_us {key}'] > 0


def test_what_is_spread_waits_for_its_moment_and_is_skipped_when_a_period_late(
        clock: Clock) -> None:
    ticks = iter([*range(0, 40 * US, US), *range(100 * US, 500 * US, US)])
    clock.monotonic_ns = lambda: next(ticks)  # type: ignore[method-assign]
    calls: list[int] = []
    functions = [lambda number=number: calls.append(number) for number in range(2)]
    # Periods of 20 us; for 60 us, three of them, the CPU is away.
    missed = spacing_floor._spread(functions, 0, 10 * US, 20)
    assert missed > 0 and len(calls) == 20 - missed
    assert calls[:4] == [0, 1, 0, 1]


def test_a_bare_handler_interrupts_what_computes() -> None:
    measured = preemption.handler(_harness(
        period_ns=MS, busy_ns=5 * MS, busy_period_ns=10 * MS, middle_period_ns=0, native=0))
    assert len(measured.samples['busy_begins']) >= 1
    assert len(measured.samples['starts']) >= 1


def test_a_bare_handler_ends_what_computes_for_ever() -> None:
    late = kernel.strike(_harness(period_ns=4 * MS, budget_ns=MS)).samples['late_ns']
    assert len(late) == 5 and (late > 0).all()


def test_a_loop_that_spins_wakes_at_each_period() -> None:
    late = wakeup.spin(_harness(period_ns=MS, spin_ns=100 * US)).samples['late_ns']
    assert 1 <= len(late) <= 21


def test_rows_of_a_long_loop() -> None:
    samples = stability.rows(_harness(row_ns=10 * MS)).samples
    assert samples['time_s'].tolist() == [0.01, 0.02]
    assert set(samples) == {'time_s', 'acquire_hz', 'missed'}


def test_callbacks_that_are_called_after_the_end_do_not_count(
        monkeypatch: pytest.MonkeyPatch) -> None:
    moments = iter([0, 500 * MS, 999 * MS, 1000 * MS, 5000 * MS])
    monkeypatch.setattr('rt_robot_os.tools.bench.cases.overload.subjects.time',
                        SimpleNamespace(monotonic_ns=lambda: next(moments)))
    ended: list[int] = []
    crowd = OverloadCallbacks({
        'work_ns': 0, 'measure_ns': 100 * MS, 'longer_ns': {'1000': 1000 * MS}}, 1000)
    crowd.over = lambda: ended.append(1)
    for _ in range(5):
        crowd.jobs[0]()
    assert crowd.counts[0] == 3 and len(ended) == 2


def test_overload_is_judged_by_threads_of_the_same_run() -> None:
    options = BenchOptions(1.0, 1, quick=True)
    for served, verdict in ((90.0, TargetVerdict.REACHED), (85.0, TargetVerdict.MISSED)):
        outcomes = Outcomes(overload.CASE.plan(options))
        for key, percent in (('kernel', served), ('threads', 91.0)):
            outcomes.add(key, RunOutcome(RunStatus.OK, '', {}, {
                f'served {load} {number}': percent for load in overload.LOADS
                for number in range(overload.TASKS)} | {
                f'jobs {load}': 1.0 for load in overload.LOADS}))
        assert overload.CASE.evaluate(options, outcomes).targets[0].verdict is verdict
