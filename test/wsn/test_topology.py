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


"""Topologies: files of links and gains, grids, random places, walls, ways, and what happens."""

from __future__ import annotations

import gzip
import math
from pathlib import Path
from random import Random

from hypothesis import given
from hypothesis import strategies as st
import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.wsn.simulator.faults import Fault
from rt_robot_os.features.wsn.simulator.faults import fault
from rt_robot_os.features.wsn.simulator.faults import nodes_of
from rt_robot_os.features.wsn.simulator.link_files import Link
from rt_robot_os.features.wsn.simulator.link_files import LinkChange
from rt_robot_os.features.wsn.simulator.link_files import read_gains
from rt_robot_os.features.wsn.simulator.link_files import read_links
from rt_robot_os.features.wsn.simulator.scenario import Scenario
from rt_robot_os.features.wsn.simulator.scenario import SinkSettings
from rt_robot_os.features.wsn.simulator.scenario import TopologySettings
from rt_robot_os.features.wsn.simulator.sink_route import read_point
from rt_robot_os.features.wsn.simulator.sink_route import SinkRoute
from rt_robot_os.features.wsn.simulator.topology import make_topology
from rt_robot_os.features.wsn.simulator.topology import WallCount
from rt_robot_os.motion.grid_map import GridMap

FLAT = Path(__file__).resolve().parents[2] / 'config' / 'maps' / 'flat.yaml'


def written(folder: Path, text: str, name: str = 'file.txt') -> str:
    path = folder / name
    path.write_bytes(gzip.compress(text.encode()) if name.endswith('.gz') else text.encode())
    return str(path)


@pytest.mark.parametrize('name', ['links.txt', 'links.txt.gz'])
def test_links_are_read_with_their_changes(tmp_path: Path, name: str) -> None:
    links, changes = read_links(written(tmp_path, """# from to prr rssi lqi
0 1 1.000 -78 106   # good
1\t0 0.5 -79.5 90

@ 20 0 1 0.1 -94 60
@10.5 1 0 0
0 1 0.9 -80 105
""", name))
    assert links == {(0, 1): Link(0.9, -80.0, 105), (1, 0): Link(0.5, -79.5, 90)}
    assert changes == [LinkChange(10_500_000_000, 1, 0, Link(0.0, -100.0, 50)),
                       LinkChange(20_000_000_000, 0, 1, Link(0.1, -94.0, 60))]


def test_the_time_of_changes_has_a_unit(tmp_path: Path) -> None:
    file = written(tmp_path, '0 1 1 -78 106\n@ 1500 0 1 0 -90 50\n')
    assert [read_links(file, unit)[1][0].at_ns for unit in ('s', 'ms', 'us')] == [
        1_500_000_000_000, 1_500_000_000, 1_500_000]


def test_every_wrong_line_of_links_is_told(tmp_path: Path) -> None:
    file = written(tmp_path, '0 1 1.5 -78 106\n0 0 1 -78 100\n1 2\n@ x 0 1 1 -78 106\n0 1 1 a 1\n')
    with pytest.raises(ConfigError) as caught:
        read_links(file)
    said = [text.replace(file, 'F') for text in caught.value.problems]
    assert said == [
        "F:1: '0 1 1.5 -78 106': prr must be a number from 0 to 1, not '1.5'",
        "F:2: '0 0 1 -78 100': node 0 cannot have a link to itself",
        "F:3: '1 2': must be from to prr rssi lqi",
        "F:4: '@ x 0 1 1 -78 106': t must be a number from 0 to 1e+12, not 'x'",
        "F:5: '0 1 1 a 1': rssi, in dBm, must be a number from -200 to 50, not 'a'"]


