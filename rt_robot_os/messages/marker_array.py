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

"""Markers for RViz and Foxglove: ``visualization_msgs/msg/MarkerArray`` as CDR bytes."""

from __future__ import annotations

from collections.abc import Sequence
import struct
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.messages.cdr import LITTLE_ENDIAN
from rt_robot_os.messages.cdr import padding
from rt_robot_os.messages.cdr import text_bytes

MARKERS: Final = 'visualization_msgs/msg/MarkerArray'

# Of visualization_msgs/msg/Marker.
SPHERE: Final = 2
CYLINDER: Final = 3
LINE_LIST: Final = 5
SPHERE_LIST: Final = 7
TEXT: Final = 9
_ADD: Final = 0
_DELETE: Final = 2

Colour = tuple[float, float, float, float]
WHITE: Final = (1.0, 1.0, 1.0, 1.0)

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

    :ivar namespace: together with ``id`` it identifies the marker.
    :ivar shape: the type of the marker.
    :ivar points: of a line list, alternately start and end; ``colours``, when given, has one for
        each point.
    """

    namespace: str
    id: int  # noqa: A003
    shape: int
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    colour: Colour = WHITE
    text: str = ''
    points: Sequence[tuple[float, float, float]] = ()
    colours: Sequence[Colour] = ()


class Drawing(NamedTuple):
    """
    The markers of one message.

    :ivar lifetime_s: after which the viewer removes a marker by itself; 0: never.
    """

    markers: Sequence[Marker]
    lifetime_s: int = 0


def marker_array(markers: Sequence[Marker], gone: Sequence[tuple[str, int]], frame_id: str,
                 wall_ns: int, lifetime_s: int) -> bytes:
    """
    Write a message.

    :param gone: namespace and id of the markers to delete.
    :param wall_ns: since 1970.
    :param lifetime_s: after which the viewer removes a marker by itself; 0: never.
    """
    body = bytearray(_COUNT.pack(len(markers) + len(gone)))
    header = _STAMP.pack(*divmod(wall_ns, NS_PER_S)) + text_bytes(frame_id)
    for each in markers:
        _write(body, header, each, _ADD, lifetime_s)
    for namespace, number in gone:
        _write(body, header, Marker(namespace, number, SPHERE), _DELETE, lifetime_s)
    return LITTLE_ENDIAN + bytes(body)


def _write(body: bytearray, header: bytes, each: Marker, action: int,
           lifetime_s: int) -> None:
    _aligned(body, 4, header)
    _aligned(body, 4, text_bytes(each.namespace))
    _aligned(body, 4, _NUMBERS.pack(each.id, each.shape, action))
    _aligned(body, 8, _POSE.pack(*each.position, 0.0, 0.0, 0.0, 1.0) + _SCALE.pack(*each.scale))
    body += _COLOUR.pack(*each.colour)
    body += _STAMP.pack(lifetime_s, 0)
    body += b'\0'  # frame_locked
    _aligned(body, 4, _COUNT.pack(len(each.points)))
    if each.points:
        _aligned(body, 8, b''.join(_SCALE.pack(*point) for point in each.points))
    _aligned(body, 4, _COUNT.pack(len(each.colours)))
    for colour in each.colours:
        body += _COLOUR.pack(*colour)
    # The texture: its resource, then an image (header, format, no data).
    _aligned(body, 4, _NO_TEXT)
    _aligned(body, 4, _STAMP.pack(0, 0) + _NO_TEXT)
    _aligned(body, 4, _NO_TEXT)
    _aligned(body, 4, _COUNT.pack(0))
    _aligned(body, 4, _COUNT.pack(0))  # uv_coordinates
    _aligned(body, 4, text_bytes(each.text))
    _aligned(body, 4, _NO_TEXT)  # the mesh: its resource, then a file (name, no data)
    _aligned(body, 4, _NO_TEXT)
    _aligned(body, 4, _COUNT.pack(0))
    body += b'\0'


def _aligned(body: bytearray, size: int, data: bytes) -> None:
    body += bytes(padding(len(body), size)) + data
