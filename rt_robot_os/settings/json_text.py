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
Settings as one line of JSON, for the core's process and for recordings.

The conversion is lossless. Only the form is checked when it is parsed: the values were checked
when they were loaded.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from dataclasses import is_dataclass
from dataclasses import MISSING
import json
from typing import Any
from typing import Final
from typing import get_args
from typing import get_origin

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import hints_of
from rt_robot_os.settings.model import frozen
from rt_robot_os.settings.model import RobotSettings

# Incremented when the form changes: the node and the core may be of different installations.
FORMAT: Final = 4


def to_json(settings: RobotSettings) -> str:
    """Write settings as one line of ASCII."""
    return json.dumps({'format': FORMAT, **_plain(settings)}, allow_nan=False)


def from_json(text: str) -> RobotSettings:
    """
    Parse settings that :func:`to_json` wrote.

    :raises ConfigError: the text is not valid.
    """
    try:
        data = json.loads(text, parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        raise ConfigError([f'settings: not JSON: {error}']) from None
    if not isinstance(data, dict) or data.pop('format', None) != FORMAT:
        raise ConfigError([f'settings: not of format {FORMAT}: the node and the core must be of '
                           'the same version'])
    settings: RobotSettings = _make(RobotSettings, data, 'robot')
    return settings


def _plain(value: Any) -> Any:
    if is_dataclass(value):
        return {each.name: _plain(getattr(value, each.name)) for each in fields(value)}
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value


def _make(kind: type, data: Any, name: str) -> Any:
    if not isinstance(data, dict):
        raise ConfigError([f'settings: {name} must be an object'])
    hints = hints_of(kind)
    known = {each.name: hints[each.name] for each in fields(kind)}
    # A setting that is newer than a recording has its default there.
    needed = {each.name for each in fields(kind)
              if each.default is MISSING and each.default_factory is MISSING}
    wrong = sorted((needed - set(data)) | (set(data) - set(known)))
    if wrong:
        raise ConfigError([f"settings: {name}: keys missing or unknown: {', '.join(wrong)}"])
    return kind(**{key: _value(known[key], value, f'{name}.{key}') for key, value in data.items()})


def _value(hint: Any, value: Any, name: str) -> Any:
    """Parse one value of the annotated type."""
    if type(value) is hint:
        return value
    if isinstance(hint, type) and is_dataclass(hint):
        return _make(hint, value, name)
    if get_origin(hint) is tuple:
        return _tuple(get_args(hint)[0], value, name)
    if hint is float and type(value) is int:
        return _float(value, name)
    allowed = (hint, *get_args(hint))
    if isinstance(value, dict):
        fits = any(get_origin(each) in (Mapping, dict) for each in allowed)
    else:
        fits = type(value) in allowed
    if not fits:
        raise ConfigError([f'settings: {name} must be {_name(hint)}'])
    return frozen(value)


def _tuple(item: Any, value: Any, name: str) -> tuple[Any, ...]:
    if item is str:
        if type(value) is not list or any(type(each) is not str for each in value):
            raise ConfigError([f'settings: {name} must be a list of strings'])
        return tuple(value)
    name = name.rpartition('.')[2]
    if type(value) is not list:
        raise ConfigError([f'settings: {name} must be a list'])
    return tuple(_value(item, each, name) for each in value)


def _name(hint: Any) -> str:
    if isinstance(hint, type):
        return hint.__name__
    return str(hint).replace('collections.abc.', '').replace('typing.', '')


def _float(value: int, name: str) -> float:
    try:
        return float(value)
    except OverflowError:
        raise ConfigError([f'settings: {name} is too large']) from None


def _refuse(constant: str) -> Any:
    raise ValueError(f'{constant} is not a number')
