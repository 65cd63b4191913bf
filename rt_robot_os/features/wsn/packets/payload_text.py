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
Parser of payloads in YAML: each is a string, or a mapping.

A string is ``NAME AM_TYPE FIELD ...``; a field is ``name:code``, then its unit in brackets, then
``=quantity`` with a conversion, or a scale and an offset::

    soil 0x42 moisture:H[%]=soil_moisture_percent,0.1 skin:H=temperature,sht1x_temperature

The words ``big`` or ``little`` among the fields set the byte order, and ``plain`` declares a
payload without a header of the routing under TinyOS 1.x.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping
import re
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.wsn.packets.payload import check_payloads
from rt_robot_os.features.wsn.packets.payload import installed_payloads
from rt_robot_os.features.wsn.packets.payload import Payload
from rt_robot_os.features.wsn.packets.payload import PayloadField

_EXAMPLE: Final = 'soil 0x42 moisture:H[%]=soil_moisture_percent,0.1'
_FIELD: Final = re.compile(
    r'(?P<name>[^:\[\]=,]+):(?P<code>[^:\[\]=,]+)(\[(?P<unit>[^\]]*)\])?'
    r'(=(?P<quantity>[^:\[\]=,]+)(,(?P<how>[^,]+)(,(?P<offset>[^,]+))?)?)?')
_WORDS: Final = ('big', 'little', 'plain')
_KEYS: Final = ('name', 'am_type', 'fields', 'byte_order', 'routed')
_FIELD_KEYS: Final = ('name', 'code', 'unit', 'quantity', 'conversion', 'scale', 'offset')


def parse_payloads(values: Iterable[object]) -> tuple[Payload, ...]:
    """
    Parse payloads in YAML.

    :param values: strings and mappings.
    :raises ConfigError: with every problem; each line names payload, field, value and remedy.
    """
    found: list[Payload] = []
    problems: list[str] = []
    for value in values:
        try:
            found.append(parse_payload(value))
        except ConfigError as error:
            problems += error.problems
    if problems:
        raise ConfigError(problems)
    return check_payloads(found)


def known_payloads(values: Iterable[object]) -> tuple[Payload, ...]:
    """
    Return payloads in YAML, and those of installed packages.

    :param values: strings and mappings; they override an installed payload of the same name.
    :raises ConfigError: with every problem.
    """
    found = parse_payloads(values)
    names = {each.name for each in found}
    return check_payloads((*found, *(each for each in installed_payloads()
                                     if each.name not in names)))


def parse_payload(value: object) -> Payload:
    """
    Parse one payload.

    :param value: a string, or a mapping with the keys of :class:`.Payload`.
    :raises ConfigError: with every problem.
    """
    if isinstance(value, str):
        return _of_text(value)
    if isinstance(value, Mapping):
        return _of_mapping(value)
    raise ConfigError([f'payload {value!r}: must be a string such as "{_EXAMPLE}", or a mapping '
                       f'with {", ".join(_KEYS[:3])}'])


def _of_text(text: str) -> Payload:
    words = text.split()
    if len(words) < 3:
        raise ConfigError([f'payload {text[:60]!r}: must be NAME AM_TYPE FIELD ..., such as '
                           f'{_EXAMPLE}'])
    name, am_type, *rest = words
    options = [word for word in rest if word in _WORDS]
    problems: list[str] = []
    fields = []
    for word in rest:
        if word not in _WORDS:
            try:
                fields.append(_field_of(name, word))
            except ConfigError as error:
                problems += error.problems
    if problems:
        raise ConfigError(problems)
    order = ''.join(word for word in options if word != 'plain')
    return Payload(name, _number_of(name, am_type), tuple(fields), order, 'plain' not in options)


def _field_of(payload: str, text: str) -> PayloadField:
    found = _FIELD.fullmatch(text)
    if not found:
        raise ConfigError([
            f'payload {payload!r}, field {text!r}: must be name:code[unit]=quantity,conversion or '
            'name:code[unit]=quantity,scale,offset; unit and quantity are optional, as in '
            'moisture:H'])
    how, offset = found['how'] or '', found['offset'] or '0'
    scale = '1'
    if how and not how[0].isalpha():
        scale, how = how, ''
    elif how and found['offset']:
        raise ConfigError([f'payload {payload!r}, field {text!r}: a conversion has no offset; '
                           'remove it'])
    where = f'payload {payload!r}, field {found["name"]!r}'
    return PayloadField(found['name'], found['code'], found['unit'] or '',
                        found['quantity'] or '', how, _float_of(where, 'scale', scale),
                        _float_of(where, 'offset', offset))


def _of_mapping(value: Mapping[Any, Any]) -> Payload:
    name = str(value.get('name', ''))
    where = f'payload {name!r}'
    problems = _unknown(where, value, _KEYS)
    problems += [f'{where}: {key} is missing' for key in _KEYS[:3] if key not in value]
    items = value.get('fields', [])
    if not isinstance(items, list):
        problems.append(f'{where}: fields = {items!r} must be a list')
        items = []
    routed = value.get('routed', True)
    if not isinstance(routed, bool):
        problems.append(f'{where}: routed = {routed!r} must be true or false')
    fields = []
    for item in items:
        try:
            fields.append(_field_of(name, item) if isinstance(item, str)
                          else _field_of_mapping(where, item))
        except ConfigError as error:
            problems += error.problems
    if problems:
        raise ConfigError(problems)
    return Payload(name, _number_of(name, value['am_type']), tuple(fields),
                   str(value.get('byte_order', '')), routed)


def _field_of_mapping(where: str, item: object) -> PayloadField:
    if not isinstance(item, Mapping):
        raise ConfigError([f'{where}: the field {item!r} must be a string such as moisture:H, or '
                           'a mapping with name and code'])
    where = f'{where}, field {str(item.get("name", ""))!r}'
    problems = _unknown(where, item, _FIELD_KEYS)
    problems += [f'{where}: {key} is missing' for key in _FIELD_KEYS[:2] if key not in item]
    if problems:
        raise ConfigError(problems)
    name, code, unit, quantity, conversion = [str(item.get(key, '')) for key in _FIELD_KEYS[:5]]
    return PayloadField(name, code, unit, quantity, conversion,
                        _float_of(where, 'scale', item.get('scale', 1.0)),
                        _float_of(where, 'offset', item.get('offset', 0.0)))


def _unknown(where: str, value: Mapping[Any, Any], keys: tuple[str, ...]) -> list[str]:
    return [f'{where}: unknown key {key!r}; must be one of {", ".join(keys)}'
            for key in value if key not in keys]


def _number_of(payload: str, value: object) -> int:
    if isinstance(value, int) and not isinstance(value, bool):
        return value
    try:
        return int(str(value), 0)
    except ValueError:
        raise ConfigError([f'payload {payload!r}: the AM type {value!r} must be a number from 0 '
                           'to 255, such as 0x42']) from None


def _float_of(where: str, key: str, value: object) -> float:
    try:
        if isinstance(value, bool):
            raise ValueError
        return float(str(value))
    except ValueError:
        raise ConfigError([f'{where}: the {key} {value!r} must be a number; or put the name of a '
                           'conversion before it']) from None
