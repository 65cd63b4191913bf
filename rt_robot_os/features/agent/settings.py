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

"""The settings of the agent, and the objects made from them."""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import declared
from rt_robot_os.base.schema import Field
from rt_robot_os.features.agent.agent import AgentContext
from rt_robot_os.features.agent.inputs import Location
from rt_robot_os.features.agent.standoff import StandoffPlanner
from rt_robot_os.features.agent.tuning import AgentTuning
from rt_robot_os.messages.survey import SurveyedNode
from rt_robot_os.modules.command_age import COMMAND_AGE
from rt_robot_os.motion.clearing import Clearing
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.grid_map import GridMap

ORDERS: Final = ('picture', 'clip', 'sound')

SETTINGS: Final = (
    Field('decision_rate_hz', float, 20.0, 'Rate of decisions during an emergency; alarms and '
          'commands wake it in addition', 'Hz', 1.0, 100.0),
    Field('people', list, [], 'Persons; the location of each comes on health/NAME/place'),
    Field('nodes_file', str, '', 'The survey of the nodes: a YAML file with nodes, such as that '
          'of a simulated world; each is "name x y height [id N] [on PERSON] [quantity ...]"',
          is_file=True),
    Field('nodes', list, [], 'More nodes, or all, as strings of that form'),
    Field('map', str, '', 'The map for choosing where to stand: a YAML file as map_saver '
          'writes it; with neither this nor map_topic walls are not known', is_file=True),
    Field('map_topic', str, '', 'Topic of a growing map, nav_msgs/msg/OccupancyGrid; map is '
          'used for areas that it does not cover yet'),
    Field('robot_radius_m', float, 0.22, 'Radius around base_link that must be free where it '
          'stands',
          'm', 0.0, 10.0),
    Field('clearance_m', float, 0.2, 'Additional distance that must be free', 'm', 0.0, 5.0),
    COMMAND_AGE,
    Field('home', list, [], 'Pose to return to: x, y in m and the heading in degrees, on the '
          'map; empty: where it came from', item=float),
    Field('operator_sources', list, ['teleop'], 'Sources of the velocity multiplexer that are '
          'people'),
    Field('observe', list, list(ORDERS), 'What the observer records; empty: nothing',
          choices=ORDERS),
    Field('ignored_kinds', list, ['test'], 'Kinds of causes; alarms of only these are ignored'),
    Field('answer_topics', list, [], 'Buttons by which people answer, each a '
          'std_msgs/msg/Float64 of the quantity alarm: 1 help, 2 all is well; such as '
          'wsn/wrist/alarm'),
    Field('name', str, 'robot', 'Name of the robot in commands and causes'),
    *declared(AgentTuning),
)


def clearing_of(settings: Mapping[str, Any], grid: GridMap | None) -> Clearing | None:
    """Return where the robot may stand on a map; None without a map."""
    s = settings
    return Clearing(grid, s['robot_radius_m'] + s['clearance_m']) if grid is not None else None


def context_of(name: str, settings: Mapping[str, Any], survey: tuple[SurveyedNode, ...],
               grid: GridMap | None) -> AgentContext:
    """Make the context of the agent."""
    s = settings
    nodes = {key: Location(node.x, node.y, node.name) for node in survey
             for key in (node.name, node.token)}
    wearers = {key: node.person for node in survey if node.person
               for key in (node.name, node.token)}
    return AgentContext(
        StandoffPlanner(clearing_of(s, grid), s['standoff_m'], s['spread_m']), nodes, wearers,
        home_of(name, s),
        tuple(s['operator_sources']), tuple(dict.fromkeys(s['observe'])),
        tuple(s['ignored_kinds']), s['name'])


def home_of(name: str, settings: Mapping[str, Any]) -> Pose | None:
    """
    Return where the robot returns to; None: to where it came from.

    :raises ConfigError: it is not a pose.
    """
    home = settings['home']
    if not home:
        return None
    if len(home) != 3 or not all(math.isfinite(each) for each in home):
        raise ConfigError([f'{name}.home = {list(home)}: must be x and y in m and the heading in '
                           'degrees, such as [0.6, 0.6, 90.0]'])
    return home[0], home[1], math.radians(home[2])
