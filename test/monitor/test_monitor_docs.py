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

"""The page that users start with says what there is."""

from __future__ import annotations

from pathlib import Path
import re

from rt_robot_os.monitor.api.commands import NEEDS
from rt_robot_os.monitor.settings import MonitorSettings
from rt_robot_os.schema import declared

TEXT = (Path(__file__).resolve().parents[2] / 'docs' / 'monitor.md').read_text()


def test_every_setting_is_explained_with_its_default() -> None:
    table = TEXT.partition('## Settings')[2].partition('\n## ')[0]
    rows = {name: row for row in table.splitlines() if row.startswith('| `')
            for name in re.findall(r'`(\w+)`', row.split('|')[1])}
    assert set(rows) == {each.name for each in declared(MonitorSettings)}
    for each in declared(MonitorSettings):
        if isinstance(each.default, int | float):
            assert f'{each.default:g}' in rows[each.name].split('|')[2], each.name


def test_every_command_is_explained_with_what_it_needs() -> None:
    table = TEXT.partition('| `do` |')[2].partition('\n\n')[0]
    rows = {name: row.split('|')[3] for row in table.splitlines() if row.startswith('| `')
            for name in re.findall(r'`(\w+)`', row.split('|')[1])}
    assert set(rows) == set(NEEDS)
    for name, needed in NEEDS.items():
        assert all(each.value in rows[name] for each in needed), name
