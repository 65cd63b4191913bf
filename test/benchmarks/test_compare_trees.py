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

"""The command `compare_trees`: two trees and their builds in turns, and what is reported."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from benchmarks.commands import compare_trees
import pytest

from rt_robot_os.tools.bench.processes import lock_path

ROOT = Path(__file__).resolve().parents[2]


def _values(case: str, **by_name: list[float | None]) -> dict[str, Any]:
    return {case: {name.replace('_', ' '): found for name, found in by_name.items()}}


def test_two_trees_and_bare_loops_take_turns(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        capfd: pytest.CaptureFixture[str]) -> None:
    assert compare_trees.LOCK == lock_path()
    monkeypatch.setattr(compare_trees, 'LOCK', tmp_path / 'lock')
    path = tmp_path / 'costs.json'
    assert compare_trees.main([
        str(ROOT), str(ROOT), '--rounds', '2', '--seconds', '0.001', '--builds', 'pure', '--cases',
        'take,to_task,call', '--json', str(path)]) == 0
    said = capfd.readouterr().out
    assert 'old pure: pure Python: RT_ROBOT_OS_COMPILE=0\nnew pure: pure Python' in said
    assert 'new pure / old pure: publish and take 64 B: ' in said
    assert 'pure: publish and take, new / old: <= 1.3: ' in said
    values = json.loads(path.read_text())
    assert [*values] == ['take', 'to_task', 'call']
    for case, ours in (('take', True), ('to_task', True), ('call', False)):
        assert {name for name, found in values[case].items() if found != [None, None]} == (
            {'old pure', 'new pure'} if ours else {'floor'}), case
    assert all(len(found) == 2 for found in values['take'].values())


def test_ratios_are_of_the_same_round_and_their_median_is_judged() -> None:
    values = _values('take', old_compiled=[10.0, 1.0, 10.0], new_compiled=[3.0, 0.5, 3.0],
                     floor=[None, None, None])
    assert list(compare_trees.verdicts(values)) == [
        '', 'Targets (median of the rounds):',
        '  publish and take, new / old: <= 0.4: 0.3 (0.3..0.5) reached']
    values['take']['new compiled'] = [5.0, 0.5, 3.0]
    assert list(compare_trees.verdicts(values))[-1].endswith('0.5 (0.3..0.5) MISSED')


def test_a_rate_is_reached_from_below_and_a_delay_is_compared_with_the_loop_of_its_build(
        ) -> None:
    values = {**_values('reached', new_compiled=[199.8]),
              **_values('delay', new_compiled=[4.0]), **_values('bare_delay', new_compiled=[2.0])}
    assert list(compare_trees.verdicts(values))[2:] == [
        '  delay at 500 Hz / bare loop: <= 1.5: 2 (2..2) MISSED',
        '  1000 tasks together, Hz: >= 199.9: 199.8 (199.8..199.8) MISSED']


def test_a_build_that_is_not_there_is_left_out_with_its_reason(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    package = tmp_path / 'rt_robot_os'
    package.mkdir()
    (package / '__init__.py').write_text('raise ImportError("nothing is compiled")\n')
    subjects = compare_trees.subjects(tmp_path, ROOT, ['compiled'])
    assert [subject.name for subject in subjects] == ['old compiled', 'new compiled', 'floor']
    found = compare_trees.available([subjects[0], subjects[2]])
    assert [subject.name for subject in found] == ['floor']
    assert 'old compiled: left out: ImportError: nothing is compiled' in capsys.readouterr().out


@pytest.mark.parametrize('words, complaint', [
    (('nowhere', str(ROOT)), 'nowhere: no copy of this repository'),
    ((str(ROOT), str(ROOT), '--cases', 'nothing'), '--cases nothing: there are single'),
    ((str(ROOT), str(ROOT), '--rounds', '0'), '--rounds is at least 1')])
def test_bad_arguments_are_named(words: tuple[str, ...], complaint: str,
                                 capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        compare_trees.main(words)
    assert ended.value.code == 2
    assert complaint in capsys.readouterr().err
