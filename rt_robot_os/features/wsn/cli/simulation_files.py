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


"""Writer of the tables of a simulation: nodes, links, packets and the tree."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Sequence
import csv
from pathlib import Path

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.wsn.simulator.gain_medium import GainMedium
from rt_robot_os.features.wsn.simulator.link_medium import LinkMedium
from rt_robot_os.features.wsn.simulator.results import Results
from rt_robot_os.features.wsn.simulator.simulation import Simulation

NODES, LINKS, PACKETS, TREE = 'nodes.csv', 'links.csv', 'packets.csv', 'tree.csv'


def write_tables(folder: Path, simulation: Simulation, results: Results) -> None:
    """
    Write all tables into a folder, which is created if needed.

    :raises OSError: one cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    _write(folder / NODES, (
        'node', 'name', 'x_m', 'y_m', 'z_m', 'parent', 'hops', 'cost', 'generated', 'delivered',
        'data_frames', 'used_mah', 'on'), _nodes(simulation, results))
    _write(folder / LINKS, ('from', 'to', 'prr', 'rssi_dbm', 'lqi'), _links(simulation))
    _write(folder / PACKETS, ('origin', 'made_s', 'latency_ms'), (
        (origin, f'{made_ns / NS_PER_S:.6f}', '' if took_ns < 0 else f'{took_ns / NS_PER_MS:.3f}')
        for origin, made_ns, took_ns in simulation.statistics.fates()))
    _write(folder / TREE, ('time_s', 'node', 'parent', 'cost', 'hops'), (
        (f'{at_ns / NS_PER_S:.3f}', node, '' if parent is None else parent, cost, hops)
        for at_ns, node, parent, cost, hops in simulation.tree))


def _write(path: Path, head: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    with path.open('w', newline='', encoding='utf-8') as file:
        writer = csv.writer(file, lineterminator='\n')
        writer.writerow(head)
        writer.writerows(rows)


def _nodes(simulation: Simulation, results: Results) -> Iterable[Sequence[object]]:
    for each, place in simulation.topology.places.items():
        mote = simulation.network.motes[each]
        parent = results.parents.get(each)
        routed = parent is not None
        yield (each, place.name, *(f'{one:.3f}' for one in mote.position),
               parent if routed else '', results.hops[each] if routed else '',
               results.costs[each] if routed else '', results.generated.get(each, 0),
               results.delivered.get(each, 0), results.data_by_node.get(each, 0),
               f'{results.used_mah.get(each, 0.0):.4f}', int(mote.is_on))


def _links(simulation: Simulation) -> Iterable[Sequence[object]]:
    """Yield the links at the end; of a physical medium those with a receivable signal."""
    medium = simulation.medium
    for each, mote in sorted(simulation.network.motes.items()):
        if isinstance(medium, LinkMedium):
            for other, link in mote.radio.fixed_links.items():
                yield (each, other.number, f'{link.reception_rate:.4f}', link.rssi_dbm, link.lqi)
        elif isinstance(medium, GainMedium):
            for other in medium.hearers(mote.radio):
                yield (each, other.number, '', f'{medium.links_of(mote.radio)[other]:.1f}', '')
