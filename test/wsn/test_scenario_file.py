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


"""Scenarios of sensor networks are read as they are meant, and what is wrong is said at once."""

from __future__ import annotations

from pathlib import Path
import re

import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import declared
from rt_robot_os.features.wsn.cli.scenario_file import find_scenario
from rt_robot_os.features.wsn.cli.scenario_file import load_scenario
from rt_robot_os.features.wsn.simulator.scenario import Scenario
from rt_robot_os.features.wsn.simulator.scenario import SECTIONS

ROOT = Path(__file__).resolve().parents[2]
SHIPPED = sorted((ROOT / 'config' / 'scenarios').glob('*.yaml'))
PAGE = ROOT / 'docs' / 'network_simulator.md'


@pytest.fixture
def write(tmp_path: Path):
    def to_file(text: str, name: str = 'case.yaml') -> Path:
        path = tmp_path / name
        path.write_text(text)
        return path
    return to_file


def problems_of(path: Path, **overrides) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        load_scenario(path, overrides)
    return [text.replace(str(path), 'F') for text in caught.value.problems]


def test_one_line_is_a_scenario(write) -> None:
    scenario, topology = load_scenario(write('topology: {grid: 3x4}\n', 'small.yaml'))
    assert scenario.name == 'small'
    assert scenario.period_ns == 781_250_000
    assert scenario.beacon_period_ns == 32_000_000_000
    assert scenario.start_ns is None  # drawn for each node
    assert (scenario.tinyos, scenario.radio.mac, scenario.radio.acknowledge, scenario.u16_wrap,
            scenario.traffic.payload) == (2, 'tinyos2', 'software', True, 'oscilloscope')
    assert len(topology.places) == 12
    assert topology.places[7][:4] == (7, '7', 90.0, 30.0)


@pytest.mark.parametrize('text, expected', [
    ('protocol: paper', (1, 'tinyos1', 'hardware', True, 'data', 4.0)),
    ('{protocol: multihoplqi, tinyos: 1}', (1, 'tinyos1', 'hardware', True, 'surge', 32.0)),
    ('protocol: ctp', (2, 'tinyos2', 'software', True, 'oscilloscope', 32.0)),
    ('{radio: {mac: tossim}, beacon_period_ms: 500}',
     (2, 'tossim', 'hardware', False, 'oscilloscope', 0.5))])
def test_what_is_left_open_follows_from_the_rest(write, text: str, expected) -> None:
    lines = text.strip('{}') if text[0] != '{' else text[1:-1].replace(', beacon', '\nbeacon')
    lines = lines.replace(', tinyos', '\ntinyos')
    found, _ = load_scenario(write(f'topology: {{grid: 2x2}}\n{lines}\n'))
    assert (found.tinyos, found.radio.mac, found.radio.acknowledge, found.u16_wrap,
            found.traffic.payload, found.beacon_period_ns / 1e9) == expected


def test_every_problem_is_told_at_once_with_its_line(write) -> None:
    assert problems_of(write("""
topology: {gird: 3x4, spacing_m: -8}
protocl: ctp
sink: {place: [1, x], way: ["1"]}
faults:
  - kil 5 at 120
  - noise 10 at 3
""")) == [
        "F:2: topology.gird: unknown key, did you mean 'grid'?",
        'F:2: topology.spacing_m = -8: must be a number from 0.01 to 10000 (m)',
        "F:3: protocl: unknown key, did you mean 'protocol'?",
        "F:4: sink.place = [1, 'x']: ROS 2 requires a list of one type: quote strings",
        "F:4: sink.way = '1': must be x y, or x y stay SECONDS",
        "F:6: faults = 'kil 5 at 120': 'kil' is not an event: there are kill, boot, "
        'reboot, sleep, silence, move, noise',
        "F:7: faults = 'noise 10 at 3': must be noise DB at S for S"]


def test_a_file_of_links_has_no_noise_and_no_places(write) -> None:
    links = write('0 1 1.0 -80 106\n1 0 1.0 -80 106\n', 'two.links.txt')
    move, noise = problems_of(write(
        f'topology: {{links: {links}}}\nfaults: ["move 1 2 3 at 4", "noise 10 at 3 for 2"]\n'))
    assert 'the nodes of a links file have no position' in move
    assert 'change its links with lines "@ t from to prr rssi lqi"' in noise


