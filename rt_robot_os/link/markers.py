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
import struct
from typing import Final
from typing import NamedTuple

from rt_robot_os.link.cdr import LITTLE_ENDIAN
from rt_robot_os.link.cdr import padding
from rt_robot_os.link.cdr import text_bytes
from rt_robot_os.units import NS_PER_S
from rt_robot_os.wsn.network_rows import names_of
from rt_robot_os.wsn.network_rows import NodeRow
from rt_robot_os.wsn.network_rows import NodeState
from rt_robot_os.wsn.network_rows import rows_of
from rt_robot_os.wsn.survey import HIGHEST_ID

MARKERS: Final = 'visualization_msgs/msg/MarkerArray'

# Of visualization_msgs/msg/Marker.
SPHERE: Final = 2
CYLINDER: Final = 3
LINE_LIST: Final = 5
TEXT: Final = 9
_ADD: Final = 0
_DELETE: Final = 2

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

Colour = tuple[float, float, float, float]
_COLOURS: Final[Mapping[int, Colour]] = {
    NodeState.UNHEARD: (0.5, 0.5, 0.5, 1.0), NodeState.GOOD: (0.1, 0.8, 0.2, 1.0),
    NodeState.WEAK: (1.0, 0.65, 0.0, 1.0), NodeState.SILENT: (0.9, 0.1, 0.1, 1.0),
    NodeState.ASLEEP: (0.3, 0.4, 0.9, 1.0), NodeState.DOUBTFUL: (0.9, 0.1, 0.9, 1.0),
    NodeState.SINK: (0.0, 0.8, 0.9, 1.0)}
_WHITE: Final = (1.0, 1.0, 1.0, 1.0)
# States in which a parent still says where packets go.
_LINKED: Final = (NodeState.GOOD, NodeState.WEAK, NodeState.DOUBTFUL)

_STAMP: Final = struct.Struct('<iI')
_NUMBERS: Final = struct.Struct('<iii')
_POSE: Final = struct.Struct('<7d')
_SCALE: Final = struct.Struct('<3d')
_COLOUR: Final = struct.Struct('<4f')
_COUNT: Final = struct.Struct('<I')
_NO_TEXT: Final = text_bytes('')


class Marker(NamedTuple):
    """
    One marker.

    :ivar namespace: with ``id`` it tells markers apart.
    :ivar shape: its type.
    :ivar points: of a line list, from and to in turn; ``colours`` has one for each.
    """

    namespace: str
    id: int  # noqa: A003
    shape: int
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    colour: Colour = _WHITE
    text: str = ''
    points: Sequence[tuple[float, float, float]] = ()
    colours: Sequence[Colour] = ()


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
                                               _WHITE)
        size = _SINK_M if is_sink else _NODE_M
        sure = not row.stddev_m > 0.0
        yield Marker(NODES, number, SPHERE, (row.x, row.y, row.z), (size,) * 3,
                     (red, green, blue, alpha if sure else 0.5))
        yield Marker(LABELS, number, TEXT, (row.x, row.y, row.z + 1.5 * size),
                     (_TEXT_M,) * 3, _WHITE, label_of(row, names))
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
    Make what turns the rows of a network into markers.

    :param numbers_of: returns the label of the first dimension, and the numbers.
    :param frame_id: of the places.
    """
    frame = text_bytes(frame_id)
    shown: set[tuple[str, int]] = set()

    def convert(cdr: memoryview, wall_ns: int) -> bytes:
        label, numbers = numbers_of(cdr)
        markers = list(markers_of(list(rows_of(numbers)), names_of(label)))
        now = {(each.namespace, each.id) for each in markers}
        gone = sorted(shown - now)
        shown.clear()
        shown.update(now)
        body = bytearray(_COUNT.pack(len(markers) + len(gone)))
        header = _STAMP.pack(*divmod(wall_ns, NS_PER_S)) + frame
        for each in markers:
            _write(body, header, each, _ADD)
        for namespace, number in gone:
            _write(body, header, Marker(namespace, number, SPHERE), _DELETE)
        return LITTLE_ENDIAN + bytes(body)

    return convert


def _write(body: bytearray, header: bytes, each: Marker, action: int) -> None:
    _aligned(body, 4, header)
    _aligned(body, 4, text_bytes(each.namespace))
    _aligned(body, 4, _NUMBERS.pack(each.id, each.shape, action))
    _aligned(body, 8, _POSE.pack(*each.position, 0.0, 0.0, 0.0, 1.0) + _SCALE.pack(*each.scale))
    body += _COLOUR.pack(*each.colour)
    body += _STAMP.pack(LIFETIME_S, 0)
    body += b'\0'  # not locked to its frame
    _aligned(body, 4, _COUNT.pack(len(each.points)))
    for point in each.points:
        _aligned(body, 8, _SCALE.pack(*point))
    _aligned(body, 4, _COUNT.pack(len(each.colours)))
    for colour in each.colours:
        body += _COLOUR.pack(*colour)
    # The texture: its resource, then an image with a header, its format and no data.
    _aligned(body, 4, _NO_TEXT)
    _aligned(body, 4, _STAMP.pack(0, 0) + _NO_TEXT)
    _aligned(body, 4, _NO_TEXT)
    _aligned(body, 4, _COUNT.pack(0))
    _aligned(body, 4, _COUNT.pack(0))  # where it is on the marker
    _aligned(body, 4, text_bytes(each.text))
    _aligned(body, 4, _NO_TEXT)  # a mesh, its file's name and no data
    _aligned(body, 4, _NO_TEXT)
    _aligned(body, 4, _COUNT.pack(0))
    body += b'\0'


def _aligned(body: bytearray, size: int, data: bytes) -> None:
    body += bytes(padding(len(body), size)) + data
