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

"""What the set-up has installed is enough to install a package in place, without network."""

from __future__ import annotations

import os
from pathlib import Path
import re
import shutil
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parents[2]
TABLE = ROOT / 'rt_robot_os' / 'base' / 'requirements.py'
OURS = ('setup.py', 'setup.cfg', 'package.xml', 'resource', 'rt_robot_os', 'config', 'launch')


@pytest.mark.parametrize('name', ['rt_robot_os', 'rt_robot_example'])
def test_a_package_is_installed_in_place_without_network(tmp_path: Path, name: str) -> None:
    package = tmp_path / 'package'
    if name == 'rt_robot_os':
        package.mkdir()
        for part in OURS:
            copy = shutil.copytree if (ROOT / part).is_dir() else shutil.copy
            copy(ROOT / part, package / part)
    else:
        shutil.copytree(ROOT / 'examples' / name, package)
    done = subprocess.run(
        [sys.executable, '-m', 'pip', 'install', '--disable-pip-version-check', '--no-index',
         '--no-deps', '--no-build-isolation', '--prefix', str(tmp_path / 'prefix'), '-e',
         str(package)], capture_output=True, text=True, timeout=300, cwd=tmp_path,
        env={**os.environ, 'PIP_CONFIG_FILE': os.devnull})
    assert done.returncode == 0, done.stderr
    assert f'Successfully installed {name}' in done.stdout


def test_what_the_programs_need_is_installed_with_them() -> None:
    listed = (ROOT / 'scripts' / 'requirements-run.txt').read_text()
    assert '\nsetuptools ' in listed  # installing in place
    for program, library in (('record', 'mcap'), ('replay', 'mcap'), ('mapping', 'scipy'),
                             ('robot', 'pillow'), ('monitor', 'fastapi'), ('top', 'rich')):
        extras = answer('extras', program).split()
        assert f'\n{library}>=' in answer('install', 'base', *extras)
    # A robot's environment has neither a database nor WebRTC.
    of_robot = answer('install', 'base', *answer('extras', 'robot').split())
    assert not re.search('sqlalchemy|fastapi|aiortc|cryptography|scipy', of_robot)
    assert 'aiortc' not in answer('install', *answer('extras', 'monitor').split())


def test_an_extra_that_there_is_not_is_named() -> None:
    done = subprocess.run([sys.executable, '-I', TABLE, 'install', 'base', 'nonsense'],
                          capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.startswith("no extra 'nonsense', there are: attitude camera ")


def answer(*arguments: str) -> str:
    """Give what the scripts are answered by the table of libraries."""
    return '\n' + subprocess.run([sys.executable, '-I', TABLE, *arguments], check=True,
                                 capture_output=True, text=True).stdout


def test_run_explains_itself_without_a_set_up(tmp_path: Path) -> None:
    (tmp_path / 'scripts').mkdir()
    for name in ('run', 'environment.bash'):
        shutil.copy(ROOT / 'scripts' / name, tmp_path / 'scripts' / name)
    shutil.copy(ROOT / 'setup.py', tmp_path)
    for manifest in (ROOT / 'rt_robot_os' / 'features').glob('*/manifest.py'):
        folder = tmp_path / manifest.parent.relative_to(ROOT)
        folder.mkdir(parents=True)
        shutil.copy(manifest, folder)
    before = {path.name for path in tmp_path.iterdir()}
    done = subprocess.run([tmp_path / 'scripts' / 'run', '--help'], capture_output=True, text=True,
                          timeout=60, check=True)
    assert done.stdout.startswith('usage: ./scripts/run [PROGRAM]')
    assert 'Programs: alarms bench black_box core doctor ' in done.stdout
    assert {path.name for path in tmp_path.iterdir()} == before
