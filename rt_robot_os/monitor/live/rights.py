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
What a user may see of a robot, and the removal of the rest from messages.

The name of a person who is not granted is never sent: signals and alarms about them are omitted,
and their name is replaced in all other texts and names.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
import re
from typing import Any
from typing import Final

#: Replacement for the name of a person who is not granted.
SOMEBODY: Final = '(somebody)'
#: Signals of a person that belong to the overview; all others are health data.
_OVERVIEW: Final = frozenset({'place', 'place_details'})


@dataclass(frozen=True)
class Rights:
    """
    The rights of clients; clients with equal rights get the same bytes.

    :ivar people: people they may see; None for everybody.
    :ivar health: whether they may see vital signs.
    """

    people: frozenset[str] | None
    health: bool

    def sees_person(self, person: str) -> bool:
        """Return whether a person is visible."""
        return self.people is None or person in self.people

    def sees_robot(self, people: frozenset[str] | None) -> bool:
        """
        Return whether a robot is visible.

        One without residents is visible only to users who may see all residents.

        :param people: its residents; None while they are unknown.
        """
        return self.people is None or (people is not None
                                       and not self.people.isdisjoint(people))

    def hidden(self, people: Iterable[str]) -> frozenset[str]:
        """Return which of these people must not be named."""
        return frozenset() if self.people is None else frozenset(people) - self.people

    def sees_signal(self, name: str, hidden: frozenset[str]) -> bool:
        """Return whether a signal is visible."""
        kind, _, rest = name.partition('/')
        if kind == 'health':
            person, _, sign = rest.partition('/')
            return self.sees_person(person) and (self.health or sign in _OVERVIEW)
        # The list of all alarms includes other people; clients get visible alarms one by one
        # instead.
        return not hidden or (kind != 'alarms' and names_of(hidden).search(name) is None)


@lru_cache(maxsize=1024)
def names_of(hidden: frozenset[str]) -> re.Pattern[str]:
    """Return a pattern that finds these names as words, also within ``bed_of_NAME``."""
    words = '|'.join(sorted(map(re.escape, hidden), key=len, reverse=True))
    return re.compile(rf'(?<![^\W_])(?:{words})(?![^\W_])', re.IGNORECASE)


def without(value: Any, hidden: frozenset[str]) -> Any:
    """Return a JSON value in which none of these people is named."""
    return _without(value, names_of(hidden)) if hidden else value


def _without(value: Any, names: re.Pattern[str]) -> Any:
    if isinstance(value, str):
        return names.sub(SOMEBODY, value)
    if isinstance(value, dict):
        return {names.sub(SOMEBODY, key): _without(each, names) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_without(each, names) for each in value]
    return value
