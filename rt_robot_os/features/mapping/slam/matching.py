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
Match a scan with the local map, starting at the pose of odometry.

The search window is the uncertainty of odometry since the last match, so it grows while there is
none. Odometry is part of the match: it determines directions that a scan leaves open, as along a
corridor.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from rt_robot_os.features.mapping.slam.alignment import Aligned
from rt_robot_os.features.mapping.slam.correlation import best_fit
from rt_robot_os.features.mapping.slam.correlation import SearchWindow
from rt_robot_os.features.mapping.slam.keyframes import LocalMap
from rt_robot_os.features.mapping.slam.keyframes import Match
from rt_robot_os.features.mapping.slam.scan import Surface
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.features.mapping.slam.tuning import MapperTuning

#: Steps shorter than this need no search: odometry is near enough.
_SHORT_M: Final = 0.3
_SHORT_RAD: Final = 0.15
#: After less than this a scan is first aligned from there, and a window is searched only if fewer
#: of its points lie on lines than this share.
_NEAR_M: Final = 1.5
_NEAR_RAD: Final = 1.0
_CONVINCING: Final = 0.75
_DENSE_M: Final = 0.15
_DENSE_RAD: Final = 0.15
#: Size of the first search window in standard deviations of odometry.
_WITHIN: Final = 3.0
#: Largest search window; beyond it global relocalisation is needed.
_REACH_MOST_M: Final = 3.0
_REACH_MOST_RAD: Final = 2.6
#: An unmatched scan is searched at all headings within this distance, as after a turn without
#: odometry. At other headings it must match worse by the last value.
_TURNED_M: Final = 0.6
_TURNED_STEP_RAD: Final = float(np.radians(1.0))
_APART_RAD: Final = 0.3
_CLEARLY: Final = 0.15
#: A scan that matches with less than this part of the usual share is lost; the usual share is a
#: moving mean, which decays without matches.
_SUDDEN: Final = 0.7
_AS_EVER: Final = 0.9
_SURE: Final = 0.85
_USUAL: Final = 0.1
_FORGOTTEN: Final = 0.995
#: Length over which the errors of odometry are correlated.
_TOGETHER_M: Final = 1.0
_TOGETHER_RAD: Final = 1.0
_PER_M_RAD: Final = 0.02
_ARM_M: Final = 3.0
#: Covariance of keyframes relative to each other,
_MAP: Final = np.diag((0.015 ** 2, 0.015 ** 2, 0.003 ** 2))
#: and error of the whole map, bent and stretched, for each metre from its origin.
_BENT: Final = 0.001


@dataclass
class OdometryDelta:
    """
    Odometry since the last match.

    :ivar way_m: distance, with turn_rad the turn,
    :ivar steps: and the number of steps.
    """

    way_m: float = 0.0
    turn_rad: float = 0.0
    steps: int = 0

    def add(self, step: Floats) -> None:
        """Add a step; shape (3,)."""
        self.way_m += float(np.hypot(step[0], step[1]))
        self.turn_rad += abs(float(step[2]))
        self.steps += 1

    def sigmas(self, tuning: MapperTuning) -> tuple[float, float]:
        """Return its standard deviations, in m and rad."""
        return (tuning.odometry_m + tuning.odometry_per_m * self.way_m,
                tuning.odometry_rad + tuning.odometry_per_rad * self.turn_rad)

    @property
    def is_dense(self) -> bool:
        """Return whether scans arrive so fast that each is similar to the next."""
        return (self.way_m < _DENSE_M * self.steps) and (self.turn_rad < _DENSE_RAD * self.steps)

    @property
    def is_near(self) -> bool:
        """Return whether an alignment should start at odometry."""
        return self.way_m < _NEAR_M and self.turn_rad < _NEAR_RAD

    @property
    def is_short(self) -> bool:
        """Return whether odometry is near enough to align without a search."""
        return self.way_m < _SHORT_M and self.turn_rad < _SHORT_RAD


def prior_of(sigmas: tuple[float, float], tuning: MapperTuning) -> Floats:
    """Return the information of odometry in units of a point's own; shape (3, 3)."""
    noise = tuning.match_noise_m ** 2
    of_place = noise / sigmas[0] ** 2
    return np.diag((of_place, of_place, noise / sigmas[1] ** 2))


