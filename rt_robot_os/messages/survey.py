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
The survey of the sensor nodes: names, positions and quantities.

A node is one string, ``name x y height [id N] [on PERSON] [quantity ...]``, such as::

    nodes:
      - hall 3.0 1.5 2.2
      - bed 2.4 6.6 0.8 id 12 pulse_per_min spo2_percent battery
      - wrist 2.4 3.9 1.0 on anna pulse_per_min alarm

A node that a person wears is where the person is; its position counts while that is unknown.

The same list serves the simulated world, the simulator of networks and the modules that read
nodes. Nodes are numbered from 1 in the order of the list, where a string has no other number.
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
# No building is larger; a wrong unit is noticed.
FARTHEST_M: Final = 1e6
_MOST_QUANTITIES: Final = 16
_FORM: Final = 'name x y height [id N] [on PERSON] [quantity ...]'
_ID: Final = 'id'
_ON: Final = 'on'
_LONGEST_NAME: Final = 64
_WHOLE: Final = re.compile('[0-9]{1,5}')


class SurveyedNode(NamedTuple):
    """
    A wireless node at a surveyed position.

    :ivar name: for people; may be a number.
    :ivar x: in the map, in m.
    :ivar y: in the map, in m.
    :ivar z: height above the floor, in m.
    :ivar id: its address, which is in its packets; -1 until :func:`numbered` gives one.
    :ivar quantities: what it measures; see :mod:`rt_robot_os.messages.quantities`.
    :ivar person: the person who wears it; empty for a fixed one.
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
        """Return its name as part of a topic's name; ``12`` and ``hall-2`` are changed."""
        return topic_token(self.name)


def topic_token(name: str) -> str:
    """Return the part of the names of its topics that stands for a node."""
    token = re.sub(r'\W', '_', name, flags=re.ASCII)
    return f'node_{token}' if token[:1].isdigit() else token


def node(text: str) -> SurveyedNode:
    """
    Parse one string; commas and colons may separate its words.

    :raises ValueError: with what is wrong, and an example.
    """
    words = text.replace(',', ' ').replace(':', ' ').split()
    if len(words) < 4:
        raise ValueError(f'must be: {_FORM}, such as hall 3.0 1.5 2.2')
    name, *rest = words
    if len(name) > _LONGEST_NAME:
        raise ValueError(f'its name has {len(name)} letters: {_LONGEST_NAME} are the most')
    place = [_number(word) for word in rest[:3]]
    number, quantities, person = _rest(rest[3:])
    return SurveyedNode(name, place[0], place[1], place[2], number, quantities, person)


def numbered(nodes: Sequence[SurveyedNode], where: str = 'nodes', first: int = 1
             ) -> tuple[SurveyedNode, ...]:
    """
    Give the nodes numbers, and check that no number, name or topic occurs twice.

    :param where: the setting or file, for the errors.
    :param first: number of the first.
    :raises ConfigError: with every problem.
    """
    found = tuple(each if each.id >= 0 else each._replace(id=place)
                  for place, each in enumerate(nodes, first))
    problems = []
    if len(found) > MOST_NODES:
        problems.append(f'{where}: {len(found)} nodes: {MOST_NODES} are the most')
    names: dict[str, SurveyedNode] = {}
    ids: dict[int, SurveyedNode] = {}
    for each in found:
        other = names.setdefault(each.token, each)
        if other is not each:
            problems.append(
                f'{where}: {each.name} is there twice' if other.name == each.name else
                f'{where}: {other.name} and {each.name} would have the same topics, '
                f'wsn/{each.token}/...: give one of them another name')
            continue
        other = ids.setdefault(each.id, each)
        if other is not each:
            problems.append(
                f'{where}: {other.name} and {each.name} both have the number {each.id}: numbers '
                'count from 1 in the order of the list; write "id N" to give another')
    if problems:
        raise ConfigError(problems)
    return found


def survey_of(texts: Iterable[str], where: str = 'nodes', first: int = 1
              ) -> tuple[SurveyedNode, ...]:
    """
    Parse a list of strings.

    :param where: the setting or file, for the errors.
    :param first: number of the first.
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
    Parse the content of a YAML file: a list of strings, at its top or below ``nodes``.

    :param name: of the file, for the errors.
    :raises ConfigError: with every problem.
    """
    import yaml
    try:
        content = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ConfigError([f'{name} is no YAML: {error}']) from error
    if isinstance(content, Mapping):
        content = content.get('nodes')
    if not isinstance(content, list) or not content:
        raise ConfigError([f'{name} holds no nodes: write "nodes:" and below it lines such as '
                           f'"- hall 3.0 1.5 2.2" ({_FORM})'])
    wrong = [f'{name}: the node at place {place} must be a text, {_FORM}'
             for place, each in enumerate(content, 1) if not isinstance(each, str)]
    if wrong:
        raise ConfigError(wrong)
    return survey_of(content, name)


def text_of(each: SurveyedNode) -> str:
    """Return a string that :func:`node` parses as this node."""
    words: list[Any] = [each.name, repr(each.x), repr(each.y), repr(each.z)]
    if each.id >= 0:
        words += [_ID, each.id]
    if each.person:
        words += [_ON, each.person]
    return ' '.join(map(str, [*words, *each.quantities]))


def _rest(words: list[str]) -> tuple[int, tuple[str, ...], str]:
    """Return the number, -1 without, the quantities, and the person who wears it."""
    number, quantities, person = -1, [], ''
    left = iter(words)
    for word in left:
        if word == _ID:
            said = next(left, '')
            if not _WHOLE.fullmatch(said) or int(said) > HIGHEST_ID:
                raise ValueError(f'id {said[:20]!r}: it must be an integer from 0 to '
                                 f'{HIGHEST_ID}')
            if number >= 0:
                raise ValueError('two numbers: "id" may stand once')
            number = int(said)
        elif word == _ON:
            if person:
                raise ValueError('two people: "on" may stand once')
            person = next(left, '')
            if not person:
                raise ValueError('no person after "on": name the person who wears it, such as '
                                 'on anna')
        elif word in quantities:
            raise ValueError(f'{word[:40]} is there twice')
        else:
            quantities.append(_quantity_name(word))
    if len(quantities) > _MOST_QUANTITIES:
        raise ValueError(f'{len(quantities)} quantities: {_MOST_QUANTITIES} are the most')
    return number, tuple(quantities) or DEFAULT_QUANTITIES, person


def _quantity_name(word: str) -> str:
    name = quantity(word).name
    if name not in QUANTITIES:
        close = get_close_matches(name, QUANTITIES, 1, 0.8)
        # temperature_2 is a quantity of the user; temprature is a typing error.
        if close and not name.startswith(close[0]):
            raise ValueError(f'{name!r} is not a quantity: did you mean {close[0]}?')
    return name


def _number(word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not abs(value) <= FARTHEST_M:
        raise ValueError(f'{word[:40]!r} is not a valid number: it must be: {_FORM}')
    return value
