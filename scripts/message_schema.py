#!/usr/bin/env python3
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
Write docs/messages.json and docs/messages.md from the classes of messages.

    .venv/bin/python scripts/message_schema.py

A test fails while the files differ from the classes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import MISSING
from enum import Enum
import json
import math
from pathlib import Path
import re
import sys
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / 'docs'
if __name__ == '__main__':
    sys.path.insert(0, str(ROOT))

from rt_robot_os.messages.alarm_state import AlarmEventKind  # noqa: E402
from rt_robot_os.messages.alarm_state import AlarmState  # noqa: E402
from rt_robot_os.messages.catalogue import MessageEntry  # noqa: E402
from rt_robot_os.messages.catalogue import MESSAGES  # noqa: E402
from rt_robot_os.messages.codec import FieldOf  # noqa: E402

HEAD = (
    '# Messages\n\n'
    'These messages cross a process: between modules and clients, between the robot and a server, '
    'or to the disk. Each is a class in `rt_robot_os/messages`, which checks the limits below. In '
    'ROS each is the text of a `std_msgs/msg/String`; it is a JSON object, if not noted '
    'otherwise. [messages.json](messages.json) has the same as a JSON schema.\n\n'
    'This page is made by `scripts/message_schema.py`; edit the classes instead.\n\n'
    'A receiver ignores keys that it does not know, unless *unknown keys* says otherwise. A field '
    'without a value is left out or null. Times in ns are on the clock of the core that sent the '
    'message.\n')


def schema() -> dict[str, Any]:
    """Return the JSON schema of all messages."""
    return {'$schema': 'https://json-schema.org/draft/2020-12/schema',
            'title': 'Messages of rt_robot_os',
            '$defs': {each.message.__name__: message_schema(each) for each in MESSAGES}}


def message_schema(entry: MessageEntry) -> dict[str, Any]:
    """Return the JSON schema of a message."""
    meanings = meanings_of(entry.message)
    properties = {each.key: {**field_schema(each), 'description': meanings[each.name]}
                  for each in entry.codec.fields}
    return {'description': summary_of(entry.message), 'x-place': entry.place.replace('`', ''),
            'type': 'object', 'properties': properties,
            'required': [each.key for each in entry.codec.fields if each.needed],
            'additionalProperties': not entry.codec.refuses_unknown}


def field_schema(field: FieldOf) -> dict[str, Any]:
    """Return the JSON schema of a field."""
    found = {('x-unit' if key == 'unit' else key): value
             for key, value in field.limit.schema().items()}
    if field.default is None:
        return {'anyOf': [found, {'type': 'null'}]}
    default = field.default
    if default is MISSING or isinstance(default, float) and not math.isfinite(default):
        return found
    if isinstance(default, Enum):
        default = default.name.lower()
    return {**found, 'default': list(default) if isinstance(default, tuple) else default}


def summary_of(message: type) -> str:
    """Return the first sentences of a docstring, on one line."""
    text = (message.__doc__ or '').split(':ivar')[0]
    return ' '.join(text.split()).replace('``', '`')


def meanings_of(message: type) -> dict[str, str]:
    """Return what a docstring says of each field."""
    return {name: ' '.join(text.split()).replace('``', '`') for name, text in re.findall(
        r':ivar (\w+): (.*?)(?=:ivar|\Z)', message.__doc__ or '', re.S)}


def page() -> str:
    """Return the page for people."""
    return '\n'.join([HEAD, *states(), *(line for each in MESSAGES for line in section(each))])


def states() -> Iterator[str]:
    """Yield the tables of states and events."""
    yield '## Alarms: states\n'
    yield '| state | open |\n|---|---|'
    yield from (f'| `{each.value}` | {"yes" if each.is_open else "no"} |' for each in AlarmState)
    yield '\n[alarms.md](alarms.md) says what each means, and what an alarm goes through.\n'
    yield 'Events of an alarm: ' + ', '.join(f'`{each.value}`' for each in AlarmEventKind) + '.\n'


def section(entry: MessageEntry) -> Iterator[str]:
    """Yield the section of a message."""
    meanings = meanings_of(entry.message)
    yield f'## {entry.message.__name__}\n'
    yield f'{summary_of(entry.message)}\n'
    yield f'- where: {entry.place}\n- from: {entry.sender}\n- to: {entry.receivers}'
    if entry.codec.refuses_unknown:
        yield '- unknown keys: an error'
    yield '\n| field | type | unit | limits | required | meaning |\n|---|---|---|---|---|---|'
    for each in entry.codec.fields:
        found = each.limit.schema()
        yield (f'| `{each.key}` | {kind_of(found)} | {found.get("unit", "")} | {limits_of(found)} '
               f'| {"yes" if each.needed else ""} | {meanings[each.name]} |')
    yield ''


def kind_of(found: dict[str, Any]) -> str:
    """Return the type in words."""
    if found.get('type') == 'array':
        return f'list of {kind_of(found["items"])}s'
    return {'boolean': 'true or false', 'object': 'JSON object'}.get(
        str(found.get('type', 'string')), str(found.get('type', 'string')))


def limits_of(found: dict[str, Any]) -> str:
    """Return the limits in words."""
    parts = []
    values = found.get('enum') or found.get('examples')
    if values:
        parts.append(', '.join(f'`{each}`' for each in values))
    if 'pattern' in found and '[a-z]' in found['pattern']:
        parts.append(f'`{found["pattern"]}`')
    if 'maxItems' in found:
        parts.append(f'at most {found["maxItems"]}')
    if 'maxLength' in found and not values:
        least = found.get('minLength', 0)
        parts.append(f'{least} to {found["maxLength"]} characters')
    low, high = found.get('minimum'), found.get('maximum')
    if high is not None and abs(high) < 1 << 53:
        parts.append(f'{low:g} to {high:g}' if low is not None else f'at most {high:g}')
    elif low is not None and abs(low) < 1 << 53:
        parts.append(f'at least {low:g}')
    return ', '.join(parts)


def files() -> dict[str, str]:
    """Return the files by name, with their content."""
    return {'messages.json': json.dumps(schema(), indent=2, ensure_ascii=False) + '\n',
            'messages.md': page().rstrip() + '\n'}


def main() -> None:
    """Write the files."""
    for name, text in files().items():
        (DOCS / name).write_text(text, encoding='utf-8')


if __name__ == '__main__':
    main()
