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
A sensor network as markers for RViz and Foxglove.

Each node is a sphere in the colour of its state with a text above it; a line leads to its parent.
Where a position is only estimated, the sphere is pale and stands on a disc of one standard
deviation.
"""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
import math
from typing import Final

from rt_robot_os.messages.marker_array import Colour
from rt_robot_os.messages.marker_array import CYLINDER
from rt_robot_os.messages.marker_array import Drawing
from rt_robot_os.messages.marker_array import LINE_LIST
from rt_robot_os.messages.marker_array import Marker
from rt_robot_os.messages.marker_array import SPHERE
from rt_robot_os.messages.marker_array import TEXT
from rt_robot_os.messages.marker_array import WHITE
from rt_robot_os.messages.network_rows import names_of
from rt_robot_os.messages.network_rows import NodeRow
from rt_robot_os.messages.network_rows import NodeState
from rt_robot_os.messages.network_rows import rows_of
from rt_robot_os.messages.survey import HIGHEST_ID

NODES: Final = 'nodes'
LABELS: Final = 'labels'
LINKS: Final = 'links'
UNCERTAINTY: Final = 'uncertainty'

#: Markers vanish when no message has come for this time.
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
# States in which packets still go to the parent.
_LINKED: Final = (NodeState.GOOD, NodeState.WEAK, NodeState.DOUBTFUL)


def draw_network(label: str, numbers: Sequence[float]) -> Drawing:
    """
    Draw rows of numbers, as :mod:`rt_robot_os.messages.network_rows` describes them.

    :param label: the names of the nodes.
    """
    return Drawing(list(markers_of(list(rows_of(numbers)), names_of(label))), LIFETIME_S)


def markers_of(rows: Sequence[NodeRow], names: Mapping[int, str]) -> Iterator[Marker]:
    """
    Draw a network.

    :param rows: nodes without a position are not drawn.
    :param names: of nodes, by number; other nodes are labelled with their number.
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
    """Return the text above a node: its name, battery voltage and delivery ratio."""
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
