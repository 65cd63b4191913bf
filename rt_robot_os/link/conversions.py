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
Messages that ROS has in another type than the core, converted as CDR bytes.

Topics of the core hold messages of fixed shape: a path is a row of numbers, a sensor network is
rows of numbers, diagnostics are a string, and each transform has its own topic. ROS has a
``Path``, each pose of which names its frame, a ``MarkerArray``, a ``DiagnosticArray``, and
``/tf``, on which all transforms are published.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence
from dataclasses import dataclass
import math
import struct
from typing import Final
from typing import TypeAlias

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.link.drawings import to_markers
from rt_robot_os.messages.cdr import CdrReader
from rt_robot_os.messages.cdr import ENCAPSULATION
from rt_robot_os.messages.cdr import labelled_numbers
from rt_robot_os.messages.cdr import LITTLE_ENDIAN
from rt_robot_os.messages.cdr import padding
from rt_robot_os.messages.cdr import string_in
from rt_robot_os.messages.cdr import text_bytes
from rt_robot_os.messages.diagnostic_array import diagnostic_array
from rt_robot_os.messages.diagnostic_array import DIAGNOSTICS
from rt_robot_os.messages.diagnostic_array import statuses_of
from rt_robot_os.messages.diagnostic_array import TEXT_BYTES_MAXIMUM
from rt_robot_os.messages.marker_array import MARKERS
from rt_robot_os.motion.angles import yaw_of

TRANSFORM: Final = 'geometry_msgs/msg/TransformStamped'
TRANSFORMS: Final = 'tf2_msgs/msg/TFMessage'
NUMBERS: Final = 'std_msgs/msg/Float64MultiArray'
TEXT: Final = 'std_msgs/msg/String'
PATH: Final = 'nav_msgs/msg/Path'
GOAL: Final = 'geometry_msgs/msg/PoseStamped'
ESTIMATE: Final = 'geometry_msgs/msg/PoseWithCovarianceStamped'

#: From the message of the core and its time since 1970 in ns to the message of ROS.
Outward: TypeAlias = Callable[[memoryview, int], bytes]
#: From the message of ROS to that of the core; raises ValueError if it is not valid.
Inward: TypeAlias = Callable[[bytes], bytes]

_DOUBLE: Final = 8
_STAMP: Final = struct.Struct('<iI')
_COUNT: Final = struct.Struct('<I')
_TRIPLET: Final = struct.Struct('<3d')
_POSE: Final = struct.Struct('<7d')
# Of a Float64MultiArray without dimensions: their count, data_offset, the length of the data.
_NUMBERS_HEAD: Final = struct.Struct('<III4x')


@dataclass(frozen=True)
class Conversion:
    """
    A pair of types.

    :ivar core: the type of the topic in the core.
    :ivar ros: the type of the topic in ROS.
    :ivar frame_id: the frame of the ROS message, unless the mirror has another.
    :ivar outward: makes the converter to ROS, from the frame; None if there is none.
    :ivar inward: makes the converter from ROS, from the frame and the longest message of the core
        in bytes; None if there is none.
    """

    core: str
    ros: str
    frame_id: str = ''
    outward: Callable[[str], Outward] | None = None
    inward: Callable[[str, int], Inward] | None = None

    def factory(self, direction: str) -> Callable[..., Outward | Inward] | None:
        """Return the factory of the converter for a direction, ``out`` or ``in``."""
        return self.outward if direction == 'out' else self.inward


# ---- transforms ------------------------------------------------------------------------------

def to_transforms(frame_id: str = '') -> Outward:
    """Make a converter from one transform to a message with only this transform."""
    return _to_transforms


def _to_transforms(cdr: memoryview, wall_ns: int) -> bytes:
    return transforms_of([_STAMP.pack(*divmod(wall_ns, NS_PER_S)) + bytes(
        cdr[ENCAPSULATION + _STAMP.size:])])


