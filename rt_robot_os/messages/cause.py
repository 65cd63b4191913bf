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
Causes of alarms, from the modules that detect them to module ``alarms``.

Each is JSON in a ``std_msgs/msg/String``. A module publishes a cause when it becomes active and
again when it is cleared. Module ``alarms`` decides what follows: a new alarm, a part of an open
one, or nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
import math
from typing import Annotated
from typing import Any
from typing import Final

from rt_robot_os.messages.codec import Codec
from rt_robot_os.messages.fields import Choice
from rt_robot_os.messages.fields import compact
from rt_robot_os.messages.fields import Flag
from rt_robot_os.messages.fields import parse_object
from rt_robot_os.messages.fields import Real
from rt_robot_os.messages.fields import Text

CAUSES_TOPIC: Final = 'alarms/causes'
CAUSES_MESSAGE: Final = 'std_msgs/msg/String'
CAUSE_BYTES: Final = 3000
CAUSES_DEPTH: Final = 64

_KIND: Final = Text(48, 1, '[a-z][a-z0-9_]{0,47}', (
    'a small letter, then at most 47 small letters, digits and _, such as water_leak'))
_SUBJECT: Final = Text(64, 1)
_NAME: Final = Text(64)
_SENTENCE: Final = Text(240)


class Level(IntEnum):
    """How severe an alarm is; more is worse."""

    #: A part of the system has failed; that alone endangers no person.
    TECHNICAL = 1
    #: A person should check within the day.
    WARNING = 2
    #: A person should come soon.
    URGENT = 3
    #: A life may be in danger.
    CRITICAL = 4


LEVELS: Final = {level.name.lower(): level for level in Level}
LEVEL_WORDS: Final = {level: word for word, level in LEVELS.items()}


@dataclass(frozen=True, slots=True)
class Cause:
    """
    A condition that is a reason for an alarm, or that has cleared.

    :ivar kind: what it is: ``fall``, ``help``, ``news2``, ``smoke``, ``sensor_off``.
    :ivar subject: the person, room or device concerned.
    :ivar level: how severe it is.
    :ivar active: the condition holds; false: it has cleared.
    :ivar text: a sentence for people.
    :ivar source: the module that publishes it; empty for a person.
    :ivar node: the sensor node that reported it; left out without.
    :ivar x: position in the map; left out when it is not known.
    :ivar y: as x.
    :ivar value: the measured value behind it; left out without.
    """

    kind: Annotated[str, _KIND]
    subject: Annotated[str, _SUBJECT]
    level: Annotated[Level, Choice(LEVELS)]
    active: Annotated[bool, Flag()] = True
    text: Annotated[str, _SENTENCE] = ''
    source: Annotated[str, _NAME] = ''
    node: Annotated[str, _NAME] = ''
    x: Annotated[float, Real(unit='m')] = math.nan
    y: Annotated[float, Real(unit='m')] = math.nan
    value: Annotated[float, Real()] = math.nan

    def of_source(self, source: str) -> Cause:
        """Return it with the name of the module that publishes it."""
        return Cause(self.kind, self.subject, self.level, self.active, self.text, source,
                     self.node, self.x, self.y, self.value)

    def to_dict(self) -> dict[str, Any]:
        """Return it as a JSON object; what is not known is left out."""
        found: dict[str, Any] = {
            'kind': self.kind, 'subject': self.subject, 'level': LEVEL_WORDS[self.level],
            'active': self.active, 'text': self.text[:_SENTENCE.most], 'source': self.source}
        if self.node:
            found['node'] = self.node
        if math.isfinite(self.x):
            found['x'] = self.x
        if math.isfinite(self.y):
            found['y'] = self.y
        if math.isfinite(self.value):
            found['value'] = self.value
        return found

    def to_json(self) -> str:
        """Return it as JSON of at most :data:`CAUSE_BYTES`; safe in the real-time loop."""
        return compact(self.to_dict())

    @classmethod
    def from_dict(cls, found: Mapping[str, Any]) -> Cause:
        """
        Read what :meth:`to_dict` gave.

        :raises ValueError: with the field, its value and what it must be.
        """
        return CODEC.read(found)

    @classmethod
    def from_json(cls, text: str) -> Cause:
        """
        Read what :meth:`to_json` gave, or what a person published from ROS.

        :raises ValueError: with the field, its value and what it must be.
        """
        return CODEC.read(parse_object(text, _EXAMPLE))


_EXAMPLE: Final = '{"kind": "fall", "subject": "anna", "level": "critical"}'
# Strict: a person who publishes a cause by hand wants to know about a misspelt key.
CODEC: Final = Codec(Cause, refuses_unknown=True)


def check_kind(kind: str) -> str:
    """
    Return a kind of cause unmodified.

    :raises ValueError: it is not valid.
    """
    try:
        return _KIND.read(kind)
    except ValueError:
        raise ValueError(f'{kind[:60]!r} is not a kind of cause: it must be {_KIND.must_be}'
                         ) from None
