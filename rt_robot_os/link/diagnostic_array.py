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
Diagnoses as JSON, and as ``diagnostic_msgs/msg/DiagnosticArray``.

A topic of the core has no list of texts of any length: modules publish a ``std_msgs/msg/String``
that holds ``{"status": [{"level", "name", "message", "hardware_id", "values": {}}]}``.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
import json
import math
import struct
from types import MappingProxyType
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.link.cdr import LITTLE_ENDIAN
from rt_robot_os.link.cdr import padding
from rt_robot_os.link.cdr import string_in
from rt_robot_os.link.cdr import text_bytes

DIAGNOSTICS: Final = 'diagnostic_msgs/msg/DiagnosticArray'

#: OK, WARN, ERROR, STALE of ``diagnostic_msgs/msg/DiagnosticStatus``.
LEVEL_NAMES: Final = ('ok', 'warn', 'error', 'stale')
#: The longest JSON that is read, in bytes; more is refused.
TEXT_BYTES_MAXIMUM: Final = 1 << 18
#: Statuses of a message, and values of a status.
STATUSES_MAXIMUM: Final = 512
VALUES_MAXIMUM: Final = 256

_STAMP: Final = struct.Struct('<iI')
_COUNT: Final = struct.Struct('<I')
_KEYS: Final = frozenset({'level', 'name', 'message', 'hardware_id', 'values'})
_EXAMPLE: Final = '{"status": [{"level": 0, "name": "anna", "message": "all is well"}]}'


class Status(NamedTuple):
    """
    One status of an array, with the fields of ``diagnostic_msgs/msg/DiagnosticStatus``.

    :ivar level: 0 OK, 1 WARN, 2 ERROR, 3 STALE.
    :ivar values: texts by their keys.
    """

    level: int
    name: str
    message: str = ''
    hardware_id: str = ''
    values: Mapping[str, str] = MappingProxyType({})


def statuses_of(text: str) -> list[Status]:
    """
    Read diagnoses in JSON.

    :raises ValueError: with what is wrong and what would be right.
    """
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueError(f'{text[:60]!r} is no JSON: {error}; write {_EXAMPLE}') from None
    statuses = found.get('status') if isinstance(found, dict) else None
    if not isinstance(statuses, list):
        raise ValueError(f'{text[:60]!r} has no list "status": write {_EXAMPLE}')
    if len(statuses) > STATUSES_MAXIMUM:
        raise ValueError(f'{len(statuses)} statuses: there may be {STATUSES_MAXIMUM}')
    return [_status(each, f'status {index}') for index, each in enumerate(statuses)]


def _status(found: Any, what: str) -> Status:
    if not isinstance(found, dict):
        raise ValueError(f'{what} is {str(found)[:40]!r}: it must be an object')
    unknown = sorted(set(found) - _KEYS)
    if unknown:
        raise ValueError(f'{what} has unknown keys {", ".join(unknown)[:80]}; there are '
                         f'{", ".join(sorted(_KEYS))}')
    level = found.get('level')
    if not isinstance(level, int) or isinstance(level, bool) or not 0 <= level < len(LEVEL_NAMES):
        raise ValueError(f'level {str(level)[:20]!r} of {what}: it must be 0 (OK), 1 (WARN), '
                         '2 (ERROR) or 3 (STALE)')
    values = found.get('values', {})
    if not isinstance(values, dict) or len(values) > VALUES_MAXIMUM:
        raise ValueError(f'values of {what}: they must be an object of at most {VALUES_MAXIMUM} '
                         'texts')
    return Status(
        level, _text(found.get('name', ''), f'name of {what}'),
        _text(found.get('message', ''), f'message of {what}'),
        _text(found.get('hardware_id', ''), f'hardware_id of {what}'),
        {_text(key, f'key of {what}'): _value(value, f'{key[:40]} of {what}')
         for key, value in values.items()})


def _text(value: Any, what: str) -> str:
    """Return a text that a message can hold."""
    if not isinstance(value, str):
        raise ValueError(f'{what} is {str(value)[:40]!r}: it must be a text')
    if '\0' in value:
        raise ValueError(f'{what} holds a NUL, which ends a text in ROS')
    try:
        value.encode()
    except UnicodeEncodeError:
        raise ValueError(f'{what} holds half a character (a lone surrogate)') from None
    return value


def _value(value: Any, what: str) -> str:
    """Return a value as text; numbers may be written as such."""
    if isinstance(value, int) or isinstance(value, float) and math.isfinite(value):
        return json.dumps(value)  # true and false are whole numbers as well
    return _text(value, what)


def to_diagnostics(frame_id: str = '') -> Callable[[memoryview, int], bytes]:
    """
    Make what turns a text with diagnoses in JSON into a ``DiagnosticArray``.

    :param frame_id: in the header.
    :return: raises ValueError with what is wrong with the text.
    """
    frame = text_bytes(frame_id)

    def convert(cdr: memoryview, wall_ns: int) -> bytes:
        if len(cdr) > TEXT_BYTES_MAXIMUM:
            raise ValueError(f'{len(cdr)} bytes: there may be {TEXT_BYTES_MAXIMUM}')
        statuses = statuses_of(string_in(cdr))
        body = bytearray(_STAMP.pack(*divmod(wall_ns, NS_PER_S)) + frame)
        _put_count(body, len(statuses))
        for each in statuses:
            body.append(each.level)
            for text in (each.name, each.message, each.hardware_id):
                _put_text(body, text)
            _put_count(body, len(each.values))
            for key, value in each.values.items():
                _put_text(body, key)
                _put_text(body, value)
        return LITTLE_ENDIAN + bytes(body)

    return convert


def _put_count(body: bytearray, count: int) -> None:
    body += bytes(padding(len(body), _COUNT.size)) + _COUNT.pack(count)


def _put_text(body: bytearray, text: str) -> None:
    body += bytes(padding(len(body), _COUNT.size)) + text_bytes(text)
