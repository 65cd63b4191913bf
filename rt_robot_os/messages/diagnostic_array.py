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
Diagnostics as JSON, and ``diagnostic_msgs/msg/DiagnosticArray`` as CDR bytes.

A topic of the core cannot hold a list of strings of any length. Modules publish a
``std_msgs/msg/String`` with the JSON ``{"status": [{"level", "name", "message", "hardware_id",
"values": {}}]}`` instead.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping
import json
import math
import struct
from types import MappingProxyType
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.messages.cdr import LITTLE_ENDIAN
from rt_robot_os.messages.cdr import padding
from rt_robot_os.messages.cdr import text_bytes

DIAGNOSTICS: Final = 'diagnostic_msgs/msg/DiagnosticArray'

#: OK, WARN, ERROR, STALE of ``diagnostic_msgs/msg/DiagnosticStatus``.
LEVEL_NAMES: Final = ('ok', 'warn', 'error', 'stale')
#: The longest JSON that is accepted, in bytes.
TEXT_BYTES_MAXIMUM: Final = 1 << 18
#: The most statuses of a message, and the most values of a status.
STATUSES_MAXIMUM: Final = 512
VALUES_MAXIMUM: Final = 256

_STAMP: Final = struct.Struct('<iI')
_COUNT: Final = struct.Struct('<I')
_KEYS: Final = frozenset({'level', 'name', 'message', 'hardware_id', 'values'})
_EXAMPLE: Final = '{"status": [{"level": 0, "name": "anna", "message": "all is well"}]}'


class DiagnosticStatus(NamedTuple):
    """
    One status of an array, with the fields of ``diagnostic_msgs/msg/DiagnosticStatus``.

    :ivar level: 0 OK, 1 WARN, 2 ERROR, 3 STALE.
    :ivar values: strings by key.
    """

    level: int
    name: str
    message: str = ''
    hardware_id: str = ''
    values: Mapping[str, str] = MappingProxyType({})


def statuses_of(text: str) -> list[DiagnosticStatus]:
    """
    Parse diagnostics in JSON.

    :raises ValueError: the JSON is not valid; the message gives the problem and the remedy.
    """
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueError(f'{text[:60]!r} is not JSON: {error}; write {_EXAMPLE}') from None
    statuses = found.get('status') if isinstance(found, dict) else None
    if not isinstance(statuses, list):
        raise ValueError(f'{text[:60]!r} has no list "status": write {_EXAMPLE}')
    if len(statuses) > STATUSES_MAXIMUM:
        raise ValueError(f'{len(statuses)} statuses: at most {STATUSES_MAXIMUM} are allowed')
    return [_status(each, f'status {index}') for index, each in enumerate(statuses)]


def _status(found: Any, what: str) -> DiagnosticStatus:
    if not isinstance(found, dict):
        raise ValueError(f'{what} is {str(found)[:40]!r}: it must be an object')
    unknown = sorted(set(found) - _KEYS)
    if unknown:
        raise ValueError(f'{what} has unknown keys {", ".join(unknown)[:80]}; known are '
                         f'{", ".join(sorted(_KEYS))}')
    level = found.get('level')
    if not isinstance(level, int) or isinstance(level, bool) or not 0 <= level < len(LEVEL_NAMES):
        raise ValueError(f'level {str(level)[:20]!r} of {what}: it must be 0 (OK), 1 (WARN), '
                         '2 (ERROR) or 3 (STALE)')
    values = found.get('values', {})
    if not isinstance(values, dict) or len(values) > VALUES_MAXIMUM:
        raise ValueError(f'values of {what}: they must be an object of at most {VALUES_MAXIMUM} '
                         'strings')
    return DiagnosticStatus(
        level, _text(found.get('name', ''), f'name of {what}'),
        _text(found.get('message', ''), f'message of {what}'),
        _text(found.get('hardware_id', ''), f'hardware_id of {what}'),
        {_text(key, f'key of {what}'): _value(value, f'{key[:40]} of {what}')
         for key, value in values.items()})


def _text(value: Any, what: str) -> str:
    """Return a string that a message can hold."""
    if not isinstance(value, str):
        raise ValueError(f'{what} is {str(value)[:40]!r}: it must be a string')
    if '\0' in value:
        raise ValueError(f'{what} holds a NUL, which ends a string in ROS')
    try:
        value.encode()
    except UnicodeEncodeError:
        raise ValueError(f'{what} holds a lone surrogate (half a character)') from None
    return value


def _value(value: Any, what: str) -> str:
    """Return a value as a string; numbers and booleans are allowed."""
    if isinstance(value, int) or isinstance(value, float) and math.isfinite(value):
        return json.dumps(value)  # a bool is an int as well
    return _text(value, what)


def diagnostic_array(statuses: Iterable[DiagnosticStatus], wall_ns: int, frame: bytes) -> bytes:
    """
    Write a message.

    :param wall_ns: since 1970.
    :param frame: the frame_id of the header, as CDR.
    """
    statuses = list(statuses)
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


def _put_count(body: bytearray, count: int) -> None:
    body += bytes(padding(len(body), _COUNT.size)) + _COUNT.pack(count)


def _put_text(body: bytearray, text: str) -> None:
    body += bytes(padding(len(body), _COUNT.size)) + text_bytes(text)
