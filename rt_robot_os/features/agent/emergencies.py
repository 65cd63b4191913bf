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

"""Which emergencies there are, as the alarms tell it, and which of them comes first."""

from __future__ import annotations

from collections.abc import Collection
from collections.abc import Container
from collections.abc import Mapping
from dataclasses import dataclass
import json
import math
from typing import Any
from typing import Final

from rt_robot_os.messages.cause import Level
from rt_robot_os.messages.cause import LEVELS

SUSPECTED: Final = 'suspected'
RAISED: Final = 'raised'
ACKNOWLEDGED: Final = 'acknowledged'
_OPEN: Final = (SUSPECTED, RAISED, ACKNOWLEDGED)
_ENDED: Final = ('resolved', 'cancelled')
_MOST: Final = 64
_LONGEST: Final = 240
_LONGEST_NAME: Final = 64


@dataclass
class Emergency:
    """
    An alarm that is open.

    :ivar alarm: its identifier.
    :ivar level: how much it matters.
    :ivar since_ns: from when on it has mattered so much.
    :ivar state: ``suspected``, ``raised`` or ``acknowledged``.
    :ivar subject: whom or what it concerns.
    :ivar kinds: of its causes.
    :ivar node: that reported it; empty without.
    :ivar x: where its cause said it is, in m; NaN without.
    :ivar y: as x.
    :ivar is_done: the agent did what it could: it goes on only when something new is told.
    :ivar first: an operator wants this one first.
    """

    alarm: str
    level: Level
    since_ns: int
    state: str = RAISED
    subject: str = ''
    kinds: tuple[str, ...] = ()
    node: str = ''
    x: float = math.nan
    y: float = math.nan
    is_done: bool = False
    first: bool = False

    def key(self) -> tuple[bool, int, int, str]:
        """Return by what they are ordered, the most important first: level, then age."""
        return not self.first, -self.level, self.since_ns, self.alarm

    def what(self, worn: Container[str]) -> str:
        """
        Return it in words: ``smoke, at kitchen``.

        :param worn: names of nodes that people wear, which are no place.
        """
        kinds = ', '.join(self.kinds[:3]) or 'emergency'
        return f'{kinds}, at {self.node}' if self.node and self.node not in worn else kinds


class Emergencies:
    """
    All alarms that are open and emergencies.

    :param least: those of a lower level are none.
    :param ignored: alarms of which all kinds are among these are none, such as tests.
    :ivar unreadable: texts that were no event of an alarm.
    :ivar dropped: emergencies that there was no room for: the least important.
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

    def take(self, text: str, t_ns: int) -> tuple[str, str] | None:
        """
        Take an event of an alarm's life; safe in the real-time loop.

        :param text: JSON of ``alarms/events``.
        :param t_ns: when.
        :return: the alarm and what it means for whoever serves it: ``new``, ``confirmed``,
            ``acknowledged``, ``again`` (something new of one that was left), ``over``, or nothing;
            None for what is no emergency.
        """
        try:
            told = json.loads(text)
            alarm, state = clean(told['alarm'], _LONGEST), told['state']
            level = LEVELS[told['level']] if state in _OPEN else Level.TECHNICAL
            hash(state)
        except (ValueError, KeyError, TypeError, RecursionError):
            self.unreadable += 1
            return None
        if state in _ENDED:
            return (alarm, 'over') if self._all.pop(alarm, None) else None
        kinds = tuple(clean(each, _LONGEST_NAME) for each in _list(told.get('kinds'))[:16])
        found = self._all.get(alarm)
        if state not in _OPEN or level < self._least or (
                kinds and self._ignored.issuperset(kinds)):
            return None
        if found is None:
            return self._add(Emergency(alarm, level, t_ns, state), told, kinds)
        return alarm, self._change(found, told, kinds, state, level, t_ns)

    def _add(self, made: Emergency, told: Mapping[str, Any], kinds: tuple[str, ...]
             ) -> tuple[str, str]:
        _fill(made, told, kinds)
        self._all[made.alarm] = made
        if len(self._all) > _MOST:
            least = max(self._all.values(), key=Emergency.key)
            del self._all[least.alarm]
            self.dropped += 1
        return made.alarm, 'new'

    def _change(self, found: Emergency, told: Mapping[str, Any], kinds: tuple[str, ...],
                state: str, level: Level, t_ns: int) -> str:
        was, worse = found.state, level > found.level
        more = not set(kinds) <= set(found.kinds)
        if level != found.level:
            found.level, found.since_ns = level, t_ns
        found.state = state
        _fill(found, told, kinds)
        if state == ACKNOWLEDGED:
            return '' if was == ACKNOWLEDGED else ACKNOWLEDGED
        if was == ACKNOWLEDGED or worse or more or (state, was) == (RAISED, SUSPECTED):
            again, found.is_done = found.is_done, False
            if again or was == ACKNOWLEDGED:
                return 'again'
            return 'confirmed' if (state, was) == (RAISED, SUSPECTED) else ''
        return ''

    def best(self, but: Emergency | None = None) -> Emergency | None:
        """
        Return the most important that waits to be served; None when there is none.

        :param but: the one that is served.
        """
        return min((each for each in self._all.values()
                    if each is not but and not each.is_done
                    and (each.first or each.state != ACKNOWLEDGED)),
                   key=Emergency.key, default=None)

    def prefer(self, alarm: str) -> bool:
        """
        Have one served first; an operator wants it.

        :return: whether it is open.
        """
        for each in self._all.values():
            each.first = each.alarm == alarm
        if alarm not in self._all:
            return False
        self._all[alarm].is_done = False
        return True


def _fill(emergency: Emergency, told: Mapping[str, Any], kinds: tuple[str, ...]) -> None:
    emergency.kinds = kinds or emergency.kinds
    for key in ('subject', 'node'):
        value = told.get(key)
        if isinstance(value, str) and value:
            setattr(emergency, key, clean(value, _LONGEST_NAME))
    x, y = told.get('x'), told.get('y')
    if _is_place(x) and _is_place(y):
        emergency.x, emergency.y = float(x), float(y)  # type: ignore[arg-type]


def clean(value: object, longest: int) -> str:
    """Return a text that can be published: JSON may have escaped what is no letter."""
    text = str(value)[:longest].replace('\0', ' ')
    return text.encode('utf-8', 'replace').decode()


def _is_place(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and (
        -1e6 < value < 1e6)


def _list(value: object) -> list[object]:
    return value if isinstance(value, list) else []
