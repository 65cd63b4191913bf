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
Close loops in pieces: verify one candidate, or do one step of optimisation, and return.

The keyframes keep their poses until the optimisation is done; then all are moved together.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Generator
from dataclasses import replace
from typing import Final

import numpy as np

from rt_robot_os.features.mapping.slam.graph import MapGraph
from rt_robot_os.features.mapping.slam.local_map_query import LocalMapQuery
from rt_robot_os.features.mapping.slam.loops import loop_candidates
from rt_robot_os.features.mapping.slam.loops import LoopCandidate
from rt_robot_os.features.mapping.slam.loops import LoopVerdict
from rt_robot_os.features.mapping.slam.loops import verified
from rt_robot_os.features.mapping.slam.pose_graph import optimise
from rt_robot_os.features.mapping.slam.pose_graph import PoseEdge
from rt_robot_os.features.mapping.slam.transforms import between
from rt_robot_os.features.mapping.slam.transforms import composed
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.features.mapping.slam.tuning import MapperTuning

#: Candidates that wait at most; beyond that the oldest are dropped.
_WAITING_MOST: Final = 12
_STEPS: Final = 6
_STEPS_AT_END: Final = 20
#: Optimisation ends below this step, in m or rad, while the robot drives.
_SMALL: Final = 1e-3
_REJECTED_WEIGHT: Final = 0.3
#: Loops of keyframes this far apart along the path confirm each other within these limits.
_APART_M: Final = 0.5
_SAME_M: Final = 0.5
_SAME_RAD: Final = 0.06
_UNCONFIRMED_MOST: Final = 24
#: Near misses that are stored: the last ones.
_NEAR_MOST: Final = 50


