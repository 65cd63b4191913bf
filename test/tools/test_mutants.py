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
"""Mutation testing: which changes are made, which tests run, and how a run continues."""

from __future__ import annotations

import json
from pathlib import Path
import sys

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / 'scripts'))

import mutants  # noqa: E402, I100

MODULE = """
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    UNUSED = 1
COUNT: int = 3


def is_large(value: int = COUNT) -> bool:
    return value > 10
"""
TEST = """
from rt_robot_os.sizes import is_large


def test_large():
    assert is_large(11) and not is_large(10)
"""


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """Make a package with a tested and an untested module."""
    for path, text in (('rt_robot_os/__init__.py', ''), ('rt_robot_os/sizes.py', MODULE),
                       ('rt_robot_os/other.py', 'LIMIT = 5\n'), ('test/test_sizes.py', TEST)):
        file = tmp_path / 'tree' / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    return tmp_path / 'tree'


def test_each_outcome_is_reported_and_a_further_run_continues(
        tree: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / 'mutants.jsonl'
    arguments = ['rt_robot_os', 'test', '--output', str(output)]
    assert mutants.main(arguments, tree) == 1
    found = {(each['before'], each['after']): each['outcome']
             for each in map(json.loads, output.read_text().splitlines())}
    assert found == {
        ('>', '>='): 'killed', ('10', '11'): 'killed', ('value > 10', 'None'): 'killed',
        ('3', '4'): 'survived', ('5', '6'): 'not covered'}
    text = capsys.readouterr().out
    assert "survived: rt_robot_os/sizes.py:6: '3' -> '4'" in text
    assert '3 killed\n1 not covered\n1 survived\n' in text
    assert (tree / 'rt_robot_os' / 'sizes.py').read_text() == MODULE
    lines = output.read_text().splitlines(keepends=True)
    output.write_text(''.join(lines[:-1]) + lines[-1][:20])  # as after an interruption
    assert mutants.main(arguments, tree) == 1
    assert capsys.readouterr().out.count("' -> '") == 1


@pytest.mark.parametrize('source, changes', [
    ('if a and b:\n    pass\n', ['and -> or', 'a and b -> False']),
    ('a = not b\n', ['not  -> ']),
    ('a = b + 1\n', ['+ -> -', '1 -> 2']),
    ('a = "x" + b\n', []),
    ('a = b is not None\n', ['is not -> is']),
    ('a: int = True\n', ['True -> False']),
    ('x = "ä"; a = b < 0.0\n', ['< -> <=', '0.0 -> 1.0'])])
def test_the_changes_of_a_statement(source: str, changes: list[str]) -> None:
    found = mutants.Sites('a.py', source.encode()).found
    assert sorted(f'{each.before} -> {each.after}' for each in found) == sorted(changes)
