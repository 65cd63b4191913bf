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


"""
Settings as one line of JSON: how the node hands them to the core's process.

Nothing is lost on the way. What is read back is checked for its form only: the values were checked
when they were loaded.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from dataclasses import is_dataclass
import json
from typing import Any, Final, TypeVar

from rt_robot_os.errors import ConfigError
from rt_robot_os.settings.model import CoreSettings
from rt_robot_os.settings.model import DeviceSettings
from rt_robot_os.settings.model import frozen
from rt_robot_os.settings.model import LogSettings
from rt_robot_os.settings.model import MirrorSettings
from rt_robot_os.settings.model import ModuleSettings
from rt_robot_os.settings.model import RobotSettings
from rt_robot_os.settings.model import TaskSettings
from rt_robot_os.settings.model import TopicSettings
from rt_robot_os.settings.model import WatchdogSettings

# Counted up when the form changes: the node and the core may be of different installations.
FORMAT: Final = 4

_PARTS: Final[Mapping[str, type]] = {
    'devices': DeviceSettings, 'modules': ModuleSettings, 'topics': TopicSettings,
    'mirrors': MirrorSettings,
}
_NESTED: Final[Mapping[str, type]] = {
    'CoreSettings': CoreSettings, 'TaskSettings': TaskSettings,
    'WatchdogSettings': WatchdogSettings, 'LogSettings': LogSettings,
}
_TYPES: Final[Mapping[str, tuple[type, ...]]] = {
    'bool': (bool,), 'int': (int,), 'float': (float, int), 'str': (str,),
    'int | None': (int, type(None)), 'Mapping[str, Any]': (dict,),
    'Mapping[str, Any] | None': (dict, type(None)),
}

_Settings = TypeVar('_Settings')


def to_json(settings: RobotSettings) -> str:
    """Write settings as one line of ASCII."""
    return json.dumps({'format': FORMAT, **_plain(settings)}, allow_nan=False)


def from_json(text: str) -> RobotSettings:
    """
    Read settings that :func:`to_json` wrote.

    :raises ConfigError: the text is anything else.
    """
    try:
        data = json.loads(text, parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        raise ConfigError([f'settings: not JSON: {error}']) from None
    if not isinstance(data, dict) or data.pop('format', None) != FORMAT:
        raise ConfigError([f'settings: not of format {FORMAT}: the node and the core must be of '
                           'the same version'])
    for name, kind in _PARTS.items():
        items = data.get(name)
        if not isinstance(items, list):
            raise ConfigError([f'settings: {name} must be a list'])
        data[name] = tuple(_part(kind, each, name) for each in items)
    return _make(RobotSettings, data, 'robot')


def _plain(value: Any) -> Any:
    if is_dataclass(value):
        return {each.name: _plain(getattr(value, each.name)) for each in fields(value)}
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value


def _part(kind: type[_Settings], data: Any, name: str) -> _Settings:
    if not isinstance(data, dict):
        raise ConfigError([f'settings: {name} must be an object'])
    return _make(kind, data, name)


def _make(kind: type[_Settings], data: dict[str, Any], name: str) -> _Settings:
    known = {each.name: str(each.type) for each in fields(kind)}  # type: ignore[arg-type]
    wrong = sorted(set(known) ^ set(data))
    if wrong:
        raise ConfigError([f"settings: {name}: keys missing or unknown: {', '.join(wrong)}"])
    values: dict[str, Any] = {}
    for key, type_name in known.items():
        value = data[key]
        allowed = _TYPES.get(type_name)
        if type_name in _NESTED:
            value = _part(_NESTED[type_name], value, f'{name}.{key}')
        elif type_name == 'tuple[str, ...]':
            if type(value) is not list or any(type(item) is not str for item in value):
                raise ConfigError([f'settings: {name}.{key} must be a list of texts'])
            value = tuple(value)
        elif allowed is not None:
            if type(value) not in allowed:
                raise ConfigError([f'settings: {name}.{key} must be {type_name}'])
            value = _float(value, f'{name}.{key}') if type_name == 'float' else frozen(value)
        values[key] = value
    return kind(**values)


def _float(value: float, name: str) -> float:
    try:
        return float(value)
    except OverflowError:
        raise ConfigError([f'settings: {name} is too large']) from None


def _refuse(constant: str) -> Any:
    raise ValueError(f'{constant} is no number')
