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
Blind sectors of a scanner: directions without valid readings, and their free space.

A ray without a valid reading (NaN, 0, less than ``range_min``) leaves its direction unknown; +inf
is a reading: nothing within range (REP 117). Such a ray does not make its direction free.
Two things are still known there:

- Between two valid rays an obstacle of a given size fits only where the gap is as wide, so single
  lost rays have no effect.
- Space that recent scans saw free is free, less the distance an obstacle may have moved since.

Beyond both is unknown space, which may contain the centre of an obstacle. Its border is given as
points, at most one for each 2.5 degrees. Safe in the real-time loop; docs/safety.md has the cost.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
import math
from typing import Any
from typing import Final
from typing import NamedTuple

import numpy as np

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.navigation.collision_guard.sensors import Scanner
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.zones import Array
from rt_robot_os.motion.zones import Footprint
from rt_robot_os.motion.zones import Mask
from rt_robot_os.motion.zones import TOUCHING_M

# Directions in which the end of the free space is computed are so far apart, in rad.
_GROUP_RAD: Final = math.radians(2.5)
# Places along each of them.
_STEPS: Final = 14
# Stored scans: their number, and the minimum time between them.
_SCANS_MOST: Final = 8
_SCAN_EVERY_NS: Final = NS_PER_S // 4
# The pose between two scans is that of the commands: an error to each side in rad, one in m, and
# one for each m that was driven.
_ERROR_RAD: Final = 0.05
_ERROR_M: Final = 0.03
_ERROR_SHARE: Final = 0.1
_OUTLINE_STEP_M: Final = 0.01
_NONE: Final[Array] = np.empty(0)
_TURN: Final = 2 * math.pi


class _RememberedScan(NamedTuple):
    """A stored scan: its time, the pose of ``base_link``, and the free length of each ray."""

    stamp_ns: int
    pose: Pose
    free_m: Array