def transforms_of(transforms: Sequence[bytes]) -> bytes:
    """
    Join transforms to a ``tf2_msgs/msg/TFMessage``.

    :param transforms: each a ``TransformStamped`` as CDR, little-endian, without encapsulation.
    """
    body = bytearray(_COUNT.pack(len(transforms)))
    for each in transforms:
        end = _end_of_names(each)
        body += bytes(padding(len(body), _COUNT.size)) + each[:end]
        start = end + padding(end, _DOUBLE)
        body += bytes(padding(len(body), _DOUBLE)) + each[start:start + _POSE.size]
    return LITTLE_ENDIAN + bytes(body)


def _end_of_names(transform: bytes) -> int:
    """Return the offset behind frame_id and child_frame_id."""
    end = _STAMP.size
    for _ in range(2):
        end += padding(end, _COUNT.size)
        end += _COUNT.size + _COUNT.unpack_from(transform, end)[0]
    return end


def transform(frame_id: str, child_frame_id: str, pose: Sequence[float], wall_ns: int) -> bytes:
    """
    Write a ``TransformStamped``, without encapsulation.

    :param pose: x, y, z in m, then the quaternion x, y, z, w.
    """
    body = _STAMP.pack(*divmod(wall_ns, NS_PER_S)) + text_bytes(frame_id)
    body += bytes(padding(len(body), _COUNT.size)) + text_bytes(child_frame_id)
    return body + bytes(padding(len(body), _DOUBLE)) + _POSE.pack(*pose)


# ---- paths -----------------------------------------------------------------------------------

