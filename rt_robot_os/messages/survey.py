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
The survey of the sensor nodes: their names, positions and quantities.

A node is a string ``name x y height [id N] [on PERSON] [quantity ...]``, such as::

    nodes:
      - hall 3.0 1.5 2.2
      - bed 2.4 6.6 0.8 id 12 pulse_per_min spo2_percent battery
      - wrist 2.4 3.9 1.0 on anna pulse_per_min alarm

The position of a worn node is that of the person; the surveyed position counts while that is
unknown. The same list serves the simulated world, the network simulator and the modules that
read nodes. Ids count from 1 in the order of the list, unless an entry has ``id``.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping
from collections.abc import Sequence
from difflib import get_close_matches
import math
import re
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.messages.quantities import DEFAULT_QUANTITIES
from rt_robot_os.messages.quantities import QUANTITIES
from rt_robot_os.messages.quantities import quantity

MOST_NODES: Final = 10_000
#: 65535 is the broadcast address.
HIGHEST_ID: Final = 65_534
# Larger than any building, to detect a wrong unit.
FARTHEST_M: Final = 1e6
_MOST_QUANTITIES: Final = 16
_FORM: Final = 'name x y height [id N] [on PERSON] [quantity ...]'
_ID: Final = 'id'
_ON: Final = 'on'
_LONGEST_NAME: Final = 64
_WHOLE: Final = re.compile('[0-9]{1,5}')


class SurveyedNode(NamedTuple):
    """
    A wireless sensor node.

    :ivar name: for people; may be a number.
    :ivar x: in the map, in m.
    :ivar y: in the map, in m.
    :ivar z: height above the floor, in m.
    :ivar id: its address in packets; -1 until :func:`numbered` assigns one.
    :ivar quantities: that it measures; see :mod:`rt_robot_os.messages.quantities`.
    :ivar person: the wearer; empty for a fixed node.
    """

    name: str
    x: float
    y: float
    z: float
    id: int = -1  # noqa: A003
    quantities: tuple[str, ...] = DEFAULT_QUANTITIES
    person: str = ''

    @property
    def token(self) -> str:
        """Return its name in topics: ``hall``, and for ``12`` ``node_12``."""
        return topic_token(self.name)


def topic_token(name: str) -> str:
    """Return the name of a node in the names of its topics."""
    token = re.sub(r'\W', '_', name, flags=re.ASCII)
    return f'node_{token}' if token[:1].isdigit() else token


def node(text: str) -> SurveyedNode:
    """
    Parse an entry; commas and colons may separate its words.

    :raises ValueError: with the problem and the correct form.
    """
    words = text.replace(',', ' ').replace(':', ' ').split()
    if len(words) < 4:
        raise ValueError(f'must be: {_FORM}, such as hall 3.0 1.5 2.2')
    name, *rest = words
    if len(name) > _LONGEST_NAME:
        raise ValueError(f'its name has {len(name)} characters: at most {_LONGEST_NAME}')
    place = [_number(word) for word in rest[:3]]
    number, quantities, person = _rest(rest[3:])
    return SurveyedNode(name, place[0], place[1], place[2], number, quantities, person)


def numbered(nodes: Sequence[SurveyedNode], where: str = 'nodes', first: int = 1
             ) -> tuple[SurveyedNode, ...]:
    """
    Assign ids, and check that ids, names and topics are unique.

    :param where: the setting or file, for the errors.
    :param first: the first id.
    :raises ConfigError: with every problem.
    """
    found = tuple(each if each.id >= 0 else each._replace(id=place)
                  for place, each in enumerate(nodes, first))
    problems = []
    if len(found) > MOST_NODES:
        problems.append(f'{where}: {len(found)} nodes: at most {MOST_NODES}')
    names: dict[str, SurveyedNode] = {}
    ids: dict[int, SurveyedNode] = {}
    for each in found:
        other = names.setdefault(each.token, each)
        if other is not each:
            problems.append(
                f'{where}: {each.name} is listed twice' if other.name == each.name else
                f'{where}: {other.name} and {each.name} would have the same topics, '
                f'wsn/{each.token}/...: rename one of them')
            continue
        other = ids.setdefault(each.id, each)
        if other is not each:
            problems.append(
                f'{where}: {other.name} and {each.name} both have the id {each.id}: ids count '
                'from 1 in the order of the list; write "id N" for another one')
    if problems:
        raise ConfigError(problems)
    return found


