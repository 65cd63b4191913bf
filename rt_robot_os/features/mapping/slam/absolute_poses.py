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
"""Absolute poses as constraints of the graph, thinned to one for each keyframe."""

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

#: Scans that are remembered for late poses, and poses that wait for the next scan.
_SCANS: Final = 64
_WAITING: Final = 16
#: The information of a keyframe's pose is at most that of as many absolute poses.
_INFORMATION_MOST: Final = 4.0
#: Squared distance, in variances, up to which two absolute poses are consistent.
_CONSISTENT_CHI2: Final = 16.0
#: The map is optimised again after as many poses of keyframes that had one.
_OPTIMISE_AFTER: Final = 20
#: Covariance of a scan match, in m and rad.
_MATCH_COVARIANCE: Final = np.diag((0.02 ** 2, 0.02 ** 2, 0.01 ** 2))


@dataclass(frozen=True)
class _RecordedScan:
    """The pose of a scan, relative to a keyframe."""

    stamp_ns: int
    odometry: Floats
    keyframe: int
    relative: Floats


class AbsoluteConstraints:
    """
    Absolute poses on their way to constraints of the graph.

    :param counts: of the mapper; ``fixes`` and ``fixes_left`` are counted there.
    """

    def __init__(self, graph: MapGraph, counts: dict[str, int]) -> None:
        self._graph, self._counts = graph, counts
        self._scans: deque[_RecordedScan] = deque(maxlen=_SCANS)
        self._waiting: deque[tuple[int, Floats, Floats]] = deque()
        self._more = 0

    def add(self, stamp_ns: int, pose: Floats, covariance: Floats) -> bool:
        """
        Add an absolute pose.

        :return: whether the map must be optimised.
        :raises ValueError: the pose or its covariance is invalid.
        """
        pose, covariance = np.asarray(pose, np.float64), np.asarray(covariance, np.float64)
        if pose.shape != (3,) or not np.isfinite(pose).all():
            raise ValueError(f'a fix at {stamp_ns} ns is at {pose.tolist()}: must be x, y in m '
                             'and yaw in rad')
        if (covariance.shape != (3, 3) or not np.isfinite(covariance).all()
                or np.linalg.eigvalsh((covariance + covariance.T) / 2).min() <= 0.0):
            raise ValueError(f'a fix at {stamp_ns} ns has the covariance {covariance.tolist()}: '
                             'must be 3 x 3, in m and rad, positive definite')
        if len(self._waiting) == _WAITING:
            self._waiting.popleft()
            self._counts['fixes_left'] += 1
        self._waiting.append((stamp_ns, pose, covariance))
        return self._make_constraints()

    def record_scan(self, stamp_ns: int, odometry: Floats, keyframe: int, relative: Floats
                    ) -> bool:
        """Record the pose of a scan; return as :meth:`add` does."""
        if self._scans and stamp_ns <= self._scans[-1].stamp_ns:
            self._scans.clear()
        self._scans.append(_RecordedScan(stamp_ns, odometry, keyframe, relative))
        return self._make_constraints()

    def restart(self) -> None:
        """Discard the recorded scans: the robot was moved."""
        self._scans.clear()

    def remove_keyframe(self, index: int, successor: int, seen_from_successor: Floats) -> None:
        """Adapt to a keyframe that is removed, as the trajectory does."""
        self._scans = deque((
            replace(each, keyframe=successor - (successor > index),
                    relative=composed(seen_from_successor, each.relative))
            if each.keyframe == index else
            replace(each, keyframe=each.keyframe - (each.keyframe > index))
            for each in self._scans), _SCANS)

    def _make_constraints(self) -> bool:
        """Make constraints of the poses that lie between two scans."""
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
        """Return one pose for two: their mean, or the one that is consistent with the map."""
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
