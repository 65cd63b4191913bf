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

"""Run a linter of ament over the whole package."""

from __future__ import annotations

from collections.abc import Callable
import importlib.util
from pathlib import Path
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parents[2]


def check(linter: str, is_finding: Callable[[str], object]) -> None:
    """Fail with what a linter finds; :param is_finding: tells a finding from what else it says."""
    if importlib.util.find_spec(linter) is None:
        pytest.skip(f'the linter {linter} is missing')
    done = subprocess.run(
        [sys.executable, '-c', f'import sys; from {linter}.main import main; sys.exit(main())',
         'rt_robot_os', 'test', 'examples', 'setup.py'], cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        said = done.stdout + done.stderr
        found = [line for line in said.splitlines() if is_finding(line)]
        pytest.fail('\n'.join(found) or said, pytrace=False)
