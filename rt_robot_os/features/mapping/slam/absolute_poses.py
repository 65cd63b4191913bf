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
"""Absolute poses as edges of the graph: thinned, at most one for each keyframe."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from dataclasses import dataclass
from dataclasses import replace
from typing import Final

import numpy as np

from rt_robot_os.features.mapping.slam.graph import MapGraph
from rt_robot_os.features.mapping.slam.pose_graph import AbsolutePose
from rt_robot_os.features.mapping.slam.transforms import between
from rt_robot_os.features.mapping.slam.transforms import composed
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.features.mapping.slam.transforms import wrapped

#: Scans between which a fix may lie, and fixes that wait for the scan after them.
_SCANS: Final = 64
_WAITING: Final = 16
#: What is known of a keyframe's place becomes no surer by more than so many fixes.
_INFORMATION_MOST: Final = 4.0
#: Squared distance, in variances, up to which two fixes agree.
_CONSISTENT_CHI2: Final = 16.0
#: The map is put right after so many fixes of keyframes that had one.
_OPTIMISE_AFTER: Final = 20
#: A match is that uncertain, in m and rad.
_MATCH_COVARIANCE: Final = np.diag((0.02 ** 2, 0.02 ** 2, 0.01 ** 2))


@dataclass(frozen=True)
class _RecordedScan:
    """Where a scan was taken, seen from a keyframe."""

    stamp_ns: int
    odometry: Floats
    keyframe: int
    relative: Floats


class AbsoluteConstraints:
    """
    What an absolute source says, until it is an edge.

    :param counts: of the mapper; ``fixes`` and ``fixes_left`` are counted there.
    """

    def __init__(self, graph: MapGraph, counts: dict[str, int]) -> None:
        self._graph, self._counts = graph, counts
        self._scans: deque[_RecordedScan] = deque(maxlen=_SCANS)
        self._waiting: deque[tuple[int, Floats, Floats]] = deque()
        self._more = 0

    def add(self, stamp_ns: int, pose: Floats, covariance: Floats) -> bool:
        """
        Take an absolute pose.

        :return: whether the map has to agree with something new.
        :raises ValueError: that is no pose, or its covariance none.
        """
        pose, covariance = np.asarray(pose, np.float64), np.asarray(covariance, np.float64)
        if pose.shape != (3,) or not np.isfinite(pose).all():
            raise ValueError(f'a fix at {stamp_ns} ns is at {pose.tolist()}: x, y in m, yaw in '
                             'rad are a pose')
        if (covariance.shape != (3, 3) or not np.isfinite(covariance).all()
                or np.linalg.eigvalsh((covariance + covariance.T) / 2).min() <= 0.0):
            raise ValueError(f'a fix at {stamp_ns} ns has the covariance {covariance.tolist()}: '
                             '3 x 3 numbers in m and rad, positive definite, are one')
        if len(self._waiting) == _WAITING:
            self._waiting.popleft()
            self._counts['fixes_left'] += 1
        self._waiting.append((stamp_ns, pose, covariance))
        return self._make_constraints()

    def record_scan(self, stamp_ns: int, odometry: Floats, keyframe: int, relative: Floats
                    ) -> bool:
        """Notice where a scan was taken; return as :meth:`add` does."""
        if self._scans and stamp_ns <= self._scans[-1].stamp_ns:
            self._scans.clear()
        self._scans.append(_RecordedScan(stamp_ns, odometry, keyframe, relative))
        return self._make_constraints()

    def restart(self) -> None:
        """Forget where scans were taken: the robot is elsewhere."""
        self._scans.clear()

    def remove_keyframe(self, index: int, successor: int, seen_from_successor: Floats) -> None:
        """Follow a keyframe that is taken out of the list, as the trajectory does."""
        self._scans = deque((
            replace(each, keyframe=successor - (successor > index),
                    relative=composed(seen_from_successor, each.relative))
            if each.keyframe == index else
            replace(each, keyframe=each.keyframe - (each.keyframe > index))
            for each in self._scans), _SCANS)

    def _make_constraints(self) -> bool:
        """Make edges of the fixes that lie between two scans."""
        is_new, late = False, []
        for fix in self._waiting:
            at = bisect_right(self._scans, fix[0], key=lambda each: each.stamp_ns)
            if self._scans and at == len(self._scans) and fix[0] > self._scans[-1].stamp_ns:
                late.append(fix)  # the next scan comes after it
            elif at == 0:
                self._counts['fixes_left'] += 1
            else:
                is_new |= self._add(fix, at)
        self._waiting = deque(late)
        return is_new

    def _add(self, fix: tuple[int, Floats, Floats], at: int) -> bool:
        stamp_ns, pose, covariance = fix
        before = self._scans[at - 1]
        relative = before.relative
        if at < len(self._scans):
            after = self._scans[at]
            part = (stamp_ns - before.stamp_ns) / (after.stamp_ns - before.stamp_ns)
            relative = composed(relative, between(before.odometry, after.odometry) * part)
        there = composed(pose, between(relative, np.zeros(3)))
        turn = np.eye(3)
        turn[:2, 2] = pose[1] - there[1], there[0] - pose[0]
        information: Floats = np.asarray(
            np.linalg.inv(turn @ covariance @ turn.T + _MATCH_COVARIANCE), dtype=np.float64)
        known = AbsolutePose(before.keyframe, there, information)
        self._counts['fixes'] += 1
        return self._place(known)

    def _place(self, new: AbsolutePose) -> bool:
        fixes = self._graph.fixes
        for number, old in enumerate(fixes):
            if old.keyframe == new.keyframe:
                fixes[number] = self._fused(old, new)
                self._more = (self._more + 1) % _OPTIMISE_AFTER
                return self._more == 0
        fixes.append(new)
        return True

    def _fused(self, old: AbsolutePose, new: AbsolutePose) -> AbsolutePose:
        """Return one fix for two: their mean, or that which agrees with the map."""
        off = new.pose - old.pose
        off[2] = wrapped(off[2])
        if float(off @ new.information @ off) > _CONSISTENT_CHI2:
            here = self._graph.keyframes[old.keyframe].pose
            return min((old, new), key=lambda each: _chi2(each, here))
        total = old.information + new.information
        pose = old.pose + np.linalg.solve(total, new.information @ off)
        pose[2] = wrapped(pose[2])
        most = _INFORMATION_MOST * np.trace(new.information) / np.trace(total)
        return AbsolutePose(old.keyframe, pose, total * min(1.0, float(most)))


def _chi2(fix: AbsolutePose, pose: Floats) -> float:
    off = fix.pose - pose
    off[2] = wrapped(off[2])
    return float(off @ fix.information @ off)