@given(st.binary(max_size=200))
def test_any_bytes_are_a_topology_or_a_problem(tmp_path_factory, data: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / 'fuzzed.txt'
    path.write_bytes(data)
    for read in (read_links, read_gains):
        try:
            read(str(path))
        except ConfigError as error:
            assert error.problems


def test_gains_are_read_as_tossim_does(tmp_path: Path) -> None:
    file = written(tmp_path, 'gain 0 1 -75.5\ngain\t1 0 -76\n\n# more\nnoise 0 -98.0 4.0\n'
                   'gain 0 0 -1\ngain 0 1 -70\n')
    assert read_gains(file) == {(0, 1): -70.0, (1, 0): -76.0}
    with pytest.raises(ConfigError, match=r':1: .gain 0 x -75.*must be a node'):
        read_gains(written(tmp_path, 'gain 0 x -75\n'))


def test_the_nodes_of_a_links_file_are_those_that_it_names(tmp_path: Path) -> None:
    file = written(tmp_path, '3 7 1 -78 106\n@ 5 9 7 1 -78 106\n')
    topology = make_topology(Scenario(topology=TopologySettings(links=file),
                                      sink=SinkSettings(id=7)))
    assert list(topology.places) == [3, 7, 9]
    assert not topology.located
    with pytest.raises(ConfigError, match='set sink.id to one of 3, 7, 9'):
        make_topology(Scenario(topology=TopologySettings(links=file)))


def test_random_nodes_are_apart_and_the_same_for_a_seed() -> None:
    def places(seed: int):
        return make_topology(Scenario(seed=seed, topology=TopologySettings(random=200))).places
    found = places(1)
    assert found == places(1) != places(2)
    assert found[0][2:4] == (50.0, 50.0)  # the sink
    points = [each[2:4] for each in found.values()][1:]
    nearest = min(math.dist(a, b) for i, a in enumerate(points) for b in points[:i])
    assert nearest >= 0.5 * math.sqrt(100 * 100 / 200)


def test_random_nodes_hang_in_the_free_places_of_a_map() -> None:
    grid = GridMap.load(FLAT)
    topology = make_topology(Scenario(topology=TopologySettings(random=40, map=str(FLAT)),
                                      sink=SinkSettings(place=(3.4, 2.4))))
    assert all(grid.free(each.x, each.y) for each in topology.places.values())
    assert topology.walls is not None


def test_surveyed_nodes_count_from_one_and_the_sink_is_added() -> None:
    topology = make_topology(Scenario(
        topology=TopologySettings(nodes=('a 1 2 0.5', 'b 3 4 1.5 id 9 pulse_per_min')),
        sink=SinkSettings(way=('5 6', '7 6'))))
    assert {each.id: (each.name, each.x) for each in topology.places.values()} == {
        0: ('sink', 5.0), 1: ('a', 1.0), 9: ('b', 3.0)}
    assert topology.places[9].quantities == ('pulse_per_min',)


def test_each_wall_on_the_way_counts_once() -> None:
    walls = WallCount(GridMap.load(FLAT))
    assert walls.between(3.0, 3.0, 5.0, 3.0) == 0
    assert walls.between(3.0, 2.9, 7.0, 2.9) == 1
    assert walls.between(7.0, 2.9, 3.0, 2.9) == 1
    assert walls.between(3.0, 4.0, 3.0, 5.0) == 1
    assert walls.between(3.0, 4.0, 3.0, 4.42) == 0  # hangs on the wall


def test_a_way_is_driven_round_and_round() -> None:
    way = SinkRoute([read_point('0 0'), read_point('2, 0 stay 3'), read_point('2 1')], 0.5, 10.0)
    assert way.round_s == pytest.approx(4 + 3 + 2 + math.sqrt(5) / 0.5)
    assert [way.at_s(t) for t in (0.0, 10.0, 12.0, 14.0, 17.0)] == [
        (0, 0), (0, 0), (1, 0), (2, 0), (2, 0)]
    assert way.at_s(18.0) == pytest.approx((2.0, 0.5))
    assert way.at_s(12.0 + way.round_s) == pytest.approx((1.0, 0.0))


@pytest.mark.parametrize('text, expected', [
    ('kill 5 at 120', Fault('kill', '5', (), 120.0)),
    ('kill 10% at 1e2 s', Fault('kill', '10%', (), 100.0)),
    ('reboot 3,4 at 5', Fault('reboot', '3,4', (), 5.0, 1.0)),
    ('sleep all at 5 for 60', Fault('sleep', 'all', (), 5.0, 60.0)),
    ('move 5 1.5 -2 at 3', Fault('move', '5', (1.5, -2.0), 3.0)),
    ('noise 10 at 3 for 2', Fault('noise', '', (10.0,), 3.0, 2.0))])
def test_a_fault_is_read(text: str, expected: Fault) -> None:
    assert fault(text) == expected


@pytest.mark.parametrize('text', [
    '', 'kill', 'kill 5', 'kill at 5', 'kill 5 at x', 'kill 5 at -1', 'kill 5 at 1 for 2',
    'sleep 5 at 1', 'move 5 1 at 2', 'kill five at 3', 'burn 5 at 3', 'noise nan at 1 for 2'])
def test_no_fault_is_told_with_what_is_right(text: str) -> None:
    with pytest.raises(ValueError, match='must be|is not an event'):
        fault(text)


def test_whom_a_fault_concerns() -> None:
    def who(text: str):
        return nodes_of(fault(text), range(21), {0}, Random(1))
    assert who('kill 3,4 at 1') == [3, 4]
    assert who('kill sink at 1') == [0]
    assert who('kill all at 1') == list(range(1, 21))
    assert len(who('kill 25% at 1')) == 5
