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
import sys

from background import Reading
import pytest


class Linter:
    """
    One of the linters of ament.

    :param is_finding: tells a finding from what else it says.
    """

    def __init__(self, name: str, is_finding: Callable[[str], object]) -> None:
        self._name = name
        self._is_finding = is_finding
        self._reading = Reading(
            sys.executable, '-c', f'import sys; from {name}.main import main; sys.exit(main())',
            'rt_robot_os', 'benchmarks', 'test', 'examples', 'setup.py')

    def check(self) -> None:
        """Fail with what it finds."""
        if importlib.util.find_spec(self._name) is None:
            pytest.skip(f'the linter {self._name} is missing')
        code, said = self._reading.outcome()
        if code:
            found = [line for line in said.splitlines() if self._is_finding(line)]
            pytest.fail('\n'.join(found) or said, pytrace=False)
