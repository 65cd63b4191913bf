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

"""The cases and commands of `benchmarks`: all are listed, and each names what exists."""

from __future__ import annotations

import ast
from pathlib import Path
import re

from benchmarks import __main__ as benchmarks
from benchmarks.registry import CASES as FURTHER
import pytest

from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.options import parse
from rt_robot_os.tools.bench.registry import CASES
from rt_robot_os.tools.bench.registry import cases
from rt_robot_os.tools.bench.registry import INSTALLED
from rt_robot_os.tools.bench.registry import ORDER
from rt_robot_os.tools.bench.registry import SOURCE_ONLY

ROOT = Path(__file__).resolve().parents[2]


def _functions(module: str) -> set[str]:
    tree = ast.parse((ROOT / f'{module.replace(".", "/")}.py').read_text())
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def test_the_source_tree_has_all_cases_in_their_order() -> None:
    assert tuple(CASES) == ORDER
    assert {*FURTHER} == {*SOURCE_ONLY}


@pytest.mark.parametrize('name', ORDER)
def test_every_run_names_a_function_that_exists(name: str) -> None:
    for full in (False, True):
        for run in CASES[name].plan(BenchOptions(1.0, 1, full=full)):
            module, _, function = run.subject.partition(':')
            assert function in _functions(module), run.subject


def test_an_installed_case_needs_nothing_of_the_source_tree() -> None:
    for case in INSTALLED.values():
        for run in case.plan(BenchOptions(1.0, 1, full=True)):
            assert run.subject.startswith('rt_robot_os.'), run.subject
    imports = re.compile(r'^\s*(from|import) benchmarks\b', re.MULTILINE)
    assert [path for path in (ROOT / 'rt_robot_os').rglob('*.py')
            if imports.search(path.read_text())] == []


def test_without_the_source_tree_the_other_cases_are_named_and_refused(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    here = cases(tmp_path)
    assert dict(here) == dict(INSTALLED)
    assert [case.name for case in parse([], here).cases] == [*here]
    with pytest.raises(SystemExit):
        parse(['--help'], here)
    assert 'Only in the source tree, by ./scripts/bench: frequency,' in capsys.readouterr().out
    with pytest.raises(SystemExit) as end:
        parse(['delay'], here)
    assert end.value.code == 2
    assert capsys.readouterr().err == (
        "bench: case 'delay' is not installed; it is in benchmarks/ of the source tree: run "
        './scripts/bench delay there (see bench --help)\n')


def test_the_readme_lists_every_case_and_command() -> None:
    rows = dict(re.findall(r'^\| `(\w+)` \| (.+) \|$', (
        ROOT / 'benchmarks' / 'README.md').read_text(), re.MULTILINE))
    assert rows == {**{case.name: case.title for case in CASES.values()}, **benchmarks.COMMANDS}


def test_every_command_is_a_module_that_runs() -> None:
    for name in benchmarks.COMMANDS:
        path = ROOT / benchmarks.module_of(name).replace('.', '/')
        file = path / '__main__.py' if path.is_dir() else path.with_suffix('.py')
        assert file.is_file(), name


def test_without_a_name_all_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert benchmarks.main([]) == 0
    listed = capsys.readouterr().out
    for name in (*ORDER, *benchmarks.COMMANDS):
        assert f'\n  {name} ' in listed
