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

"""The program with measurements that are made up: what is shown, written and returned."""

from __future__ import annotations

from html import escape
import io
import json
from pathlib import Path
import re
from typing import Any

import numpy as np
import pytest

from rt_robot_os.base.compiled import state
from rt_robot_os.base.programs import run_program
from rt_robot_os.base.requirements import Library
from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.cases.preemption.case import BUSY_NS
from rt_robot_os.tools.bench.cases.preemption.case import BUSY_PERIOD_NS
from rt_robot_os.tools.bench.cases.preemption.case import PERIOD_NS
from rt_robot_os.tools.bench.command import run
from rt_robot_os.tools.bench.method import BY_HAND
from rt_robot_os.tools.bench.progress import ProgressLine
from rt_robot_os.tools.bench.registry import CASES
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import RunStatus
from rt_robot_os.tools.bench.result import TargetVerdict
from rt_robot_os.tools.bench.runner import run_case
from rt_robot_os.tools.bench.text_report import case_lines
from rt_robot_os.tools.bench.text_report import WIDTH

PREEMPTION = {'preemption': CASES['preemption']}
MISSING = RunOutcome(RunStatus.MISSING, 'rclpy is not installed (No module named rclpy)')
GRANTED = (('CPU 1', True, ''), ('SCHED_FIFO priority 80', False, 'not permitted'))


def _preemption(measured: Run) -> RunOutcome:
    """Make up a run: ours and the floor late by 20 us, a peer by up to 20 ms."""
    if 'peers' in measured.subject or 'threads' in measured.subject:
        return MISSING
    late_ns = 20_000 if measured.key.startswith('floor') else 24_000
    starts = np.arange(-1, 2000) * PERIOD_NS + late_ns
    begins = np.arange(0, 20) * BUSY_PERIOD_NS
    return RunOutcome(RunStatus.OK, samples={
        'starts': starts, 'middle_starts': starts[::5], 'busy_begins': begins,
        'busy_ends': begins + BUSY_NS},
        figures={'phase_ns': 0, 'begin_ns': 0, 'measure_ns': 2000 * PERIOD_NS}, realtime=GRANTED)


def _quiet() -> ProgressLine:
    return ProgressLine(io.StringIO(), 1.0)


def _run(*argv: str, measured: Any = _preemption, cases: Any = PREEMPTION) -> int:
    return run_program('bench', lambda: lambda words: run(words, cases, measured), argv)


def test_tables_verdicts_and_what_linux_refuses_are_shown(
        capsys: pytest.CaptureFixture[str]) -> None:
    assert _run('--quick', '--repeats', '2') == 0
    said = capsys.readouterr().out
    assert said.count('SCHED_FIFO priority 80: not permitted') == 1
    assert said.count('CPU 1') == 1
    assert 'rt_robot_os kernel' in said
    assert 'not available: rclpy is not installed' in said
    assert 'not measured' in said
    assert 'targets: 2 of 4 reached, 0 missed, 2 not measured' in said
    assert max(len(line) for line in said.splitlines()) <= WIDTH


def test_a_missed_aim_is_shown_and_is_no_failure(capsys: pytest.CaptureFixture[str]) -> None:
    def slow(measured: Run) -> RunOutcome:
        outcome = _preemption(measured)
        if measured.key == 'kernel':
            outcome.samples['starts'][:] += 100_000
        return outcome

    assert _run('--quick', measured=slow) == 0
    assert 'MISSED' in capsys.readouterr().out


