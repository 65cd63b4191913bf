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

"""What `--help` says of the programs that start a robot; kept as it is meant to be."""

from __future__ import annotations

import os
from pathlib import Path
import subprocess
import sys

import pytest
from rt_robot_os import cli

ROOT = Path(__file__).resolve().parents[2]
GOLDEN = ROOT / 'test' / 'golden'
PROGRAMS = sorted(path.stem for path in Path(cli.__file__).parent.glob('*.py')
                  if 'def main(' in path.read_text())


def help_of(module: str, function: str = 'main') -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, '-c', f'import sys; from {module} import {function}; '
         f'sys.exit({function}())', '--help'], capture_output=True, text=True, timeout=60,
        env={**os.environ, 'COLUMNS': '100', 'PYTHONPATH': os.pathsep.join(
            [str(ROOT), os.environ.get('PYTHONPATH', '')])})


@pytest.mark.parametrize('program', ['robot', 'core'])
def test_the_help_of_what_starts_a_robot(program: str) -> None:
    done = help_of(f'rt_robot_os.cli.{program}')
    path = GOLDEN / f'{program}_help.txt'
    if 'UPDATE_GOLDEN' in os.environ:
        path.write_text(done.stdout)
    assert done.stdout == path.read_text(), 'if it is right: UPDATE_GOLDEN=1 ./scripts/test ...'


@pytest.mark.parametrize('program', [*PROGRAMS, 'simulator', 'player'])
def test_every_program_helps(program: str) -> None:
    simulated = {'simulator': 'main', 'player': 'player'}
    done = (help_of('rt_robot_os.sim.main', simulated[program]) if program in simulated
            else help_of(f'rt_robot_os.cli.{program}'))
    assert done.returncode == 0 and done.stdout.startswith(f'usage: {program} ')
    assert done.stderr == ''
