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
Causes of alarms, as one module tells them to another: JSON in a ``std_msgs/msg/String``.

Whoever assesses something says "this is so" and, when it is over, "this is so no longer". What
becomes of it (an alarm, a part of one, nothing) is decided where all causes come together.
"""

from __future__ import annotations

from enum import IntEnum
import json
import math
import re
from typing import Any
from typing import Final
from typing import NamedTuple

#: On the core's bus; several modules publish on it.
CAUSES_TOPIC: Final = 'alarms/causes'
CAUSES_MESSAGE: Final = 'std_msgs/msg/String'
#: The longest text of a cause, in bytes.
CAUSE_BYTES: Final = 3000
#: Kept on the bus: a flood of technical causes displaces nothing before it is read.
CAUSES_DEPTH: Final = 64

_WORD: Final = re.compile(r'[a-z][a-z0-9_]{0,47}', re.ASCII)
_LONGEST_TEXT: Final = 240
_LONGEST_NAME: Final = 64


class Level(IntEnum):
    """How much an alarm matters; more is worse."""

    #: Something of ours is broken: nobody is in danger by that alone.
    TECHNICAL = 1
    #: Somebody should look, today.
    WARNING = 2
    #: Somebody should come soon.
    URGENT = 3
    #: Somebody may die.
    CRITICAL = 4


#: As they are written in settings and messages.
LEVELS: Final = {level.name.lower(): level for level in Level}


class Cause(NamedTuple):
    """
    Something that is a reason for an alarm, or no longer is.

    :ivar kind: what it is: ``fall``, ``help``, ``news2``, ``smoke``, ``sensor_off``.
    :ivar subject: whom or what it concerns: a person, a room, a device.
    :ivar level: how much it matters.
    :ivar active: it is so; False: it is over.
    :ivar text: a sentence for people.
    :ivar source: the module that says so.
    :ivar node: the sensor node that reported it; empty without.
    :ivar x: where it is in the map, in m; NaN while that is not known.
    :ivar y: as x.
    :ivar value: the number behind it; NaN without.
    """

    kind: str
    subject: str
    level: Level
    active: bool = True
    text: str = ''
    source: str = ''
    node: str = ''
    x: float = math.nan
    y: float = math.nan
    value: float = math.nan

    def to_text(self) -> str:
        """Return it as JSON of at most :data:`CAUSE_BYTES`; safe in the real-time loop."""
        found: dict[str, Any] = {
            'kind': self.kind, 'subject': self.subject, 'level': self.level.name.lower(),
            'active': self.active, 'text': self.text[:_LONGEST_TEXT], 'source': self.source}
        if self.node:
            found['node'] = self.node
        for key in ('x', 'y', 'value'):
            number = getattr(self, key)
            if math.isfinite(number):
                found[key] = number
        return json.dumps(found, ensure_ascii=False, separators=(',', ':'))


def cause_of(text: str) -> Cause:
    """
    Read what :meth:`Cause.to_text` wrote, or what somebody published from ROS.

    :raises ValueError: with what is wrong and what would be right.
    """
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueError(f'{text[:60]!r} is no JSON: {error}') from None
    if not isinstance(found, dict):
        raise ValueError(f'{text[:60]!r} is no object: write {{"kind": "fall", "subject": "anna", '
                         '"level": "critical"}')
    unknown = sorted(set(found) - set(Cause._fields))
    if unknown:
        raise ValueError(f'unknown keys {", ".join(unknown)[:80]}; '
                         f'there are {", ".join(Cause._fields)}')
    level = found.get('level')
    if not isinstance(level, str) or level not in LEVELS:
        raise ValueError(f'level {str(level)[:20]!r}: it must be one of {", ".join(LEVELS)}')
    active = found.get('active', True)
    if not isinstance(active, bool):
        raise ValueError(f'active {str(active)[:20]!r}: it must be true or false')
    return Cause(
        _word(found, 'kind'), _short(found, 'subject', _LONGEST_NAME, needed=True), LEVELS[level],
        active, _short(found, 'text', _LONGEST_TEXT), _short(found, 'source', _LONGEST_NAME),
        _short(found, 'node', _LONGEST_NAME), _number(found, 'x'), _number(found, 'y'),
        _number(found, 'value'))


def check_kind(kind: str) -> str:
    """
    Return a kind of cause as it is.

    :raises ValueError: it is none.
    """
    if not _WORD.fullmatch(kind):
        raise ValueError(f'{kind[:60]!r} is no kind of cause: it must be a small letter, then '
                         'at most 47 small letters, digits and _, such as water_leak')
    return kind


def _word(found: dict[str, Any], key: str) -> str:
    value = found.get(key)
    return check_kind(value if isinstance(value, str) else str(value))


def _short(found: dict[str, Any], key: str, longest: int, needed: bool = False) -> str:
    value = found.get(key, '')
    if not isinstance(value, str) or len(value) > longest or (needed and not value.strip()):
        raise ValueError(f'{key} {str(value)[:60]!r}: it must be a text of '
                         f'{"1" if needed else "0"} to {longest} letters')
    # JSON can escape what no message can hold: it is told all the same.
    return value.replace('\0', ' ').encode('utf-8', 'replace').decode()


def _number(found: dict[str, Any], key: str) -> float:
    value = found.get(key, math.nan)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f'{key} {str(value)[:20]!r}: it must be a number')
    try:
        return float(value)
    except OverflowError:
        raise ValueError(f'{key} is an absurdly large number') from None