def test_the_document_holds_conditions_metrics_and_verdicts(tmp_path: Path) -> None:
    path = tmp_path / 'result.json'
    assert _run('--repeats', '3', '--json', str(path)) == 0
    content = json.loads(path.read_text())
    assert content['schema'] == 2
    assert content['interrupted'] is False
    assert content['options'] == {
        'seconds': 2.0, 'repeats': 3, 'full': False, 'quick': False, 'docs': False,
        'hours': 1 / 60,
        'data': '', 'expected': '', 'imu_mounting': [0.0, 0.0, 0.0]}
    assert content['realtime'] == {'CPU 1': 'in force', 'SCHED_FIFO priority 80': 'not permitted'}
    assert content['harness_ns_per_sample'] > 0
    assert (content['machine']['compiled'], content['machine']['build']) == (
        state().compiled, state().text)
    for key in ('cpu', 'kernel', 'kernel_version', 'preemption', 'cores', 'load_average',
                'virtual', 'python', 'packages'):
        assert key in content['machine'], key
    case = content['cases'][0]
    assert case['name'] == 'preemption'
    rows = {row['label']: row for row in case['tables'][0]['rows']}
    ours = rows['rt_robot_os kernel']
    assert ours['status'] == 'ok'
    assert ours['metrics']['p99']['repeats'] == [24.0, 24.0, 24.0]
    assert ours['metrics']['calls_part']['median'] == 100.0
    assert rows['rclpy EventsExecutor']['status'] == 'missing'
    assert {target['verdict'] for target in case['aims']} == {'reached', 'not measured'}
    assert case['aims'][0]['measured']['median'] == pytest.approx(1.2)


def test_the_page_needs_nothing_but_itself(tmp_path: Path) -> None:
    out = tmp_path / 'out'
    assert _run('--quick', '--repeats', '2', '--out', str(out)) == 0
    said = (out / 'index.html').read_text()
    for words in (f'rt_robot_os: {escape(state().text)}', 'What to expect on your machine',
                  'Which system meets which requirement', 'Targets and verdicts',
                  'How each system is run',
                  'rt_robot_os kernel', 'not available: rclpy', 'bench --quick --repeats 2',
                  'Refused to the measured processes: SCHED_FIFO priority 80: not permitted'):
        assert words in said, words
    # Names of XML name spaces are no addresses that are fetched.
    fetched = re.findall(r'(?:src|href)="(?!#)[^"]*"|url\((?!#)|@import|<script', said)
    assert fetched == []
    # Identifiers are unique although there are several pictures.
    names = re.findall(r'\bid="([^"]+)"', said)
    assert len(names) == len(set(names))
    text = (out / 'benchmarks.md').read_text()
    assert text.count('# Benchmarks of rt_robot_os') == 1
    for image in re.findall(r'!\[[^]]*\]\(([^)]+)\)', text):
        assert (out / image).is_file(), image


