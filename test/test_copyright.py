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

"""Check that every source file carries the licence header."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def _header() -> str:
    """Return the header that all files share: the one of this file."""
    return Path(__file__).read_text().split('\n\n')[0] + '\n'


def _sources() -> list[Path]:
    found = [ROOT / 'setup.py']
    for folder in ('rt_robot_os', 'benchmarks', 'test', 'examples'):
        found += sorted((ROOT / folder).rglob('*.py'))
    for folder in ('scripts', '.ci'):
        found += [path for path in sorted((ROOT / folder).iterdir())
                  if path.is_file() and path.suffix != '.txt']
    return found


@pytest.mark.copyright
@pytest.mark.linter
def test_every_source_file_starts_with_the_licence_header() -> None:
    without = []
    for path in _sources():
        text = path.read_text()
        if text.startswith('#!'):
            text = text.partition('\n')[2]
        if not text.startswith(_header()):
            without.append(str(path.relative_to(ROOT)))
    assert not without, f'without the full licence header: {without}'


# Not a wheel, so it is there only where ROS 2 is installed.
if importlib.util.find_spec('ament_copyright') is not None:

    @pytest.mark.copyright
    @pytest.mark.linter
    def test_ament_copyright() -> None:
        from ament_copyright.main import main
        assert main(argv=[str(ROOT / 'rt_robot_os'), str(ROOT / 'test')]) == 0
