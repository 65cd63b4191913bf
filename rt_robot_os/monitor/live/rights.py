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
What a user may see of a robot, and what is left of a message without the rest.

A person who is not granted is not even named: signals and alarms of theirs are left out, and in
every text and name of others theirs is replaced.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
import re
from typing import Any
from typing import Final

#: Stands for a person who is not granted.
SOMEBODY: Final = '(somebody)'
#: Signals of a person that go with the overview; all others are of their health.
_OVERVIEW: Final = frozenset({'place', 'place_details'})


@dataclass(frozen=True)
class Rights:
    """
    What clients with the same rights may see, who get the same bytes.

    :ivar people: who they may see; None for everybody.
    :ivar health: whether they may see signs of them.
    """

    people: frozenset[str] | None
    health: bool

    def sees_person(self, person: str) -> bool:
        """Return whether they may see that person."""
        return self.people is None or person in self.people

    def sees_robot(self, people: frozenset[str] | None) -> bool:
        """
        Return whether they may see the robot; without residents only those who see everyone may.

        :param people: those who live with it; None while it is not known who.
        """
        return self.people is None or (people is not None
                                       and not self.people.isdisjoint(people))

    def hidden(self, people: Iterable[str]) -> frozenset[str]:
        """Return which of these people must not be named."""
        return frozenset() if self.people is None else frozenset(people) - self.people

    def sees_signal(self, name: str, hidden: frozenset[str]) -> bool:
        """Return whether they may see a signal at all."""
        kind, _, rest = name.partition('/')
        if kind == 'health':
            person, _, sign = rest.partition('/')
            return self.sees_person(person) and (self.health or sign in _OVERVIEW)
        # The list of all alarms has those of others; who may see some get these each.
        return not hidden or (kind != 'alarms' and names_of(hidden).search(name) is None)


@lru_cache(maxsize=1024)
def names_of(hidden: frozenset[str]) -> re.Pattern[str]:
    """Return what finds any of these names as a word, also within ``bed_of_NAME``."""
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
