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
What has become of each notification, so that none is told twice and each is reported.

Pure: lines to be kept come out, lines that were kept go in. A notification whose beginning was
kept and whose end was not may have been told: that is for its channel to find out.
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

#: Notifications that are remembered; the oldest are forgotten first.
REMEMBERED: Final = 4096
_KEY: Final = Text(200)


class DeliveryStatus(Enum):
    """What is to be done with a notification that came."""

    NEW = 'new'
    #: It was begun before a restart, and nobody knows whether it was told.
    AGAIN = 'again'
    #: It is under way already.
    RUNNING = 'running'
    #: What became of it is known: report that.
    DONE = 'done'


class DeliveryLog:
    """
    The memory of notifications, by their keys.

    :ivar unreadable: lines that could not be read.
    """

    def __init__(self, remembered: int = REMEMBERED) -> None:
        self.unreadable = 0
        self._remembered = remembered
        # None: begun in an earlier life; False: under way in this one.
        self._known: OrderedDict[str, DeliveryReport | None | bool] = OrderedDict()

    def __len__(self) -> int:
        return len(self._known)

    def restore(self, lines: Iterable[str]) -> None:
        """Take what was kept before a restart; a line that was cut is passed over."""
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

    def take(self, key: str, doubtful: bool = False) -> DeliveryStatus:
        """
        Take a notification that came; one that is new or begun again is under way now.

        :param doubtful: an earlier life may have told it, and not have been able to keep that.
        """
        known = self._known.get(key)
        if isinstance(known, DeliveryReport):
            return DeliveryStatus.DONE
        if known is False:
            return DeliveryStatus.RUNNING
        verdict = DeliveryStatus.AGAIN if doubtful or key in self._known else DeliveryStatus.NEW
        self._put(key, False)
        return verdict

    def begun(self, key: str, channel: str) -> str:
        """Return the line to be kept before a notification is told."""
        return _line({'key': key, 'channel': channel})

    def end(self, report: DeliveryReport) -> str:
        """Note what became of one; return the line to be kept."""
        self._put(report.key, report)
        return _line(report.to_dict())

    def report(self, key: str) -> DeliveryReport | None:
        """Return what became of one, as far as it is known."""
        known = self._known.get(key)
        return known if isinstance(known, DeliveryReport) else None

    def recent(self, most: int) -> list[DeliveryReport]:
        """Return the newest reports, the oldest of them first."""
        found = [each for each in self._known.values() if isinstance(each, DeliveryReport)]
        return found[-most:]

    def lines(self) -> list[str]:
        """Return what has to be kept of all that is remembered."""
        return [_line(known.to_dict()) if isinstance(known, DeliveryReport) else _line({'key': key})
                for key, known in self._known.items()]

    def _put(self, key: str, known: DeliveryReport | None | bool) -> None:
        self._known[key] = known
        self._known.move_to_end(key)
        while len(self._known) > self._remembered:
            self._known.popitem(last=False)


def is_doubtful(notification: Notification, stamp_ns: int, start_ns: int) -> bool:
    """
    Return whether an earlier life of the notifier may have told a notification.

    :param stamp_ns: when it was sent.
    :param start_ns: when this life began, on the same clock.
    """
    return stamp_ns < start_ns or notification.again


def _line(found: dict[str, Any]) -> str:
    return json.dumps(found, ensure_ascii=True) + '\n'
