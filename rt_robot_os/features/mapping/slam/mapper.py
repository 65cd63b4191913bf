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
Make a map of scans, and return the pose of each (graph SLAM).

Each scan is matched with the local map, starting at the pose of odometry; one with new content
becomes a keyframe; when the robot returns to a place, the poses of all keyframes are optimised.
Removed objects and redundant keyframes are dropped, so that mapping can run without end.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import numpy as np

from rt_robot_os.features.mapping.slam.absolute_poses import AbsoluteConstraints
from rt_robot_os.features.mapping.slam.deferred_matching import DeferredMatching
from rt_robot_os.features.mapping.slam.global_localization import FoundPose
from rt_robot_os.features.mapping.slam.graph import MapGraph
from rt_robot_os.features.mapping.slam.joining import edge_of_odometry
from rt_robot_os.features.mapping.slam.joining import edges_of_match
from rt_robot_os.features.mapping.slam.keyframe_pruning import DynamicPointFilter
from rt_robot_os.features.mapping.slam.keyframe_pruning import redundant_keyframes
from rt_robot_os.features.mapping.slam.keyframes import Keyframe
from rt_robot_os.features.mapping.slam.keyframes import LocalMap
from rt_robot_os.features.mapping.slam.keyframes import Match
from rt_robot_os.features.mapping.slam.local_map_query import LocalMapQuery
from rt_robot_os.features.mapping.slam.located import Located
from rt_robot_os.features.mapping.slam.loop_closing import LoopClosing
from rt_robot_os.features.mapping.slam.loops import LoopVerdict
from rt_robot_os.features.mapping.slam.marginalisation import marginalise
from rt_robot_os.features.mapping.slam.matching import Certainty
from rt_robot_os.features.mapping.slam.matching import Matcher
from rt_robot_os.features.mapping.slam.matching import OdometryDelta
from rt_robot_os.features.mapping.slam.novelty import Novelty
from rt_robot_os.features.mapping.slam.relocalization import Relocalization
from rt_robot_os.features.mapping.slam.scan import Scan
from rt_robot_os.features.mapping.slam.scan import Surface
from rt_robot_os.features.mapping.slam.scan import surface_of
from rt_robot_os.features.mapping.slam.trajectory import ScanTrajectory
from rt_robot_os.features.mapping.slam.transforms import between
from rt_robot_os.features.mapping.slam.transforms import composed
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.features.mapping.slam.transforms import moved_by
from rt_robot_os.features.mapping.slam.tuning import MapperTuning

_RAD_AS_M: Final = 0.5
#: Distance after which the local map is chosen again.
_CHOSEN_M: Final = 0.5
#: A longer step of odometry between two scans is a jump, not a motion.
_JUMP_M: Final = 5.0
#: Uncertainty of a given pose, as that of odometry after this motion.
_UNSURE_M: Final = 1.0
_UNSURE_RAD: Final = 0.5
#: Distance after which dense scans become keyframes again while lost.
_LOST_M: Final = 0.5
#: Movement from which on the map is redrawn.
_CELL_M: Final = 0.05
_STILL: Final = np.zeros(3)
#: After longer steps all pending work is done immediately: such logs are thinned out.
_THINNED_M: Final = 0.25


