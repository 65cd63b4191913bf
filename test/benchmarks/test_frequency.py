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

"""The case `frequency`: what becomes of late releases, and what a plain loop reaches."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from benchmarks.frequency import case as frequency
from benchmarks.frequency import floor
from benchmarks.frequency import subjects as modules
import numpy as np
import pytest

from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.result import RunStatus
from rt_robot_os.tools.bench.result import TargetVerdict

MS = 1_000_000


def test_modules_of_a_plain_loop_run_as_often_as_asked() -> None:
    harness: Any = SimpleNamespace(prepare=lambda freeze: None, arguments={
        'warmup_ns': 0, 'measure_ns': 20 * MS, 'modules': [(1000, 1), (500, 2)], 'every': 1,
        'receive': True})
    measured = floor.modules(harness)
    assert 1 <= measured.samples['counts'][1] <= 10
    assert 1 <= measured.samples['counts'][0] <= 20


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
    outcome = RunOutcome(RunStatus.OK, '', {'starts': _calls(after)})
    for which in ('own', 'away'):
        found = [frequency._LATE_METRICS[f'{name} {which}'](outcome)
                 for name in ('at_once', 'left_out', 'shift')]
        assert found[:2] == list(expected[:2]), which
        assert abs(found[2]) == expected[2]  # type: ignore[arg-type]


def test_a_module_is_late_twice_and_asks_for_its_process_to_be_stopped(
        monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    computed: list[int] = []
    monkeypatch.setattr(modules, 'Helper', lambda subject, arguments, cpus: SimpleNamespace(
        process=SimpleNamespace(pid=4711)))
    monkeypatch.setattr(modules.os, 'kill', lambda pid, signo: asked.append(pid))
    monkeypatch.setattr(modules, 'compute', computed.append)
    module = modules.Late(100, 35 * MS)
    for call in range(1, 41):
        module.work()
        assert computed == [35 * MS][:call >= modules.OWN_CALL]
        assert asked == [4711][:call >= modules.AWAY_CALL]
    assert module.stamps.count == 40


@pytest.mark.parametrize('floor_hz, verdict', [(1990.0, TargetVerdict.REACHED),
                                               (2000.0, TargetVerdict.MISSED)])
def test_a_frequency_is_judged_by_what_a_plain_loop_reaches(
        floor_hz: float, verdict: TargetVerdict) -> None:
    def measured(hz: float) -> RunOutcome:
        starts = [np.arange(0, 10**9, round(10**9 / rate / (2000 / hz) ** -1))
                  for rate in frequency.RATES_HZ]
        return RunOutcome(RunStatus.OK, '', {
            'starts': np.concatenate(starts).astype(np.int64),
            'counts': np.array([len(one) for one in starts])},
            {'begin_ns': 0, 'measure_ns': 10**9, 'cpu_percent': 1.0})

    options = BenchOptions(1.0, 1, quick=True)
    outcomes = Outcomes(frequency.CASE.plan(options))
    outcomes.add('kernel', measured(1990.0))
    outcomes.add('monotonic', measured(1990.0))
    outcomes.add('floor', measured(floor_hz))
    result = frequency.CASE.evaluate(options, outcomes)
    assert {each.verdict for each in result.targets} == {verdict}
