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


"""Settings of the module whereabouts, and their parsers."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import REQUIRED
from rt_robot_os.base.schema import STAR
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.health.duration import duration_ns
from rt_robot_os.features.health.rule.fields import error_lines
from rt_robot_os.features.health.rule.parser import read_rule
from rt_robot_os.features.health.rule.parser import RuleError
from rt_robot_os.features.health.rule.terms import Rule
from rt_robot_os.features.health.whereabouts.activity import ActivityLimits
from rt_robot_os.features.health.whereabouts.activity import OUTSIDE
from rt_robot_os.features.health.whereabouts.place_estimate import Room
from rt_robot_os.features.health.whereabouts.place_estimate import room_of
from rt_robot_os.features.wsn.sensor_packets import PACKET_SETTINGS
from rt_robot_os.messages.cause import LEVELS
from rt_robot_os.messages.survey import SurveyedNode

_LONGEST_S: Final = 31 * 86_400.0

SETTINGS: Final = (
    Field('person', str, REQUIRED, 'Pseudonym of the person; part of the names of topics'),
    *(each for each in PACKET_SETTINGS if each.name in ('nodes_file', 'nodes')),
    Field('prefix', str, 'wsn', 'Prefix of the topics of readings, as in sensor_readings'),
    Field('pose_topic', str, '', 'Position of the person from a localisation in ROS, a '
          'geometry_msgs/msg/PoseStamped in the map; empty: none'),
    Field('pose_uncertainty_m', float, 0.5, 'Its standard deviation', 'm', 0.01, 100.0),
    Field('seen_topic', str, '', 'Sightings by the robot, such as health/anna/seen of a '
          'person_finder, a geometry_msgs/msg/PoseStamped in the map; empty: none'),
    Field('seen_uncertainty_m', float, 0.5, 'Their standard deviation', 'm', 0.01, 100.0),
    Field('network_topic', str, '', 'Topic of the network model, such as wsn/nodes, with the '
          'position or the parent of the worn node; empty: not used'),
    Field('others', list, [], 'Other people with a module of this type, whom a presence sensor '
          'may detect instead'),
    Field('node_uncertainty_m', float, 3.0, 'Distance of a person from the node that the worn '
          'node receives best', 'm', 0.1, 100.0),
    Field('presence_range_m', float, 5.0, 'Range of presence sensors', 'm', 0.1, 100.0),
    Field('timeout_s', float, 900.0, 'Age at which a position becomes unknown', 's', 1.0,
          _LONGEST_S),
    Field('rooms', list, [], "Rooms, 'kitchen 0 0 3.5 4': a name and two corners in m; of "
          f'overlapping ones the smallest counts. {OUTSIDE} is not the home'),
    Field('movement', list, [], 'Rules that detect a movement of the person while they are true, '
          "such as 'wsn/anna/acceleration_g.data moves 0.1 within 10 s'; a change of position, "
          'and presence, always count'),
    Field('still_s', float, 0.0, 'Time without movement that is a cause; 0: never', 's', 0.0,
          _LONGEST_S),
    Field('still', list, [], "The same by room, 'bed 12 h'"),
    Field('still_level', str, 'urgent', 'Level of that cause', choices=tuple(LEVELS)),
    Field('stay', list, [], "Time in a room that is a cause, 'bath 1 h'"),
    Field('stay_level', str, 'warning', 'Level of that cause', choices=tuple(LEVELS)),
    Field('exits', list, [], 'Nodes at exits: a person who is seen there last has left'),
    Field('away_s', float, 0.0, 'Time after leaving that is a cause; 0: never', 's', 0.0,
          _LONGEST_S),
    Field('away_level', str, 'urgent', 'Level of that cause, and of being outside for too long',
          choices=tuple(LEVELS)),
    Field('blind_s', float, 600.0, 'Time without any sample after which the state is unknown, so '
          'that no cause starts', 's', 1.0, _LONGEST_S),
)


def rooms_from(name: str, settings: Mapping[str, Any]) -> list[Room]:
    """
    Parse the rooms.

    :param name: of the module, for errors.
    :raises ConfigError: with all that are not valid.
    """
    found, problems = [], []
    for text in settings['rooms']:
        try:
            found.append(room_of(text))
        except ValueError as error:
            problems.append(f'{name}.rooms: {error}')
    if problems:
        raise ConfigError(problems)
    return found


def limits_from(name: str, settings: Mapping[str, Any], rooms: Iterable[Room]) -> ActivityLimits:
    """
    Parse the limits of the durations.

    :raises ConfigError: with every problem.
    """
    known = {room.name for room in rooms}
    problems: list[str] = []
    by_room: dict[str, dict[str, int]] = {'still': {}, 'stay': {}}
    for key, times in by_room.items():
        for text in settings[key]:
            room, _, length = text.strip().partition(' ')
            try:
                if room not in known:
                    raise ValueError(f'unknown room {room[:40]!r}, must be one of the setting '
                                     f'rooms: {", ".join(sorted(known)) or "it is empty"}')
                times[room] = duration_ns(length)
            except ValueError as error:
                problems.append(f'{name}.{key}: {error}; write a room and a time, bed 12 h')
    if problems:
        raise ConfigError(problems)
    return ActivityLimits(
        round(settings['still_s'] * NS_PER_S), by_room['still'], by_room['stay'],
        round(settings['away_s'] * NS_PER_S), round(settings['blind_s'] * NS_PER_S))


def movement_from(name: str, settings: Mapping[str, Any]) -> dict[str, Rule]:
    """
    Parse the rules that detect a movement, by their text.

    :raises ConfigError: one of them is not valid.
    """
    found = {}
    for text in settings['movement']:
        try:
            found[' '.join(text.split())] = read_rule(' '.join(text.split()))
        except RuleError as error:
            raise ConfigError(error_lines(f'{name}.movement', error)) from None
    return found


def check_names(name: str, settings: Mapping[str, Any], survey: Iterable[SurveyedNode]) -> None:
    """
    Check the names of nodes and people.

    :raises ConfigError: with all that do not exist.
    """
    nodes = {node.token for node in survey}
    problems = [f'{name}.exits: unknown node {each[:40]!r}, only {", ".join(sorted(nodes))}'
                for each in settings['exits'] if each not in nodes]
    if settings['person'] in settings['others']:
        problems.append(f'{name}.others contains person {settings["person"]}: remove it')
    if settings['away_s'] and not settings['exits']:
        problems.append(f'{name}.away_s: name the nodes at the exits in exits')
    if STAR in settings['prefix']:
        problems.append(f'{name}.prefix: must not contain {STAR}')
    if problems:
        raise ConfigError(problems)
