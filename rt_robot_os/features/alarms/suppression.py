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
Suppression of causes that are still active after their alarm was resolved or cancelled.

Without it, an operator who resolves an alarm would get it back ten seconds later, when the module
publishes the active cause again.
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
    A cause that is active without an alarm.

    :ivar alarm: the alarm that has ended.
    :ivar until_ns: if it is active then, it opens an alarm again.
    :ivar heard_ns: when it was published last.
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
    """The causes that are active although their alarm has ended; at most 256."""

    def __init__(self, rules: Rules) -> None:
        self._rules = rules
        self._causes: dict[tuple[str, str], SuppressedCause] = {}

    def add(self, alarm: Alarm, t_ns: int) -> None:
        """Suppress the active causes of an alarm that ends now."""
        for reason in alarm.reasons.values():
            if reason.active:
                self._causes[alarm.subject, reason.kind] = SuppressedCause(
                    alarm.id, alarm.subject, reason.kind, reason.level,
                    t_ns + self._rules.remind_ns, t_ns)
        while len(self._causes) > _MOST:
            del self._causes[next(iter(self._causes))]

    def of(self, alarm: Alarm) -> list[dict[str, Any]]:
        """Return the suppressed causes of an alarm, for the journal."""
        return [each.as_dict() for each in self._causes.values() if each.alarm == alarm.id]

    def restore(self, records: Iterable[Mapping[str, Any]], shift_ns: int, t_ns: int) -> None:
        """
        Restore what :meth:`of` gave before a restart.

        :param shift_ns: from the clock of then to that of now.
        :raises ValueError: it is something else.
        """
        try:
            for each in records:
                found = SuppressedCause(
                    str(each['alarm']), str(each['subject']), str(each['kind']),
                    LEVELS[each['level']], int(each['until_ns']) + shift_ns, t_ns)
                if found.until_ns > t_ns:
                    self._causes[found.subject, found.kind] = found
        except (KeyError, TypeError) as error:
            raise ValueError(f'not a suppressed cause: {type(error).__name__} {error}') from error

    def remove(self, cause: Cause) -> None:
        """Remove a cause: it has cleared, or belongs to an open alarm now."""
        self._causes.pop((cause.subject, cause.kind), None)

    def suppresses(self, cause: Cause, t_ns: int) -> bool:
        """
        Return whether a cause is suppressed, because it is the one that was active before.

        It is not when it is worse, when it was not published for a while, or when it has no
        source: then a person has published it by hand.
        """
        found = self._causes.get((cause.subject, cause.kind))
        if found is None:
            return False
        lasts = (bool(cause.source) and cause.level <= found.level and t_ns < found.until_ns
                 and t_ns - found.heard_ns <= self._rules.refresh_ns)
        if lasts:
            found.heard_ns = t_ns
        else:
            del self._causes[cause.subject, cause.kind]
        return lasts