class BlindSectors:
    """
    The end of the known free space in the blind sectors of one scanner.

    :param settings: of the guard: ``unseen_size_m``, ``unseen_speed_m_s``.
    :ivar x: of the nearest possible centres of unseen obstacles, in m in ``base_link``; as is y.
    :ivar blind_rad: angle of the view without valid readings.
    """

    def __init__(self, scanner: Scanner, footprint: Footprint,
                 settings: Mapping[str, Any]) -> None:
        self.topic = scanner.topic
        self.x = self.y = _NONE
        self.blind_rad = 0.0
        self._scanner = scanner
        self._footprint = footprint
        self._settings = settings
        self._geometry: tuple[float, float, int] = math.nan, math.nan, 0
        self._size_m = 0.0
        self._scans: deque[_RememberedScan] = deque(maxlen=_SCANS_MOST + 1)
        self._groups = self._middles = np.empty(0, np.intp)
        self._outline_m = _NONE
        self._blind_groups = np.empty(0, np.intp)

    @property
    def driven_m(self) -> float:
        """Return the distance driven until the last scan."""
        return self._scanner.driven_m

    def update(self, pose: Pose, window_m: float) -> None:
        """
        Compute the blind sectors of the last scan.

        :param pose: of ``base_link`` at the time of the scan, in any fixed frame.
        :param window_m: points further away from the robot are ignored.
        """
        scanner = self._scanner
        geometry = *scanner.geometry, scanner.blind.size
        if geometry != self._geometry or self._settings['unseen_size_m'] != self._size_m:
            self._measure(geometry)
        free_m = self._free(scanner.ranges, scanner.blind)
        far_m = window_m + math.hypot(*scanner.at_m[:2])
        scan = _RememberedScan(scanner.stamp_ns, pose, np.minimum(free_m, far_m))
        self.blind_rad = float(np.count_nonzero(scanner.blind)) * abs(geometry[1])
        self._find(scan, np.where(scanner.blind, free_m, math.inf), far_m)
        self._remember(scan)

    def sector(self, point: int) -> tuple[float, float]:
        """Return first and last angle, in rad in ``base_link``, of the sector of a point."""
        groups = self._blind_groups
        apart = np.flatnonzero(np.diff(groups) > 1) + 1
        run = int(np.searchsorted(apart, point, side='right'))
        part = np.split(groups, apart)[run]
        along, across = self._scanner.directions
        ends = [float(math.atan2(across[i], along[i])) for i in self._middles[part[[0, -1]]]]
        return min(ends), max(ends)

    # ---- work --------------------------------------------------------------------------------

    def _measure(self, geometry: tuple[float, float, int]) -> None:
        """Choose the directions; again only when the scan geometry changes."""
        self._geometry = geometry
        self._size_m = self._settings['unseen_size_m']
        self._scans.clear()
        _, step, count = geometry
        every = max(1, int(_GROUP_RAD / max(abs(step), 1e-9)))
        self._groups = np.arange(0, count, every)
        self._middles = np.minimum(self._groups + every // 2, count - 1)
        along, across = (each[self._middles] for each in self._scanner.directions)
        x0, y0, _ = self._scanner.at_m
        room_m = max(self._size_m / 2, 2 * TOUCHING_M)
        far_m = self._footprint.reach_m + math.hypot(x0, y0) + room_m
        radii = np.arange(0.0, far_m + 2 * _OUTLINE_STEP_M, _OUTLINE_STEP_M)
        inside = self._footprint.room(x0 + np.outer(along, radii), y0 + np.outer(across, radii)
                                      ) < room_m
        # Behind the last place that is too narrow for it.
        last = radii.size - np.argmax(inside[:, ::-1], axis=1)
        self._outline_m = np.where(inside.any(axis=1), last * _OUTLINE_STEP_M, 0.0)

    def _free(self, ranges: Array, blind: Mask) -> Array:
        """Return the free length of each ray; of a blind one as far as its neighbours imply."""
        free_m = np.where(blind, 0.0, ranges).astype(np.float64)
        if not blind.any() or blind.all():
            return free_m
        _, step, count = self._geometry
        # An all-round scan has no first ray: start with one that is valid.
        shift = int(np.argmin(blind)) if self._is_round() else 0
        free_m, blind = np.roll(free_m, -shift), np.roll(blind, -shift)
        edges = np.flatnonzero(np.diff(np.concatenate(([False], blind, [False]))))
        begins, ends = edges[::2], edges[1::2]
        lengths = ends - begins
        is_open = begins == 0, (ends == count) & (not self._is_round())
        before = np.where(is_open[0], math.inf, free_m[begins - 1])
        after = np.where(is_open[1], math.inf, free_m[ends % count])
        at = np.flatnonzero(blind)
        left = np.where(np.repeat(is_open[0], lengths), count, at - np.repeat(begins, lengths) + 1)
        right = np.where(np.repeat(is_open[1], lengths), count, np.repeat(ends, lengths) - at)
        # The centre of a just hidden obstacle is its radius away from the next valid ray.
        aside_rad = np.minimum(np.minimum(left, right) * abs(step), math.pi / 2)
        hidden_m = self._settings['unseen_size_m'] / 2 / np.sin(aside_rad)
        beside_m = np.repeat(np.maximum(np.minimum(before, after), 0.0), lengths)
        free_m[blind] = np.minimum(hidden_m, beside_m)
        return np.roll(free_m, shift)

    def _is_round(self) -> bool:
        _, step, count = self._geometry
        return abs(step) * (count + 0.5) >= _TURN

    def _find(self, scan: _RememberedScan, blind_m: Array, far_m: float) -> None:
        """Compute where the known free space ends in the blind directions."""
        nearest_m = np.minimum.reduceat(blind_m, self._groups)
        groups = np.flatnonzero(nearest_m < far_m)
        self.x = self.y = _NONE
        if not groups.size:
            return
        along, across = (each[self._middles[groups]] for each in self._scanner.directions)
        x0, y0, _ = self._scanner.at_m
        begin_m = self._outline_m[groups]
        radii = begin_m[:, None] + np.maximum(far_m - begin_m, 0.0)[:, None] * (
            np.arange(1, _STEPS + 1) / _STEPS)
        unknown = radii > nearest_m[groups][:, None]
        self._recall(unknown, x0 + radii * along[:, None], y0 + radii * across[:, None], scan)
        ended = np.flatnonzero(unknown.any(axis=1))
        first = np.argmax(unknown[ended], axis=1)
        # Of the last place that is known, or of the gap where that is further.
        known_m = np.where(first > 0, radii[ended, first - 1], begin_m[ended])
        end_m = np.maximum(known_m, np.minimum(nearest_m[groups[ended]], radii[ended, first]))
        self._blind_groups = groups[ended]
        self.x = x0 + end_m * along[ended]
        self.y = y0 + end_m * across[ended]

    def _recall(self, unknown: Mask, x: Array, y: Array, now: _RememberedScan) -> None:
        """Remove the places that recent scans saw free from the unknown ones."""
        first, step, count = self._geometry
        to_scanner = self._scanner.to_scanner
        if to_scanner is None:
            return
        spread = math.ceil(_ERROR_RAD / abs(step))
        x0, y0, _ = self._scanner.at_m
        for scan in reversed(self._scans):
            left = np.flatnonzero(unknown)
            if not left.size:
                return
            moved = _relative(scan.pose, now.pose)
            age_s = (now.stamp_ns - scan.stamp_ns) / NS_PER_S
            margin_m = (_ERROR_M + _ERROR_SHARE * math.hypot(moved[0], moved[1])
                        + self._settings['unseen_speed_m_s'] * age_s)
            c, s = math.cos(moved[2]), math.sin(moved[2])
            px, py = x.flat[left], y.flat[left]
            dx, dy = moved[0] + c * px - s * py - x0, moved[1] + s * px + c * py - y0
            angle = np.arctan2(to_scanner[1, 0] * dx + to_scanner[1, 1] * dy,
                               to_scanner[0, 0] * dx + to_scanner[0, 1] * dy)
            ray = np.rint(np.mod(math.copysign(1.0, step) * (angle - first), _TURN)
                          / abs(step)).astype(np.intp)
            far_m = np.hypot(dx, dy) + margin_m
            free = np.ones(left.size, bool)
            for side in (-spread, 0, spread):
                other = ray + side
                if self._is_round():
                    other %= count
                inside = (other >= 0) & (other < count)
                free &= inside & (scan.free_m[np.where(inside, other, 0)] >= far_m)
            unknown.flat[left[free]] = False

    def _remember(self, scan: _RememberedScan) -> None:
        """Store the scan, unless the last one was stored just before."""
        scans = self._scans
        if len(scans) > 1 and scans[-1].stamp_ns - scans[-2].stamp_ns < _SCAN_EVERY_NS:
            scans.pop()
        scans.append(scan)


def _relative(before: Pose, now: Pose) -> Pose:
    """Return the second pose as seen from the first."""
    x, y = now[0] - before[0], now[1] - before[1]
    c, s = math.cos(before[2]), math.sin(before[2])
    return c * x + s * y, c * y - s * x, now[2] - before[2]
