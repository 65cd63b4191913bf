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


"""What a large network costs follows from what is near each node, not from how many there are."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.wsn.cli.scenario_file import load_scenario
from rt_robot_os.features.wsn.simulator import radio_positions as radio_places
from rt_robot_os.features.wsn.simulator import simulation as simulation_module
from rt_robot_os.features.wsn.simulator import topology as topology_module
from rt_robot_os.features.wsn.simulator.path_loss_medium import PathLossMedium
from rt_robot_os.features.wsn.simulator.simulation import Simulation

SPARSE = ('radio.exponent=4', 'radio.shadowing_db=2', 'topology.spacing_m=20')


def simulated(folder: Path, *assignments: str, topology: str = 'grid: 6x6',
              **given: Any) -> Simulation:
    path = folder / 'net.yaml'
    path.write_text(f'topology: {{{topology}}}\nseconds: 20\ntraffic: {{period_ms: 4000}}\n'
                    'boot_spread_s: 2\nbeacon_period_ms: 4000\n')
    return Simulation(*load_scenario(path, assignments=assignments), **given)


def medium_of(simulation: Simulation) -> PathLossMedium:
    assert isinstance(simulation.medium, PathLossMedium)
    return simulation.medium


def test_pairs_examined_for_a_node_do_not_grow_with_the_network(tmp_path: Path) -> None:
    def examined(side: int) -> float:
        simulation = simulated(tmp_path, f'topology.grid={side}x{side}', *SPARSE)
        medium = medium_of(simulation)
        assert medium.places.examined == 0  # setting up compares nobody
        motes = simulation.network.motes.values()
        assert sum(len(medium.hearers(mote.radio)) for mote in motes) > 4 * len(motes)
        return medium.places.examined / len(motes)

    # At the rim a node has fewer around it; all pairs would be 4 times as many.
    small, large = examined(25), examined(50)
    assert small <= large < 1.25 * small < 200


def all_links(simulation: Simulation) -> list[list[tuple[int, float]]]:
    medium = medium_of(simulation)
    return [[(other.number, power) for other, power in medium.links_of(mote.radio).items()]
            for mote in simulation.network.motes.values()]


def test_neither_cells_nor_the_order_of_asking_change_links_or_their_order(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = []
    for cells in (1, 3, 8):
        monkeypatch.setattr(radio_places, '_CELLS_A_RANGE', cells)
        for first in ((), (30, 7, 19)):
            simulation = simulated(tmp_path, *SPARSE)
            for number in first:
                medium_of(simulation).links_of(simulation.network.motes[number].radio)
            simulation.network.move(8, (50.0, 47.0, 1.5))
            simulation.network.move(3, (1.0, 90.0, 1.5))
            found.append(all_links(simulation))
    assert all(each == found[0] for each in found)
    # The rule: who came before, by block and time; then who came later, by time.
    later = [number for number, _ in found[0][0] if number not in (8, 3)]
    assert later == sorted(later)
    assert {number for number, _ in found[0][0][-2:]} <= {8, 3} | set(later)


def test_few_stored_links_give_the_same_results(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def results(most_links: int) -> tuple[dict[str, Any], int]:
        monkeypatch.setattr(simulation_module, 'PathLossMedium', lambda *given: PathLossMedium(
            *given, most_links=most_links))
        simulation = simulated(tmp_path, 'topology.grid=12x12', 'radio.exponent=3.5', *SPARSE[1:])
        simulation.run()
        # The first search of each node, and one for each time that its links were dropped.
        found = dataclasses.asdict(simulation.results()) | {'wall_s': 0.0}
        return found, medium_of(simulation).places.examined

    all_kept, few = results(1 << 30), results(500)
    assert few[0] == all_kept[0] and all_kept[0]['events'] > 1000
    assert few[1] > all_kept[1]


def test_more_nodes_than_addresses_are_several_networks(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(topology_module, 'MOST_NODES_A_PAN', 15)
    simulation = simulated(tmp_path, 'topology.grid=6x7', 'seconds=60', 'radio.power_dbm=-10')
    assert simulation.topology.sinks == {0, 14, 28}
    radio = simulation.network.motes[15].radio
    assert (radio.address, radio.pan, radio.number) == (1, 1, 15)
    simulation.run()
    results = simulation.results()
    assert results.delivery > 0.5 and len(results.generated) == 39
    parents = {node: parent for node, parent in results.parents.items() if parent is not None}
    assert len(parents) > 30
    assert all(node // 14 == parent // 14 for node, parent in parents.items())
    assert results.as_json()['sinks'] == [0, 14, 28]
    # Each hears the others all the same: as noise.
    assert any(other.pan != radio.pan for other in medium_of(simulation).links_of(radio))
    assert all(other.pan == radio.pan for other in medium_of(simulation).hearers(radio))
    with pytest.raises(ConfigError, match='3 networks'):
        simulated(tmp_path, 'topology.grid=6x7', with_host=True)
    with pytest.raises(ConfigError, match='sink.id'):
        simulated(tmp_path, 'topology.grid=6x7', 'sink.id=3')


def test_random_networks_are_strips_with_a_sink_in_the_middle_of_each(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(topology_module, 'MOST_NODES_A_PAN', 50)
    topology = simulated(tmp_path, topology='random: 120').topology
    assert topology.sinks == {0, 40, 80} and list(topology.places) == list(range(120))
    strips = [[topology.places[each] for each in range(first, first + 40)]
              for first in (0, 40, 80)]
    assert max(place.y for place in strips[0]) <= min(place.y for place in strips[1])
    for sink, *others in strips:
        assert 30.0 < sink.x < 70.0
        assert min(place.y for place in others) <= sink.y <= max(place.y for place in others)


def test_what_is_too_large_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match='100,172 nodes: there must be from 2 to 100,000'):
        simulated(tmp_path, 'topology.grid=317x316')