def survey_of(texts: Iterable[str], where: str = 'nodes', first: int = 1
              ) -> tuple[SurveyedNode, ...]:
    """
    Parse a list of entries.

    :param where: the setting or file, for the errors.
    :param first: id of the first.
    :raises ConfigError: with every problem; each names its entry.
    """
    found, problems = [], []
    for text in texts:
        try:
            found.append(node(text))
        except ValueError as error:
            problems.append(f'{where}: {text[:80]!r}: {error}')
    if problems:
        raise ConfigError(problems)
    return numbered(found, where, first)


def read_survey(text: str, name: str) -> tuple[SurveyedNode, ...]:
    """
    Parse the content of a YAML file: a list of entries, at its top or below ``nodes``.

    :param name: of the file, for the errors.
    :raises ConfigError: with every problem.
    """
    import yaml
    try:
        content = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ConfigError([f'{name} is not valid YAML: {error}']) from error
    if isinstance(content, Mapping):
        content = content.get('nodes')
    if not isinstance(content, list) or not content:
        raise ConfigError([f'{name} contains no nodes: write "nodes:" and below it lines such as '
                           f'"- hall 3.0 1.5 2.2" ({_FORM})'])
    wrong = [f'{name}: entry {place} must be a string, {_FORM}'
             for place, each in enumerate(content, 1) if not isinstance(each, str)]
    if wrong:
        raise ConfigError(wrong)
    return survey_of(content, name)


def text_of(each: SurveyedNode) -> str:
    """Return the entry that :func:`node` parses as this node."""
    words: list[Any] = [each.name, repr(each.x), repr(each.y), repr(each.z)]
    if each.id >= 0:
        words += [_ID, each.id]
    if each.person:
        words += [_ON, each.person]
    return ' '.join(map(str, [*words, *each.quantities]))


def _rest(words: list[str]) -> tuple[int, tuple[str, ...], str]:
    """Return the id, -1 without one, the quantities and the wearer."""
    number, quantities, person = -1, [], ''
    left = iter(words)
    for word in left:
        if word == _ID:
            given = next(left, '')
            if not _WHOLE.fullmatch(given) or int(given) > HIGHEST_ID:
                raise ValueError(f'id {given[:20]!r}: must be an integer from 0 to {HIGHEST_ID}')
            if number >= 0:
                raise ValueError('"id" is given twice')
            number = int(given)
        elif word == _ON:
            if person:
                raise ValueError('"on" is given twice')
            person = next(left, '')
            if not person:
                raise ValueError('no name after "on": write the wearer, such as on anna')
        elif word in quantities:
            raise ValueError(f'{word[:40]} is listed twice')
        else:
            quantities.append(_quantity_name(word))
    if len(quantities) > _MOST_QUANTITIES:
        raise ValueError(f'{len(quantities)} quantities: at most {_MOST_QUANTITIES}')
    return number, tuple(quantities) or DEFAULT_QUANTITIES, person


def _quantity_name(word: str) -> str:
    name = quantity(word).name
    if name not in QUANTITIES:
        close = get_close_matches(name, QUANTITIES, 1, 0.8)
        # temperature_2 is a quantity of the user; temprature is a typing error.
        if close and not name.startswith(close[0]):
            raise ValueError(f'unknown quantity {name!r}: did you mean {close[0]}?')
    return name


def _number(word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not abs(value) <= FARTHEST_M:
        raise ValueError(f'{word[:40]!r} is not a valid coordinate: must be: {_FORM}')
    return value
