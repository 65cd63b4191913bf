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

import numpy as np
import pytest

from rt_robot_os.tools.bench.case import Options
from rt_robot_os.tools.bench.case import Outcome
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.cases import frequency
from rt_robot_os.tools.bench.cases import overload
from rt_robot_os.tools.bench.result import Status
from rt_robot_os.tools.bench.result import Verdict
from rt_robot_os.tools.bench.workers import floors
from rt_robot_os.tools.bench.workers import modules
from rt_robot_os.tools.bench.workers.floors import Group
from rt_robot_os.tools.bench.workers.floors import plain_loop
from rt_robot_os.tools.bench.workers.overload import Crowd

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
    plain_loop([Group(500 * US, [_noting(clock, 'fast', calls)]),
                Group(MS, [_noting(clock, 'a', calls), _noting(clock, 'b', calls)])], MS, 3 * MS)
    assert calls == [('fast', 1000), ('a', 1000), ('b', 1000), ('fast', 1500),
                     ('fast', 2000), ('a', 2000), ('b', 2000), ('fast', 2500)]


def test_what_it_is_too_late_for_is_left_out_and_counted_and_the_grid_is_kept(clock: Clock
                                                                              ) -> None:
    calls: list[tuple[str, int]] = []
    takes_ns = [3_500 * US, 0, 0, 0, 0]

    def job() -> None:
        calls.append(('x', clock.now_ns // US))
        clock.now_ns += takes_ns.pop(0)

    group = Group(MS, [job])
    plain_loop([group], 0, 6 * MS)
    assert [moment for _, moment in calls] == [0, 4000, 5000]
    assert group.missed == 3


def test_modules_of_a_plain_loop_run_as_often_as_asked() -> None:
    measured = floors.modules(_harness(modules=[(1000, 1), (500, 2)], every=1, receive=True))
    assert 1 <= measured.samples['counts'][1] <= 10
    assert 1 <= measured.samples['counts'][0] <= 20


def test_a_thousand_functions_cost_their_calls(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(floors, '_STRETCH_NS', 10 * MS)
    assert (floors.jobs(_harness(tasks=100, rate_hz=200)).samples['cpu_ns'] > 0).all()
    figures = floors.many(_harness(tasks=10, rate_hz=200)).figures
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
    missed = floors._spread(functions, 0, 10 * US, 20)
    assert missed > 0 and len(calls) == 20 - missed
    assert calls[:4] == [0, 1, 0, 1]


def test_a_bare_handler_interrupts_what_computes() -> None:
    measured = floors.handler(_harness(
        period_ns=MS, busy_ns=5 * MS, busy_period_ns=10 * MS, middle_period_ns=0, native=0))
    assert len(measured.samples['busy_begins']) >= 1
    assert len(measured.samples['starts']) >= 1


def test_a_bare_handler_ends_what_computes_for_ever() -> None:
    late = floors.strike(_harness(period_ns=4 * MS, budget_ns=MS)).samples['late_ns']
    assert len(late) == 5 and (late > 0).all()


def test_a_loop_that_spins_wakes_at_each_period() -> None:
    late = floors.spin(_harness(period_ns=MS, spin_ns=100 * US)).samples['late_ns']
    assert 1 <= len(late) <= 21


def test_rows_of_a_long_loop() -> None:
    samples = floors.rows(_harness(row_ns=10 * MS)).samples
    assert samples['time_s'].tolist() == [0.01, 0.02]
    assert set(samples) == {'time_s', 'acquire_hz', 'missed'}


# What becomes of releases that come late: made-up calls on a grid of 10 ms, after a call that
# computed for 35 ms (the 10th), and after one after which the CPU was away as long (the 30th).
_SKIPPED = (0, 3, 0.0)
_ONE_LATE = (1, 2, 0.0)
_CAUGHT_UP = (3, 0, 0.0)
_MOVED = (1, 3, 5.0)


def _calls(after: Callable[[int], list[int]]) -> np.ndarray:
    """Return calls, in ns, that go on after each stall as ``after`` says, in ms from its call."""
    first = list(range(0, 100, 10))
    second = [first[-1] + ms for ms in after(0)][:20]
    return np.array([*first, *second, *(second[-1] + ms for ms in after(1))], np.int64) * MS


@pytest.mark.parametrize('after, expected', [
    (lambda which: list(range(40, 400, 10)), _SKIPPED),
    (lambda which: [35, *range(40, 400, 10)], _ONE_LATE),
    (lambda which: [35, 35, 35, *range(40, 400, 10)], _CAUGHT_UP),
    (lambda which: list(range(35, 400, 10)), _MOVED)])
def test_what_a_late_release_does_is_told_by_the_calls(
        after: Callable[[int], list[int]], expected: tuple[int, int, float]) -> None:
    outcome = Outcome(Status.OK, '', {'starts': _calls(after)})
    for which in ('own', 'away'):
        found = [frequency._LATE_METRICS[f'{name} {which}'](outcome)
                 for name in ('at_once', 'left_out', 'shift')]
        assert found[:2] == list(expected[:2]), which
        assert abs(found[2]) == expected[2]  # type: ignore[arg-type]


def test_a_module_is_late_twice_and_asks_for_its_process_to_be_stopped(
        monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    computed: list[int] = []
    monkeypatch.setattr(modules, 'Helper', lambda worker, arguments, cpus: SimpleNamespace(
        process=SimpleNamespace(pid=4711)))
    monkeypatch.setattr(modules.os, 'kill', lambda pid, signo: asked.append(pid))
    monkeypatch.setattr(modules, 'compute', computed.append)
    module = modules.Late(100, 35 * MS)
    for call in range(1, 41):
        module.work()
        assert computed == [35 * MS][:call >= modules.OWN_CALL]
        assert asked == [4711][:call >= modules.AWAY_CALL]
    assert module.stamps.count == 40


@pytest.mark.parametrize('floor_hz, verdict', [(1990.0, Verdict.REACHED),
                                               (2000.0, Verdict.MISSED)])
def test_a_frequency_is_judged_by_what_a_plain_loop_reaches(
        floor_hz: float, verdict: Verdict) -> None:
    def measured(hz: float) -> Outcome:
        starts = [np.arange(0, 10**9, round(10**9 / rate / (2000 / hz) ** -1))
                  for rate in frequency.RATES_HZ]
        return Outcome(Status.OK, '', {
            'starts': np.concatenate(starts).astype(np.int64),
            'counts': np.array([len(one) for one in starts])},
            {'begin_ns': 0, 'measure_ns': 10**9, 'cpu_percent': 1.0})

    options = Options(1.0, 1, quick=True)
    outcomes = Outcomes(frequency.CASE.plan(options))
    outcomes.add('kernel', measured(1990.0))
    outcomes.add('monotonic', measured(1990.0))
    outcomes.add('floor', measured(floor_hz))
    assert {aim.verdict for aim in frequency.CASE.evaluate(options, outcomes).aims} == {verdict}


def test_callbacks_that_are_called_after_the_end_do_not_count(
        monkeypatch: pytest.MonkeyPatch) -> None:
    moments = iter([0, 500 * MS, 999 * MS, 1000 * MS, 5000 * MS])
    monkeypatch.setattr('rt_robot_os.tools.bench.workers.overload.time',
                        SimpleNamespace(monotonic_ns=lambda: next(moments)))
    ended: list[int] = []
    crowd = Crowd({'work_ns': 0, 'measure_ns': 100 * MS, 'longer_ns': {'1000': 1000 * MS}}, 1000)
    crowd.over = lambda: ended.append(1)
    for _ in range(5):
        crowd.jobs[0]()
    assert crowd.counts[0] == 3 and len(ended) == 2


def test_overload_is_judged_by_threads_of_the_same_run() -> None:
    options = Options(1.0, 1, quick=True)
    for served, verdict in ((90.0, Verdict.REACHED), (85.0, Verdict.MISSED)):
        outcomes = Outcomes(overload.CASE.plan(options))
        for key, percent in (('kernel', served), ('threads', 91.0)):
            outcomes.add(key, Outcome(Status.OK, '', {}, {
                f'served {load} {number}': percent for load in overload.LOADS
                for number in range(overload.TASKS)} | {
                f'jobs {load}': 1.0 for load in overload.LOADS}))
        assert overload.CASE.evaluate(options, outcomes).aims[0].verdict is verdict
