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
"""How channels show a notification: a title, lines for people, and JSON for programs."""

from __future__ import annotations

import json
import math

from rt_robot_os.base.safe_text import safe_line
from rt_robot_os.messages.notification import Notification

_TITLE_CHARACTERS = 150


def title_of(notification: Notification) -> str:
    """Return what a notification is about, in a few words."""
    return safe_line(f'{notification.level.upper()} {notification.subject}: '
                     f'{", ".join(notification.kinds)}'.strip(), _TITLE_CHARACTERS)


def json_of(notification: Notification, again: bool) -> str:
    """
    Return it as JSON for programs.

    :param again: it may have been delivered before; the JSON says so.
    """
    return json.dumps({**notification.to_dict(), 'title': title_of(notification),
                       **({'again': True} if again else {})}, ensure_ascii=False)


def lines_of(notification: Notification, again: bool) -> list[str]:
    """
    Return it as lines for people.

    :param again: it may have been delivered before; the last line says so.
    """
    lines = [notification.text or title_of(notification)]
    for name, text in (('level', notification.level), ('subject', notification.subject),
                       ('kinds', ', '.join(notification.kinds)), ('node', notification.node)):
        if text:
            lines.append(f'{name}: {text}')
    if math.isfinite(notification.x) and math.isfinite(notification.y):
        lines.append(f'place: x {notification.x:.1f} m, y {notification.y:.1f} m')
    lines.append(f'alarm: {notification.alarm}, step {notification.step}')
    if again:
        lines.append('This may have reached you before: the robot was interrupted.')
    return lines
