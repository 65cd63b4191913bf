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

"""Two builds side by side: how a child gets its own, and what is made of one that is not there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import os
from pathlib import Path

from benchmarks.delay.subjects import DELAY
from benchmarks.delay.subjects import SLEEPING
from benchmarks.delay.subjects import WAITING
from benchmarks.delay.subjects import WARM
import numpy as np
import pytest

from rt_robot_os.base.compiled import BuildState
from rt_robot_os.base.compiled import SWITCH
from rt_robot_os.tools.bench import builds
from rt_robot_os.tools.bench import processes
from rt_robot_os.tools.bench.blocks import TableBlock
from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import COMPILED
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import PURE
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.case import UNPINNED
from rt_robot_os.tools.bench.child import _work
from rt_robot_os.tools.bench.processes import measure
from rt_robot_os.tools.bench.registry import CASES
from rt_robot_os.tools.bench.report import _case
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import RunStatus
from rt_robot_os.tools.bench.result import TargetVerdict
from rt_robot_os.tools.bench.text_report import case_lines

ROOT = Path(__file__).resolve().parents[3]
OPTIONS = BenchOptions(0.5, 2, quick=True)
_FLOORS = ('floor', 'wakes', 'wake', 'row', 'plain')
WITHOUT = RunOutcome(
    RunStatus.MISSING, 'pure Python: it was not compiled; with a compiler it would be')


def test_a_build_is_chosen_by_the_environment_and_else_left_to_the_user() -> None:
    user = {'A': 'b', SWITCH: '0'}
    assert builds.environment(user, COMPILED) == {'A': 'b'}
    assert builds.environment({'A': 'b'}, PURE) == user
    assert builds.environment({'A': 'b', SWITCH: '1'}, PURE) == {'A': 'b', SWITCH: '0'}
    assert builds.environment(user, '') == user


def test_a_child_without_the_compiled_build_says_why_and_measures_nothing(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def job(build: str) -> dict[str, object]:
        return {'subject': 'no.such.module:work', 'arguments': {}, 'cpu': UNPINNED, 'priority': 0,
                'build': build}

    monkeypatch.setattr(builds, 'state', lambda: BuildState(False, 'pure Python: not compiled'))
    assert _work(job(COMPILED), tmp_path) == RunOutcome(
        RunStatus.MISSING, 'pure Python: not compiled')
    # The other build would have been measured.
    assert 'no' in _work(job(PURE), tmp_path).reason != 'pure Python: not compiled'
    monkeypatch.setattr(builds, 'state', lambda: BuildState(True, 'compiled'))
    assert 'pure' not in _work(job(COMPILED), tmp_path).reason


@pytest.mark.parametrize('build, switch', [(PURE, '0'), (COMPILED, 'unset'), ('', '0')])
def test_a_real_child_gets_its_build_and_tells_which_it_ran(
        build: str, switch: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / 'asking.py').write_text(
        'import os\nfrom rt_robot_os.tools.bench.harness import Measurement\n\n\n'
        f'def work(harness):\n    assert os.environ.get("{SWITCH}", "unset") == "{switch}"\n'
        '    return Measurement()\n')
    monkeypatch.setattr(processes, 'lock_path', lambda: tmp_path / 'lock')
    monkeypatch.setenv('PYTHONPATH', os.pathsep.join((str(tmp_path), str(ROOT))))
    monkeypatch.setenv(SWITCH, '0')
    outcome = measure(Run('x', 'x', 'asking:work', {}, 1.0, UNPINNED, 0, build=build))
    if build == COMPILED and outcome.status is RunStatus.MISSING:
        assert outcome.reason.startswith('pure Python: ') and '\n' not in outcome.reason
        return
    assert outcome.status is RunStatus.OK, outcome.reason
    assert outcome.figures[builds.FIGURE] == float(build == COMPILED)


def _ps(run: Run, factor: int) -> RunOutcome:
    """Make up samples of every name that the runs of these cases have."""
    names = ('publish 64', 'publish+take 64', 'publish to task 64', 'publish 2048',
             'publish+take 2048', 'field set', 'field get', 'pack ten', 'unpack ten', 'log three',
             'log throttled', 'log off', 'call', 'system call')
    samples = {name: np.full(20, 500_000 * factor) for name in names}
    samples |= {name: np.full(200, 2_000 * factor) for name in (DELAY, WARM, SLEEPING, WAITING)}
    samples |= {name: np.full(20, 3_000 * factor) for name in ('cpu_ns', *(
        str(ns) for ns in run.arguments.get('spacings_ns', ())))}
    figures = {f'{name} {ns}': 1.0 for name in ('sleeps', 'looked')
               for ns in run.arguments.get('spacings_ns', ())}
    for key in ('together', 'spread'):
        figures |= {f'reached_hz {key}': 200.0 / factor, f'missed {key}': 100.0 * (factor - 1),
                    f'job_us {key}': 3.0 * factor, f'looked_us {key}': 0.0,
                    f'cpu_percent {key}': 30.0 * factor}
    return RunOutcome(RunStatus.OK, '', samples, {'due': 200, **figures})


def _evaluate(name: str, measured: Callable[[Run], RunOutcome]) -> CaseResult:
    case = CASES[name]
    outcomes = Outcomes(case.plan(OPTIONS))
    for key, run in outcomes.runs.items():
        for _ in range(OPTIONS.repeats):
            outcomes.add(key, measured(run) if run.build or key in _FLOORS
                         else RunOutcome(RunStatus.MISSING, 'left out'))
    return case.evaluate(OPTIONS, outcomes)


def _both(run: Run) -> RunOutcome:
    return _ps(run, 8 if run.build == PURE else 1)


def _only_pure(run: Run) -> RunOutcome:
    return WITHOUT if run.build == COMPILED else _ps(run, 2)


@pytest.mark.parametrize('name', ['micro', 'delay', 'spacing'])
def test_every_measurement_of_a_build_has_a_row_for_each(name: str) -> None:
    for case in (_evaluate(name, _both), _evaluate(name, _only_pure)):
        rows = [row for table in case.tables for row in table.rows]
        compiled = [row for row in rows if row.label.endswith(', compiled')]
        pure = [row for row in rows if row.label.endswith(', pure Python')]
        assert [row.label.rpartition(',')[0] for row in compiled] == [
            row.label.rpartition(',')[0] for row in pure]
        assert len(compiled) > 3
        assert all(row.status is RunStatus.OK for row in pure)


@pytest.mark.parametrize('name', ['micro', 'delay', 'spacing'])
def test_with_both_builds_their_ratio_is_shown_and_judged(name: str) -> None:
    case = _evaluate(name, _both)
    ratios = [row.metrics['ratio'] for table in case.tables for row in table.rows
              if 'ratio' in row.metrics]
    assert ratios and {metric.median for metric in ratios if metric is not None} == {0.125}
    targets = [target for target in case.targets if target.text.endswith('compiled / pure')]
    assert targets and {target.verdict for target in targets} == {TargetVerdict.REACHED}


@pytest.mark.parametrize('name', ['micro', 'delay', 'spacing'])
def test_without_a_compiled_build_the_reason_is_told_once_and_nothing_is_missed_for_it(
        name: str) -> None:
    case = _evaluate(name, _only_pure)
    targets = [target for target in case.targets if 'compiled /' in target.text]
    assert targets and {target.verdict for target in targets} == {TargetVerdict.UNKNOWN}
    said = '\n'.join(case_lines(case))
    assert said.count('pure Python: it was not compiled') == len(case.tables) - (name == 'delay')
    assert 'not available, as above' in said
    for grid in (block for block in _case(case) if isinstance(block, TableBlock)):
        reasons = [row[-1] for row in grid.rows if 'not compiled' in row[-1]]
        assert len(reasons) <= 1


def test_what_holds_for_any_build_is_judged_by_the_one_that_is_there() -> None:
    def measured(case: CaseResult) -> float:
        target = next(each for each in case.targets
                      if each.text == 'log a line with three arguments')
        assert target.measured is not None
        return target.measured.median

    assert measured(_evaluate('micro', _both)) == 0.5
    assert measured(_evaluate('micro', _only_pure)) == 1.0


@pytest.mark.parametrize('name', ['micro', 'delay', 'spacing'])
def test_both_builds_do_the_same_one_right_after_the_other(name: str) -> None:
    runs = [run for run in CASES[name].plan(replace(OPTIONS, quick=False)) if run.build]
    assert runs
    for one, two in zip(runs[::2], runs[1::2]):
        assert (one.build, two.build) == (COMPILED, PURE)
        assert replace(one, key='', label='', build='') == replace(two, key='', label='', build='')
