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
Random stories of emergencies: what happens to people, to the robot, to the network, and who helps.

A story is drawn from one number, so that each can be told again.
"""

from __future__ import annotations

from collections.abc import Sequence
from random import Random
from typing import Final
from typing import NamedTuple

#: What may happen to people and to the home; each asks for help.
EMERGENCIES: Final = ('fall', 'help', 'sick', 'smoke')
#: What may go wrong besides, and with what.
TROUBLES: Final = (
    'node_dies', 'node_reboots', 'path_blocked', 'lost_position', 'estop', 'battery_low',
    'core_killed', 'channel_fails', 'disk_full', 'sink_silent', 'no_free_place')
#: What somebody does when the robot asks how they are.
ANSWERS: Final = ('fine', 'help', 'silent')


class Scene(NamedTuple):
    """
    Something that happens.

    :ivar at_s: since the beginning.
    :ivar what: of :data:`EMERGENCIES` or :data:`TROUBLES`.
    :ivar who: a person, a node; empty for the robot.
    :ivar for_s: how long; 0 is for good.
    :ivar answer: of the person, for a fall.
    """

    at_s: float
    what: str
    who: str = ''
    for_s: float = 0.0
    answer: str = ''


class Carer(NamedTuple):
    """
    Somebody who is told of alarms.

    :ivar reads_after_s: from the message to the acknowledgement; infinite for one who never looks.
    :ivar ends_after_s: from there to the end of the emergency.
    """

    reads_after_s: float
    ends_after_s: float


class Story(NamedTuple):
    """
    One story.

    :ivar number: from which it was drawn.
    :ivar scenes: in the order of their times.
    :ivar carer: who is told.
    """

    number: int
    scenes: tuple[Scene, ...]
    carer: Carer

    @property
    def last_s(self) -> float:
        """Return when the last of it has begun."""
        return max((each.at_s for each in self.scenes), default=0.0)


def draw(number: int, people: Sequence[str], rooms: Sequence[str], nodes: Sequence[str]) -> Story:
    """
    Draw a story.

    :param people: who lives there.
    :param rooms: the nodes that smell smoke; empty for none.
    :param nodes: those that may die or reboot.
    """
    random = Random(number)
    scenes = [_emergency(random, people, rooms) for _ in range(random.choice((1, 1, 1, 2, 2, 3)))]
    begins_s = min(each.at_s for each in scenes)
    for what in random.sample(TROUBLES, random.choice((0, 1, 1, 2, 3))):
        scenes.append(_trouble(random, what, begins_s, nodes))
    never = random.random() < 0.15
    carer = Carer(float('inf') if never else random.uniform(5.0, 240.0),
                  random.uniform(20.0, 120.0))
    return Story(number, tuple(sorted(scenes)), carer)


def _emergency(random: Random, people: Sequence[str], rooms: Sequence[str]) -> Scene:
    what = random.choice(EMERGENCIES if rooms else EMERGENCIES[:-1])
    at_s = random.uniform(20.0, 120.0)
    if what == 'smoke':
        return Scene(at_s, what, random.choice(list(rooms)), random.uniform(30.0, 240.0))
    lasts_s = random.choice((0.0, random.uniform(40.0, 200.0)))
    return Scene(at_s, what, random.choice(list(people)), lasts_s, random.choice(ANSWERS))


def _trouble(random: Random, what: str, begins_s: float, nodes: Sequence[str]) -> Scene:
    at_s = max(1.0, begins_s + random.uniform(-15.0, 60.0))
    who = random.choice(list(nodes)) if what.startswith('node') and nodes else ''
    for_s = random.choice((0.0, random.uniform(5.0, 120.0)))
    if what == 'core_killed':
        for_s = random.uniform(0.5, 15.0)
    return Scene(at_s, what, who, for_s)
