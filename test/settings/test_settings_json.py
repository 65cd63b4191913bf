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


"""Settings survive the way to the core's process, and nothing else is taken for them."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from dataclasses import fields
from dataclasses import is_dataclass
import json
import pickle
import re
from typing import Any
from typing import get_args
from typing import get_origin
from typing import get_type_hints

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.settings import from_json
from rt_robot_os.settings import RobotSettings
from rt_robot_os.settings import TaskSettings
from rt_robot_os.settings import to_json
from rt_robot_os.settings import WatchdogSettings

TEXTS = st.text(st.characters(codec='utf-8'), max_size=8)
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
INTEGERS = st.integers(-2 ** 63, 2 ** 63 - 1)
SCALARS = st.one_of(st.booleans(), INTEGERS, NUMBERS, TEXTS)
VALUES = st.one_of(SCALARS, st.lists(SCALARS, max_size=3).map(tuple))
MAPS = st.dictionaries(TEXTS, VALUES, max_size=4)

BY_HINT: dict[object, st.SearchStrategy[object]] = {
    bool: st.booleans(), int: INTEGERS, float: NUMBERS, str: TEXTS,
    Mapping[str, Any]: MAPS, Mapping[str, Any] | None: st.none() | MAPS,
    int | None: st.none() | INTEGERS}


def any_of(hint: Any) -> st.SearchStrategy[Any]:
    """Give values of the type that a field is annotated with; of a dataclass whole objects."""
    if is_dataclass(hint):
        hints = get_type_hints(hint)
        return st.builds(hint, **{each.name: any_of(hints[each.name]) for each in fields(hint)})
    if get_origin(hint) is tuple:
        return st.lists(any_of(get_args(hint)[0]), max_size=2).map(tuple)
    return BY_HINT[hint]


ROBOTS: st.SearchStrategy[RobotSettings] = any_of(RobotSettings)

JSON = st.recursive(st.none() | SCALARS, lambda inner: st.one_of(
    st.lists(inner, max_size=3), st.dictionaries(TEXTS, inner, max_size=3)), max_leaves=8)


@settings(max_examples=60, deadline=None)
@given(ROBOTS)
def test_what_is_read_back_is_what_was_written(robot: RobotSettings) -> None:
    text = to_json(robot)
    assert '\n' not in text and text.isascii()
    again = from_json(text)
    assert again == robot
    assert repr(to_json(again)) == repr(text)


def test_loaded_settings_survive(
    good: str, load_text: Callable[..., RobotSettings],
) -> None:
    robot = load_text(good)
    again = from_json(to_json(robot))
    assert again == robot
    assert isinstance(again.devices[1].rate_hz, float)
    assert again.devices[0].sim == {'rate_hz': 50.0, 'faults': ('unplug at 5 for 2',)}


def test_settings_cannot_be_changed_by_accident(
    good: str, load_text: Callable[..., RobotSettings],
) -> None:
    robot = load_text(good)
    with pytest.raises(AttributeError):
        robot.autostart = False  # type: ignore[misc]
    with pytest.raises(TypeError):
        robot.devices[0].settings['baud'] = 1  # type: ignore[index]
    with pytest.raises(TypeError):
        pickle.dumps(robot)


@pytest.mark.parametrize('text', [
    '', '[]', '5', '{}', '{"format": 1}', '{"format": 2}', '[' * 100_000, '{"format": NaN}',
    '1' * 5000,
])
def test_other_text_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match='settings: '):
        from_json(text)


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_damaged_settings_are_refused_or_read(data: st.DataObject) -> None:
    written = json.loads(to_json(data.draw(ROBOTS)))
    key = data.draw(st.sampled_from(sorted(written)))
    target = written
    if isinstance(written[key], dict):
        target, key = written[key], data.draw(st.sampled_from(sorted(written[key])))
    elif isinstance(written[key], list) and written[key] and key != 'files':
        target = written[key][0]
        key = data.draw(st.sampled_from(sorted(target)))
    if data.draw(st.booleans()):
        target[key] = data.draw(JSON)
    else:
        del target[key]
    try:
        from_json(json.dumps(written))
    except ConfigError as error:
        assert error.problems


def test_what_a_task_declares_survives(
    good: str, load_text: Callable[..., RobotSettings],
) -> None:
    robot = load_text(good.replace(
        'port: sim, rate_hz: 20,', 'port: sim, rate_hz: 20, budget_us: 500, on_budget: abort, '
        'failure: restart, resources: [map, arm], critical: true,').replace(
            'autostart: true', 'watchdog: {timeout_s: 2, action: exit}'))
    assert robot.devices[0].task == TaskSettings()
    assert robot.devices[1].task == TaskSettings(
        budget_us=500.0, on_budget='abort', failure='restart', resources=('map', 'arm'),
        critical=True)
    assert robot.watchdog == WatchdogSettings(timeout_s=2.0, action='exit')
    assert from_json(to_json(robot)) == robot


@pytest.mark.parametrize(('section', 'key', 'value', 'problem'), [
    ('', 'devices', 5, 'devices must be a list'),
    ('', 'devices', [5], 'devices must be an object'),
    ('', 'core', 5, 'robot.core must be an object'),
    ('', 'autostart', 1, 'robot.autostart must be bool'),
    ('', 'files', [5], 'robot.files must be a list of strings'),
    ('core', 'cpu', 1.5, 'robot.core.cpu must be int'),
    ('core', 'cpus', 1, 'robot.core: keys missing or unknown: cpus'),
    ('devices', 'rate_hz', 10 ** 400, 'devices.rate_hz is too large'),
    ('devices', 'sim', [], 'devices.sim must be Mapping[str, Any] | None')])
def test_what_is_wrong_in_the_text_is_named(
    section: str, key: str, value: Any, problem: str, good: str,
    load_text: Callable[..., RobotSettings],
) -> None:
    data = json.loads(to_json(load_text(good)))
    target = data[section] if section else data
    (target[0] if isinstance(target, list) else target)[key] = value
    with pytest.raises(ConfigError, match=re.escape(f'settings: {problem}')):
        from_json(json.dumps(data))
