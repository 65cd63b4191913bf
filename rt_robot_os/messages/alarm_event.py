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
"""An event in the life of an alarm: JSON in a ``std_msgs/msg/String``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
import math
from typing import Annotated
from typing import Any
from typing import Final

from rt_robot_os.messages.alarm_state import AlarmEventKind
from rt_robot_os.messages.alarm_state import AlarmState
from rt_robot_os.messages.alarm_state import CLOSED_STATES
from rt_robot_os.messages.cause import LEVELS
from rt_robot_os.messages.codec import Codec
from rt_robot_os.messages.fields import compact
from rt_robot_os.messages.fields import Flag
from rt_robot_os.messages.fields import OneOf
from rt_robot_os.messages.fields import parse_object
from rt_robot_os.messages.fields import Real
from rt_robot_os.messages.fields import Text
from rt_robot_os.messages.fields import Texts
from rt_robot_os.messages.fields import Whole

#: Kinds of causes that one alarm has at most.
KINDS_MOST: Final = 12
_STATES: Final = tuple(each.value for each in AlarmState)
_EVENTS: Final = tuple(each.value for each in AlarmEventKind)
_LINE: Final = Text(500)
_PLACE: Final = Real(-1e6, 1e6, 'm')


@dataclass(frozen=True, slots=True)
class AlarmEvent:
    """
    A moment in the life of an alarm, and the alarm as it was then.

    The state, event and level of a newer release may be unknown here; they are strings.

    :ivar seq: number of the event; it counts all events, also over restarts.
    :ivar t_ns: when, on the clock of the core that published it.
    :ivar alarm: identifier of the alarm.
    :ivar event: what happened.
    :ivar state: of the alarm.
    :ivar level: of the alarm.
    :ivar subject: the person, room or device concerned.
    :ivar kinds: of the causes, the first one first.
    :ivar text: a sentence about the newest cause.
    :ivar by: the person or module that did it; empty when a deadline passed.
    :ivar why: the reason.
    :ivar node: the sensor node that reported the cause; left out without.
    :ivar x: position in the map; left out when it is not known.
    :ivar y: as x.
    :ivar restored: the event repeats the state of before a restart; left out when false.
    """

    seq: Annotated[int, Whole()]
    t_ns: Annotated[int, Whole(-(1 << 63), unit='ns')]
    alarm: Annotated[str, Text(200, 1)]
    event: Annotated[str, OneOf(_EVENTS)]
    state: Annotated[str, OneOf(_STATES)]
    level: Annotated[str, OneOf(tuple(LEVELS))]
    subject: Annotated[str, _LINE] = ''
    kinds: Annotated[tuple[str, ...], Texts(KINDS_MOST, Text(64))] = ()
    text: Annotated[str, _LINE] = ''
    by: Annotated[str, _LINE] = ''
    why: Annotated[str, _LINE] = ''
    node: Annotated[str, _LINE] = ''
    x: Annotated[float, _PLACE] = math.nan
    y: Annotated[float, _PLACE] = math.nan
    restored: Annotated[bool, Flag()] = False

    @property
    def is_open(self) -> bool:
        """Return whether the alarm has not ended; an unknown state counts as open."""
        return self.state not in CLOSED_STATES

    def to_dict(self) -> dict[str, Any]:
        """Return it as a JSON object; what is not known is left out."""
        found: dict[str, Any] = {
            'seq': self.seq, 't_ns': self.t_ns, 'alarm': self.alarm, 'event': self.event,
            'state': self.state, 'level': self.level, 'subject': self.subject,
            'kinds': list(self.kinds), 'text': self.text, 'by': self.by, 'why': self.why}
        if self.node:
            found['node'] = self.node
        if math.isfinite(self.x):
            found['x'] = self.x
        if math.isfinite(self.y):
            found['y'] = self.y
        if self.restored:
            found['restored'] = True
        return found

    def to_json(self) -> str:
        """Return it as JSON."""
        return compact(self.to_dict())

    @classmethod
    def from_dict(cls, found: Mapping[str, Any]) -> AlarmEvent:
        """
        Read what :meth:`to_dict` gave; unknown keys are ignored.

        :raises ValueError: it does not name an alarm.
        """
        return CODEC.read(found)

    @classmethod
    def from_json(cls, text: str) -> AlarmEvent:
        """
        Read what :meth:`to_json` gave; unknown keys are ignored.

        :raises ValueError: it is not an event of an alarm.
        """
        return CODEC.read(parse_object(text, _EXAMPLE))


_EXAMPLE: Final = '{"alarm": "7", "state": "raised", ...}'
#: Of a robot of another release anything but the alarm may be missing.
CODEC: Final = Codec(AlarmEvent, repairs=True, missing={
    'seq': 0, 't_ns': 0, 'event': '', 'state': '', 'level': ''})
