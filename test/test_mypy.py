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

"""Check the type annotations with mypy, strict as setup.cfg says."""

from __future__ import annotations

import importlib.util
import sys

from background import Reading
import pytest

MYPY = Reading(sys.executable, '-m', 'mypy', '--config-file', 'setup.cfg', 'rt_robot_os',
               'benchmarks')


@pytest.mark.linter
@pytest.mark.mypy
def test_mypy() -> None:
    for name in ('mypy', 'rclpy'):
        if importlib.util.find_spec(name) is None:
            pytest.skip(f'{name} is missing, the types cannot be checked')
    code, said = MYPY.outcome()
    if code:
        pytest.fail(said, pytrace=False)
