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
The graph of a map as a row of numbers, and as markers: keyframes, and what is known between them.

The row, of a ``std_msgs/msg/Float64MultiArray``: -1, which no row of a sensor network begins with;
n; x and y of n nodes, in m on the map; then from, to and a kind (:class:`EdgeKind`) for each edge.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Sequence
from enum import IntEnum
import math
from typing import Final

from rt_robot_os.link.marker import Colour
from rt_robot_os.link.marker import LINE_LIST
from rt_robot_os.link.marker import Marker
from rt_robot_os.link.marker import SPHERE_LIST

#: Nodes and edges of one message at most: 64 KB.
NODES_MOST: Final = 1000
EDGES_MOST: Final = 1500
#: Numbers that this takes: the ``tail`` of the topic.
NUMBERS_MOST: Final = 2 + 2 * NODES_MOST + 3 * EDGES_MOST

_GRAPH: Final = -1.0
_NODE_M: Final = 0.08
_LINE_M: Final = 0.02
_LOOP_M: Final = 0.03


class EdgeKind(IntEnum):
    """How two nodes are known to lie to each other."""

    NEIGHBOUR = 0  #: one after the other
    LOOP = 1  #: seen again
    FIX = 2  #: one node, whose place on the map was measured


_NODE_COLOUR: Final[Colour] = (0.1, 0.4, 0.9, 1.0)
_FIX_COLOUR: Final[Colour] = (0.1, 0.8, 0.2, 1.0)
_COLOURS: Final[dict[int, Colour]] = {EdgeKind.NEIGHBOUR: (0.35, 0.55, 0.85, 0.9),
                                      EdgeKind.LOOP: (1.0, 0.45, 0.0, 1.0)}

Point = tuple[float, float]
GraphEdge = tuple[int, int, int]


def graph_numbers(points: Sequence[Point], edges: Iterable[GraphEdge]) -> list[float]:
    """
    Write a graph; of a large one every second, third, ... node, the edges to the next of those.

    :param points: x and y of the nodes, in m on the map.
    :param edges: from, to, :class:`EdgeKind`; those between places that do not exist are left out.
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
    # The way is drawn whole; of what is beyond the limit the newest loops are.
    room = max(0, EDGES_MOST - len(chain))
    for edge in [*chain, *list(others)[max(0, len(others) - room):]][:EDGES_MOST]:
        numbers += map(float, edge)
    return numbers


def is_graph(numbers: Sequence[float]) -> bool:
    """Return whether a row of numbers is a graph."""
    return len(numbers) >= 2 and numbers[0] == _GRAPH


def graph_of(numbers: Sequence[float]) -> tuple[list[Point], list[GraphEdge]]:
    """
    Read a graph.

    :return: the nodes, and the edges that name two of them.
    :raises ValueError: it is none.
    """
    if not is_graph(numbers):
        raise ValueError('no graph: the first number of one is -1')
    count = int(numbers[1]) if 0 <= numbers[1] <= len(numbers) else 0
    end = 2 + 2 * count
    if count != numbers[1] or end > len(numbers):
        raise ValueError(f'no graph: {len(numbers)} numbers are too few for {numbers[1]:g} nodes')
    points = list(zip(numbers[2:end:2], numbers[3:end:2]))
    edges = [(int(a), int(b), int(kind)) for a, b, kind in zip(*[iter(numbers[end:])] * 3)
             if 0 <= a < count and 0 <= b < count and 0 <= kind <= max(EdgeKind)]
    return points, edges


def graph_markers(numbers: Sequence[float]) -> list[Marker]:
    """
    Draw a graph: nodes, edges to neighbours, loops and measured places, each one marker.

    :raises ValueError: the numbers are no graph.
    """
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
    return [each for each in markers if each.points]


def _nodes(name: str, colour: Colour, points: list[tuple[float, float, float]]) -> Marker:
    return Marker(name, 0, SPHERE_LIST, scale=(_NODE_M,) * 3, colour=colour, points=points)