class Mapper:
    """
    A map that grows where a scan has new content.

    :param start: shape (3,): pose of the laser on the map at the first scan; None: 0.
    :ivar graph: the map.
    :ivar keyframes: of the map.
    :ivar edges: between them.
    :ivar version: increases when keyframes are added, removed or moved by a cell.
    :ivar counts: ``scans``, ``keyframes`` (added, ever), ``searched`` (a window was), ``lost``
        (odometry was used, as the scan matched nowhere), ``loops``, ``refused`` (a loop
        that odometry and other loops contradict), ``near_misses`` (candidates that matched nearly,
        or that no second keyframe confirmed), ``empty`` (scans without a point), ``jumps``
        (of odometry, ignored), ``crowded`` (redundant keyframes, removed), ``outdated`` (with too
        few points left, removed), ``points_gone`` (that were seen through), ``skipped``
        (candidates that were dropped for newer ones), ``fixes``, ``fixes_left`` (absolute poses
        that were not used: too near to another, too late), ``forgotten`` (poses of scans),
        ``found`` (a robot that was carried away).
    """

    _odometry: Floats | None
    _correction: Floats | None
    _local: LocalMap | None

    def __init__(self, tuning: MapperTuning | None = None, start: Floats | None = None) -> None:
        self.tuning = tuning or MapperTuning()
        self.graph = MapGraph()
        self.version = 0
        self.counts = dict.fromkeys((
            'scans', 'keyframes', 'searched', 'lost', 'loops', 'refused', 'near_misses', 'empty',
            'jumps', 'crowded', 'outdated', 'points_gone', 'skipped', 'fixes', 'fixes_left',
            'forgotten', 'found'), 0)
        self._begin(np.zeros(3) if start is None else np.asarray(start, dtype=np.float64), True)

    @classmethod
    def of_graph(cls, graph: MapGraph, tuning: MapperTuning | None = None) -> Mapper:
        """
        Continue with an existing map.

        Until :meth:`relocate` sets the pose, each scan is searched on the whole map, the map does
        not grow, and ``Located.is_lost`` is set.

        :param graph: it is extended; it may be empty.
        """
        mapper = cls(tuning)
        mapper.graph = graph
        mapper._begin(graph.keyframes[-1].pose if graph.keyframes else np.zeros(3),
                      not graph.keyframes)
        mapper._anchor = max(0, len(graph.keyframes) - 1)
        mapper._travelled_m = 2.0 * mapper.tuning.loop_apart_m + max(
            (each.travelled_m for each in graph.keyframes), default=0.0)
        mapper._novelty.mark_known()
        return mapper

    def relocate(self, pose: Floats, odometry: Floats) -> None:
        """
        Set the pose of the robot; the map is unchanged.

        :param pose: shape (3,): of the laser.
        :param odometry: shape (3,): of the laser, at that time.
        :raises ValueError: one of them is not finite.
        """
        pose, odometry = np.asarray(pose, np.float64), np.asarray(odometry, np.float64)
        if not (np.isfinite(pose).all() and np.isfinite(odometry).all()):
            raise ValueError(f'the robot is at {pose.tolist()}, its odometry at '
                             f'{odometry.tolist()}: both must be finite')
        self._pose, self._odometry = pose, odometry
        self._correction = None
        self._since_match = OdometryDelta(_UNSURE_M, _UNSURE_RAD)
        self._certainty.reset(np.diag((0.1 ** 2, 0.1 ** 2, 0.05 ** 2)))
        self._relocalization.confirm()
        self._absolute.restart()
        self._local = None
        if self.keyframes:
            poses = np.array([each.pose for each in self.keyframes])
            self._set_anchor(int(np.hypot(*(poses[:, :2] - pose[:2]).T).argmin()))
            self._novelty.mark_known()

    def _begin(self, pose: Floats, is_placed: bool) -> None:
        self.keyframes, self.edges = self.graph.keyframes, self.graph.edges
        self._matcher = Matcher(self.tuning)
        self._certainty = Certainty(self.tuning)
        self._loop_closing = LoopClosing(self.graph, self.tuning, self.counts)
        self._absolute = AbsoluteConstraints(self.graph, self.counts)
        self._relocalization = Relocalization(self.graph, self.tuning, is_placed)
        self._dynamic_points = DynamicPointFilter()
        self._novelty = Novelty(self.keyframes, self.tuning)
        self._since_match = OdometryDelta()
        self._track = ScanTrajectory(self.tuning.trajectory_most)
        self._deferred = DeferredMatching()
        self._local = None
        self._members: list[int] = []  # indices of the keyframes of the local map
        self._chosen = np.full(2, np.inf)  # where the local map was chosen
        self._anchor, self._relative = 0, _STILL  # pose of the robot relative to a keyframe
        self._travelled_m = 0.0
        self._odometry = None
        self._pose = pose
        self._correction = None
        self._unseen_m = 0.0  # movements of the map since the last version
        self._has_idle_time = False  # process_pending is called between scans

    def add(self, scan: Scan) -> Located:
        """
        Process the next scan.

        :raises ValueError: odometry is not finite.
        """
        if not np.isfinite(scan.odometry).all():
            raise ValueError(f'odometry says {scan.odometry.tolist()} at {scan.stamp_ns} ns')
        surface = surface_of(scan, self.tuning.range_max_m)
        self.counts['scans'] += 1
        self.counts['empty'] += not len(surface)
        if not self.keyframes:
            return self._first(scan, surface)
        step = self._step(scan.odometry)
        guess = composed(self._pose, step)
        self._since_match.add(step)
        self._certainty.predict(step, float(self._pose[2]))
        match = (None if self._relocalization.is_unplaced else self._matcher.match(
            self._local_map(guess), surface, guess, self._since_match,
            self._relocalization.is_searching))
        self.counts['searched'] = self._matcher.searched
        self._pose = guess if match is None else match.aligned.pose
        if match is None:
            self.counts['lost'] += 1
            found = self._relocalization.add_unmatched_scan(scan, self._since_match.way_m)
            if found is not None:
                return self._found(scan, found)
        else:
            self._certainty.update(match.aligned)
            self._relocalization.confirm()
            self._novelty.record_match(self._local_map(guess).unknown(surface, self._pose),
                                       len(surface))
        is_kept = self._is_novel(match)
        if is_kept:
            self._add_keyframe(scan, surface, match)
        elif match is None:
            self._deferred.add(self._track.forgotten + len(self._track), surface)
        else:
            self._set_anchor(self._nearest())
            if self._matcher.is_sure(match):
                self._remove_dynamic_points(surface)
        if match is not None:
            self._since_match = OdometryDelta()
        self._relative = between(self.keyframes[self._anchor].pose, self._pose)
        self._record_scan(scan)
        self._process_closing(1 if np.hypot(step[0], step[1]) < _THINNED_M else None)
        correction, self._correction = self._correction, None
        return Located(self._pose, self._certainty.on_map(self._pose, self.keyframes[0].pose),
                       0.0 if match is None else match.aligned.share, match is None, is_kept,
                       correction)

    def _first(self, scan: Scan, surface: Surface) -> Located:
        self._odometry = scan.odometry
        self._append(Keyframe(scan.stamp_ns, self._pose, scan.odometry, surface, 0.0))
        self._record_scan(scan)
        return Located(self._pose, self._certainty.on_map(self._pose, self._pose), is_kept=True)

    def _found(self, scan: Scan, found: FoundPose) -> Located:
        """Continue where the robot was found."""
        self.relocate(found.pose, scan.odometry)
        self.counts['found'] += 1
        self._record_scan(scan)
        return Located(found.pose, found.covariance, found.share)

    def _record_scan(self, scan: Scan) -> None:
        """Store the pose of a scan."""
        if self._absolute.record_scan(scan.stamp_ns, scan.odometry, self._anchor, self._relative):
            self._loop_closing.request_optimisation()
        self._track.append(self._anchor, self._relative)
        self.counts['forgotten'] = self._track.forgotten

    def _step(self, odometry: Floats) -> Floats:
        step = _STILL if self._odometry is None else between(self._odometry, odometry)
        self._odometry = odometry
        way = float(np.hypot(step[0], step[1]))
        if way > _JUMP_M:
            self.counts['jumps'] += 1
            return _STILL
        self._travelled_m += way + _RAD_AS_M * abs(float(step[2]))
        return step

    # ---- local map -----------------------------------------------------------------------------

    def _local_map(self, guess: Floats) -> LocalMap:
        moved = float(np.hypot(*(guess[:2] - self._chosen)))
        if self._local is None or moved > _CHOSEN_M:
            around = LocalMapQuery(self.graph)
            members = around.near(guess, self._anchor, self._travelled_m, self.tuning)
            if self._local is None or members != self._members:
                self._local = LocalMap([self.keyframes[index] for index in members])
            self._members, self._chosen = members, guess[:2]
        return self._local

    def _nearest(self) -> int:
        """Return the nearest keyframe of the local map."""
        poses = np.array([self.keyframes[index].pose[:2] for index in self._members])
        return self._members[int(np.hypot(*(poses - self._pose[:2]).T).argmin())]

    def _set_anchor(self, anchor: int) -> None:
        self._anchor = anchor
        self._relative = between(self.keyframes[anchor].pose, self._pose)

    # ---- growth --------------------------------------------------------------------------------

    def _is_novel(self, match: Match | None) -> bool:
        """Return whether a scan has content that is new to the map."""
        if self._relocalization.is_searching or (
                match is None and self._since_match.is_dense
                and self._since_match.way_m < _LOST_M):
            return False  # its pose is too uncertain
        near = self._members if match is not None else [self._anchor]
        return self._novelty.is_novel(match, self._pose, near, self._travelled_m)

    def _add_keyframe(self, scan: Scan, surface: Surface, match: Match | None) -> None:
        """Add a scan as a keyframe."""
        index = len(self.keyframes)
        if match is None:
            self.edges.append(edge_of_odometry(self.keyframes, self._anchor, self._pose,
                                               self._since_match))
        else:
            bases = {self._nearest(), *({index - 1} & set(self._members))}
            self.edges.extend(edges_of_match(self.keyframes, sorted(bases), match,
                                             self._since_match,
                                             self.tuning))
        self._append(Keyframe(scan.stamp_ns, self._pose, scan.odometry, surface,
                              self._travelled_m))
        self._novelty.record_keyframe(self._members, self._travelled_m)
        self._anchor, self._relative = index, _STILL
        self._loop_closing.add_keyframe(index)
        for gone in redundant_keyframes(self.keyframes, index, self.tuning):
            self.counts['crowded'] += 1
            self._remove_keyframe(gone)

    def _append(self, keyframe: Keyframe) -> None:
        self.keyframes.append(keyframe)
        self.counts['keyframes'] += 1
        self._changed()

    def _changed(self) -> None:
        self.version += 1
        self._local = None

    # ---- pruning -------------------------------------------------------------------------------

    def _remove_dynamic_points(self, surface: Surface) -> None:
        """Remove points that the scan sees through."""
        gone = self._dynamic_points.remove_seen_through(self.keyframes, self._members, self._pose,
                                                        surface)
        if not gone.points:
            return
        self.counts['points_gone'] += gone.points
        self._changed()
        for index in sorted(gone.keyframes, reverse=True):
            if index != self._anchor and len(self.keyframes) > 1:
                self.counts['outdated'] += 1
                self._remove_keyframe(index)

    def _remove_keyframe(self, index: int) -> None:
        """Remove a keyframe from the graph and all that refers to it."""
        seen = [each.pose for each in self.keyframes]
        successor = marginalise(self.graph, index)
        relative = between(seen[successor], seen[index])
        self._track.remove_keyframe(index, successor, relative)
        self._absolute.remove_keyframe(index, successor, relative)
        self._loop_closing.remove_keyframe(index)
        if self._anchor == index:
            self._anchor, self._relative = successor, between(seen[successor], self._pose)
        self._anchor -= self._anchor > index
        self._members = [each - (each > index) for each in self._members if each != index]
        self._changed()

    # ---- loops and absolute poses --------------------------------------------------------------

    def process_pending(self) -> bool:
        """
        Do one piece of pending work, of some 10 ms: verify a loop, or optimise the keyframes.

        If it is called between scans, all pieces are short; else :meth:`add` verifies whole loops.

        :return: whether there is more.
        """
        self._has_idle_time = True
        return self._process_piece(False)

    def _process_piece(self, whole: bool) -> bool:
        if self._loop_closing.is_busy:
            if self._loop_closing.process_pending(whole):
                self._follow_keyframes()
            return self._loop_closing.is_busy
        return self._relocalization.process_pending()

    def _process_closing(self, pieces: int | None) -> None:
        while self._loop_closing.is_busy and (pieces is None or pieces > 0):
            self._process_piece(pieces is None or not self._has_idle_time)
            pieces = None if pieces is None else pieces - 1

    def _follow_keyframes(self) -> None:
        """Update the pose after the keyframes were moved."""
        was, self._pose = self._pose, composed(self.keyframes[self._anchor].pose, self._relative)
        movement = moved_by(was, self._pose)
        self._correction = (movement if self._correction is None
                            else composed(movement, self._correction))
        self._local = None
        self._unseen_m += self._loop_closing.moved_m
        if self._unseen_m > _CELL_M:
            self.version += 1
            self._unseen_m = 0.0

    def add_absolute_pose(self, stamp_ns: int, pose: Floats, covariance: Floats) -> None:
        """
        Add an absolute pose of the laser, to which the map is fitted.

        :param stamp_ns: on the clock of the scans; it may lie between scans or be late.
        :param pose: shape (3,), on the map.
        :param covariance: shape (3, 3), in m and rad, along the axes of the map.
        :raises ValueError: the pose or its covariance is invalid.
        """
        if self._absolute.add(stamp_ns, pose, covariance):
            self._loop_closing.request_optimisation()

    def optimise_all(self) -> None:
        """Do all pending work, optimise all keyframes, and match lost scans again."""
        self._process_closing(None)
        self._loop_closing.optimise_all()
        self._follow_keyframes()
        self.counts['lost'] -= self._deferred.match_again(self.keyframes, self._track,
                                                          self._matcher)

    @property
    def near_misses(self) -> list[LoopVerdict]:
        """Return the last near misses, with the reasons why no loop was closed."""
        return list(self._loop_closing.near_misses)

    def trajectory(self) -> Floats:
        """Return the poses of the scans on the present map; shape (scans, 3)."""
        return self._track.poses([each.pose for each in self.keyframes])


def mapped(scans: Iterable[Scan], tuning: MapperTuning | None = None) -> Mapper:
    """Map a whole log."""
    mapper = Mapper(tuning)
    for scan in scans:
        mapper.add(scan)
    mapper.optimise_all()
    return mapper
