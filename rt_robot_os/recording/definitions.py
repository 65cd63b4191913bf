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
The definition of a message type and of the types it contains, in the ``ros2msg`` format of MCAP.

It comes from the ``.msg`` files that every ROS 2 package installs. If they are missing, it is made
by introspection of the Python classes: the same fields, without comments.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
import json
import os
from pathlib import Path
import sys
from typing import Any
from typing import Final

from rt_robot_os.base.errors import LayoutError
from rt_robot_os.link.conversions import TRANSFORM
from rt_robot_os.link.conversions import TRANSFORMS
from rt_robot_os.topics.resolve import FieldSpec
from rt_robot_os.topics.resolve import MessageSpec
from rt_robot_os.topics.resolve import resolve

_RULE: Final = '=' * 80
# The wheels of ROS lack tf2_msgs. A bag only needs the one field of its one message, and the
# resulting hash (REP 2016).
_TRANSFORMS_TEXT: Final = 'geometry_msgs/TransformStamped[] transforms\n'
_TRANSFORMS_HASH: Final = (
    'RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087')


@cache
def definition(type_name: str) -> str:
    """
    Return the definition of a type such as ``sensor_msgs/msg/Imu``.

    :raises LayoutError: the type is not installed.
    """
    if _is_lacking(type_name):
        return f'{_TRANSFORMS_TEXT}{_RULE}\nMSG: {_short(TRANSFORM)}\n{definition(TRANSFORM)}'
    specs: dict[str, MessageSpec] = {}
    _collect(resolve(type_name), specs)
    texts: list[str] = []
    for name, spec in specs.items():
        text = _installed(name, '.msg') or _made(spec)
        head = f'{_RULE}\nMSG: {_short(name)}\n' if texts else ''
        texts.append(head + text.rstrip('\n') + '\n')
    return ''.join(texts)


@cache
def type_hash(type_name: str) -> str:
    """Return the hash of a type as in DDS, ``RIHS01_...``; empty if unknown."""
    if _is_lacking(type_name):
        return _TRANSFORMS_HASH
    try:
        hashes = json.loads(_installed(type_name, '.json') or '{}').get('type_hashes', ())
        return next((str(each['hash_string']) for each in hashes
                     if each['type_name'] == type_name), '')
    except (ValueError, KeyError, TypeError, AttributeError):
        return ''


def _is_lacking(type_name: str) -> bool:
    return type_name == TRANSFORMS and find_spec('tf2_msgs') is None


def _collect(spec: MessageSpec, specs: dict[str, MessageSpec]) -> None:
    specs.setdefault(spec.type_name, spec)
    for field in spec.fields:
        if isinstance(field.item, MessageSpec) and field.item.type_name not in specs:
            _collect(field.item, specs)


def _short(type_name: str) -> str:
    package, _, name = type_name.split('/')
    return f'{package}/{name}'


def _shares() -> Iterator[Path]:
    for prefix in filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)):
        yield Path(prefix) / 'share'
    yield Path(sys.prefix) / 'share'


def _installed(type_name: str, suffix: str) -> str | None:
    for share in _shares():
        try:
            return (share / f'{type_name}{suffix}').read_text(encoding='utf-8')
        except OSError:
            continue
    return None


def _made(spec: MessageSpec) -> str:
    if not spec.fields or [field.name for field in spec.fields] == [
            'structure_needs_at_least_one_member']:
        return ''
    return ''.join(f'{_field(field)}\n' for field in spec.fields)


def _field(field: FieldSpec) -> str:
    base = _short(field.item.type_name) if isinstance(field.item, MessageSpec) else {
        'boolean': 'bool', 'octet': 'byte', 'float': 'float32', 'double': 'float64',
    }.get(field.type_name, field.type_name)
    if field.text_limit is not None:
        base += f'<={field.text_limit}'
    limit: Any = '' if field.limit is None else field.limit
    if field.container == 'array':
        base += f'[{limit}]'
    elif field.container == 'sequence':
        base += f'[<={limit}]' if limit else '[]'
    return f'{base} {field.name}'


def is_known(type_name: str) -> bool:
    """Return whether the type is installed."""
    try:
        definition(type_name)
    except LayoutError:
        return False
    return True
