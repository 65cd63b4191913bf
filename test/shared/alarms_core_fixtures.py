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

"""A core for all tests of a module, for conftest.py to import: to start one takes longest."""

from __future__ import annotations

from collections.abc import Iterator

from alarms_core import Core
from processes import in_a_folder
import pytest


@pytest.fixture(scope='module')
def running() -> Iterator[Core]:
    with in_a_folder(Core) as core:
        core.start()
        yield core


@pytest.fixture
def core(running: Core, monkeypatch: pytest.MonkeyPatch) -> Core:
    monkeypatch.setenv('RT_ROBOT_OS_RUNTIME_DIR', str(running.folder))
    running.answers = lambda command: None
    for said in running.heard.values():
        said.clear()
    return running
