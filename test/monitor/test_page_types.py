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

"""The page's types: as the models of the server are, and kept by the page."""

from __future__ import annotations

import os
from pathlib import Path
import shutil
import subprocess
import sys

import pytest

pytest.importorskip('fastapi')

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / 'rt_robot_os' / 'monitor' / 'page'
FLAGS = ('--allowJs', '--noEmit', '--target', 'es2022', '--module', 'esnext',
         '--moduleResolution', 'bundler', '--lib', 'es2023,dom,dom.iterable', '--skipLibCheck')


def modules() -> list[Path]:
    return [PAGE / 'app.js', *sorted((PAGE / 'lib').rglob('*.js')),
            *sorted((PAGE / 'views').rglob('*.js'))]


def test_the_types_are_those_of_the_models() -> None:
    made = subprocess.run([sys.executable, str(ROOT / 'scripts' / 'page_types.py'), '--check'],
                          capture_output=True, text=True, check=False)
    assert made.returncode == 0, f'run scripts/page_types.py {made.stderr[-2000:]}'


def test_every_module_asks_for_the_check() -> None:
    assert [each.name for each in modules()
            if not each.read_text(encoding='utf-8').startswith('// @ts-check\n')] == []


def test_the_page_keeps_its_types() -> None:
    tsc = os.environ.get('RT_ROBOT_OS_TSC') or shutil.which('tsc')
    if not tsc:
        pytest.skip('no tsc: npm install typescript, and say where it is in RT_ROBOT_OS_TSC')
    found = subprocess.run([tsc, *FLAGS, *map(str, modules())], capture_output=True, text=True,
                           check=False)
    assert found.stdout == '' and found.returncode == 0
