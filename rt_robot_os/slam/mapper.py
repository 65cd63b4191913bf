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
Make a map of scans, and say where each was taken.

Each scan is matched with what was seen last, beginning where odometry says; some are kept as
keyframes; when the robot comes back to a place all of them are moved until they agree.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import numpy as np

from rt_robot_os.slam.correlation import Window
from rt_robot_os.slam.keyframes import edge_of
from rt_robot_os.slam.keyframes import Keyframe
from rt_robot_os.slam.keyframes import LocalMap
from rt_robot_os.slam.keyframes import Match
from rt_robot_os.slam.loops import close
from rt_robot_os.slam.loops import places_near
from rt_robot_os.slam.pose_graph import agree
from rt_robot_os.slam.pose_graph import Edge
from rt_robot_os.slam.scan import Scan
from rt_robot_os.slam.scan import Surface
from rt_robot_os.slam.scan import surface_of
from rt_robot_os.slam.transforms import between
from rt_robot_os.slam.transforms import composed
from rt_robot_os.slam.transforms import Floats
from rt_robot_os.slam.tuning import Tuning

_RAD_AS_M: Final = 0.5
#: Steps shorter than this need no search: odometry is near enough.
_SHORT_M: Final = 0.3
_SHORT_RAD: Final = 0.15
_STEP_COMMON: Final = np.array((0.02, 0.02, 0.004))
#: Standard deviations of odometry within which a scan is looked for, at first.
_WITHIN: Final = 3.0
_STEPS_ONLINE: Final = 6
_STEPS_AT_END: Final = 20


