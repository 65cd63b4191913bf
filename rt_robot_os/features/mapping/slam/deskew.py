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
Correct scans for the motion of the laser: its pose at each beam, by odometry.

The mounting of a laser in the plane is a position, a direction, and whether it is upside down.
"""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Final

import numpy as np

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.mapping.slam.odometry_track import OdometryTrack
from rt_robot_os.features.mapping.slam.scan import Scan
from rt_robot_os.features.mapping.slam.transforms import between
from rt_robot_os.features.mapping.slam.transforms import composed
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.motion.quaternion import rotate

#: Longest duration of a sweep.
SWEEP_MOST_S: Final = 1.0
#: Motion within a sweep below the noise of a beam.
_STILL_M: Final = 5e-4
_STILL_RAD: Final = 2e-4


@dataclass(frozen=True)
class LaserMount:
    """
    The mounting of a laser on the robot.

    :ivar pose: shape (3,): x, y in m, yaw in rad in ``base_link``.
    :ivar is_mirrored: it hangs upside down: its beams turn clockwise.
    :ivar tilt_rad: angle between its plane and the floor.
    """

    pose: Floats
    is_mirrored: bool = False
    tilt_rad: float = 0.0

    @classmethod
    def of(cls, mounting: Mounting) -> LaserMount:
        """Project a mounting in space to the plane."""
        turn = mounting.quaternion()
        ahead, up = rotate(turn, (1.0, 0.0, 0.0)), rotate(turn, (0.0, 0.0, 1.0))
        x, y, _ = mounting.position_m
        return cls(np.array((x, y, math.atan2(ahead[1], ahead[0]))), up[2] < 0.0,
                   math.acos(min(1.0, abs(up[2]))))

    def lasers(self, bases: Floats) -> Floats:
        """Return poses of the laser for those of ``base_link``; shape (..., 3)."""
        return composed(bases, np.broadcast_to(self.pose, bases.shape))

    def base(self, laser: Floats) -> Floats:
        """Return the pose of ``base_link`` for one of the laser; shape (3,)."""
        return composed(laser, self._back)

    def bases(self, lasers: Floats) -> Floats:
        """Return poses of ``base_link`` for those of the laser; shape (n, 3)."""
        return composed(lasers, np.broadcast_to(self._back, lasers.shape))

    def covariance_of_base(self, laser: Floats, covariance: Floats) -> Floats:
        """
        Return the covariance of ``base_link`` for that of the laser.

        :param laser: shape (3,): its pose.
        :param covariance: shape (3, 3), along the axes of the map; so is what is returned.
        """
        x, y, _ = self._back
        cosine, sine = math.cos(laser[2]), math.sin(laser[2])
        lever = np.eye(3)
        lever[:2, 2] = -sine * x - cosine * y, cosine * x - sine * y
        return np.asarray(lever @ covariance @ lever.T)

    @property
    def _back(self) -> Floats:
        return between(self.pose, np.zeros(3))


@dataclass(frozen=True)
class Sweep:
    """
    A scan as published by its driver.

    :ivar stamp_ns: of the first beam.
    :ivar ranges: shape (beams,), in m; not finite where nothing was measured.
    :ivar beam_s: time from beam to beam; negative if the last one was measured first.
    """

    stamp_ns: int
    ranges: Floats
    angle_min: float
    angle_increment: float
    beam_s: float = 0.0

    @property
    def span_ns(self) -> tuple[int, int]:
        """Return the times of its earliest and its latest beam."""
        other_ns = self.stamp_ns + round(self.beam_s * max(0, len(self.ranges) - 1) * NS_PER_S)
        return min(self.stamp_ns, other_ns), max(self.stamp_ns, other_ns)


def scan_of(sweep: Sweep, track: OdometryTrack, mount: LaserMount) -> Scan:
    """
    Return a scan with the pose of the laser at each beam.

    :param track: covers the sweep.
    """
    count = len(sweep.ranges)
    # Also for a single beam, or none.
    offsets = np.rint(np.arange(max(1, count)) * (sweep.beam_s * NS_PER_S)).astype(np.int64)
    lasers = mount.lasers(track.at(sweep.stamp_ns + offsets))
    seen = between(np.broadcast_to(lasers[0], lasers.shape), lasers)
    moved = bool((np.hypot(seen[:, 0], seen[:, 1]) > _STILL_M).any()
                 or (np.abs(seen[:, 2]) > _STILL_RAD).any())
    way = -1.0 if mount.is_mirrored else 1.0
    return Scan(sweep.stamp_ns, lasers[0], sweep.ranges, way * sweep.angle_min,
                way * sweep.angle_increment, seen if moved and count else None)


def beam_seconds(time_increment_s: float, scan_time_s: float, angle_increment: float,
                 beams: int) -> float:
    """
    Return the time from beam to beam of a ``sensor_msgs/msg/LaserScan``.

    Drivers that leave ``time_increment`` at 0 may still say how long a turn takes (``scan_time``).

    :return: 0 when the message has no plausible value.
    """
    found = time_increment_s
    if found == 0.0 and scan_time_s > 0.0:
        found = scan_time_s * abs(angle_increment) / math.tau
    return found if abs(found) * beams <= SWEEP_MOST_S else 0.0