@pytest.mark.parametrize('text, said', [
    ('seconds: 10', 'topology must have one of grid, random, nodes, nodes_file, links, tossim'),
    ('topology: {grid: 2x2, random: 5}', 'topology.random = 5: must be left out: grid already'),
    ('topology: {grid: 2by2}', 'must be rows x columns'),
    ('topology: {grid: 1x1}', '1 nodes: there must be from 2'),
    ('topology: {grid: 2x2}\nsink: {id: 4}', 'sink.id = 4: must be from 0 to 3'),
    ('topology: {nodes: [a 1 2 3]}', 'sink.place is missing'),
    ('topology: {nodes: [a 1 2]}', "topology.nodes = 'a 1 2': must be: name x y height"),
    ('topology: {links: none.txt}', 'none.txt: cannot be read: there is no such file'),
    ('topology: {grid: 2x2}\nprotocol: ctp\nbeacon_period_ms: 10', 'period of ctp is adaptive'),
    ('topology: {grid: 2x2}\nlongest_interval_binary_ms: 1024', 'only ctp has it'),
    ('topology: {grid: 2x2}\nradio: {cut_off_frames: kept}', 'kept needs links'),
    ('topology: {grid: 2x2}\nprotocol: paper\ntinyos: 2', 'tinyos = 2: must be 1'),
    ('topology: {grid: 2x2}\nprotocol: paper\nsink: {id: 1}', 'sink.id = 1: must be 0'),
    ('topology: {grid: 2x2}\ntraffic: {period_ms: 1, period_binary_ms: 1}', 'must be left out'),
    ('topology: {grid: 2x2}\nfaults: [kill 9 at 3]', "'kill 9 at 3': there is no node 9"),
    ('topology: {grid: 2x2}\ntraffic: {sources: [0]}', '0 is the sink'),
    ('topology: 3', 'topology = 3: must be a section'), ('', 'must have the keys of a scenario')])
def test_a_contradiction_is_told(write, text: str, said: str) -> None:
    assert said in '\n'.join(problems_of(write(text)))


def test_the_command_line_wins(write) -> None:
    path = write('topology: {grid: 2x2}\nseed: 1\n')
    found, _ = load_scenario(path, {'seed': 7, 'topology': {'grid': '3x3'}},
                             ['sink.place=[1, 2.5]', 'radio.noise = heavy', 'topology.grid=4x4'])
    assert (found.seed, found.topology.grid) == (7, '4x4')
    assert (found.sink.place, found.radio.noise) == ((1.0, 2.5), 'heavy')


def test_an_unknown_scenario_names_those_that_there_are() -> None:
    with pytest.raises(ConfigError, match='home12'):
        find_scenario('home13')


@pytest.mark.parametrize('path', SHIPPED, ids=lambda path: path.stem)
def test_what_is_shipped_can_be_read(path: Path) -> None:
    scenario, topology = load_scenario(find_scenario(path.stem))
    assert scenario.name == path.stem
    assert topology.sink in topology.places
    assert len(SHIPPED) >= 8


def test_the_page_names_every_key() -> None:
    said = PAGE.read_text()
    keys = [each.name for each in declared(Scenario)] + [
        f'{name}.{each.name}' for name, kind in SECTIONS.items() for each in declared(kind)]
    assert [key for key in keys if f'`{key}`' not in said] == []


def test_the_scenarios_of_the_page_can_be_read(write, tmp_path: Path) -> None:
    blocks = re.findall(r'^```yaml\n(.*?)^```', PAGE.read_text(), re.MULTILINE | re.DOTALL)
    assert len(blocks) >= 3
    (tmp_path / 'house.links.txt').write_text('0 1 1.0 -80 105\n1 0 1.0 -80 105\n')
    (tmp_path / 'topology.txt').write_text('gain 0 1 -70\ngain 1 0 -70.5\n')
    (tmp_path / 'noise.txt').write_text('-98\n' * 100)
    for text in blocks:
        load_scenario(write(text))
