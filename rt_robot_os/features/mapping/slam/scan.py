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

"""A scan, and the surfaces that it shows: points and the lines through them."""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import field

import numpy as np
import numpy.typing as npt

from rt_robot_os.features.mapping.slam.transforms import Floats

#: Shorter ranges are the robot itself or invalid.
NEAREST_M = 0.05
#: Neighbours further apart than this, or than this many steps of the beam, are of two objects.
_GAP_M = 0.15
_GAP_STEPS = 4.0
#: Neighbours on each side that make a line.
_NEIGHBOURS = 3
#: A coordinate that no scan has, for invalid points.
_NOWHERE = 1e9


@dataclass(frozen=True)
class Scan:
    """
    A scan and the pose of odometry at its time.

    :ivar stamp_ns: its time.
    :ivar odometry: shape (3,): x, y in m, yaw in rad; of the laser, in the frame of odometry.
    :ivar ranges: shape (beams,), in m; values that are not finite or out of range are invalid.
    :ivar angle_min: of the first beam in rad, counter-clockwise.
    :ivar angle_increment: from beam to beam in rad; negative for a laser upside down.
    :ivar beam_poses: shape (beams, 3): pose of the laser at each beam, relative to that at the
        stamp; None for a laser that stood still.
    """

    stamp_ns: int
    odometry: Floats
    ranges: Floats
    angle_min: float
    angle_increment: float
    beam_poses: Floats | None = None


@dataclass(frozen=True)
class Surface:
    """
    The surfaces of a scan, in the frame of its laser.

    :ivar points: shape (n, 2), in m.
    :ivar normals: shape (n, 2), of unit length, to the side of the laser; zero where there is no
        line.
    :ivar lined: shape (n,): whether a point lies on a line.
    :ivar echoless: shape (k,): bearings in rad of beams without an echo, those with a range of
        +inf (REP 117); other invalid ranges have no meaning.
    """

    points: Floats
    normals: Floats
    lined: npt.NDArray[np.bool_] = field(repr=False)
    echoless: Floats = field(default_factory=lambda: np.zeros(0), repr=False)

    def __len__(self) -> int:
        return len(self.points)


def surface_of(scan: Scan, range_max: float) -> Surface:
    """
    Return the points of a scan, each with the normal of the line through its neighbours.

    :param range_max: in m; longer ranges are ignored.
    """
    ranges = np.asarray(scan.ranges, dtype=np.float64)
    angles = scan.angle_min + scan.angle_increment * np.arange(len(ranges))
    valid = np.isfinite(ranges) & (ranges > NEAREST_M) & (ranges < range_max)
    safe = np.where(valid, ranges, 0.0)
    if scan.beam_poses is None:
        points = np.stack((safe * np.cos(angles), safe * np.sin(angles)), -1)
    else:
        angles = angles + scan.beam_poses[:, 2]
        points = scan.beam_poses[:, :2] + np.stack(
            (safe * np.cos(angles), safe * np.sin(angles)), -1)
    gap = np.maximum(_GAP_M, _GAP_STEPS * safe * abs(scan.angle_increment))
    apart = np.hypot(*np.diff(points, axis=0).T)
    before, has_before = _reach(points, valid, apart, gap, -1)
    after, has_after = _reach(points, valid, apart, gap, 1)
    along = after - before
    length = np.hypot(along[:, 0], along[:, 1])
    lined = valid & (has_before | has_after) & (length > 1e-6)
    normals = np.zeros_like(points)
    normals[lined] = np.stack((-along[lined, 1], along[lined, 0]), -1) / length[lined, None]
    seen_from = points if scan.beam_poses is None else points - scan.beam_poses[:, :2]
    normals[(normals * seen_from).sum(1) > 0.0] *= -1.0
    echoless = np.asarray(angles[np.isposinf(ranges)], np.float64)
    return Surface(points[valid], normals[valid], lined[valid], echoless)


def _reach(points: Floats, valid: npt.NDArray[np.bool_], apart: Floats, gap: Floats, step: int
           ) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """
    Return how far the line of each point reaches to one side, a few neighbours at most.

    :param apart: shape (n - 1,): how far each point is from the next.
    :param step: 1: to the points that follow; -1: to those before.
    """
    furthest, size = points.copy(), len(points)
    going, moved = valid.copy(), np.zeros(size, dtype=np.bool_)
    for count in range(1, min(_NEIGHBOURS, size - 1) + 1):
        first, last = slice(size - count), slice(count, size)
        here, there, link = ((first, last, slice(count - 1, size - 1)) if step > 0
                             else (last, first, first))
        goes = going[here] & valid[there] & (apart[link] < gap[here])
        going[:] = False
        going[here] = goes
        furthest[here][goes] = points[there][goes]
        moved |= going
    return furthest, moved
