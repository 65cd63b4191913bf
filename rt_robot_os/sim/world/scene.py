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

"""What is in the world besides its walls, read from the texts of its settings."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from dataclasses import dataclass
import math
import re
from typing import Any
from typing import Final

from rt_robot_os.errors import ConfigError
from rt_robot_os.wsn.survey import node
from rt_robot_os.wsn.survey import numbered

# Farther away than anything in a map.
_FARTHEST: Final = 1e6
_MOST_POINTS: Final = 1000
_LONGEST_S: Final = 1e6
_NAME: Final = re.compile(r'[A-Za-z_]\w{0,63}', re.ASCII)
_TIMES: Final = re.compile(r'(.*\S)\s+at\s+(\S+)(?:\s+for\s+(\S+))?')


@dataclass(frozen=True)
class Way:
    """
    Who walks where.

    :ivar points: x and y in m; after the last comes the first again.
    """

    name: str
    speed_m_s: float
    points: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Landmark:
    """A mark on the ceiling that a localiser reads."""

    number: int
    x: float
    y: float
    yaw: float


@dataclass(frozen=True)
class Lamp:
    """What gives light; straight below it the light is ``lux`` more."""

    x: float
    y: float
    lux: float


@dataclass(frozen=True)
class Heat:
    """What makes its surroundings warmer, or colder."""

    x: float
    y: float
    degrees: float
    radius_m: float


@dataclass(frozen=True)
class Happening:
    """
    Something that happens to the world.

    :ivar kind: ``kidnap``, ``person``, ``walk``, ``slip``, ``lamp``, ``alarm``, or such as
        ``node off``.
    :ivar name: of whom or of which node; empty where there is nobody.
    :ivar numbers: the numbers that follow.
    :ivar for_s: how long; 0 is for good.
    """

    kind: str
    name: str
    numbers: tuple[float, ...]
    at_s: float = 0.0
    for_s: float = 0.0


# kind -> what follows it: whether a name, and what the numbers are.
_HAPPENINGS: Final[Mapping[str, tuple[bool, tuple[str, ...]]]] = {
    'kidnap': (False, ('X', 'Y', 'YAW')),
    'person': (True, ('X', 'Y')),
    'walk': (True, ()),
    'slip': (False, ('SHARE',)),
    'lamp': (False, ('SHARE',)),
    'node off': (True, ()),
    'node on': (True, ()),
    'node reboot': (True, ()),
    'node move': (True, ('X', 'Y')),
    'alarm': (True, ()),
}
_LASTING: Final = ('person', 'slip', 'lamp', 'node off', 'alarm')
# What it is done to stands before what is done, as in "node kitchen off".
_NODE: Final = 'node'
HAPPENINGS: Final = '; '.join(
    ' '.join([*kind.split()[:1], *(['NAME'] if named else []), *kind.split()[1:], *numbers,
              *(['[SECONDS]'] if kind in _LASTING else [])])
    for kind, (named, numbers) in _HAPPENINGS.items())
#: What happens to wireless nodes.
OF_NODES: Final = frozenset({'alarm', *(kind for kind in _HAPPENINGS if kind.startswith(_NODE))})


def _words(text: str) -> list[str]:
    """Take a text apart; colons and commas may stand between, as in the driver's landmarks."""
    return text.replace(',', ' ').replace(':', ' ').split()


def way(text: str) -> Way:
    """Read such as ``anna 0.8 1.0 2.0 4.0 2.0``; raises ValueError, as do all of these."""
    name, *numbers = _name(text), *_numbers(text, 1)
    if len(numbers) < 3 or len(numbers) % 2 == 0 or len(numbers) > _MOST_POINTS:
        raise ValueError('must be a name, a speed in m/s and x y of each way point')
    if not 0.0 <= numbers[0] <= 20.0:
        raise ValueError(f'a speed of {numbers[0]:g} m/s: it must be from 0 to 20')
    return Way(name, numbers[0], tuple(zip(numbers[1::2], numbers[2::2])))


def landmark(text: str) -> Landmark:
    """Read such as ``24836 1.5 2.0 0.0``."""
    number, *place = _exactly(text, 0, 'number x y yaw')
    if not (number.is_integer() and 0 <= number < 2 ** 31):
        raise ValueError(f'the number of a mark is {number:g}: it must be a whole one from 0')
    return Landmark(int(number), *place)


