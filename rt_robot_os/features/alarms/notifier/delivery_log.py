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
The log of deliveries, so that no notification is delivered twice and each is reported.

It does no input or output: it returns lines to be stored, and reads stored lines. A notification
whose start is stored and whose end is not may have been delivered; its channel has to find out.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable
from enum import Enum
import json
from typing import Any
from typing import Final

from rt_robot_os.messages.fields import parse_object
from rt_robot_os.messages.fields import Text
from rt_robot_os.messages.notification import DeliveryReport
from rt_robot_os.messages.notification import Notification

#: The most deliveries that are remembered; the oldest are dropped first.
REMEMBERED: Final = 4096
_KEY: Final = Text(200)


class DeliveryStatus(Enum):
    """How far the delivery of a notification has come."""

    NEW = 'new'
    #: It was started before a restart; whether it was delivered is unknown.
    AGAIN = 'again'
    #: It is being delivered.
    RUNNING = 'running'
    #: It has a report, which is sent again.
    DONE = 'done'


class DeliveryLog:
    """
    The deliveries, by the keys of their notifications.

    :ivar unreadable: lines that could not be read.
    """

    def __init__(self, remembered: int = REMEMBERED) -> None:
        self.unreadable = 0
        self._remembered = remembered
        # None: started by an earlier process; False: being delivered by this one.
        self._known: OrderedDict[str, DeliveryReport | None | bool] = OrderedDict()

    def __len__(self) -> int:
        return len(self._known)

    def restore(self, lines: Iterable[str]) -> None:
        """Read the lines of before a restart; a line that was cut is skipped."""
        for line in lines:
            try:
                found = parse_object(line, '{"key": "7.1.0.0.operator", ...}')
                if found.get('ok') is None:
                    self._put(_KEY.read(found.get('key')), None)
                else:
                    report = DeliveryReport.from_dict(found)
                    self._put(report.key, report)
            except ValueError:
                self.unreadable += bool(line.strip())

    def start(self, key: str, doubtful: bool = False) -> DeliveryStatus:
        """
        Start the delivery of a notification, if it is new or has to be repeated.

        :param doubtful: an earlier process may have delivered it without storing that.
        """
        known = self._known.get(key)
        if isinstance(known, DeliveryReport):
            return DeliveryStatus.DONE
        if known is False:
            return DeliveryStatus.RUNNING
        verdict = DeliveryStatus.AGAIN if doubtful or key in self._known else DeliveryStatus.NEW
        self._put(key, False)
        return verdict

    def start_line(self, key: str, channel: str) -> str:
        """Return the line to be stored before a notification is delivered."""
        return _line({'key': key, 'channel': channel})

    def finish(self, report: DeliveryReport) -> str:
        """Add a delivery report; return the line to be stored."""
        self._put(report.key, report)
        return _line(report.to_dict())

    def report(self, key: str) -> DeliveryReport | None:
        """Return the report of a notification, if there is one."""
        known = self._known.get(key)
        return known if isinstance(known, DeliveryReport) else None

    def recent(self, most: int) -> list[DeliveryReport]:
        """Return the newest reports, the oldest of them first."""
        found = [each for each in self._known.values() if isinstance(each, DeliveryReport)]
        return found[-most:]

    def lines(self) -> list[str]:
        """Return the lines that have to be stored for all deliveries."""
        return [_line(known.to_dict() if isinstance(known, DeliveryReport) else {'key': key})
                for key, known in self._known.items()]

    def _put(self, key: str, known: DeliveryReport | None | bool) -> None:
        self._known[key] = known
        self._known.move_to_end(key)
        while len(self._known) > self._remembered:
            self._known.popitem(last=False)


def is_doubtful(notification: Notification, stamp_ns: int, start_ns: int) -> bool:
    """
    Return whether an earlier process may have delivered a notification.

    :param stamp_ns: when it was sent.
    :param start_ns: when this process began, on the same clock.
    """
    return stamp_ns < start_ns or notification.again


def _line(found: dict[str, Any]) -> str:
    return json.dumps(found, ensure_ascii=True) + '\n'
