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

"""A notification, as the module of alarms publishes it, read with care."""

from __future__ import annotations

import json
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.safe_text import safe_line

_LONGEST_KEY: Final = 200
_LONGEST: Final = 500
_LIST_MOST: Final = 16


class Notification(NamedTuple):
    """
    What is to be told, and by which channel.

    :ivar key: tells it from all others; the same when it is sent again.
    :ivar content: as it came, with plain values only, for who reads JSON.
    """

    key: str
    channel: str
    content: dict[str, Any]

    def text(self, name: str) -> str:
        """Return something of it as one line."""
        value = self.content.get(name, '')
        if isinstance(value, list):
            value = ', '.join(map(str, value))
        return safe_line(str(value), _LONGEST)

    @property
    def title(self) -> str:
        """Return what it is about, in a few words."""
        return safe_line(f'{self.text("level").upper()} {self.text("subject")}: '
                         f'{self.text("kinds")}'.strip(), 150)

    def as_json(self, again: bool) -> str:
        """Write it for programs; ``again`` is there when it may have been told before."""
        return json.dumps({**self.content, 'title': self.title,
                           **({'again': True} if again else {})}, ensure_ascii=False)

    def lines(self, again: bool) -> list[str]:
        """Write it for people."""
        lines = [self.text('text') or self.title]
        for name in ('level', 'subject', 'kinds', 'node'):
            if self.text(name):
                lines.append(f'{name}: {self.text(name)}')
        if isinstance(self.content.get('x'), float) and isinstance(self.content.get('y'), float):
            lines.append(f'place: x {self.content["x"]:.1f} m, y {self.content["y"]:.1f} m')
        lines.append(f'alarm: {self.text("alarm")}, step {self.text("step")}')
        if again:
            lines.append('This may have reached you before: the robot was interrupted.')
        return lines


def notification_of(text: str) -> Notification:
    """
    Read a notification.

    :raises ValueError: it is none; says why.
    """
    try:
        found = json.loads(text, parse_constant=lambda name: None)
    except (ValueError, RecursionError) as error:
        raise ValueError(f'{text[:60]!r} is no JSON: {error}') from None
    if not isinstance(found, dict):
        raise ValueError(f'{text[:60]!r} is no object')
    key, channel = found.get('key'), found.get('channel')
    if not isinstance(key, str) or not 0 < len(key) <= _LONGEST_KEY or not key.isprintable():
        raise ValueError(f'key {str(key)[:60]!r}: it must be a text of 1 to {_LONGEST_KEY} '
                         'letters')
    if not isinstance(channel, str) or not channel:
        raise ValueError(f'channel {str(channel)[:60]!r} of {key}: it must be a name')
    return Notification(key, channel, {
        str(name)[:_LONGEST]: _plain(value) for name, value in found.items()})


def _plain(value: Any) -> Any:
    if isinstance(value, str):
        return safe_line(value, _LONGEST)
    if isinstance(value, list):
        return [_plain(each) for each in value[:_LIST_MOST] if not isinstance(each, list | dict)]
    return value if isinstance(value, int | float | bool | None) else str(value)[:_LONGEST]
