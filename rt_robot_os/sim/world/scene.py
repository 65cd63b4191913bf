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

"""The content of the world, without its walls, parsed from the strings of its settings."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.messages.survey import node
from rt_robot_os.messages.survey import numbered
from rt_robot_os.sim.world.events import parse_timed_event
from rt_robot_os.sim.world.texts import exactly
from rt_robot_os.sim.world.texts import name_of
from rt_robot_os.sim.world.texts import numbers_of

_MOST_POINTS: Final = 1000


@dataclass(frozen=True)
class WalkingRoute:
    """
    The route of a person.

    :ivar points: x and y in m; after the last follows the first.
    """

    name: str
    speed_m_s: float
    points: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class CeilingLandmark:
    """A mark on the ceiling for a localiser."""

    number: int
    x: float
    y: float
    yaw: float


@dataclass(frozen=True)
class Lamp:
    """A lamp; directly below it the light is increased by ``lux``."""

    x: float
    y: float
    lux: float


@dataclass(frozen=True)
class Heat:
    """A place that warms or cools its surroundings."""

    x: float
    y: float
    degrees: float
    radius_m: float


def way(text: str) -> WalkingRoute:
    """Parse ``anna 0.8 1.0 2.0 4.0 2.0``; raises ValueError, as do all of these."""
    name, *numbers = name_of(text), *numbers_of(text, 1)
    if len(numbers) < 3 or len(numbers) % 2 == 0 or len(numbers) > _MOST_POINTS:
        raise ValueError('must be a name, a speed in m/s and x y of each way point')
    if not 0.0 <= numbers[0] <= 20.0:
        raise ValueError(f'a speed of {numbers[0]:g} m/s: it must be from 0 to 20')
    return WalkingRoute(name, numbers[0], tuple(zip(numbers[1::2], numbers[2::2])))


def landmark(text: str) -> CeilingLandmark:
    """Parse ``24836 1.5 2.0 0.0``."""
    number, *place = exactly(text, 0, 'number x y yaw')
    if not (number.is_integer() and 0 <= number < 2 ** 31):
        raise ValueError(f'the number of a mark is {number:g}: it must be an integer from 0')
    return CeilingLandmark(int(number), *place)


def lamp(text: str) -> Lamp:
    """Parse ``2.0 3.0 400``."""
    return Lamp(*exactly(text, 0, 'x y lux'))


def heat(text: str) -> Heat:
    """Parse ``0.5 2.0 6 1.0``."""
    found = Heat(*exactly(text, 0, 'x y degrees radius'))
    if found.radius_m <= 0.0:
        raise ValueError(f'its radius is {found.radius_m:g} m: it must be above 0')
    return found


# Setting -> parser of one of its strings.
READERS: Final[Mapping[str, Callable[[str], Any]]] = {
    'people': way, 'landmarks': landmark, 'nodes': node, 'lights': lamp, 'heat': heat,
    'events': parse_timed_event,
}


def clashes(key: str, things: list[Any]) -> tuple[str, ...]:
    """Return the problem of equal names or numbers in a setting."""
    where = f'world.{key}'
    if key == 'nodes':
        try:
            numbered(things, where)
        except ConfigError as error:
            return error.problems
    attribute = {'people': 'name', 'landmarks': 'number'}.get(key)
    names = [getattr(thing, attribute) for thing in things] if attribute else []
    twice = next((name for name in names if names.count(name) > 1), None)
    return () if twice is None else (f'{where}: {twice} is listed twice',)