def to_path(frame_id: str) -> Outward:
    """Make a converter from triplets x, y, yaw (m, rad) to a path."""
    frame = text_bytes(frame_id)

    def convert(cdr: memoryview, wall_ns: int) -> bytes:
        header = _STAMP.pack(*divmod(wall_ns, NS_PER_S)) + frame
        numbers = _numbers(cdr)
        body = bytearray(header)
        body += bytes(padding(len(body), _COUNT.size)) + _COUNT.pack(len(numbers) // 3)
        for x, y, yaw in zip(*[iter(numbers)] * 3):
            body += bytes(padding(len(body), _COUNT.size)) + header
            body += bytes(padding(len(body), _DOUBLE)) + _POSE.pack(
                x, y, 0.0, 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
        return LITTLE_ENDIAN + bytes(body)

    return convert


def _numbers(cdr: memoryview) -> tuple[float, ...]:
    return labelled_numbers(cdr)[1]


def from_path(frame_id: str, maximum_bytes: int) -> Inward:
    """
    Make a converter from a path to triplets x, y, yaw.

    :param frame_id: of the path; the frames of its poses may be empty.
    :param maximum_bytes: of a message of the core.
    """
    maximum = (maximum_bytes - ENCAPSULATION - _NUMBERS_HEAD.size) // _TRIPLET.size

    def convert(cdr: bytes) -> bytes:
        reader = CdrReader(cdr)
        reader.skip(4, 8)
        _check_frame(reader.text(), frame_id)
        count = reader.count()
        if count > maximum:
            raise ValueError(f'{count} poses, and the topic of the core can hold {maximum}: give '
                             'it a larger tail, three numbers for each')
        found = bytearray(LITTLE_ENDIAN + _NUMBERS_HEAD.pack(0, 0, 3 * count))
        for index in range(count):
            reader.skip(4, 8)
            own = reader.text()
            if own:
                _check_frame(own, frame_id, f'pose {index} ')
            found += _TRIPLET.pack(*_in_plane(reader.doubles(7), f'pose {index}'))
        return bytes(found) if count else bytes(found[:-4])

    return convert


def pose_message(frame_id: str, pose: Sequence[float], wall_ns: int) -> bytes:
    """
    Write a ``geometry_msgs/msg/PoseStamped``.

    :param pose: x, y, z in m, then the quaternion x, y, z, w.
    :param wall_ns: since 1970.
    """
    body = _STAMP.pack(*divmod(wall_ns, NS_PER_S)) + text_bytes(frame_id)
    return LITTLE_ENDIAN + body + bytes(padding(len(body), _DOUBLE)) + _POSE.pack(*pose)


def _in_plane(pose: Sequence[float], what: str) -> tuple[float, float, float]:
    x, y, z, *quaternion = pose
    _unit(pose, what)
    a, b, c, d = quaternion
    return x, y, yaw_of(a, b, c, d)


def _unit(pose: Sequence[float], what: str) -> tuple[float, ...]:
    """
    Return the quaternion of a pose with length 1.

    :raises ValueError: a number is not finite, or the quaternion has no direction.
    """
    if not all(map(math.isfinite, pose)):
        raise ValueError(f'{what} has a number that is not finite')
    length = math.hypot(*pose[3:])
    if not 1e-6 < length < 1e6:
        raise ValueError(f'{what} has a quaternion of length {length:g}: it must be 1 '
                         '(no rotation: x 0, y 0, z 0, w 1)')
    return tuple(each / length for each in pose[3:])


def _check_frame(found: str, wanted: str, what: str = '') -> None:
    if found != wanted:
        remedy = f'it must be {wanted!r}; transform it to that frame first' if wanted else (
            'the topic of the core has none; declare it with fixed: {header.frame_id: map}')
        raise ValueError(f'{what}frame_id {found[:60]!r}: {remedy}')


# ---- goals and initial poses -----------------------------------------------------------------

def check_pose(frame_id: str, maximum_bytes: int) -> Inward:
    """Make a converter that accepts poses in this frame and normalises their quaternion."""
    def convert(cdr: bytes) -> bytes:
        reader = CdrReader(cdr)
        reader.skip(4, 8)
        _check_frame(reader.text(), frame_id)
        pose = reader.doubles(7)
        start = reader.at - _POSE.size
        return cdr[:start] + _POSE.pack(*pose[:3], *_unit(pose, 'it')) + cdr[reader.at:]

    return convert


# ---- diagnostics -----------------------------------------------------------------------------

def to_diagnostics(frame_id: str = '') -> Outward:
    """
    Make a converter from a string with diagnostics in JSON to a ``DiagnosticArray``.

    :return: raises ValueError when the string is not valid.
    """
    frame = text_bytes(frame_id)

    def convert(cdr: memoryview, wall_ns: int) -> bytes:
        if len(cdr) > TEXT_BYTES_MAXIMUM:
            raise ValueError(f'{len(cdr)} bytes: at most {TEXT_BYTES_MAXIMUM} are allowed')
        return diagnostic_array(statuses_of(string_in(cdr)), wall_ns, frame)

    return convert


# ---- the table -------------------------------------------------------------------------------

CONVERSIONS: Final = (
    Conversion(TRANSFORM, TRANSFORMS, '', to_transforms),
    Conversion(NUMBERS, PATH, 'map', to_path, from_path),
    Conversion(NUMBERS, MARKERS, 'map', to_markers),
    Conversion(TEXT, DIAGNOSTICS, '', to_diagnostics),
)
#: Types in ROS with one header, whose frame_id a mirror may set.
FRAMED: Final = (PATH, MARKERS, DIAGNOSTICS)
#: Types that are checked when they come from ROS, although they are not converted.
CHECKED: Final = {GOAL: check_pose, ESTIMATE: check_pose}


def find(core: str, ros: str) -> Conversion | None:
    """Return the conversion of a pair of types; None if there is none."""
    return next((each for each in CONVERSIONS if (each.core, each.ros) == (core, ros)), None)


def possible(direction: str) -> str:
    """Return the pairs that can be converted in a direction, ``out`` or ``in``."""
    return ', '.join(
        f'{each.core} as {each.ros}' for each in CONVERSIONS
        if each.factory(direction) is not None)
