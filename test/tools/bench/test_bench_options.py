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

"""The command line of the benchmark."""

from __future__ import annotations

from pathlib import Path

import pytest

from rt_robot_os.tools.bench.command import run
from rt_robot_os.tools.bench.options import BenchRequest
from rt_robot_os.tools.bench.options import parse
from rt_robot_os.tools.bench.processes import alone
from rt_robot_os.tools.bench.registry import CASES
from rt_robot_os.tools.bench.runner import expected_seconds


def _parse(*argv: str) -> BenchRequest:
    return parse(argv, CASES)


def test_without_arguments_everything_is_measured_and_nothing_written() -> None:
    request = _parse()
    assert [case.name for case in request.cases] == list(CASES)
    assert (request.json, request.out, request.options.full) == (None, None, False)


def test_the_length_can_be_chosen() -> None:
    quick, normal, full = _parse('--quick').options, _parse().options, _parse('--full').options
    assert quick.seconds < normal.seconds < full.seconds
    assert quick.repeats < normal.repeats < full.repeats
    assert full.full
    own = _parse('--quick', '--seconds', '0.5', '--repeats', '7').options
    assert (own.seconds, own.repeats) == (0.5, 7)


def test_it_takes_as_long_as_the_help_says() -> None:
    # What is expected allows for slow starts: a tenth more than it really takes.
    for argv, limit_s in (('--quick', 1.1 * 360), ('--docs', 1.1 * 720), ('--full', 1.1 * 6000)):
        request = _parse(argv)
        assert sum(expected_seconds(case, request.options) for case in request.cases) < limit_s


def test_hours_are_those_of_the_stability_case() -> None:
    assert _parse('--hours', '24').options.hours == 24.0
    whole = CASES['slam'].plan(_parse('slam', '--full', '--hours', '1').options)
    assert '3600 s in the flat' in {one.label for one in whole}
    runs = {one.key: one for one in CASES['stability'].plan(_parse('--hours', '24').options)}
    assert runs['kernel'].seconds > 24 * 3600
    assert runs['kernel'].once
    assert runs['events'].seconds < 60


def test_a_case_named_twice_is_measured_once_in_the_order_given() -> None:
    assert [c.name for c in _parse('micro', 'delay', 'micro').cases] == ['micro', 'delay']


def test_what_ros2_launch_appends_is_left_alone() -> None:
    assert [c.name for c in _parse('micro', '--ros-args', '-r', '__node:=x').cases] == ['micro']


@pytest.mark.parametrize('argv, words', [
    (('preemtion',), ("no case 'preemtion'", 'did you mean preemption?')),
    (('zzz',), ("no case 'zzz'", 'there are frequency, delay')),
    (('--seconds', 'nan'), ('--seconds', "'nan'", 'from 0.1 to')),
    (('--seconds', '0'), ('--seconds', "'0'")),
    (('--seconds', '-3'), ('--seconds',)),
    (('--hours', '0'), ('--hours', "'0'", 'from 0.001')),
    (('--hours', 'a day'), ('--hours', "'a day'")),
    (('--repeats', '0'), ('--repeats', "'0'", 'integer')),
    (('--repeats', '1.5'), ('--repeats', "'1.5'")),
    (('--repeats', '9' * 5000), ('--repeats',)),
    (('--quick', '--full'), ('--full', '--quick')),
    (('--bogus',), ('--bogus',)),
    (('--page', 'x', 'micro', '--json', 'y'), ('--page x', '--json, micro')),
    (('micro', '--hours', '3'), ('--hours 3', 'stability', 'micro is --seconds')),
    (('--json',), ('--json',)),
])
def test_a_bad_argument_is_one_clear_line_and_code_2(
        argv: tuple[str, ...], words: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        _parse(*argv)
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert said.startswith('bench: ')
    assert said.count('\n') == 1
    for word in words:
        assert word in said


@pytest.mark.parametrize('option', ['--out', '--json'])
def test_what_cannot_be_written_is_found_before_measuring(
        option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / 'file').write_text('x')
    path = tmp_path / 'file' / 'below'
    with pytest.raises(SystemExit) as ended:
        _parse('micro', option, str(path))
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert f'{option} {path}: cannot be written' in said
    assert said.count('\n') == 1


def test_the_check_leaves_nothing_and_keeps_what_is_there(tmp_path: Path) -> None:
    old = tmp_path / 'old.json'
    old.write_text('kept')
    _parse('--json', str(old))
    _parse('--json', str(tmp_path / 'new.json'), '--out', str(tmp_path / 'out' / 'deep'))
    assert old.read_text() == 'kept'
    assert sorted(p.name for p in tmp_path.rglob('*')) == ['deep', 'old.json', 'out']


def test_earlier_results_are_not_overwritten(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / 'bench.json').write_text('{}')
    with pytest.raises(SystemExit) as ended:
        _parse('--out', str(tmp_path))
    assert ended.value.code == 2
    assert 'earlier run' in capsys.readouterr().err


@pytest.mark.parametrize('content, cases, goes_on', [
    ('{"interrupted": true, "cases": [{"name": "stability"}]}', ['stability'], True),
    ('{"interrupted": true, "cases": []}', ['stability'], True),
    ('{"interrupted": true, "cases": []}', ['stability', 'micro'], False),
    ('{"interrupted": true, "cases": [{"name": "micro"}]}', ['stability'], False),
    ('{"interrupted": false, "cases": []}', ['stability'], False),
    ('rubbish', ['stability'], False)])
def test_only_the_long_case_goes_on_in_its_folder(
        content: str, cases: list[str], goes_on: bool, tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr('rt_robot_os.tools.bench.options.lock_path', lambda: tmp_path / 'lock')
    (tmp_path / 'bench.json').write_text(content)
    if goes_on:
        assert _parse(*cases, '--out', str(tmp_path)).out == tmp_path
        with alone(tmp_path / 'lock'), pytest.raises(SystemExit):
            _parse(*cases, '--out', str(tmp_path))
        assert 'another bench is measuring' in capsys.readouterr().err
        return
    with pytest.raises(SystemExit):
        _parse(*cases, '--out', str(tmp_path))
    assert 'earlier run' in capsys.readouterr().err


def test_the_list_names_every_case(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(['--list']) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(CASES)
    assert max(len(line) for line in lines) <= 100


def test_the_help_says_that_a_missed_aim_is_no_error(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        run(['--help'])
    assert ended.value.code == 0
    said = capsys.readouterr().out
    assert 'exit code is 0 also when a target is missed' in ' '.join(said.split())
    for name in CASES:
        assert name in said