class Matcher:
    """
    Scan matching.

    :ivar searched: how often a window was searched.
    """

    def __init__(self, tuning: MapperTuning) -> None:
        self._tuning = tuning
        self.searched = 0
        self._usual = 0.0  # share of points on lines

    def match(self, local: LocalMap, surface: Surface, guess: Floats, way: OdometryDelta,
              is_astray: bool = False) -> Match | None:
        """
        Match a scan; return None without a match.

        A scan that follows soon must match about as well as those before: if it suddenly matches
        much worse, the robot may have been carried away, and no match is better than a wrong one.

        :param guess: shape (3,): the pose by odometry.
        :param is_astray: the robot seems to have been carried away: to be here after all, a scan
            must match as well as usual.
        """
        found = self._match(local, surface, guess, way)
        if found is None and not way.is_dense and not local.is_empty and len(surface):
            found = self.turned(local, surface, guess)
        share = 0.0 if found is None else found.aligned.share
        if is_astray and share < _AS_EVER * self._usual:
            return None
        if way.is_dense and share < _SUDDEN * self._usual:
            self._usual *= _FORGOTTEN
            return None
        self._usual += (share - self._usual) * _USUAL
        return found

    def is_sure(self, match: Match) -> bool:
        """Return whether a match is good enough to remove points that contradict it."""
        return match.aligned.share > max(self._tuning.loop_share, _SURE * self._usual)

    def _match(self, local: LocalMap, surface: Surface, guess: Floats, way: OdometryDelta
               ) -> Match | None:
        if local.is_empty or not len(surface):
            return None
        t = self._tuning
        sigmas = way.sigmas(t)
        best: Match | None = None
        if way.is_near:
            best = Match(local.lines.align(surface.points, guess, guess, prior_of(sigmas, t),
                                           normals=surface.normals), 0.0)
            if best.aligned.share >= (t.share_good if way.is_short else _CONVINCING):
                return best
        self.searched += 1
        for factor in (1.0, 2.0):
            wide = (factor * sigmas[0], factor * sigmas[1])
            window = SearchWindow(guess, min(_REACH_MOST_M, _WITHIN * wide[0]),
                                  min(_REACH_MOST_RAD, _WITHIN * wide[1]), *wide)
            found = local.search(surface, window, prior_of(wide, t))
            if best is None or found.aligned.share > best.aligned.share:
                best = found
            if best.aligned.share >= t.share_good:
                break
        return best if best is not None and best.aligned.share >= t.share_least else None

    def turned(self, local: LocalMap, surface: Surface, guess: Floats) -> Match | None:
        """
        Search a scan at all headings, near a pose.

        :return: None unless it matches at one as well as a loop must, and at no other.
        """
        t = self._tuning
        window = SearchWindow(guess, _TURNED_M, np.pi, step_rad=_TURNED_STEP_RAD)
        found = local.search(surface, window, None)
        self.searched += 1
        if found.aligned.share < t.loop_share or found.score < t.loop_score:
            return None
        others = SearchWindow(found.aligned.pose + (0.0, 0.0, np.pi), _TURNED_M,
                              np.pi - _APART_RAD,
                              step_rad=_TURNED_STEP_RAD)
        _, score = best_fit(local.field, surface.points, others)
        return found if score < found.score - _CLEARLY else None


class Certainty:
    """
    The covariance of the pose on the map, from scan to scan.

    The last scan determines the certainty of each direction; in directions that it leaves open,
    it is that of before plus odometry. Matches with one map share its errors, so several are no
    more certain than one.
    """

    def __init__(self, tuning: MapperTuning) -> None:
        self._tuning = tuning
        self._covariance: Floats = np.zeros((3, 3))

    def reset(self, covariance: Floats) -> None:
        """Reset the covariance; shape (3, 3)."""
        self._covariance = covariance

    def predict(self, step: Floats, heading: float) -> None:
        """
        Add the error of a step of odometry.

        :param heading: of the robot on the map before the step.
        """
        t = self._tuning
        x, y = step[:2].tolist()
        cosine, sine = float(np.cos(heading)), float(np.sin(heading))
        turn = np.eye(3)
        turn[0, 2], turn[1, 2] = -(sine * x + cosine * y), cosine * x - sine * y
        way, turned = float(np.hypot(x, y)), abs(float(step[2]))
        more = (t.odometry_per_m ** 2 * way * _TOGETHER_M, ) * 2 + (
            t.odometry_per_rad ** 2 * turned * _TOGETHER_RAD + _PER_M_RAD ** 2 * way,)
        self._covariance = turn @ self._covariance @ turn.T + np.diag(more)

    def update(self, aligned: Aligned) -> None:
        """Update by a matched scan."""
        known = aligned.information / self._tuning.point_noise_m ** 2
        scale = np.diag((1.0, 1.0, _ARM_M))  # an angle counts as a distance at this arm
        values, vectors = np.linalg.eigh(np.linalg.inv(scale) @ known @ np.linalg.inv(scale))
        vectors = np.linalg.inv(scale) @ vectors
        before = scale @ self._covariance @ scale
        basis = scale @ vectors
        said = np.einsum('ik,ij,jk->k', basis, before, basis)
        variance = np.minimum(1.0 / np.maximum(values, 1e-9), said)
        self._covariance = (vectors * variance) @ vectors.T

    def on_map(self, pose: Floats, begin: Floats) -> Floats:
        """
        Return the covariance of a pose including the error of the map; shape (3, 3).

        :param pose: shape (3,): of the robot.
        :param begin: shape (3,): of the origin of the map.
        """
        x, y = (pose - begin)[:2].tolist()
        # Bending moves it across the direction from there, stretching along it: isotropic.
        far = np.diag((x * x + y * y, x * x + y * y, 1.0)) * _BENT ** 2
        far[0, 2] = far[2, 0] = -y * _BENT ** 2
        far[1, 2] = far[2, 1] = x * _BENT ** 2
        return self._covariance + _MAP + far
