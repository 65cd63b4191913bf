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
Causes that outlast their alarm: somebody resolved or cancelled it, and the cause is told on.

Without this, an operator who resolves an alarm would get it back ten seconds later, when the
module that watches says again that it is still so.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping
from dataclasses import asdict
from dataclasses import dataclass
from typing import Any
from typing import Final

from rt_robot_os.features.alarms.alarm import Alarm
from rt_robot_os.features.alarms.rules import Rules
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import Level
from rt_robot_os.messages.cause import LEVELS

_MOST: Final = 256


@dataclass
class SuppressedCause:
    """
    A cause that lasts.

    :ivar alarm: the one that is over.
    :ivar until_ns: then it is an alarm again, if it lasts.
    :ivar heard_ns: when it was told last.
    """

    alarm: str
    subject: str
    kind: str
    level: Level
    until_ns: int
    heard_ns: int

    def as_dict(self) -> dict[str, Any]:
        """Return it as it is in JSON."""
        return {**asdict(self), 'level': self.level.name.lower()}


class SuppressedCauses:
    """The causes that last although their alarm is over; at most 256."""

    def __init__(self, rules: Rules) -> None:
        self._rules = rules
        self._held: dict[tuple[str, str], SuppressedCause] = {}

    def keep(self, alarm: Alarm, t_ns: int) -> None:
        """Hold back what lasts of an alarm that is over now."""
        for reason in alarm.reasons.values():
            if reason.active:
                self._held[alarm.subject, reason.kind] = SuppressedCause(
                    alarm.id, alarm.subject, reason.kind, reason.level,
                    t_ns + self._rules.remind_ns, t_ns)
        while len(self._held) > _MOST:
            del self._held[next(iter(self._held))]

    def of(self, alarm: Alarm) -> list[dict[str, Any]]:
        """Return what lasts of an alarm, for the journal."""
        return [each.as_dict() for each in self._held.values() if each.alarm == alarm.id]

    def restore(self, found: Iterable[Mapping[str, Any]], shift_ns: int, t_ns: int) -> None:
        """
        Take over what :meth:`of` gave before a restart.

        :param shift_ns: from the clock of then to that of now.
        :raises ValueError: it is something else.
        """
        try:
            for each in found:
                held = SuppressedCause(str(each['alarm']), str(each['subject']), str(each['kind']),
                            LEVELS[each['level']], int(each['until_ns']) + shift_ns, t_ns)
                if held.until_ns > t_ns:
                    self._held[held.subject, held.kind] = held
        except (KeyError, TypeError) as error:
            raise ValueError(f'nothing that lasts: {type(error).__name__} {error}') from error

    def over(self, cause: Cause) -> None:
        """Forget a cause: it is over, or has become part of an open alarm."""
        self._held.pop((cause.subject, cause.kind), None)

    def holds(self, cause: Cause, t_ns: int) -> bool:
        """
        Return whether a cause is the one that lasts, so that there is nothing new in it.

        It is new when it is worse, when it had not been told for a while, and when nobody says who
        tells it: a person who publishes it by hand means it.
        """
        held = self._held.get((cause.subject, cause.kind))
        if held is None:
            return False
        lasts = (bool(cause.source) and cause.level <= held.level and t_ns < held.until_ns
                 and t_ns - held.heard_ns <= self._rules.refresh_ns)
        if lasts:
            held.heard_ns = t_ns
        else:
            del self._held[cause.subject, cause.kind]
        return lasts
