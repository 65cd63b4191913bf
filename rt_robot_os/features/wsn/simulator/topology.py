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
The nodes of a scenario and their positions, or their links.

A topology with positions (grid, random, surveyed) gets its links from the radio model; one from a
file (links, TOSSIM) has links and no positions.
"""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field
from functools import cached_property
import math
from random import Random
import re
from typing import Final
from typing import NamedTuple

import numpy as np

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.wsn.simulator.link_files import Gains
from rt_robot_os.features.wsn.simulator.link_files import lines_of
from rt_robot_os.features.wsn.simulator.link_files import LinkChange
from rt_robot_os.features.wsn.simulator.link_files import Links
from rt_robot_os.features.wsn.simulator.link_files import read_gains
from rt_robot_os.features.wsn.simulator.link_files import read_links
from rt_robot_os.features.wsn.simulator.scenario import MOST_NODES
from rt_robot_os.features.wsn.simulator.scenario import MOST_NODES_A_PAN
from rt_robot_os.features.wsn.simulator.scenario import Scenario
from rt_robot_os.features.wsn.simulator.sink_route import sink_route
from rt_robot_os.features.wsn.simulator.sink_route import SinkRoute
from rt_robot_os.messages.quantities import DEFAULT_QUANTITIES
from rt_robot_os.messages.survey import read_survey
from rt_robot_os.messages.survey import survey_of
from rt_robot_os.motion.grid_map import GridMap

_GRID: Final = re.compile(r'\s*(\d{1,5})\s*[xX*]\s*(\d{1,5})\s*', re.ASCII)
_TRIES: Final = 30


class NodePlacement(NamedTuple):
    """The position of a node in m in the frame of the map, and its quantities."""

    id: int  # noqa: A003
    name: str
    x: float
    y: float
    z: float
    quantities: tuple[str, ...] = DEFAULT_QUANTITIES


@dataclass(frozen=True)
class Topology:
    """
    The nodes of a scenario, the sink among them.

    :ivar places: of all nodes by id; arbitrary for a links file.
    :ivar sink: id of the sink of the first network.
    :ivar pan_nodes: number of nodes of each network, in order of their ids; 0: one network.
    :ivar located: whether the positions are real.
    :ivar links: of a links file; None without.
    :ivar changes: changes of these links, in order of time.
    :ivar gains: of a TOSSIM topology in dB; None without.
    :ivar walls: the map whose walls are between the nodes; None without.
    :ivar route: the route of the sink; None when it does not move.
    """

    places: Mapping[int, NodePlacement]
    sink: int
    located: bool = True
    links: Links | None = None
    changes: Sequence[LinkChange] = ()
    gains: Gains | None = None
    walls: GridMap | None = field(default=None, repr=False)
    route: SinkRoute | None = None
    pan_nodes: int = 0

    @cached_property
    def sinks(self) -> frozenset[int]:
        """Return the sink of each network: in all but the first its first node."""
        more = range(self.pan_nodes, len(self.places), self.pan_nodes) if self.pan_nodes else ()
        return frozenset((self.sink, *more))


def make_topology(scenario: Scenario) -> Topology:
    """
    Read the files of a scenario and place the nodes.

    :raises ConfigError: a file or a setting is wrong, or the sink has no position.
    """
    topology, sink = scenario.topology, scenario.sink.id
    if topology.links:
        links, changes = read_links(topology.links, topology.time_unit)
        ids = {end for pair in links for end in pair} | {
            end for change in changes for end in (change.source, change.destination)}
        return Topology(_listed(ids, sink, topology.links), sink, False, links, changes)
    if topology.tossim:
        gains = read_gains(topology.tossim)
        ids = {end for pair in gains for end in pair}
        return Topology(_listed(ids, sink, topology.tossim), sink, False, gains=gains)
    walls = GridMap.load(topology.map) if topology.map else None
    way = sink_route(scenario.sink) if scenario.sink.way else None
    places = _placed(scenario, walls)
    pan_nodes = _pan_nodes(len(places))
    if pan_nodes and sink:
        raise ConfigError([f'sink.id = {sink}: must be 0 with more than {MOST_NODES_A_PAN:,} '
                           'nodes, which are several networks'])
    if pan_nodes and topology.random:
        places = _in_strips(places, pan_nodes)
    return Topology(_with_sink(places, scenario, walls, way), sink, walls=walls, route=way,
                    pan_nodes=pan_nodes)


def _pan_nodes(count: int) -> int:
    """Return the number of nodes of each network; 0 where one network is sufficient."""
    networks = -(-count // MOST_NODES_A_PAN)
    return 0 if networks == 1 else -(-count // networks)


def _in_strips(places: Sequence[NodePlacement], pan_nodes: int) -> list[NodePlacement]:
    """Give random nodes ids so that each network is a strip along x, its sink in the middle."""
    ordered = [place._replace(id=index, name=str(index)) for index, place in enumerate(
        sorted(places, key=lambda place: place.y))]
    left, right = (end(place.x for place in places) for end in (min, max))
    for first in range(0, len(ordered), pan_nodes):
        low, high = ordered[first].y, ordered[min(first + pan_nodes, len(ordered)) - 1].y
        ordered[first] = ordered[first]._replace(x=(left + right) / 2, y=(low + high) / 2)
    return ordered


def _listed(ids: set[int], sink: int, file: str) -> dict[int, NodePlacement]:
    if sink not in ids:
        known = ', '.join(map(str, sorted(ids)[:20]))
        raise ConfigError([f'{file}: node {sink}, the sink, has no link: set sink.id to one of '
                           f'{known}'])
    count = len(ids)
    _check_count(count, file)
    # On a circle, for the figures.
    return {each: NodePlacement(each, str(each), *_on_circle(index, count), 0.0)
            for index, each in enumerate(sorted(ids))}


def _on_circle(index: int, count: int) -> tuple[float, float]:
    radius, angle = 1.6 * count, math.tau * index / count
    return radius * math.cos(angle), radius * math.sin(angle)


def _check_count(count: int, what: str) -> None:
    if not 2 <= count <= MOST_NODES:
        raise ConfigError([f'{what}: {count:,} nodes: there must be from 2 to {MOST_NODES:,}'])


def _placed(scenario: Scenario, walls: GridMap | None) -> list[NodePlacement]:
    topology = scenario.topology
    if topology.grid:
        return list(_grid(scenario))
    if topology.random:
        return list(_random(scenario, walls))
    return _surveyed(scenario)


def _grid(scenario: Scenario) -> Iterator[NodePlacement]:
    topology, random = scenario.topology, Random(f'{scenario.seed} grid')
    match = _GRID.fullmatch(topology.grid)
    if match is None:
        raise ConfigError([f'topology.grid = {topology.grid!r}: must be rows x columns, such as '
                           '4x5'])
    rows, columns = int(match[1]), int(match[2])
    _check_count(rows * columns, f'topology.grid = {topology.grid}')
    for index in range(rows * columns):
        row, column = divmod(index, columns)
        x, y = (place * topology.spacing_m + _off(topology.jitter_m, random)
                for place in (column, row))
        yield NodePlacement(index, str(index), x, y, topology.height_m)


def _off(deviation: float, random: Random) -> float:
    return random.gauss(0.0, deviation) if deviation else 0.0


def _random(scenario: Scenario, walls: GridMap | None) -> Iterator[NodePlacement]:
    topology, random = scenario.topology, Random(f'{scenario.seed} places')
    _check_count(topology.random, f'topology.random = {topology.random}')
    low_x, low_y, high_x, high_y = walls.bounds if walls is not None else (
        0.0, 0.0, topology.width_m, topology.depth_m)
    area = (high_x - low_x) * (high_y - low_y)
    apart_m = topology.apart_m or 0.5 * math.sqrt(area / topology.random)
    taken = _Taken(apart_m)
    for index in range(topology.random):
        x = y = 0.0
        for _ in range(_TRIES if walls is None else 50 * _TRIES):
            x, y = random.uniform(low_x, high_x), random.uniform(low_y, high_y)
            if (walls is None or walls.free(x, y)) and not taken.near(x, y):
                break
        taken.add(x, y)
        yield NodePlacement(index, str(index), x, y, topology.height_m)


class _Taken:
    """A spatial index of points."""

    def __init__(self, apart_m: float) -> None:
        self._apart_m = apart_m
        self._squares: dict[tuple[int, int], list[tuple[float, float]]] = {}

    def _square(self, x: float, y: float) -> tuple[int, int]:
        return math.floor(x / self._apart_m), math.floor(y / self._apart_m)

    def add(self, x: float, y: float) -> None:
        self._squares.setdefault(self._square(x, y), []).append((x, y))

    def near(self, x: float, y: float) -> bool:
        column, row = self._square(x, y)
        return any(math.hypot(x - other_x, y - other_y) < self._apart_m
                   for dx in (-1, 0, 1) for dy in (-1, 0, 1)
                   for other_x, other_y in self._squares.get((column + dx, row + dy), ()))


def _surveyed(scenario: Scenario) -> list[NodePlacement]:
    topology = scenario.topology
    if topology.nodes:
        nodes = survey_of(topology.nodes, 'topology.nodes')
    else:
        text = '\n'.join(text for _, text in lines_of(topology.nodes_file))
        nodes = read_survey(text, topology.nodes_file)
    _check_count(len(nodes) + 1, topology.nodes_file or 'topology.nodes')
    return [NodePlacement(each.id, each.name, each.x, each.y, each.z, each.quantities)
            for each in nodes]


def _with_sink(places: Sequence[NodePlacement], scenario: Scenario, walls: GridMap | None,
               way: SinkRoute | None) -> dict[int, NodePlacement]:
    sink, topology = scenario.sink, scenario.topology
    found = {each.id: each for each in places}
    if sink.id not in found and (topology.grid or topology.random):
        raise ConfigError([f'sink.id = {sink.id}: must be from 0 to {len(found) - 1}, as there '
                           f'are {len(found)} nodes'])
    spot = sink.place or (way.at_s(0.0) if way is not None else ())
    if not spot and topology.random and not _pan_nodes(len(places)):
        spot = _middle(scenario, walls)
    if not spot and sink.id not in found:
        raise ConfigError([f'sink.place is missing: no surveyed node has the id {sink.id}; set '
                           'the position of the sink as [x, y]'])
    if spot:
        height = spot[2] if len(spot) > 2 else (
            found[sink.id].z if sink.id in found else topology.height_m)
        found[sink.id] = NodePlacement(sink.id, 'sink', spot[0], spot[1], height)
    return dict(sorted(found.items()))


def _middle(scenario: Scenario, walls: GridMap | None) -> tuple[float, float]:
    low_x, low_y, high_x, high_y = walls.bounds if walls is not None else (
        0.0, 0.0, scenario.topology.width_m, scenario.topology.depth_m)
    return (low_x + high_x) / 2, (low_y + high_y) / 2


class WallCount:
    """
    Counts the walls between two points of a map: each obstacle that a straight line enters.

    The wall that a node is mounted on is not counted.
    """

    def __init__(self, grid: GridMap) -> None:
        self._grid = grid

    def between(self, ax: float, ay: float, bx: float, by: float) -> int:
        """Return the number of walls; takes about 20 us for 10 m."""
        length = math.hypot(bx - ax, by - ay)
        steps = int(2.0 * length / self._grid.resolution_m) + 2
        part = np.linspace(0.0, 1.0, steps)
        solid = self._grid.values(ax + part * (bx - ax), ay + part * (by - ay)) >= 50
        entered = int(np.count_nonzero(solid[1:] & ~solid[:-1]))
        return entered - 1 if entered and solid[-1] else entered
