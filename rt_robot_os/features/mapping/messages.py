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

"""The messages that mapping reads and writes, as CDR."""

from __future__ import annotations

from collections.abc import Sequence
import math
import struct
from typing import Final
from typing import NamedTuple

import numpy as np

from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.messages.cdr import CdrReader
from rt_robot_os.messages.cdr import LITTLE_ENDIAN
from rt_robot_os.motion.angles import yaw_of
from rt_robot_os.motion.grid_map import GridMap

MAP_FRAME: Final = 'map'
_FRAME: Final = MAP_FRAME.encode() + b'\0'

# The stamp of the header is set by the node: the sample has a stamp of its own.
_HEAD: Final = struct.Struct(f'<iiI{len(_FRAME)}s')
_POSE: Final = struct.Struct('<7d36d')
_GOAL: Final = struct.Struct('<7d')
_TWIST: Final = struct.Struct('<6d')
_GRID: Final = struct.Struct('<iifII4x7dI')
_COUNTS: Final = struct.Struct('<III')
_PLANE: Final = (0, 1, 5)  # x, y and the turn about z among the six of a covariance
#: Variance of height, roll and pitch, which a robot on a floor does not change.
_FLAT: Final = 1e-6
_RANGES_MOST: Final = 100_000


class ScanMessage(NamedTuple):
    """A ``sensor_msgs/msg/LaserScan``; times in s, lengths in m, angles in rad."""

    frame_id: str
    angle_min: float
    angle_increment: float
    time_increment_s: float
    scan_time_s: float
    range_min: float
    range_max: float
    ranges: Floats


class PoseMessage(NamedTuple):
    """
    A pose with its covariance, in the plane.

    :ivar pose: shape (3,): x, y in m, yaw in rad.
    :ivar covariance: shape (3, 3).
    """

    frame_id: str
    pose: Floats
    covariance: Floats


def scan_in(cdr: bytes) -> ScanMessage:
    """
    Read a ``sensor_msgs/msg/LaserScan``.

    :raises ValueError: it is malformed.
    """
    reader = CdrReader(cdr)
    reader.skip(4, 8)
    frame_id = reader.text()
    low, _, step, beam_s, scan_s, nearest, furthest = struct.unpack_from(
        '<7f', cdr, reader.skip(4, 28))
    count = reader.count()
    if count > _RANGES_MOST:
        raise ValueError(f'a scan of {count} beams')
    ranges = np.frombuffer(cdr, '<f4', count, reader.skip(4, 4 * count)).astype(np.float64)
    return ScanMessage(frame_id, low, step, beam_s, scan_s, nearest, furthest, ranges)


def odometry_in(cdr: bytes) -> tuple[float, float, float]:
    """
    Read the pose of a ``nav_msgs/msg/Odometry``: x, y in m, yaw in rad.

    :raises ValueError: it is malformed, or a number is not finite.
    """
    reader = CdrReader(cdr)
    reader.skip(4, 8)
    reader.text()
    reader.text()
    x, y, _, *turn = reader.doubles(7)
    return _plane(x, y, turn)


def pose_in(cdr: bytes) -> PoseMessage:
    """
    Read a ``geometry_msgs/msg/PoseWithCovarianceStamped``.

    :raises ValueError: it is malformed, or a number is not finite.
    """
    reader = CdrReader(cdr)
    reader.skip(4, 8)
    frame_id = reader.text()
    x, y, _, *turn = reader.doubles(7)
    covariance = np.array(reader.doubles(36)).reshape(6, 6)[np.ix_(_PLANE, _PLANE)]
    if not np.isfinite(covariance).all():
        raise ValueError('its covariance is not finite')
    return PoseMessage(frame_id, np.array(_plane(x, y, turn)), covariance)


def _plane(x: float, y: float, turn: Sequence[float]) -> tuple[float, float, float]:
    length = math.sqrt(sum(each * each for each in turn))
    if not (math.isfinite(x) and math.isfinite(y) and 0.5 < length < 2.0):
        raise ValueError(f'x {x:g}, y {y:g} and a quaternion of length {length:g} are not a pose')
    qx, qy, qz, qw = turn
    return x, y, yaw_of(qx, qy, qz, qw)


def pose_message(pose: Floats, covariance: Floats) -> bytes:
    """Write a ``geometry_msgs/msg/PoseWithCovarianceStamped`` on the map."""
    whole = np.zeros((6, 6))
    whole[np.ix_(_PLANE, _PLANE)] = covariance
    whole[(2, 3, 4), (2, 3, 4)] = _FLAT
    return LITTLE_ENDIAN + _HEAD.pack(0, 0, len(_FRAME), _FRAME) + _POSE.pack(
        *_in_space(pose), *whole.ravel().tolist())


def _in_space(pose: Sequence[float] | Floats) -> tuple[float, ...]:
    x, y, yaw = (float(each) for each in pose)
    return x, y, 0.0, 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)


def goal_message(pose: Floats) -> bytes:
    """Write a ``geometry_msgs/msg/PoseStamped`` on the map."""
    return LITTLE_ENDIAN + _HEAD.pack(0, 0, len(_FRAME), _FRAME) + _GOAL.pack(*_in_space(pose))


def turn_message(rate_rad_s: float) -> bytes:
    """Write a ``geometry_msgs/msg/Twist`` of a robot that turns on the spot."""
    return LITTLE_ENDIAN + _TWIST.pack(0.0, 0.0, 0.0, 0.0, 0.0, rate_rad_s)


def bool_message(value: bool) -> bytes:
    """Write a ``std_msgs/msg/Bool``."""
    return LITTLE_ENDIAN + bytes((value,))


def grid_message(grid: GridMap) -> bytes:
    """Write a ``nav_msgs/msg/OccupancyGrid``."""
    cells = np.ascontiguousarray(grid.cells)
    return LITTLE_ENDIAN + _HEAD.pack(0, 0, len(_FRAME), _FRAME) + _GRID.pack(
        0, 0, grid.resolution_m, grid.columns, grid.rows, *_in_space(grid.origin),
        cells.size) + cells.tobytes()


def numbers_message(numbers: Sequence[float] | Floats) -> bytes:
    """Write a ``std_msgs/msg/Float64MultiArray`` without a layout."""
    values = np.asarray(numbers, dtype='<f8')
    return LITTLE_ENDIAN + _COUNTS.pack(0, 0, values.size) + (
        bytes(4) + values.tobytes() if values.size else b'')
