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
The pose graph of a map as a row of numbers, and as markers: keyframes and constraints.

The row is the data of a ``std_msgs/msg/Float64MultiArray``: -1, with which no row of a sensor
network begins; n; x and y of n nodes, in m on the map; then start, end and kind
(:class:`EdgeKind`) of each edge.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Sequence
from enum import IntEnum
import math
from typing import Final

from rt_robot_os.messages.marker_array import Colour
from rt_robot_os.messages.marker_array import Drawing
from rt_robot_os.messages.marker_array import LINE_LIST
from rt_robot_os.messages.marker_array import Marker
from rt_robot_os.messages.marker_array import SPHERE_LIST

#: The most nodes and edges of one message: 64 KB.
NODES_MOST: Final = 1000
EDGES_MOST: Final = 1500
#: The most numbers of one message: the ``tail`` of the topic.
NUMBERS_MOST: Final = 2 + 2 * NODES_MOST + 3 * EDGES_MOST

_GRAPH: Final = -1.0
_NODE_M: Final = 0.08
_LINE_M: Final = 0.02
_LOOP_M: Final = 0.03


class EdgeKind(IntEnum):
    """Where the constraint between two nodes comes from."""

    NEIGHBOUR = 0  #: consecutive keyframes
    LOOP = 1  #: a loop closure
    FIX = 2  #: one node, whose position on the map was measured


_NODE_COLOUR: Final[Colour] = (0.1, 0.4, 0.9, 1.0)
_FIX_COLOUR: Final[Colour] = (0.1, 0.8, 0.2, 1.0)
_COLOURS: Final[dict[int, Colour]] = {EdgeKind.NEIGHBOUR: (0.35, 0.55, 0.85, 0.9),
                                      EdgeKind.LOOP: (1.0, 0.45, 0.0, 1.0)}

Point = tuple[float, float]
GraphEdge = tuple[int, int, int]


def graph_numbers(points: Sequence[Point], edges: Iterable[GraphEdge]) -> list[float]:
    """
    Write a graph; a large one is thinned out to every second, third, ... node.

    :param points: x and y of the nodes, in m on the map.
    :param edges: start, end, :class:`EdgeKind`; those of nodes that do not exist are left out.
    """
    count = len(points)
    step = max(1, -(-count // NODES_MOST))
    kept = points[::step]
    numbers = [_GRAPH, float(len(kept))]
    for x, y in kept:
        numbers += float(x), float(y)
    chain: dict[GraphEdge, None] = {}
    others: dict[GraphEdge, None] = {}
    for start, end, kind in edges:
        if 0 <= start < count and 0 <= end < count:
            start, end = start // step, end // step
            if start != end or kind != EdgeKind.NEIGHBOUR:
                (chain if kind == EdgeKind.NEIGHBOUR else others)[start, end, kind] = None
    # The path is drawn whole; of the loops the newest, up to the limit.
    room = max(0, EDGES_MOST - len(chain))
    for edge in [*chain, *list(others)[max(0, len(others) - room):]][:EDGES_MOST]:
        numbers += map(float, edge)
    return numbers


def is_graph(numbers: Sequence[float]) -> bool:
    """Return whether a row of numbers is a graph."""
    return len(numbers) >= 2 and numbers[0] == _GRAPH


def graph_of(numbers: Sequence[float]) -> tuple[list[Point], list[GraphEdge]]:
    """
    Parse a graph.

    :return: the nodes, and the edges whose nodes exist.
    :raises ValueError: the numbers are not a valid graph.
    """
    if not is_graph(numbers):
        raise ValueError('not a graph: the first number must be -1')
    count = int(numbers[1]) if 0 <= numbers[1] <= len(numbers) else 0
    end = 2 + 2 * count
    if count != numbers[1] or end > len(numbers):
        raise ValueError(
            f'not a graph: {len(numbers)} numbers are too few for {numbers[1]:g} nodes')
    points = list(zip(numbers[2:end:2], numbers[3:end:2]))
    edges = [(int(a), int(b), int(kind)) for a, b, kind in zip(*[iter(numbers[end:])] * 3)
             if 0 <= a < count and 0 <= b < count and 0 <= kind <= max(EdgeKind)]
    return points, edges


def draw_graph(label: str, numbers: Sequence[float]) -> Drawing | None:
    """
    Draw a graph: nodes, edges to neighbours, loops and measured positions, each one marker.

    :param label: not used.
    :return: None when the numbers are not a graph. Its markers stay: a robot that stands still
        publishes no new graph.
    :raises ValueError: the graph is not valid.
    """
    if not is_graph(numbers):
        return None
    points, edges = graph_of(numbers)
    flat = [(x, y, 0.0) for x, y in points]
    sure = [math.isfinite(x) and math.isfinite(y) for x, y in points]
    fixed = {start for start, _, kind in edges if kind == EdgeKind.FIX}
    markers = [
        _nodes('keyframes', _NODE_COLOUR, [
            each for number, each in enumerate(flat) if sure[number] and number not in fixed]),
        _nodes('fixes', _FIX_COLOUR, [flat[number] for number in sorted(fixed) if sure[number]])]
    for kind, name, width in ((EdgeKind.NEIGHBOUR, 'edges', _LINE_M),
                              (EdgeKind.LOOP, 'loops', _LOOP_M)):
        ends = [flat[end] for edge in edges if edge[2] == kind and sure[edge[0]] and sure[edge[1]]
                for end in edge[:2]]
        markers.append(Marker(name, 0, LINE_LIST, scale=(width, 0.0, 0.0), colour=_COLOURS[kind],
                              points=ends))
    return Drawing([each for each in markers if each.points])


def _nodes(name: str, colour: Colour, points: list[tuple[float, float, float]]) -> Marker:
    return Marker(name, 0, SPHERE_LIST, scale=(_NODE_M,) * 3, colour=colour, points=points)
