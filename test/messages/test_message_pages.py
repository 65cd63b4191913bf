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

"""The page about messages is that of the classes, and the web page knows each state of alarms."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
import re

import pytest
from rt_robot_os.messages.alarm_state import AlarmEventKind
from rt_robot_os.messages.alarm_state import AlarmState
from rt_robot_os.messages.cause import LEVELS

ROOT = Path(__file__).resolve().parents[2]
ALARMS_JS = ROOT / 'rt_robot_os' / 'monitor' / 'page' / 'lib' / 'alarms.js'


def made() -> dict[str, str]:
    spec = importlib.util.spec_from_file_location(
        'message_schema', ROOT / 'scripts' / 'message_schema.py')
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    found: dict[str, str] = module.files()
    return found


@pytest.mark.parametrize('name', ['messages.json', 'messages.md'])
def test_the_page_about_messages_is_that_of_the_classes(name: str) -> None:
    assert (ROOT / 'docs' / name).read_text(encoding='utf-8') == made()[name], (
        'run scripts/message_schema.py')


def listed(name: str) -> list[str]:
    """Return the strings of a list in the page's file about alarms."""
    match = re.search(rf'const {name} = (?:new Set\()?\[(.*?)\]', ALARMS_JS.read_text(), re.S)
    assert match is not None, name
    return re.findall(r"'(\w+)'", match.group(1))


def test_the_web_page_knows_each_state_of_an_alarm() -> None:
    assert set(listed('STATES')) == {each.value for each in AlarmState if each.is_open}
    assert set(listed('OVER')) == {each.value for each in AlarmState if not each.is_open}


def test_the_web_page_knows_each_level_from_the_least_to_the_worst() -> None:
    assert listed('LEVELS') == list(LEVELS)


@pytest.mark.parametrize('language', ['en', 'de'])
def test_the_web_page_has_words_for_each_state_and_event_of_an_alarm(language: str) -> None:
    path = ALARMS_JS.parents[1] / 'messages' / language / 'words.json'
    words = json.loads(path.read_text(encoding='utf-8'))
    wanted = {*(f'words.state.{each.value}' for each in AlarmState),
              *(f'words.event.{each.value}' for each in AlarmEventKind)}
    assert wanted - words.keys() == set()


def test_the_page_about_alarms_maps_each_state_to_the_standard() -> None:
    text = (ROOT / 'docs' / 'alarms.md').read_text(encoding='utf-8')
    table = text.split('| state | meaning | ISA-18.2 |', 1)[1].split('\n\n', 1)[0]
    assert re.findall(r'^\| `(\w+)` \|', table, re.M) == [each.value for each in AlarmState]
