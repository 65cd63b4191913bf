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
A sensor network as markers for RViz and Foxglove: ``visualization_msgs/msg/MarkerArray``.

Rows of numbers that are the graph of a map are drawn as such (:mod:`~.graph_markers`).

Each node is a sphere in the colour of its state with a text above it; a line leads to its parent.
Where a place is only estimated, the sphere is pale and stands on a disc of one standard deviation.
A marker whose node is gone is deleted by the next message, and by its lifetime when none comes.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
import math
from typing import Final

from rt_robot_os.link.graph_markers import graph_markers
from rt_robot_os.link.graph_markers import is_graph
from rt_robot_os.link.marker import Colour
from rt_robot_os.link.marker import CYLINDER
from rt_robot_os.link.marker import LINE_LIST
from rt_robot_os.link.marker import Marker
from rt_robot_os.link.marker import marker_array
from rt_robot_os.link.marker import SPHERE
from rt_robot_os.link.marker import TEXT
from rt_robot_os.link.marker import WHITE
from rt_robot_os.messages.network_rows import names_of
from rt_robot_os.messages.network_rows import NodeRow
from rt_robot_os.messages.network_rows import NodeState
from rt_robot_os.messages.network_rows import rows_of
from rt_robot_os.messages.survey import HIGHEST_ID

NODES: Final = 'nodes'
LABELS: Final = 'labels'
LINKS: Final = 'links'
UNCERTAINTY: Final = 'uncertainty'

#: Without a message for so long a marker vanishes by itself.
LIFETIME_S: Final = 15
_NODE_M: Final = 0.2
_SINK_M: Final = 0.3
_TEXT_M: Final = 0.18
_LINE_M: Final = 0.03
_DISC_M: Final = 0.01

_COLOURS: Final[Mapping[int, Colour]] = {
    NodeState.UNHEARD: (0.5, 0.5, 0.5, 1.0), NodeState.GOOD: (0.1, 0.8, 0.2, 1.0),
    NodeState.WEAK: (1.0, 0.65, 0.0, 1.0), NodeState.SILENT: (0.9, 0.1, 0.1, 1.0),
    NodeState.ASLEEP: (0.3, 0.4, 0.9, 1.0), NodeState.DOUBTFUL: (0.9, 0.1, 0.9, 1.0),
    NodeState.SINK: (0.0, 0.8, 0.9, 1.0)}
# States in which a parent still says where packets go.
_LINKED: Final = (NodeState.GOOD, NodeState.WEAK, NodeState.DOUBTFUL)


def markers_of(rows: Sequence[NodeRow], names: Mapping[int, str]) -> Iterator[Marker]:
    """
    Draw a network.

    :param rows: those without a place are not drawn.
    :param names: of nodes, by number; others are called by it.
    """
    placed = {int(row.id): row for row in rows
              if 0 <= row.id <= HIGHEST_ID and all(map(math.isfinite, (row.x, row.y, row.z)))}
    for number, row in placed.items():
        is_sink = row.state == NodeState.SINK
        red, green, blue, alpha = _COLOURS.get(int(row.state) if math.isfinite(row.state) else 0,
                                               WHITE)
        size = _SINK_M if is_sink else _NODE_M
        sure = not row.stddev_m > 0.0
        yield Marker(NODES, number, SPHERE, (row.x, row.y, row.z), (size,) * 3,
                     (red, green, blue, alpha if sure else 0.5))
        yield Marker(LABELS, number, TEXT, (row.x, row.y, row.z + 1.5 * size),
                     (_TEXT_M,) * 3, WHITE, label_of(row, names))
        if not sure and math.isfinite(row.stddev_m):
            across = 2.0 * row.stddev_m
            yield Marker(UNCERTAINTY, number, CYLINDER, (row.x, row.y, _DISC_M),
                         (across, across, _DISC_M), (red, green, blue, 0.15))
    points: list[tuple[float, float, float]] = []
    colours: list[Colour] = []
    for row in placed.values():
        parent = placed.get(int(row.parent)) if math.isfinite(row.parent) else None
        if parent is not None and parent is not row and row.state in _LINKED:
            points += (row.x, row.y, row.z), (parent.x, parent.y, parent.z)
            colours += (_link_colour(row),) * 2
    if points:
        yield Marker(LINKS, 0, LINE_LIST, scale=(_LINE_M, 0.0, 0.0), points=points,
                     colours=colours)


def label_of(row: NodeRow, names: Mapping[int, str]) -> str:
    """Return the text above a node: its name, its battery and what of its packets came."""
    number = int(row.id)
    if row.state == NodeState.SINK:
        return names.get(number, 'sink')
    lines = [names.get(number, f'node {number}')]
    facts = []
    if math.isfinite(row.battery_v):
        facts.append(f'{row.battery_v:.2f} V')
    if math.isfinite(row.delivery):
        facts.append(f'{100.0 * row.delivery:.0f} %')
    if facts:
        lines.append(' '.join(facts))
    if row.state == NodeState.SILENT and math.isfinite(row.age_s):
        lines.append(f'silent {row.age_s:.0f} s')
    return '\n'.join(lines)


def _link_colour(row: NodeRow) -> Colour:
    """Return green for a link that carries everything, red for one that carries half or less."""
    share = row.recent if math.isfinite(row.recent) else 1.0
    good = max(0.0, min(1.0, 2.0 * share - 1.0))
    return 1.0 - good, 0.2 + 0.6 * good, 0.2, 0.9


# ---- bytes -----------------------------------------------------------------------------------

def to_markers(numbers_of: Callable[[memoryview], tuple[str, Sequence[float]]], frame_id: str
               ) -> Callable[[memoryview, int], bytes]:
    """
    Make what turns the rows of a network, or the graph of a map, into markers.

    :param numbers_of: returns the label of the first dimension, and the numbers.
    :param frame_id: of the places.
    """
    shown: set[tuple[str, int]] = set()

    def convert(cdr: memoryview, wall_ns: int) -> bytes:
        label, numbers = numbers_of(cdr)
        if is_graph(numbers):
            markers, lifetime_s = graph_markers(numbers), 0
        else:
            markers = list(markers_of(list(rows_of(numbers)), names_of(label)))
            lifetime_s = LIFETIME_S
        now = {(each.namespace, each.id) for each in markers}
        gone = sorted(shown - now)
        shown.clear()
        shown.update(now)
        return marker_array(markers, gone, frame_id, wall_ns, lifetime_s)

    return convert
