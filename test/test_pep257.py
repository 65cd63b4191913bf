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

"""Check the docstrings with ament_pep257, as `ament_lint_auto` would."""

from __future__ import annotations

import importlib.util
from pathlib import Path
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parents[1]
PROGRAM = 'import sys; from ament_pep257.main import main; sys.exit(main())'


@pytest.mark.linter
@pytest.mark.pep257
def test_pep257() -> None:
    if importlib.util.find_spec('ament_pep257') is None:
        pytest.skip('the linter ament_pep257 is missing')
    done = subprocess.run(
        [sys.executable, '-c', PROGRAM, 'rt_robot_os', 'test', 'examples', 'setup.py'],
        cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        errors = [line for line in (done.stdout + done.stderr).splitlines()
                  if not line.startswith('checking ')]
        pytest.fail('\n'.join(errors), pytrace=False)
