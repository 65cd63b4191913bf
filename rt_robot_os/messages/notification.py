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
"""A notification of an alarm for one channel, and the report whether it was delivered."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field
from dataclasses import replace
import json
import math
from typing import Annotated
from typing import Any
from typing import Final

from rt_robot_os.base.safe_text import safe_line
from rt_robot_os.messages.alarm_event import KINDS_MOST
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

#: The longest text of a report.
REPORT_CHARACTERS: Final = 80
_KEY: Final = Text(200, 1, r'[^\x00-\x1f\x7f-\x9f]*', 'a string of 1 to 200 printable characters')
_LINE: Final = Text(500, printable=True)
_PLACE: Final = Real(-1e6, 1e6, 'm')
_OTHERS_MOST: Final = 32


@dataclass(frozen=True, slots=True)
class Notification:
    """
    What one channel is to deliver about an alarm.

    :ivar key: identifies it; the same when it is sent again after a restart.
    :ivar channel: that is to deliver it.
    :ivar alarm: identifier of the alarm.
    :ivar step: of the escalation, from 0.
    :ivar level: of the alarm.
    :ivar subject: the person, room or device concerned.
    :ivar text: for people, as the channel shows it.
    :ivar kinds: of the causes.
    :ivar node: the sensor node that reported the cause; left out without.
    :ivar x: position in the map; left out when it is not known.
    :ivar y: as x.
    :ivar pictures: files, the newest last.
    :ivar again: it was sent before a restart, too; left out when false.
    :ivar others: fields of a newer release, which channels pass on.
    """

    key: Annotated[str, _KEY]
    channel: Annotated[str, Text(200, 1, printable=True)]
    alarm: Annotated[str, _LINE] = ''
    step: Annotated[int, Whole(-1)] = 0
    level: Annotated[str, OneOf(tuple(LEVELS))] = ''
    subject: Annotated[str, _LINE] = ''
    text: Annotated[str, _LINE] = ''
    kinds: Annotated[tuple[str, ...], Texts(KINDS_MOST, _LINE)] = ()
    node: Annotated[str, _LINE] = ''
    x: Annotated[float, _PLACE] = math.nan
    y: Annotated[float, _PLACE] = math.nan
    pictures: Annotated[tuple[str, ...], Texts(16, _LINE)] = ()
    again: Annotated[bool, Flag()] = False
    others: Mapping[str, Any] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Return it as a JSON object; what is empty or not known is left out."""
        found: dict[str, Any] = {'key': self.key, 'channel': self.channel}
        if self.alarm:
            found['alarm'] = self.alarm
        found['step'] = self.step
        for key, value in (('level', self.level), ('subject', self.subject), ('text', self.text),
                           ('kinds', list(self.kinds)), ('node', self.node)):
            if value:
                found[key] = value
        if math.isfinite(self.x):
            found['x'] = self.x
        if math.isfinite(self.y):
            found['y'] = self.y
        if self.pictures:
            found['pictures'] = list(self.pictures)
        if self.again:
            found['again'] = True
        found.update(self.others)
        return found

    def to_json(self) -> str:
        """Return it as JSON."""
        return compact(self.to_dict())

    @classmethod
    def from_dict(cls, found: Mapping[str, Any]) -> Notification:
        """
        Read what :meth:`to_dict` gave; a wrong value of an optional field counts as missing.

        :raises ValueError: key or channel is missing or wrong.
        """
        made = NOTIFICATION.read(found)
        others = {safe_line(str(key), _LINE.most): _plain(value) for key, value in found.items()
                  if key not in NOTIFICATION.keys}
        if not others:
            return made
        return replace(made, others=dict(list(others.items())[:_OTHERS_MOST]))

    @classmethod
    def from_json(cls, text: str) -> Notification:
        """
        Read what :meth:`to_json` gave.

        :raises ValueError: it is not a notification.
        """
        return cls.from_dict(parse_object(
            text, '{"key": "7.1.0.0.operator", "channel": "operator", ...}'))


@dataclass(frozen=True, slots=True)
class DeliveryReport:
    """
    What became of a notification.

    :ivar key: of the notification.
    :ivar channel: that was to deliver it.
    :ivar ok: it was delivered.
    :ivar text: more about it, such as why it failed.
    """

    key: Annotated[str, Text(200)]
    channel: Annotated[str, Text(200)]
    ok: Annotated[bool, Flag()]
    text: Annotated[str, Text(REPORT_CHARACTERS)] = ''

    def to_dict(self) -> dict[str, Any]:
        """Return it as a JSON object."""
        return {'key': self.key, 'channel': self.channel, 'ok': self.ok, 'text': self.text}

    def to_json(self) -> str:
        """Return it as JSON."""
        return json.dumps(self.to_dict(), ensure_ascii=False)

    @classmethod
    def from_dict(cls, found: Mapping[str, Any]) -> DeliveryReport:
        """
        Read what :meth:`to_dict` gave.

        :raises ValueError: key or ok is missing or wrong.
        """
        return DELIVERY_REPORT.read(found)

    @classmethod
    def from_json(cls, text: str) -> DeliveryReport:
        """
        Read what :meth:`to_json` gave, or what a program of a user published.

        :raises ValueError: it is not a report.
        """
        return DELIVERY_REPORT.read(parse_object(text, _REPORT_EXAMPLE))


_REPORT_EXAMPLE: Final = '{"key": "7.1.0.0.operator", "channel": "operator", "ok": true}'
NOTIFICATION: Final = Codec(Notification, repairs=True)
DELIVERY_REPORT: Final = Codec(DeliveryReport, repairs=True, missing={'channel': ''})


def _plain(value: Any) -> Any:
    """Return a value that every channel can show."""
    if isinstance(value, str):
        return safe_line(value, _LINE.most)
    if isinstance(value, list):
        return [_plain(each) for each in value[:16] if not isinstance(each, list | dict)]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if isinstance(value, int | float | bool | None) else str(value)[:_LINE.most]
