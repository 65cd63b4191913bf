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
EMERGENCIES: Final = ('fall', 'help', 'sick', 'smoke', 'call')
#: What may go wrong besides, and with what.
TROUBLES: Final = (
    'node_dies', 'node_reboots', 'path_blocked', 'lost_position', 'estop', 'battery_low',
    'core_killed', 'channel_fails', 'disk_full', 'sink_silent', 'no_free_place', 'planner_silent',
    'robot_stuck', 'camera_fails', 'noise', 'operator_drives', 'operator_sends', 'operator_says',
    'walks_off', 'presses_late')
# People meddle oftener than anything breaks.
_OFTEN: Final = (
    'estop', 'operator_drives', 'operator_sends', *3 * ('operator_says',), 'walks_off')
#: What an operator says to the agent.
ORDERS: Final = ('abort', 'stay', 'return', 'go 1')
#: Where a call of another program says that it is: somewhere, in a wall, or nowhere.
CALLERS: Final = {'door': (2.0, 2.0), 'cellar': (60.0, 60.0), 'intercom': None}
#: What somebody does when the robot asks how they are.
ANSWERS: Final = ('fine', 'help', 'silent')

# It takes so long until the last scene has been noticed; illness has to last to be believed.
_SETTLE_S: Final = 60.0
_ILL_S: Final = 240.0
# They rest where they are, in any room: who lies in the study for hours needs help.
_REST_S: Final = 5400.0


class Scene(NamedTuple):
    """
    Something that happens.

    :ivar at_s: since the beginning.
    :ivar what: of :data:`EMERGENCIES` or :data:`TROUBLES`.
    :ivar who: a person, a node, one of :data:`CALLERS`, what an operator says; empty for the
        robot.
    :ivar for_s: how long; 0 is for good.
    :ivar answer: of the person, for a fall and for a button that is pressed late.
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
    def settled_s(self) -> float:
        """Return when all of it has begun, and should have been noticed."""
        return max((each.at_s + (_ILL_S if each.what == 'sick' else _SETTLE_S)
                    for each in self.scenes), default=0.0)


def draw(number: int, emergencies: Sequence[tuple[str, str]], nodes: Sequence[str]) -> Story:
    """
    Draw a story.

    :param emergencies: what may happen, of :data:`EMERGENCIES`, and to whom or where.
    :param nodes: those that may die or reboot.
    """
    random = Random(number)
    people = sorted({who for what, who in emergencies if what in ('fall', 'help')})
    scenes = [_emergency(random, *random.choice(list(emergencies)))
              for _ in range(random.choice((1, 1, 1, 2, 2, 3)))]
    begins_s = min(each.at_s for each in scenes)
    if random.random() < 0.5:  # often one happens while the robot is busy with another
        scenes = [each._replace(at_s=min(each.at_s, begins_s + random.uniform(0.0, 45.0)))
                  for each in scenes]
    for what in random.sample((*TROUBLES, *_OFTEN), random.choice((0, 1, 2, 2, 3, 4))):
        scenes.append(_trouble(random, what, begins_s, nodes, people))
    never = random.random() < 0.15
    carer = Carer(float('inf') if never else random.uniform(5.0, 240.0),
                  random.uniform(20.0, 120.0))
    return Story(number, tuple(sorted(scenes)), carer)


def _emergency(random: Random, what: str, who: str) -> Scene:
    at_s = random.uniform(20.0, 120.0)
    if what == 'smoke':
        return Scene(at_s, what, who, random.uniform(30.0, 240.0))
    lasts_s = random.choice((0.0, random.uniform(40.0, 200.0)))
    if what == 'sick':  # a sign has to be wrong for a while to be believed
        lasts_s = random.uniform(300.0, 600.0)
    return Scene(at_s, what, who, lasts_s, random.choice(ANSWERS))


def _trouble(random: Random, what: str, begins_s: float, nodes: Sequence[str],
             people: Sequence[str]) -> Scene:
    at_s = max(1.0, begins_s + random.uniform(-15.0, 60.0))
    for_s = random.choice((0.0, random.uniform(5.0, 120.0)))
    who = answer = ''
    if what.startswith('node') and nodes:
        who = random.choice(list(nodes))
    elif what == 'core_killed':
        for_s = random.uniform(0.5, 15.0)
    elif what == 'robot_stuck':  # a state has to be long for its time to be over
        for_s = random.uniform(60.0, 600.0)
    elif what == 'operator_says':
        who, for_s = random.choice(ORDERS), 0.0
    elif what in ('walks_off', 'presses_late') and people:
        who, for_s = random.choice(list(people)), 0.0
        answer = random.choice(ANSWERS[:2]) if what == 'presses_late' else ''
    return Scene(at_s, what, who, for_s, answer)


def quiet(number: int, hours: float, people: Sequence[str], nodes: Sequence[str]) -> Story:
    """
    Draw a quiet time: people sit, sleep and walk; nodes and the core are restarted at times.

    :param people: who lives there.
    :param nodes: those that fail and come back.
    """
    random = Random(number)
    last_s = hours * 3600.0
    scenes = []
    for person in people:
        at_s = random.uniform(60.0, 1800.0)
        while at_s < last_s:
            what = random.choice(('sit', 'sit', 'sleep'))
            lasts_s = random.uniform(60.0, _REST_S)
            scenes.append(Scene(at_s, what, person, lasts_s))
            at_s += lasts_s + random.uniform(30.0, 2400.0)
    for what, each_s in (('node_dies', 2400.0), ('node_reboots', 3600.0), ('sink_silent', 7200.0),
                         ('sensor_off', 5400.0), ('core_killed', 10_800.0),
                         ('channel_fails', 9000.0), ('disk_full', 20_000.0)):
        at_s = random.expovariate(1.0 / each_s)
        while at_s < last_s:
            who = (random.choice(list(nodes)) if what.startswith('node') else
                   random.choice(list(people)) if what == 'sensor_off' else '')
            lasts_s = random.uniform(1.0, 20.0 if what == 'core_killed' else 900.0)
            scenes.append(Scene(at_s, what, who, lasts_s))
            at_s += lasts_s + random.expovariate(1.0 / each_s)
    return Story(number, tuple(sorted(scenes)), Carer(60.0, 60.0))
