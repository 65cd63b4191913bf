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

"""The programs that setup.py declares: name -> ``module:main``."""

from __future__ import annotations

from pathlib import Path
import runpy
import sys
from typing import Any
from unittest.mock import patch

ROOT = Path(__file__).resolve().parents[2]


def _declared() -> dict[str, str]:
    given: dict[str, Any] = {}
    # setup.py adds the package's folder to the path, and finds it there already.
    with patch('setuptools.setup', lambda **values: given.update(values)), patch.object(
            sys, 'path', list(sys.path)):
        runpy.run_path(str(ROOT / 'setup.py'))
    scripts = given['entry_points']['console_scripts']
    return dict(script.replace(' ', '').split('=', 1) for script in scripts)


PROGRAMS = _declared()
