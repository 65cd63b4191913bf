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


"""Plot of the routing tree of a simulated network on its map; needs matplotlib, an extra."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from importlib.util import find_spec
import math
from pathlib import Path
from typing import Any
from typing import Final

import numpy as np

from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.features.wsn.simulator.gain_medium import GainMedium
from rt_robot_os.features.wsn.simulator.results import Results
from rt_robot_os.features.wsn.simulator.simulation import Simulation
from rt_robot_os.features.wsn.simulator.topology import Topology

_REMEDY: Final = 'no plot: matplotlib is not installed (remedy: pip install matplotlib)'
_GOOD_DBM, _BAD_DBM = -75.0, -95.0
_FEW: Final = 60
_LABELLED: Final = 150
# More marks than this are rasterised, because viewers cannot show that many vectors.
_VECTORS: Final = 5000


def check() -> None:
    """
    Check that a plot is possible, before a long simulation.

    :raises RtRobotError: it is not, with the remedy.
    """
    if find_spec('matplotlib') is None:
        raise RtRobotError(_REMEDY)


def draw(path: Path, simulation: Simulation, results: Results) -> None:
    """
    Draw the tree: the colour of a node is its load, that of a link its signal strength.

    :param path: its suffix, such as .png or .svg, determines the format.
    :raises RtRobotError: the format is unknown, or there is no matplotlib.
    :raises OSError: it cannot be written.
    """
    check()
    with import_module('matplotlib').rc_context({
            'font.size': 9.0, 'svg.fonttype': 'none', 'svg.hashsalt': results.scenario}):
        figure: Any = import_module('matplotlib.figure').Figure(
            figsize=(9.0, 9.0 / _shape(simulation, results)), layout='constrained')
        _draw(figure, simulation, results)
        try:
            figure.savefig(path, dpi=130, metadata={'Date': None} if path.suffix == '.svg'
                           else None)
        except ValueError as error:
            raise RtRobotError(f'{path}: {error}') from None


def positions(simulation: Simulation, results: Results) -> Mapping[int, tuple[float, float]]:
    """Return the position of each node in the plot: its own, or by its hops around the sink."""
    topology = simulation.topology
    if topology.located:
        return {each: mote.position[:2] for each, mote in simulation.network.motes.items()}
    rings: dict[int, list[int]] = {0: [topology.sink]}
    last = max([0, *results.hops.values()]) + 1
    for each in topology.places:
        if each != topology.sink:
            rings.setdefault(results.hops.get(each, last), []).append(each)
    found = {}
    for hops, members in rings.items():
        for index, each in enumerate(members):
            angle = math.tau * (index + 0.5 * (hops % 2)) / len(members)
            found[each] = hops * math.cos(angle), hops * math.sin(angle)
    return found


def _shape(simulation: Simulation, results: Results) -> float:
    """Return the aspect ratio of the plot."""
    where = np.array(list(positions(simulation, results).values()))
    low, high = where.min(0), where.max(0)
    if simulation.topology.walls is not None:
        left, bottom, right, top = simulation.topology.walls.bounds
        low, high = np.minimum(low, (left, bottom)), np.maximum(high, (right, top))
    width, height = np.maximum(high - low, 0.1)
    return float(np.clip(1.35 * width / height, 0.9, 2.4))


def _draw(figure: Any, simulation: Simulation, results: Results) -> None:
    axes, topology = figure.subplots(), simulation.topology
    where = positions(simulation, results)
    _draw_map(axes, topology)
    _draw_tree(axes, simulation, results, where, 0.8 if len(where) > _FEW else 1.8)
    _draw_nodes(axes, simulation, results, where)
    if len(where) <= _LABELLED:
        _draw_labels(axes, topology, where)
    axes.set_title(
        f'{results.scenario}: {results.nodes} nodes, {results.protocol}, after '
        f'{results.ended_s:,.0f} s: {100.0 * results.delivery:.2f} % delivered',
        loc='left', fontsize=10)
    axes.set_aspect('equal', adjustable='box')
    axes.margins(0.06)
    if topology.located:
        axes.set_xlabel('x, m')
        axes.set_ylabel('y, m')
    else:
        axes.set_axis_off()
    axes.legend(loc='upper left', bbox_to_anchor=(0.0, -0.08), ncols=4, frameon=False, fontsize=8)


def _draw_map(axes: Any, topology: Topology) -> None:
    """Draw the walls and the route of the sink."""
    if topology.walls is not None:
        grid = topology.walls
        left, bottom, right, top = grid.bounds
        axes.imshow(np.where(grid.occupied_mask(), 0.72, 1.0), cmap='gray', vmin=0.0, vmax=1.0,
                    origin='lower', extent=(left, right, bottom, top), zorder=0)
    if topology.route is not None:
        points = [*topology.route.points, topology.route.points[0]]
        axes.plot([one.x for one in points], [one.y for one in points], color='#E69F00',
                  linestyle='--', linewidth=1.2, zorder=1, label='route of the sink')


def _draw_nodes(axes: Any, simulation: Simulation, results: Results,
                where: Mapping[int, tuple[float, float]]) -> None:
    """Draw the nodes with their load, the sinks, and the nodes that are off."""
    sinks, many = simulation.topology.sinks, len(where) > _FEW
    nodes = [each for each in where if each not in sinks]
    load = [results.data_by_node.get(each, 0) for each in nodes]
    dots = axes.scatter([where[each][0] for each in nodes], [where[each][1] for each in nodes],
                        c=load, cmap='viridis_r', s=14 if many else 90, zorder=3,
                        edgecolors='black', linewidths=0.3 if many else 0.6, vmin=0,
                        rasterized=len(where) > _VECTORS)
    axes.figure.colorbar(dots, ax=axes, label='data frames sent', shrink=0.8,
                         pad=0.02)
    axes.scatter(*zip(*(where[each] for each in sinks)), marker='*',
                 s=160 if many else 260, color='#D55E00', edgecolors='black', linewidths=0.6,
                 zorder=4, label='sink')
    dark = [each for each in nodes if not simulation.network.motes[each].is_on]
    if dark:
        axes.scatter([where[each][0] for each in dark], [where[each][1] for each in dark],
                     marker='x', color='#B00000', s=40 if many else 120, zorder=5, label='dead')


def _draw_labels(axes: Any, topology: Topology, where: Mapping[int, tuple[float, float]]
                 ) -> None:
    for each, place in topology.places.items():
        if each in where and each not in topology.sinks:
            axes.annotate(str(each) if place.name == str(each) else f'{each} {place.name}',
                          where[each], textcoords='offset points', xytext=(6, 5), fontsize=7,
                          zorder=6)


def _draw_tree(axes: Any, simulation: Simulation, results: Results,
               where: Mapping[int, tuple[float, float]], width: float) -> None:
    lines = {}
    for each, parent in results.parents.items():
        if parent is not None and parent in where:
            lines[each] = [where[each], where[parent]]
    colours = import_module('matplotlib.cm').ScalarMappable(
        import_module('matplotlib.colors').Normalize(_BAD_DBM, _GOOD_DBM), 'RdYlGn')
    strengths = [_strength(simulation, each, results.parents[each]) for each in lines]
    axes.add_collection(import_module('matplotlib.collections').LineCollection(
        list(lines.values()), colors=colours.to_rgba(strengths), linewidths=width, zorder=2,
        rasterized=len(where) > _VECTORS))
    axes.autoscale_view()
    axes.figure.colorbar(colours, ax=axes, label='signal at the parent, dBm', shrink=0.8,
                         pad=0.02)


def _strength(simulation: Simulation, node: int, parent: int | None) -> float:
    """Return the signal strength of a node at its parent, in dBm."""
    motes = simulation.network.motes
    if parent not in motes:
        return _BAD_DBM
    radio, other = motes[node].radio, motes[parent].radio
    if isinstance(simulation.medium, GainMedium):
        return simulation.medium.links_of(radio).get(other, _BAD_DBM)
    link = radio.fixed_links.get(other)
    return _BAD_DBM if link is None else float(link.rssi_dbm)
