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


"""The program `black_box`, on the dump of a real run."""

from __future__ import annotations

import json
from pathlib import Path
import shutil

import pytest

from rt_robot_os.tools.black_box.program import main

EXAMPLE = Path(__file__).with_name('example.rtbb.gz')


def test_show(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['show', str(EXAMPLE), '--last', '5']) == 0
    shown = capsys.readouterr().out
    assert shown.startswith("black box: task 'logger': OSError: no space left\n")
    assert 'vision is ABORTED' in shown and 'last 5 of' in shown


def test_the_page_shows_what_the_program_writes(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['show', str(EXAMPLE), '--last', '8']) == 0
    page = Path(__file__).resolve().parents[3] / 'docs' / 'black_box.md'
    assert f'```text\n{capsys.readouterr().out}```\n' in page.read_text()


def test_export(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / 'out.json'
    assert main(['export', str(EXAMPLE), '--perfetto', str(out)]) == 0
    assert json.loads(out.read_text())['traceEvents']
    assert 'ui.perfetto.dev' in capsys.readouterr().out


@pytest.mark.parametrize('window', [[], ['--last', '5'], ['--from', '-0.02', '--to', '-0.01'],
                                    ['--from', '-0.01'], ['--to', '-0.01']])
def test_plot(tmp_path: Path, window: list[str]) -> None:
    pytest.importorskip('matplotlib', reason='matplotlib is not installed')
    out = tmp_path / 'out.svg'
    assert main(['plot', str(EXAMPLE), str(out), *window]) == 0
    assert '<svg' in out.read_text()


@pytest.mark.parametrize(('window', 'said'), [
    (['--last', '-1'], '--last -1'), (['--last', '5', '--to', '0'], 'not with'),
    (['--from', '1', '--to', '0'], 'before the second'), (['--from', 'nan'], '--from nan'),
    (['--from', '-9999999'], 'must be seconds'), (['--last', 'inf'], '--last inf')])
def test_a_window_that_makes_no_sense(tmp_path: Path, window: list[str], said: str,
                                      capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip('matplotlib', reason='matplotlib is not installed')
    assert main(['plot', str(EXAMPLE), str(tmp_path / 'out.svg'), *window]) == 1
    assert said in capsys.readouterr().err


def test_without_a_file_the_newest_is_taken(tmp_path: Path, capsys: pytest.CaptureFixture[str]
                                            ) -> None:
    folder = ['--folder', str(tmp_path)]
    assert main([*folder, 'show']) == 1
    assert 'holds no dump' in capsys.readouterr().err
    path = tmp_path / 'black_box_robot_20260304_050607_089_test.rtbb.gz'
    shutil.copy(EXAMPLE, path)
    assert main([*folder, 'show']) == 0
    assert f'reading {path}' in capsys.readouterr().err
    (tmp_path / 'black_box_robot_20260304_050607_090_cut.rtbb.gz').write_bytes(b'')
    assert main([*folder, 'list']) == 0
    listed = capsys.readouterr().out
    assert f'{path}: task ' in listed and '_cut.rtbb.gz' in listed


def test_no_robot_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                       capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv('RT_ROBOT_OS_RUNTIME_DIR', str(tmp_path / 'run'))
    assert main(['dump', '--robot', '/arm/robot']) == 1
    assert 'arm.robot.sock; is the robot running?' in capsys.readouterr().err.replace(
        'No such file or directory', '').replace(': ;', ';')