def test_without_matplotlib_there_are_tables_and_the_remedy(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(Library, 'found', lambda self: None)
    out = tmp_path / 'out'
    assert _run('--quick', '--out', str(out)) == 0
    said = (out / 'index.html').read_text()
    remedy = 'no plots: a plot needs matplotlib'
    assert remedy in said and '<svg' not in said
    shown = capsys.readouterr()
    assert remedy in shown.out and remedy in shown.err


def test_the_figures_can_be_computed_again_from_the_samples(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / 'out'
    assert _run('--quick', '--repeats', '2', '--out', str(out)) == 0
    before = json.loads((out / 'bench.json').read_text())
    (out / 'index.html').unlink()
    capsys.readouterr()
    assert _run('--page', str(out)) == 0
    assert json.loads((out / 'bench.json').read_text()) == before
    assert (out / 'index.html').exists()
    assert 'targets: 2 of 4 reached' in capsys.readouterr().out


def test_a_folder_without_results_is_one_clear_line(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert _run('--page', str(tmp_path)) == 1
    said = capsys.readouterr().err
    assert said.count('\n') == 1 and 'bench.json' in said and '--out' in said


def test_raw_samples_are_kept_by_run_and_repeat(tmp_path: Path) -> None:
    out = tmp_path / 'out'
    assert _run('--repeats', '2', '--out', str(out)) == 0
    assert {'bench.json', 'preemption.npz', 'index.html'} <= {p.name for p in out.iterdir()}
    with np.load(out / 'preemption.npz') as raw:
        assert len(raw['kernel/1/starts']) == 2001
        meta = json.loads(str(raw['meta']))
        assert meta['kernel'][0]['figures']['phase_ns'] == 0
    content = json.loads((out / 'bench.json').read_text())
    assert content['samples'] == {'preemption': ['preemption.npz']}
    rows = {row['label']: row['run'] for row in content['cases'][0]['tables'][0]['rows']}
    assert rows['rt_robot_os kernel'] == rows['  into the computation'] == 'kernel'


def test_what_the_page_shows_to_compute_by_hand_is_what_the_table_says(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / 'out'
    assert _run('--quick', '--out', str(out)) == 0
    np.savez(out / 'wakeup.npz', **{'kernel/0/late_ns': np.arange(1000, 101_000, 1000)})
    capsys.readouterr()
    monkeypatch.chdir(out)
    exec(BY_HAND, {})
    assert capsys.readouterr().out.split() == ['99.0', '24.0']


def test_a_run_that_fails_is_told_and_makes_the_code_1(capsys: pytest.CaptureFixture[str]) -> None:
    def failing(measured: Run) -> RunOutcome:
        if measured.key == 'kernel':
            return RunOutcome(RunStatus.FAILED, 'ended with code -11')
        return _preemption(measured)

    assert _run('--quick', measured=failing) == 1
    said = capsys.readouterr().out
    assert 'failed: ended with code -11' in said
    # That of the bare handler is there, that of the kernel is not.
    assert said.split('1 kHz task;')[0].count('into the computation  ') == 1


def test_ctrl_c_keeps_what_was_complete(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    second = Case('second', 'never done', CASES['preemption'].plan, CASES['preemption'].evaluate)
    calls = []
    planned = len(CASES['preemption'].plan(BenchOptions(1.0, 1, quick=True)))

    def measured(one: Run) -> RunOutcome:
        calls.append(one.key)
        if len(calls) == planned + 3:  # the probe, the first case, and then some
            raise KeyboardInterrupt
        return _preemption(one)

    path = tmp_path / 'result.json'
    assert _run('--quick', '--json', str(path), measured=measured,
                cases={**PREEMPTION, 'second': second}) == 130
    content = json.loads(path.read_text())
    assert content['interrupted'] is True
    assert [case['name'] for case in content['cases']] == ['preemption']
    assert 'interrupted' in capsys.readouterr().err


def test_ctrl_c_in_the_long_case_says_that_it_can_go_on(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def measured(one: Run) -> RunOutcome:
        if one.key == 'kernel':
            raise KeyboardInterrupt
        return MISSING

    assert _run('stability', '--out', str(tmp_path), measured=measured,
                cases={'stability': CASES['stability']}) == 130
    assert 'the same call goes on' in capsys.readouterr().err


def test_runs_are_interleaved_and_the_order_turns_over() -> None:
    order: list[str] = []

    def measured(one: Run) -> RunOutcome:
        order.append(one.key)
        return MISSING if one.key == 'b' else RunOutcome(RunStatus.OK)

    def plan(options: BenchOptions) -> list[Run]:
        return [Run(key, key, 'x:y', {}, 1.0) for key in 'abc']

    def evaluate(options: BenchOptions, outcomes: Outcomes) -> CaseResult:
        return CaseResult('x', 'x', (), ())

    outcomes = run_case(Case('x', 'x', plan, evaluate), BenchOptions(1.0, 3), _quiet(), measured)
    # What is missing is not looked for again.
    assert order == ['a', 'b', 'c', 'c', 'a', 'a', 'c']
    assert [len(outcomes.all(key)) for key in 'abc'] == [3, 3, 3]


@pytest.mark.parametrize('name', sorted(CASES))
@pytest.mark.parametrize('status', [RunStatus.MISSING, RunStatus.FAILED])
def test_every_case_tells_that_nothing_could_be_measured(name: str, status: RunStatus) -> None:
    case, options = CASES[name], BenchOptions(0.1, 2, full=True)
    outcomes = run_case(case, options, _quiet(), lambda one: RunOutcome(status, 'no such luck'))
    result = case.evaluate(options, outcomes)
    assert result.name == name
    assert result.targets and {each.verdict for each in result.targets} == {
        TargetVerdict.UNKNOWN}
    rows = [row for table in result.tables for row in table.rows]
    assert rows and all(row.published or row.reason == 'no such luck' for row in rows)
    assert max(len(line) for line in case_lines(result)) <= WIDTH
    # Limit, measured, verdict and range have to fit beside it.
    assert max(len(target.text) for target in result.targets) <= 48
    json.dumps(result.as_json(), allow_nan=False)
