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
Classes of packets by importance, and the rules that say which packet is of which class.

A rule is a line of text. The first one that matches applies; packets without a match are of the
last class::

    alarm if kind alarm smoke water
    vital if kind pulse spo2 and origin 3-7 9
    vital if type 0x93 and group 0x22

A rule uses only the header of a packet (:mod:`rt_robot_os.features.wsn.sink.packet_header`), so
the class is known before the packet is decoded.
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
import re
from typing import Final
from typing import NamedTuple

from rt_robot_os.features.wsn.packets.paper import Kind

#: Kinds of readings that data packets may name, by name.
KINDS: Final = {kind.name.lower(): int(kind) for kind in Kind}
DEFAULT_CLASSES: Final = ('alarm', 'vital', 'rest')
DEFAULT_RULES: Final = (
    'alarm if kind alarm smoke water',
    'vital if kind pulse respiration spo2 body_temperature systolic diastolic oxygen '
    'consciousness')
CLASSES_MAXIMUM: Final = 8

# Facts of rules, with their largest values.
_FACTS: Final[Mapping[str, int]] = {'type': 0xFF, 'kind': 0xFFFF, 'origin': 0xFFFF, 'group': 0xFF}
_CLASS: Final = re.compile(r'[a-z][a-z0-9_]{0,31}', re.ASCII)
_FORM: Final = "must look like 'vital if kind pulse spo2 and origin 3-7 9'"
# Size of the cache: enough for a few thousand nodes with their types.
_REMEMBERED: Final = 8192

_Spans = tuple[tuple[int, int], ...]


class ImportanceRule(NamedTuple):
    """
    One rule.

    :ivar place: index of its class.
    :ivar conditions: fact -> first and last value of each span; all facts must match.
    """

    place: int
    conditions: tuple[tuple[str, _Spans], ...]


def class_problems(classes: Sequence[str]) -> list[str]:
    """Return the problems of the names of the classes."""
    problems = [f'{each!r} is not a valid name of a class: must be a lower case letter, then '
                'lower case letters, digits or _'
                for each in classes if not _CLASS.fullmatch(each)]
    if not classes or len(classes) > CLASSES_MAXIMUM:
        problems.append(f'{len(classes)} classes: name 1 to {CLASSES_MAXIMUM}, the most important '
                        'first')
    if len(set(classes)) != len(classes):
        problems.append('a class is given twice')
    return problems


def parse_rule(text: str, classes: Sequence[str]) -> ImportanceRule:
    """
    Read a rule.

    :raises ValueError: it is not valid; the text has the problem and the remedy.
    """
    name, separator, rest = text.strip().partition(' if ')
    name = name.strip()
    if not separator:
        raise ValueError(_FORM)
    if name not in classes:
        raise ValueError(f'there is no class {name[:32]!r}: use one of {", ".join(classes)}, or '
                         'add it to classes')
    conditions: dict[str, _Spans] = {}
    for part in rest.split(' and '):
        fact, *values = part.split()[:64] or ['']
        if fact not in _FACTS:
            raise ValueError(f'{fact[:32]!r} is not a fact of a rule: use '
                             f'{", ".join(_FACTS)}; it {_FORM}')
        if fact in conditions:
            raise ValueError(f'{fact} is given twice: write its values in one list')
        if not values:
            raise ValueError(f'{fact} needs values; it {_FORM}')
        conditions[fact] = tuple(_span(fact, each) for each in values)
    return ImportanceRule(list(classes).index(name), tuple(conditions.items()))


def _span(fact: str, text: str) -> tuple[int, int]:
    if fact == 'kind' and text in KINDS:
        return KINDS[text], KINDS[text]
    first, separator, last = text.partition('-')
    try:
        low = int(first, 0)
        high = int(last, 0) if separator else low
    except ValueError:
        names = f', or one of {", ".join(KINDS)}' if fact == 'kind' else ''
        raise ValueError(f'{fact} {text[:32]!r}: must be a number such as 17 or 0x11, or a span '
                         f'such as 3-7{names}') from None
    if not 0 <= low <= high <= _FACTS[fact]:
        raise ValueError(f'{fact} {text[:32]!r}: must be within 0-{_FACTS[fact]}, the smaller '
                         'number first')
    return low, high


class Classifier:
    """
    Determines the class of packets; safe in the loop.

    :ivar classes: names of the classes, the most important first.
    """

    def __init__(self, classes: Sequence[str], rules: Sequence[str]) -> None:
        """
        Read the rules.

        :raises ValueError: some are not valid; the text has a line for each problem.
        """
        problems = [f'classes = {list(classes)}: {each}' for each in class_problems(classes)]
        found: list[ImportanceRule] = []
        for text in rules if not problems else ():
            try:
                found.append(parse_rule(text, classes))
            except ValueError as error:
                problems.append(f'rules: {text!r}: {error}')
        if problems:
            raise ValueError('\n'.join(problems))
        self.classes = tuple(classes)
        self._rules = tuple(found)
        self._known: dict[tuple[int, int, int, int], int] = {}

    def place(self, am_type: int, kind: int, origin: int, group: int) -> int:
        """
        Return the index of the class, 0 for the most important.

        :param kind: of the reading; -1 for none.
        :param origin: node that made the packet; -1 if unknown.
        """
        key = am_type, kind, origin, group
        place = self._known.get(key)
        if place is None:
            if len(self._known) >= _REMEMBERED:
                self._known.clear()
            place = self._known[key] = self._find({
                'type': am_type, 'kind': kind, 'origin': origin, 'group': group})
        return place

    def _find(self, facts: Mapping[str, int]) -> int:
        for rule in self._rules:
            if all(any(low <= facts[fact] <= high for low, high in spans)
                   for fact, spans in rule.conditions):
                return rule.place
        return len(self.classes) - 1
