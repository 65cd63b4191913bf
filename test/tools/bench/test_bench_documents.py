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

"""The tables and pictures in the documentation are those that the program writes."""

from __future__ import annotations

from pathlib import Path
import re

import pytest

from rt_robot_os.tools.bench.registry import CASES

ROOT = Path(__file__).resolve().parents[3]
PAGE = ROOT / 'docs' / 'benchmarks.md'


@pytest.mark.parametrize('page', [PAGE, ROOT / 'README.md'], ids=['benchmarks', 'readme'])
def test_every_picture_is_there(page: Path) -> None:
    pictures = re.findall(r'!\[[^]]*\]\(([^)]+)\)', page.read_text())
    assert pictures
    for picture in pictures:
        assert (page.parent / picture).is_file(), picture


def test_the_page_holds_every_case_and_names_no_machine() -> None:
    said = PAGE.read_text()
    for name in CASES:
        assert f'### {name}: ' in said, name
    assert 'bench --' in said
    assert not re.search(r'/(home|root|tmp|work|opt)/', said)
