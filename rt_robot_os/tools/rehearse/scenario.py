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
Random scenarios: emergencies, faults and interventions, and the reactions of a caregiver.

A scenario is generated from its seed, so it can be repeated.
"""

from __future__ import annotations

from collections.abc import Sequence
from random import Random
from typing import Final
from typing import NamedTuple

#: Emergencies of people and of the home.
EMERGENCIES: Final = ('fall', 'help', 'sick', 'smoke', 'call')
#: Faults and interventions.
FAULTS: Final = (
    'node_dies', 'node_reboots', 'path_blocked', 'lost_position', 'estop', 'battery_low',
    'core_killed', 'channel_fails', 'disk_full', 'sink_silent', 'no_free_place', 'planner_silent',
    'robot_stuck', 'camera_fails', 'noise', 'operator_drives', 'operator_sends', 'operator_says',
    'walks_off', 'presses_late')
# Interventions of people are more frequent than faults.
_OFTEN: Final = (
    'estop', 'operator_drives', 'operator_sends', *3 * ('operator_says',), 'walks_off')
#: Commands of an operator to the agent.
ORDERS: Final = ('abort', 'stay', 'return', 'go 1')
#: Positions of calls by other programs: free, in a wall, or none.
CALLERS: Final = {'door': (2.0, 2.0), 'cellar': (60.0, 60.0), 'intercom': None}
#: Answers of a person whom the robot asks.
ANSWERS: Final = ('fine', 'help', 'silent')

# Time until the last occurrence is detected; illness is detected only after a while.
_SETTLE_S: Final = 60.0
_ILL_S: Final = 240.0
# Limit, because a person who lies in a room for hours is an emergency for some rules.
_REST_S: Final = 5400.0


class Occurrence(NamedTuple):
    """
    An emergency, a fault or an intervention.

    :ivar at_s: time since the start.
    :ivar what: of :data:`EMERGENCIES` or :data:`FAULTS`.
    :ivar who: a person, a node, one of :data:`CALLERS` or a command of an operator; empty for
        the robot.
    :ivar for_s: its duration; 0: it does not end.
    :ivar answer: of the person, for a fall and for a button pressed late.
    """

    at_s: float
    what: str
    who: str = ''
    for_s: float = 0.0
    answer: str = ''


class CaregiverProfile(NamedTuple):
    """
    The reaction times of a caregiver.

    :ivar reads_after_s: from the message to the acknowledgement; infinite: never.
    :ivar ends_after_s: from there to the end of the emergency.
    """

    reads_after_s: float
    ends_after_s: float


class CareScenario(NamedTuple):
    """
    One scenario.

    :ivar seed: of its random numbers.
    :ivar occurrences: in order of time.
    :ivar caregiver: who is notified.
    """

    seed: int
    occurrences: tuple[Occurrence, ...]
    caregiver: CaregiverProfile

    @property
    def settled_s(self) -> float:
        """Return the time at which all has started and should be detected."""
        return max((each.at_s + (_ILL_S if each.what == 'sick' else _SETTLE_S)
                    for each in self.occurrences), default=0.0)


def random_scenario(seed: int, emergencies: Sequence[tuple[str, str]], nodes: Sequence[str]
                    ) -> CareScenario:
    """
    Generate a scenario.

    :param emergencies: possible ones of :data:`EMERGENCIES`, with their person or place.
    :param nodes: nodes that may die or reboot.
    """
    random = Random(seed)
    people = sorted({who for what, who in emergencies if what in ('fall', 'help')})
    found = [_emergency(random, *random.choice(list(emergencies)))
             for _ in range(random.choice((1, 1, 1, 2, 2, 3)))]
    begins_s = min(each.at_s for each in found)
    if random.random() < 0.5:  # often one starts during another
        found = [each._replace(at_s=min(each.at_s, begins_s + random.uniform(0.0, 45.0)))
                 for each in found]
    for what in random.sample((*FAULTS, *_OFTEN), random.choice((0, 1, 2, 2, 3, 4))):
        found.append(_fault(random, what, begins_s, nodes, people))
    never = random.random() < 0.15
    caregiver = CaregiverProfile(float('inf') if never else random.uniform(5.0, 240.0),
                                 random.uniform(20.0, 120.0))
    return CareScenario(seed, tuple(sorted(found)), caregiver)


def _emergency(random: Random, what: str, who: str) -> Occurrence:
    at_s = random.uniform(20.0, 120.0)
    if what == 'smoke':
        return Occurrence(at_s, what, who, random.uniform(30.0, 240.0))
    lasts_s = random.choice((0.0, random.uniform(40.0, 200.0)))
    if what == 'sick':  # a vital sign must be abnormal for a while
        lasts_s = random.uniform(300.0, 600.0)
    return Occurrence(at_s, what, who, lasts_s, random.choice(ANSWERS))


def _fault(random: Random, what: str, begins_s: float, nodes: Sequence[str],
           people: Sequence[str]) -> Occurrence:
    at_s = max(1.0, begins_s + random.uniform(-15.0, 60.0))
    for_s = random.choice((0.0, random.uniform(5.0, 120.0)))
    who = answer = ''
    if what.startswith('node') and nodes:
        who = random.choice(list(nodes))
    elif what == 'core_killed':
        for_s = random.uniform(0.5, 15.0)
    elif what == 'robot_stuck':  # longer than the time limits of states
        for_s = random.uniform(60.0, 600.0)
    elif what == 'operator_says':
        who, for_s = random.choice(ORDERS), 0.0
    elif what in ('walks_off', 'presses_late') and people:
        who, for_s = random.choice(list(people)), 0.0
        answer = random.choice(ANSWERS[:2]) if what == 'presses_late' else ''
    return Occurrence(at_s, what, who, for_s, answer)


def quiet_scenario(seed: int, hours: float, people: Sequence[str], nodes: Sequence[str]
                   ) -> CareScenario:
    """
    Generate quiet hours: people sit, sleep and walk; nodes, channels and the core sometimes fail.

    :param people: names of the residents.
    :param nodes: nodes that fail and recover.
    """
    random = Random(seed)
    last_s = hours * 3600.0
    found = []
    for person in people:
        at_s = random.uniform(60.0, 1800.0)
        while at_s < last_s:
            what = random.choice(('sit', 'sit', 'sleep'))
            lasts_s = random.uniform(60.0, _REST_S)
            found.append(Occurrence(at_s, what, person, lasts_s))
            at_s += lasts_s + random.uniform(30.0, 2400.0)
    for what, each_s in (('node_dies', 2400.0), ('node_reboots', 3600.0), ('sink_silent', 7200.0),
                         ('sensor_off', 5400.0), ('core_killed', 10_800.0),
                         ('channel_fails', 9000.0), ('disk_full', 20_000.0)):
        at_s = random.expovariate(1.0 / each_s)
        while at_s < last_s:
            who = (random.choice(list(nodes)) if what.startswith('node') else
                   random.choice(list(people)) if what == 'sensor_off' else '')
            lasts_s = random.uniform(1.0, 20.0 if what == 'core_killed' else 900.0)
            found.append(Occurrence(at_s, what, who, lasts_s))
            at_s += lasts_s + random.expovariate(1.0 / each_s)
    return CareScenario(seed, tuple(sorted(found)), CaregiverProfile(60.0, 60.0))
