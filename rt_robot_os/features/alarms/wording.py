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

"""What is told of an alarm, in words and as JSON, and what channels report of that."""

from __future__ import annotations

import json
from typing import Any
from typing import NamedTuple

from rt_robot_os.features.alarms.alarm import Alarm
from rt_robot_os.features.alarms.alarm import compact


class Notification(NamedTuple):
    """
    What is to be told to whom.

    :ivar key: tells it from all others; the same when it is sent again after a restart.
    :ivar again: it was sent before a restart, too.
    """

    key: str
    channel: str
    alarm: str
    step: int
    level: str
    subject: str
    text: str
    kinds: tuple[str, ...]
    node: str
    x: float
    y: float
    pictures: tuple[str, ...]
    again: bool = False

    def to_text(self) -> str:
        """Return it as JSON; what is not known is left out."""
        found: dict[str, Any] = {**self._asdict(), 'kinds': list(self.kinds),
                                 'pictures': list(self.pictures)}
        return compact({name: value for name, value in found.items()
                        if value != '' and value == value and value != [] and value is not False})


def words_of(alarm: Alarm) -> str:
    """Say in a sentence what is the matter."""
    kinds = ', '.join(alarm.kinds)
    about = f'{kinds}: {alarm.text}' if alarm.text else kinds
    again = f' (again: {alarm.why})' if alarm.round > 1 and alarm.why else ''
    remark = f'; {alarm.remark}' if alarm.remark else ''
    test = 'TEST, nothing has happened: ' if alarm.is_test else ''
    text = f'{test}{alarm.level.name} alarm {alarm.id}, {alarm.subject}: {about}{again}{remark}'
    return text[:400]


def parse_report(text: str) -> tuple[str, bool, str]:
    """
    Read a delivery report.

    :return: the key of the notification, whether it was delivered, a word about it.
    :raises ValueError: it is none.
    """
    try:
        found = json.loads(text)
        key, ok = found['key'], found['ok']
        if not isinstance(key, str) or not isinstance(ok, bool):
            raise ValueError
        return key, ok, str(found.get('text', ''))[:80]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise ValueError(f'{text[:60]!r} is no report: write {{"key": "7.1.0.0.operator", '
                         '"channel": "operator", "ok": true}') from None