class LoopClosing:
    """
    Loops that are being closed.

    :param counts: of the mapper; ``loops``, ``refused``, ``near_misses`` and ``skipped`` are
        counted there.
    :ivar near_misses: the last places that nearly matched; their ``LoopVerdict.reason`` says why
        no loop was closed.
    :ivar moved_m: largest movement of a keyframe by the last optimisation.
    """

    def __init__(self, graph: MapGraph, tuning: MapperTuning, counts: dict[str, int]) -> None:
        self._graph, self._tuning, self._counts = graph, tuning, counts
        self._waiting: deque[LoopCandidate] = deque()
        # Loops that no other loop confirms yet.
        self._unconfirmed: deque[PoseEdge] = deque(maxlen=_UNCONFIRMED_MOST)
        self._verification: Generator[None, None, LoopVerdict | None] | None = None
        self._candidate: LoopCandidate | None = None  # under verification
        self._poses: Floats | None = None  # intermediate poses of the optimisation
        self._steps = 0
        self._is_new = False  # there are new edges since the last optimisation
        self.moved_m = 0.0
        self.near_misses: deque[LoopVerdict] = deque(maxlen=_NEAR_MOST)

    @property
    def is_busy(self) -> bool:
        """Return whether there is work."""
        return bool(self._waiting) or self._verification is not None or self._is_new

    def add_keyframe(self, index: int) -> None:
        """Queue the loop candidates of a new keyframe."""
        for candidate in loop_candidates(LocalMapQuery(self._graph), index, self._tuning):
            self.add_candidate(candidate)

    def add_candidate(self, candidate: LoopCandidate) -> None:
        """Queue a place to be verified; when the queue is full the oldest one is dropped."""
        if len(self._waiting) == _WAITING_MOST:
            self._waiting.popleft()
            self._counts['skipped'] += 1
        self._waiting.append(candidate)

    def request_optimisation(self) -> None:
        """Optimise the graph again, as it has new constraints."""
        self._is_new, self._poses = True, None

    def remove_keyframe(self, index: int) -> None:
        """Adapt to a keyframe that is removed from the list."""
        if self._candidate is not None:
            self._waiting.appendleft(self._candidate)  # start again
            self._candidate = self._verification = None
        kept = [place for place in self._waiting if index not in (place.keyframe, place.nearest)]
        self._counts['skipped'] += len(self._waiting) - len(kept)
        self._waiting = deque(replace(
            place, keyframe=place.keyframe - (place.keyframe > index),
            nearest=place.nearest - (place.nearest > index),
            members=tuple(each - (each > index) for each in place.members if each != index))
            for place in kept)
        self._unconfirmed = deque((replace(
            each, first=each.first - (each.first > index), second=each.second - (
                each.second > index)) for each in self._unconfirmed
            if index not in (each.first, each.second)), _UNCONFIRMED_MOST)
        if self._poses is not None:
            self._poses = None  # start again

    def process_pending(self, whole: bool = False) -> bool:
        """
        Do a piece of work; return whether the keyframes were moved.

        :param whole: verify a candidate in one piece.
        """
        if self._waiting or self._verification is not None:
            self._verify(whole)
            return False
        return self._is_new and self._step()

    def _verify(self, whole: bool) -> None:
        if self._verification is None:
            self._candidate = self._waiting.popleft()
            self._verification = verified(self._graph.keyframes, self._candidate, self._tuning)
        try:
            next(self._verification)
            while whole:
                next(self._verification)
        except StopIteration as end:
            self._candidate = self._verification = None
            if end.value is not None:
                self._evaluate(end.value)

    def _evaluate(self, verdict: LoopVerdict) -> None:
        """Accept a loop, with unconfirmed ones that are consistent with it, or store it."""
        edge = verdict.edge
        if edge is None:
            self._record_near_miss(verdict)
            return
        taken = [edge]
        if verdict.places_needed > 1:
            taken += [each for each in self._unconfirmed if self._are_consistent(each, edge)]
            if self._place_count(taken) < verdict.places_needed:
                self._unconfirmed.append(edge)
                self._record_near_miss(replace(
                    verdict, reason='no other keyframe says the same yet'))
                return
        self._counts['near_misses'] -= len(taken) - 1
        self.near_misses = deque((each for each in self.near_misses
                                  if all(each.edge is not one for one in taken)), _NEAR_MOST)
        self._unconfirmed = deque((each for each in self._unconfirmed
                                   if all(each is not one for one in taken)), _UNCONFIRMED_MOST)
        self._counts['loops'] += len(taken)
        self._graph.edges.extend(taken)
        self.request_optimisation()

    def _record_near_miss(self, verdict: LoopVerdict) -> None:
        self._counts['near_misses'] += 1
        self.near_misses.append(verdict)

    def _matched_pose(self, edge: PoseEdge) -> Floats:
        """Return the pose of a keyframe by its loop edge."""
        return composed(self._graph.keyframes[edge.first].pose, edge.relative)

    def _place_count(self, edges: list[PoseEdge]) -> int:
        """Return the number of places, some distance apart, at which loops begin."""
        ways = sorted(self._graph.keyframes[each.second].travelled_m for each in edges)
        count, last = 0, -np.inf
        for way in ways:
            if way - last >= _APART_M:
                count, last = count + 1, way
        return count

    def _are_consistent(self, one: PoseEdge, other: PoseEdge) -> bool:
        first, second = (self._graph.keyframes[each.second] for each in (one, other))
        off = between(composed(self._matched_pose(one), between(first.pose, second.pose)),
                      self._matched_pose(other))
        return bool(np.hypot(off[0], off[1]) < _SAME_M and abs(off[2]) < _SAME_RAD)

    def _step(self) -> bool:
        if self._poses is None or len(self._poses) != len(self._graph.keyframes):
            self._poses, self._steps = self._current_poses(), 0
        optimised = optimise(self._poses, self._graph.edge_arrays(), 1, self._graph.fixes, _SMALL)
        self._poses, self._steps = optimised.poses, self._steps + 1
        if optimised.step > _SMALL and self._steps < _STEPS:
            return False
        self._apply(optimised.poses, optimised.weights)
        return True

    def optimise_all(self) -> None:
        """Optimise all keyframes until convergence."""
        optimised = optimise(self._current_poses(), self._graph.edge_arrays(), _STEPS_AT_END,
                             self._graph.fixes)
        self._apply(optimised.poses, optimised.weights)

    def _current_poses(self) -> Floats:
        return np.array([each.pose for each in self._graph.keyframes]).reshape(-1, 3)

    def _apply(self, poses: Floats, weights: Floats) -> None:
        moved = poses[:, :2] - self._current_poses()[:, :2]
        self.moved_m = float(np.hypot(moved[:, 0], moved[:, 1]).max(initial=0.0))
        for keyframe, pose in zip(self._graph.keyframes, poses):
            keyframe.pose = pose
        self._counts['refused'] = int((weights < _REJECTED_WEIGHT).sum())
        self._poses, self._is_new = None, False