def lamp(text: str) -> Lamp:
    """Read such as ``2.0 3.0 400``."""
    return Lamp(*_exactly(text, 0, 'x y lux'))


def heat(text: str) -> Heat:
    """Read such as ``0.5 2.0 6 1.0``."""
    found = Heat(*_exactly(text, 0, 'x y degrees radius'))
    if found.radius_m <= 0.0:
        raise ValueError(f'its radius is {found.radius_m:g} m: it must be above 0')
    return found


def event(text: str) -> Happening:
    """Read such as ``person anna 2.0 1.0 at 12 for 4``."""
    match = _TIMES.fullmatch(text.strip())
    if match is None:
        raise ValueError('must end with "at SECONDS" or "at SECONDS for SECONDS"')
    words = _words(match[1])
    at_s = _seconds(match[2])
    for_s = _seconds(match[3]) if match[3] else 0.0
    found = happening(words)
    if match[3] and (found.kind not in _LASTING or not for_s):
        raise ValueError(f'{found.kind} lasts no time' if for_s else 'must last more than 0 s')
    return Happening(found.kind, found.name, found.numbers, at_s, for_s)


def happening(words: list[str]) -> Happening:
    """Read such as ``person anna 2.0 1.0`` or, with seconds at the end, ``person anna 2 1 4``."""
    if len(words) > 2 and words[0] == _NODE:
        words = [f'{_NODE} {words[2]}', words[1], *words[3:]]
    kind = words[0] if words else ''
    if kind not in _HAPPENINGS:
        raise ValueError(f'{kind!r} does not happen here: write {HAPPENINGS}')
    named, wanted = _HAPPENINGS[kind]
    name = words[1] if named and len(words) > 1 else ''
    numbers = _numbers(' '.join(words[1 + named:]), 0)
    seconds = 0.0
    if kind in _LASTING and len(numbers) == len(wanted) + 1:
        seconds = numbers.pop()
    if len(numbers) != len(wanted) or named and not name or not 0.0 <= seconds <= _LONGEST_S:
        raise ValueError(f'must be one of: {HAPPENINGS}')
    if wanted == ('SHARE',) and not 0.0 <= numbers[0] <= 1.0:
        raise ValueError(f'a share of {numbers[0]:g}: it must be from 0 to 1')
    return Happening(kind, name, tuple(numbers), for_s=seconds)


# Setting -> what reads one of its texts.
READERS: Final[Mapping[str, Callable[[str], Any]]] = {
    'people': way, 'landmarks': landmark, 'nodes': node, 'lights': lamp, 'heat': heat,
    'events': event,
}


def clashes(key: str, things: list[Any]) -> tuple[str, ...]:
    """Say which of the things of a setting have the same name or number."""
    where = f'world.{key}'
    if key == 'nodes':
        try:
            numbered(things, where)
        except ConfigError as error:
            return error.problems
    attribute = {'people': 'name', 'landmarks': 'number'}.get(key)
    names = [getattr(thing, attribute) for thing in things] if attribute else []
    twice = next((name for name in names if names.count(name) > 1), None)
    return () if twice is None else (f'{where}: {twice} is there twice',)


def _name(text: str) -> str:
    words = _words(text)
    if not words or not _NAME.fullmatch(words[0]):
        raise ValueError('must begin with a name: a letter, then letters, digits and _')
    return words[0]


def _numbers(text: str, skip: int) -> list[float]:
    found = []
    for word in _words(text)[skip:]:
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not abs(value) <= _FARTHEST:
            raise ValueError(f'{word[:40]!r} is no number that can be used')
        found.append(value)
    return found


def _exactly(text: str, skip: int, wanted: str) -> list[float]:
    numbers = _numbers(text, skip)
    if len(numbers) != len(wanted.split()) - skip:
        raise ValueError(f'must be: {wanted}')
    return numbers


def _seconds(word: str) -> float:
    found, = _numbers(word, 0)
    if not 0.0 <= found <= _LONGEST_S:
        raise ValueError(f'{word} s: it must be from 0 to {_LONGEST_S:g}')
    return found
