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


"""The people of the world: their events, and their detection by sensors."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence
import math
from typing import Final

from rt_robot_os.sim.world.events import SILENT
from rt_robot_os.sim.world.events import WorldEvent
from rt_robot_os.sim.world.people import LYING_M
from rt_robot_os.sim.world.people import SimulatedPerson
from rt_robot_os.sim.world.scene import WalkingRoute
from rt_robot_os.sim.world.wireless import PRESS

#: The event that ends a set vital sign.
USUAL: Final = 'usual'
# Delay from a fall to the press of the button.
_REPLY_S: Final = 8.0
# A motion detector detects motion within this time and distance.
_STILL_S: Final = 2.0
_DETECTOR_M: Final = 6.0
# The wall that carries a detector does not hide people from it.
_WALL_M: Final = 0.3
# Margin beyond head and feet in the search of room to lie.
_ROOM_M: Final = 0.3

# Returns the distance of a wall, from x and y in a direction.
Room = Callable[[float, float, float], float]


class PeopleModel:
    """
    All people of a world.

    :ivar people: all of them.
    """

    def __init__(self, ways: Sequence[WalkingRoute], seed: int, room_m: Room) -> None:
        """
        Put all people at the beginning of their routes.

        :param room_m: returns the distance of a wall, from x and y in a direction.
        """
        self.people = tuple(SimulatedPerson(way, seed) for way in ways)
        self._room_m = room_m

    def find(self, name: str) -> SimulatedPerson | None:
        """Return the person of a name."""
        return next((each for each in self.people if each.name == name), None)

    def problem(self, name: str) -> str | None:
        """Return why no event can apply to a person of this name."""
        if self.find(name) is not None:
            return None
        names = [person.name for person in self.people]
        return f'there is no such person; there are {", ".join(names) or "none"}'

    def apply(self, what: WorldEvent) -> WorldEvent | None:
        """
        Apply an event to a person.

        :return: the event that ends it, after its duration; None if there is none.
        :raises KeyError: the name is unknown; :meth:`problem` reports that before.
        """
        person = self.find(what.name)
        if person is None:
            raise KeyError(what.name)
        follows: WorldEvent | None = None
        if what.kind == 'person':
            person.stand(*what.numbers)
            follows = WorldEvent('walk', what.name, ())
        elif what.kind == 'walk':
            person.walk()
        elif what.kind == 'rise':
            person.rise()
        elif what.kind == 'fall':
            person.fall(self._lying(person))
            follows = WorldEvent('rise', what.name, ())
        elif what.kind in ('sit', 'sleep'):
            if what.kind == 'sit':
                person.sit()
            else:
                person.sleep(self._lying(person))
            follows = WorldEvent('rise', what.name, ())
        elif what.kind == 'speak':
            person.speaks_until_s = person.time_s + what.for_s
        elif what.kind == 'vital':
            person.vitals.set(what.word, *what.numbers)
            follows = WorldEvent(USUAL, what.name, (), word=what.word)
        elif what.kind == USUAL:
            person.vitals.clear(what.word)
        else:
            person.answer = what.word
        return follows

    def reaction(self, what: WorldEvent) -> WorldEvent | None:
        """Return a person's delayed reaction to an event."""
        person = self.find(what.name)
        if person is None or person.answer == SILENT or what.kind not in ('fall', 'answer'):
            return None
        if what.kind == 'answer' and not person.lies:
            return None
        for_s = _REPLY_S if what.kind == 'fall' else 0.0
        return WorldEvent(PRESS, what.name, (), for_s=for_s, word=person.answer)

    def _lying(self, person: SimulatedPerson) -> float:
        """Return the direction with the most room to lie: ahead, if there is enough."""
        def room(heading: float) -> float:
            found = min(self._room_m(person.x, person.y, heading),
                        self._room_m(person.x, person.y, heading + math.pi))
            return min(found, LYING_M / 2 + _ROOM_M)

        return max((person.heading + turn * math.pi / 4 for turn in range(4)), key=room)

    def in_sight(self, x: float, y: float, there_x: float, there_y: float) -> bool:
        """Return whether no wall is between two positions, except the one at the second."""
        away = math.hypot(there_x - x, there_y - y)
        return self._room_m(x, y, math.atan2(there_y - y, there_x - x)) >= away - _WALL_M

    def noticed(self, x: float, y: float) -> bool:
        """Return whether a motion detector at a position detects a person's motion."""
        return any(
            person.time_s - person.moved_s <= _STILL_S
            and math.hypot(person.x - x, person.y - y) <= _DETECTOR_M
            and self.in_sight(person.x, person.y, x, y) for person in self.people)