class Mapper:
    """
    A map that grows.

    :ivar keyframes: what it is made of.
    :ivar edges: between them.
    :ivar counts: ``scans``, ``keyframes``, ``searched`` (a window was), ``lost`` (odometry was
        followed, since the scan fitted nowhere), ``loops``, ``refused`` (a loop that odometry
        and other loops contradict), ``empty`` (scans without a point).
    """

    def __init__(self, tuning: Tuning | None = None) -> None:
        self.tuning = tuning or Tuning()
        self.keyframes: list[Keyframe] = []
        self.edges: list[Edge] = []
        self.counts = dict.fromkeys(('scans', 'keyframes', 'searched', 'lost', 'loops', 'refused',
                                     'empty'), 0)
        self._at: list[tuple[int, Floats]] = []  # of each scan: its keyframe, and where from there
        self._local: LocalMap | None = None
        self._revisited: tuple[int, ...] = ()  # keyframes of places where the robot is again
        self._odometry = np.zeros(3)
        self._pose = np.zeros(3)

    def add(self, scan: Scan) -> Floats:
        """
        Take the next scan.

        :return: shape (3,): where its laser was, on the map as it is now. The first is at 0.
        :raises ValueError: odometry is not finite.
        """
        if not np.isfinite(scan.odometry).all():
            raise ValueError(f'odometry says {scan.odometry.tolist()} at {scan.stamp_ns} ns')
        surface = surface_of(scan, self.tuning.range_max_m)
        self.counts['scans'] += 1
        self.counts['empty'] += not len(surface)
        if not self.keyframes:
            self._keep(scan, surface, np.zeros(3), 0.0)
            return self._remember(scan, np.zeros(3))
        step = between(self._odometry, scan.odometry)
        guess = composed(self._pose, step)
        match = self._match(surface, guess, step)
        pose = guess if match is None else match.aligned.pose
        self.counts['lost'] += match is None
        moved = between(self.keyframes[-1].pose, pose)
        if (np.hypot(moved[0], moved[1]) > self.tuning.keyframe_m
                or abs(moved[2]) > self.tuning.keyframe_rad):
            pose = self._extend(scan, surface, pose, match)
        return self._remember(scan, pose)

    def _remember(self, scan: Scan, pose: Floats) -> Floats:
        self._odometry, self._pose = scan.odometry, pose
        last = len(self.keyframes) - 1
        self._at.append((last, between(self.keyframes[last].pose, pose)))
        return pose

    # ---- where a scan is ---------------------------------------------------------------------

    def _match(self, surface: Surface, guess: Floats, step: Floats) -> Match | None:
        """Match a scan with the last keyframes; None when it fits nowhere."""
        local = self._local_map()
        if local.is_empty or not len(surface):
            return None
        t = self.tuning
        way, turn = float(np.hypot(step[0], step[1])), abs(float(step[2]))
        sigma_m = t.odometry_m + t.odometry_per_m * way
        sigma_rad = t.odometry_rad + t.odometry_per_rad * turn
        if way < _SHORT_M and turn < _SHORT_RAD:
            aligned = local.lines.align(surface.points, guess, guess,
                                        self._prior(sigma_m, sigma_rad))
            if aligned.share >= t.share_good:
                return Match(aligned, 0.0)
        self.counts['searched'] += 1
        best = None
        for factor in (1.0, 2.0):
            window = Window(guess, factor * _WITHIN * sigma_m, factor * _WITHIN * sigma_rad,
                            factor * sigma_m, factor * sigma_rad)
            found = local.search(surface, window, self._prior(window.sigma_m, window.sigma_rad))
            if best is None or found.aligned.share > best.aligned.share:
                best = found
            if best.aligned.share >= t.share_good:
                break
        return best if best is not None and best.aligned.share >= t.share_least else None

    def _prior(self, sigma_m: float, sigma_rad: float) -> Floats:
        noise = self.tuning.match_noise_m ** 2
        return np.diag((noise / sigma_m ** 2, noise / sigma_m ** 2, noise / sigma_rad ** 2))

    def _local_map(self) -> LocalMap:
        if self._local is None:
            first = max(0, len(self.keyframes) - self.tuning.local_keyframes)
            known = [*(index for index in self._revisited if index < first),
                     *range(first, len(self.keyframes))]
            self._local = LocalMap([self.keyframes[index] for index in known])
        return self._local

    # ---- how the map grows -------------------------------------------------------------------

    def _extend(self, scan: Scan, surface: Surface, pose: Floats, match: Match | None) -> Floats:
        """Keep a scan, and look whether it closes a loop; return its pose then."""
        last = self.keyframes[-1]
        step = between(last.odometry, scan.odometry)
        way = float(np.hypot(step[0], step[1]))
        index = len(self.keyframes)
        self.edges.append(self._edge_of_odometry(index, last, pose, step) if match is None else
                          self._edge_of_match(index, last, match, step))
        self._keep(scan, surface, pose, last.travelled_m + way + _RAD_AS_M * abs(float(step[2])))
        found = []
        self._revisited = ()
        for place in places_near(self.keyframes, self.edges, self.tuning):
            edge = close(self.keyframes, place, self.tuning)
            if edge is not None:
                found.append(edge)
                self._revisited += place.members
        if found:
            self.counts['loops'] += len(found)
            self.edges.extend(found)
            self._agree(_STEPS_ONLINE)
        return self.keyframes[-1].pose

    def _edge_of_match(self, index: int, last: Keyframe, match: Match, step: Floats) -> Edge:
        """Take what the scan says, and what it does not say as odometry does."""
        t = self.tuning
        way, turn = float(np.hypot(step[0], step[1])), abs(float(step[2]))
        prior = self._prior(t.odometry_m + t.odometry_per_m * way,
                            t.odometry_rad + t.odometry_per_rad * turn)
        aligned = match.aligned
        known = type(aligned)(aligned.pose, aligned.information + prior, aligned.share)
        return edge_of(index - 1, index, last.pose, known, t.match_noise_m, _STEP_COMMON)

    def _edge_of_odometry(self, index: int, last: Keyframe, pose: Floats, step: Floats) -> Edge:
        way, turn = float(np.hypot(step[0], step[1])), abs(float(step[2]))
        sigmas = np.array((0.1 + 0.1 * way, 0.1 + 0.1 * way, 0.03 + 0.05 * turn))
        return Edge(index - 1, index, between(last.pose, pose), np.diag(sigmas ** -2))

    def _keep(self, scan: Scan, surface: Surface, pose: Floats, travelled_m: float) -> None:
        self.keyframes.append(Keyframe(scan.stamp_ns, pose, scan.odometry, surface, travelled_m))
        self.counts['keyframes'] += 1
        self._local = None

    def _agree(self, steps: int) -> None:
        agreed = agree(np.array([each.pose for each in self.keyframes]), self.edges, steps)
        for keyframe, pose in zip(self.keyframes, agreed.poses):
            keyframe.pose = pose
        self.counts['refused'] = int((agreed.weights < 0.3).sum())
        self._local = None

    def finish(self) -> None:
        """Move all keyframes until they agree as well as they can."""
        self._agree(_STEPS_AT_END)

    def trajectory(self) -> Floats:
        """Return the poses of all scans on the map as it is now; shape (scans, 3)."""
        if not self._at:
            return np.zeros((0, 3))
        bases = np.array([self.keyframes[index].pose for index, _ in self._at])
        return composed(bases, np.array([relative for _, relative in self._at]))


def mapped(scans: Iterable[Scan], tuning: Tuning | None = None) -> Mapper:
    """Map a whole log."""
    mapper = Mapper(tuning)
    for scan in scans:
        mapper.add(scan)
    mapper.finish()
    return mapper
