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

"""The files that the tutorials show are those of the example package."""

from __future__ import annotations

from pathlib import Path
import re

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted((ROOT / 'docs' / 'tutorials').glob('*.md'))
# One shows commands only.
CODED = [page for page in PAGES if page.stem != 'map_your_flat']
BLOCK = re.compile(r'<!-- (examples/[\w/.]+) -->\n```\w+\n(.*?)```\n', re.DOTALL)
HEADER = Path(__file__).read_text().split('\n\n')[0]
EXAMPLE = ROOT / 'examples' / 'rt_robot_example'


@pytest.mark.parametrize('page', CODED, ids=[page.stem for page in CODED])
def test_the_blocks_of_a_tutorial_are_the_files(page: Path) -> None:
    blocks = BLOCK.findall(page.read_text())
    assert len(blocks) >= 2
    for path, text in blocks:
        assert text == (ROOT / path).read_text().removeprefix(HEADER).lstrip('\n'), (
            f'{page.name} shows another {path}')


def test_every_file_with_code_is_shown() -> None:
    shown = {path for page in PAGES for path, _ in BLOCK.findall(page.read_text())}
    files = {path.relative_to(ROOT).as_posix() for path in EXAMPLE.rglob('*.py')
             if path.name != '__init__.py' and not {'build', 'install'} & set(path.parts)}
    assert sorted(files - shown) == []


def test_the_messages_of_the_tutorials_have_the_lines_of_the_file() -> None:
    lines = (EXAMPLE / 'config' / 'example.yaml').read_text().splitlines()
    found = [each for page in PAGES for each in re.findall(
        r'`example\.yaml:(\d+): (?:module )?(\w+)(?:\.(\w+))?', page.read_text())]
    assert len(found) >= 4
    for number, section, key in found:
        line = lines[int(number) - 1].strip()
        assert line.startswith((f'{key or section}:', f'{section}:', 'limit_v:')), (number, line)
