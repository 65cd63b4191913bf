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

"""The open emergencies, from the events of alarms, in the order of their importance."""

from __future__ import annotations

from collections.abc import Collection
from collections.abc import Container
from dataclasses import dataclass
import math
from typing import Final

from rt_robot_os.messages.alarm_event import AlarmEvent
from rt_robot_os.messages.alarm_state import ALARM_STATES
from rt_robot_os.messages.alarm_state import AlarmState
from rt_robot_os.messages.cause import Level
from rt_robot_os.messages.cause import LEVELS

_MOST: Final = 64
# Looked up once: members of an enumeration are not plain attributes.
_ACKNOWLEDGED: Final = AlarmState.ACKNOWLEDGED
_SUSPECTED: Final = AlarmState.SUSPECTED


@dataclass
class Emergency:
    """
    An open alarm that is an emergency.

    :ivar alarm: its identifier.
    :ivar level: how severe it is.
    :ivar since_ns: since when it has this level.
    :ivar state: of the alarm; an open one.
    :ivar subject: the person, room or device concerned.
    :ivar kinds: of its causes.
    :ivar node: that reported it; empty without.
    :ivar x: position of its cause, in m; NaN without.
    :ivar y: as x.
    :ivar is_done: the agent has finished with it; only news makes it serve it again.
    :ivar first: an operator has requested it.
    """

    alarm: str
    level: Level
    since_ns: int
    state: AlarmState = AlarmState.RAISED
    subject: str = ''
    kinds: tuple[str, ...] = ()
    node: str = ''
    x: float = math.nan
    y: float = math.nan
    is_done: bool = False
    first: bool = False

    def key(self) -> tuple[bool, int, int, str]:
        """Return the sort key, the most important first: level, then age."""
        return not self.first, -self.level, self.since_ns, self.alarm

    def what(self, worn: Container[str]) -> str:
        """
        Return it in words: ``smoke, at kitchen``.

        :param worn: names of nodes that people wear, which are not a location.
        """
        kinds = ', '.join(self.kinds[:3]) or 'emergency'
        return f'{kinds}, at {self.node}' if self.node and self.node not in worn else kinds


class EmergencyQueue:
    """
    The open emergencies.

    :param least: alarms of a lower level are not emergencies.
    :param ignored: alarms of these kinds only, such as tests, are not emergencies.
    :ivar unreadable: texts that were not an event of an alarm.
    :ivar dropped: emergencies that were dropped for want of room, the least important.
    """

    def __init__(self, least: Level, ignored: Collection[str]) -> None:
        self._least = least
        self._ignored = frozenset(ignored)
        self._all: dict[str, Emergency] = {}
        self.unreadable = self.dropped = 0

    def __len__(self) -> int:
        return len(self._all)

    def __contains__(self, alarm: object) -> bool:
        return alarm in self._all

    def get(self, alarm: str) -> Emergency | None:
        """Return an open one."""
        return self._all.get(alarm)

    def update(self, text: str, t_ns: int) -> tuple[str, str] | None:
        """
        Apply an event of an alarm; safe in the real-time loop.

        :param text: JSON of ``alarms/events``.
        :param t_ns: when.
        :return: the alarm, and what the event means for the agent: ``new``, ``confirmed``,
            ``acknowledged``, ``again`` (news about one that the agent had left), ``over``, or
            nothing; None for an event that is not about an emergency.
        """
        try:
            event = AlarmEvent.from_json(text)
        except ValueError:
            self.unreadable += 1
            return None
        state = ALARM_STATES.get(event.state)
        if state is None:
            self.unreadable += not event.state
            return None
        if not event.is_open:
            return (event.alarm, 'over') if self._all.pop(event.alarm, None) else None
        level = LEVELS.get(event.level)
        if level is None:
            self.unreadable += 1
            return None
        if level < self._least or (event.kinds and self._ignored.issuperset(event.kinds)):
            return None
        found = self._all.get(event.alarm)
        if found is None:
            return self._add(Emergency(event.alarm, level, t_ns, state), event)
        return event.alarm, self._change(found, event, state, level, t_ns)

    def _add(self, made: Emergency, event: AlarmEvent) -> tuple[str, str]:
        _fill(made, event)
        self._all[made.alarm] = made
        if len(self._all) > _MOST:
            least = max(self._all.values(), key=Emergency.key)
            del self._all[least.alarm]
            self.dropped += 1
        return made.alarm, 'new'

    def _change(self, found: Emergency, event: AlarmEvent, state: AlarmState, level: Level,
                t_ns: int) -> str:
        was, worse = found.state, level > found.level
        more = event.kinds != found.kinds and not set(event.kinds) <= set(found.kinds)
        if level != found.level:
            found.level, found.since_ns = level, t_ns
        found.state = state
        _fill(found, event)
        if state is _ACKNOWLEDGED:
            return '' if was is state else 'acknowledged'
        is_confirmed = was is not state and was is _SUSPECTED
        if was is _ACKNOWLEDGED or worse or more or is_confirmed:
            again, found.is_done = found.is_done, False
            if again or was is _ACKNOWLEDGED:
                return 'again'
            return 'confirmed' if is_confirmed else ''
        return ''

    def best(self, but: Emergency | None = None) -> Emergency | None:
        """
        Return the most important one that waits to be served; None when there is none.

        :param but: the one that is served.
        """
        return min((each for each in self._all.values()
                    if each is not but and not each.is_done
                    and (each.first or each.state is not _ACKNOWLEDGED)),
                   key=Emergency.key, default=None)

    def prefer(self, alarm: str) -> bool:
        """
        Serve one first, as an operator requests.

        :return: whether it is open.
        """
        for each in self._all.values():
            each.first = each.alarm == alarm
        if alarm not in self._all:
            return False
        self._all[alarm].is_done = False
        return True


def _fill(emergency: Emergency, event: AlarmEvent) -> None:
    emergency.kinds = event.kinds or emergency.kinds
    emergency.subject = event.subject or emergency.subject
    emergency.node = event.node or emergency.node
    if math.isfinite(event.x) and math.isfinite(event.y):
        emergency.x, emergency.y = event.x, event.y
