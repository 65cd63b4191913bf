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

"""The survey of sensor nodes and the table of what they measure."""

import math
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.wsn.survey_files import load_survey
from rt_robot_os.messages.quantities import DEFAULT_QUANTITIES
from rt_robot_os.messages.quantities import quantity
from rt_robot_os.messages.survey import node
from rt_robot_os.messages.survey import read_survey
from rt_robot_os.messages.survey import survey_of
from rt_robot_os.messages.survey import text_of
from rt_robot_os.messages.survey import topic_token
from rt_robot_os.sim.world.world import World
from rt_robot_os.sim.world_settings import WorldSettings
from rt_robot_os.topics.bus import TOPIC_NAME


def test_numbers_count_from_one_where_none_is_said() -> None:
    found = survey_of(['hall 3.0 1.5 2.2', '12: 1, 2, 0.5 id 40', 'bed 0 0 1 pulse_per_min alarm'])
    assert [(each.name, each.id) for each in found] == [('hall', 1), ('12', 40), ('bed', 3)]
    assert found[0].quantities == DEFAULT_QUANTITIES
    assert found[2].quantities == ('pulse_per_min', 'alarm')
    assert [each.token for each in found] == ['hall', 'node_12', 'bed']


@pytest.mark.parametrize(('texts', 'said'), [
    (['hall 1 2'], "'hall 1 2': must be: name x y height"),
    (['hall 1 2 x'], "'x' is not a valid number"),
    (['hall 1 2 nan'], "'nan' is not a valid number"),
    (['hall 1 2 3 id'], "id '': it must be an integer from 0 to 65534"),
    (['hall 1 2 3 id 65535'], "id '65535'"),
    (['hall 1 2 3 id 1 id 2'], '"id" may stand once'),
    (['hall 1 2 3 on'], 'no person after "on"'),
    (['hall 1 2 3 on anna on bob'], '"on" may stand once'),
    (['hall 1 2 3 temprature'], 'did you mean temperature'),
    (['hall 1 2 3 light light'], 'light is there twice'),
    (['hall 1 2 3 soil-moisture'], 'is not a name of a quantity'),
    (['hall 1 2 3', 'hall 1 2 4'], 'nodes: hall is there twice'),
    (['a-b 1 2 3', 'a_b 1 2 4'], 'a-b and a_b would have the same topics, wsn/a_b/'),
    (['a 1 2 3 id 2', 'b 1 2 4'], 'a and b both have the number 2'),
])
def test_what_is_wrong_is_named_with_its_entry(texts: list[str], said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        survey_of(texts)
    assert said in caught.value.problems[0]


def test_a_node_may_be_worn() -> None:
    found = node('wrist 2.4 3.9 1.0 on anna id 4 pulse_per_min alarm')
    assert (found.person, found.id) == ('anna', 4)
    assert found.quantities == ('pulse_per_min', 'alarm') and node(text_of(found)) == found


def test_every_problem_of_a_list_is_told() -> None:
    with pytest.raises(ConfigError) as caught:
        survey_of(['a 1', 'b 2 3 4', 'c 1 2 3 id -4'])
    assert len(caught.value.problems) == 2


@given(st.text(max_size=60))
def test_any_text_is_read_or_refused(text: str) -> None:
    try:
        found = node(text)
    except ValueError:
        return
    assert node(text_of(found)) == found
    assert TOPIC_NAME.fullmatch(f'wsn/{found.token}/{found.quantities[0]}')


def test_every_name_can_be_part_of_a_topic() -> None:
    assert topic_token('12') == 'node_12' and topic_token('\xfcber-2') == '_ber_2'


def test_one_file_serves_the_world_and_the_modules(tmp_path: Path) -> None:
    path = tmp_path / 'world.yaml'
    path.write_text('map: open\nnodes:\n  - hall 3.0 1.5 2.2\n  - bed 1 2 0.5 id 7 alarm\n')
    survey = load_survey(str(path), 'readings.nodes_file')
    world = World(WorldSettings(map='open', nodes=('hall 3.0 1.5 2.2', 'bed 1 2 0.5 id 7 alarm')))
    assert world.nodes == survey
    with pytest.raises(ConfigError, match='readings.nodes_file.*give the path of a YAML file'):
        load_survey(str(tmp_path / 'missing.yaml'), 'readings.nodes_file')


@pytest.mark.parametrize(('text', 'said'), [
    ('nodes: [1, 2]', 'place 1 must be a text'), ('a: b', 'holds no nodes'),
    ('{', 'is no YAML'), ('', 'holds no nodes')])
def test_a_file_without_nodes_is_refused(text: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        read_survey(text, 'nodes.yaml')


def test_a_world_tells_two_nodes_of_one_number() -> None:
    with pytest.raises(ConfigError, match='world.nodes: a and b both have the number 2'):
        World(WorldSettings(map='open', nodes=('a 1 2 3 id 2', 'b 1 2 4')))


@pytest.mark.parametrize(('name', 'value', 'fits'), [
    ('temperature', 21.5, True), ('temperature', math.nan, False), ('pulse_per_min', 0.0, False),
    ('spo2_percent', 101.0, False), ('soil_percent', 1e9, True),
    ('soil_percent', math.inf, False)])
def test_what_no_sensor_says_is_not_plausible(name: str, value: float, fits: bool) -> None:
    assert quantity(name).plausible(value) == fits
