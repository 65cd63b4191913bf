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
Global localisation: find a robot on a saved map without an initial pose.

One scan is matched at every free place and heading; these hypotheses are tested with the following
scans, also while the robot moves. There is a result only when a single one is left: a wrong result
would send the robot into walls, a late one costs a little distance.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.mapping.slam.graph import MapGraph
from rt_robot_os.features.mapping.slam.known_lines import astray
from rt_robot_os.features.mapping.slam.known_lines import KnownLines
from rt_robot_os.features.mapping.slam.known_lines import load_libraries
from rt_robot_os.features.mapping.slam.known_map import KnownMap
from rt_robot_os.features.mapping.slam.place_check import checked
from rt_robot_os.features.mapping.slam.place_check import refined
from rt_robot_os.features.mapping.slam.place_check import some_of
from rt_robot_os.features.mapping.slam.place_search import PlaceSearch
from rt_robot_os.features.mapping.slam.place_search import Pyramid
from rt_robot_os.features.mapping.slam.scan import Scan
from rt_robot_os.features.mapping.slam.scan import surface_of
from rt_robot_os.features.mapping.slam.transforms import between
from rt_robot_os.features.mapping.slam.transforms import composed
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.features.mapping.slam.transforms import wrapped
from rt_robot_os.features.mapping.slam.tuning import MapperTuning
from rt_robot_os.motion.grid_map import GridMap

#: Smallest number of points that identify a place.
_POINTS_LEAST: Final = 30
#: Hypotheses that are tracked, and those evaluated in one piece of work.
_FOLLOWED_MOST: Final = 60
_PIECE: Final = 100
#: Hypotheses that are evaluated finely, and how likely they must be relative to the best.
_CLOSELY: Final = 8
_NEARLY: Final = 0.7
#: Two hypotheses this near are one.
_SAME_M: Final = 0.3
_SAME_RAD: Final = 0.17
#: Distance or turn after which a scan is independent evidence.
_NEW_M: Final = 0.25
_NEW_RAD: Final = 0.26
#: Mean logarithm of likelihood by which the best place must be better than the next,
_MARGIN: Final = 0.3
#: and difference to the best from which others are dropped.
_HOPELESS: Final = 1.2
#: Smallest share of beams that the result explains, and largest share that passes its walls.
_EXPLAINED_LEAST: Final = 0.55
_THROUGH_MOST: Final = 0.08
#: Smallest likelihood of the result.
_LIKELY_LEAST: Final = -1.0
#: Margin for points of a moving robot beyond the maximum range.
_BESIDES_M: Final = 1.0
_SCANS_LEAST: Final = 3
#: Period of new searches while there is no result: another scan may show more.
_AGAIN_NS: Final = 2 * NS_PER_S
#: Standard deviations of the result that matching does not include.
_COMMON: Final = np.array((0.03, 0.03, 0.01))


@dataclass(frozen=True)
class FoundPose:
    """
    The pose of a robot that was found.

    :ivar stamp_ns: of the scan.
    :ivar pose: shape (3,): of the laser at that scan, in the frame of the map.
    :ivar covariance: shape (3, 3), in m and rad, along the map's axes.
    :ivar share: of the points of the scan that lie on lines of the map.
    """

    stamp_ns: int
    pose: Floats
    covariance: Floats
    share: float


_EACH: Final = ('poses', 'before', 'now', 'explained', 'through')


@dataclass
class _Hypotheses:
    """
    The poses at which the robot may be.

    :ivar poses: shape (m, 3), in the grid's own frame, at the last scan.
    :ivar before: shape (m,): log-likelihood from scans at earlier poses.
    :ivar now: shape (m,): sum over the ``scans`` at the present pose.
    """

    poses: Floats
    before: Floats
    now: Floats
    explained: Floats
    through: Floats
    scans: int = 0

    @property
    def likelihood(self) -> Floats:
        return self.before + self.now / max(1, self.scans)

    def take(self, which: npt.NDArray[np.int64]) -> None:
        for name in _EACH:
            setattr(self, name, getattr(self, name)[which])

    @classmethod
    def joined(cls, parts: list[_Hypotheses], scans: int) -> _Hypotheses:
        every = {name: np.concatenate([getattr(each, name) for each in parts]) for name in _EACH}
        return cls(**every, scans=scans)


class GlobalLocalizer:
    """
    Global localisation.

    :param grid: the map; of any resolution and origin.
    :param graph: from which it was drawn: makes the result more exact.
    :raises ConfigError: nothing in the grid is free, or nothing occupied.
    :ivar state: in one line.
    :ivar is_ambiguous: several places match: the robot should move.
    :ivar known_map: the map as it is searched, for a ``Follower``, which need not build it again.
    :ivar counts: ``scans``, ``empty`` (with too few points), ``searches``, ``places``
        (hypotheses now), ``found``.
    """

    def __init__(self, grid: GridMap, graph: MapGraph | None = None,
                 tuning: MapperTuning | None = None) -> None:
        self.tuning = tuning or MapperTuning()
        self.counts = dict.fromkeys(('scans', 'empty', 'searches', 'places', 'found'), 0)
        load_libraries()
        self.known_map = self._known = KnownMap(grid)
        self._lines = KnownLines(self._known, graph)
        self._pyramid = Pyramid(self._known, self.tuning.range_max_m + _BESIDES_M)
        self._building: Iterator[None] | None = chain(self._known.build(), self._pyramid.build())
        self.restart()

    def restart(self) -> None:
        """Drop all hypotheses, and start again with the next scan."""
        self.state = 'searching: waiting for a scan'
        self.is_ambiguous = False
        self._scan: Scan | None = None
        self._points = np.zeros((0, 2))
        self._places: _Hypotheses | None = None
        self._search: PlaceSearch | None = None
        self._working: Iterator[None] | None = None
        self._searched: Scan | None = None
        self._viewed = np.zeros(3)
        self.counts['places'] = 0

    def process_pending(self) -> bool:
        """
        Do a piece of work, some 10 ms; call it between scans.

        :return: whether there is more to do now.
        """
        if self._building is not None:
            if next(self._building, self) is self:
                self._building = None
            return True
        if self._working is None:
            return False
        if next(self._working, self) is self:
            self._working = None
        return self._working is not None

    def add_scan(self, scan: Scan) -> FoundPose | None:
        """
        Process a scan, and do a piece of work.

        :return: the pose of the robot as soon as it is unambiguous.
        :raises ValueError: odometry is not finite.
        """
        if not np.isfinite(scan.odometry).all():
            raise ValueError(f'odometry says {scan.odometry.tolist()} at {scan.stamp_ns} ns')
        self.counts['scans'] += 1
        points = surface_of(scan, self.tuning.range_max_m).points
        if len(points) < _POINTS_LEAST:
            self.counts['empty'] += 1
            self.state = (f'searching: only {len(points)} beams see something: nothing is in '
                          'reach, or the laser is covered')
            self.process_pending()
            return None
        before, self._scan, self._points = self._scan, scan, points
        if self._working is not None or self._building is not None:
            self._carry(before, scan)
            if self._working is None:
                self._start(scan, points)
            self.process_pending()
            return None
        if self._places is None:
            self._start(scan, points)
            self.process_pending()
            return None
        self._carry(before, scan)
        self._rate(self._places, points, scan)
        return self._decided(scan)

    # ---- search of the whole map ---------------------------------------------------------------

    def _start(self, scan: Scan, points: Floats) -> None:
        self.counts['searches'] += 1
        self._searched = scan
        self._search = PlaceSearch(self._pyramid, points)
        self._working = self._worked(self._search, scan, points)
        if self._places is None:
            self.state = 'searching: 0 %'

    def _worked(self, search: PlaceSearch, scan: Scan, points: Floats) -> Iterator[None]:
        for _ in search.work():
            if self._places is None:
                self.state = f'searching: {100 * search.done:.0f} %'
            yield
        some, parts = some_of(points), []
        for low in range(0, len(search.places), _PIECE):
            poses = refined(self._known, search.places[low:low + _PIECE], some)
            check = checked(self._known, poses, some)
            parts.append(_Hypotheses(poses, np.zeros(len(poses)), check.likelihood,
                                     check.explained,
                                     check.through, 1))
            yield
        if parts:
            found = _Hypotheses.joined(parts, 1)
            _thin(found)
            assert self._scan is not None
            self._carry_places(found, scan, self._scan)
            self._places = found if self._places is None else _merged(self._places, found)
            self._viewed = self._scan.odometry
        elif self._places is None:
            self.state = 'nothing fits: the robot is outside of the map, or much has changed'

    # ---- hypotheses --------------------------------------------------------------------------

    def _carry(self, before: Scan | None, scan: Scan) -> None:
        if self._places is not None and before is not None:
            self._carry_places(self._places, before, scan)

    @staticmethod
    def _carry_places(places: _Hypotheses, before: Scan, scan: Scan) -> None:
        step = between(before.odometry, scan.odometry)
        places.poses = composed(places.poses, np.broadcast_to(step, places.poses.shape))

    def _rate(self, places: _Hypotheses, points: Floats, scan: Scan) -> None:
        """Evaluate a scan at all hypotheses."""
        some = some_of(points)
        moved = between(self._viewed, scan.odometry)
        if np.hypot(moved[0], moved[1]) > _NEW_M or abs(moved[2]) > _NEW_RAD:
            places.before = places.likelihood - places.likelihood.max()
            places.now, places.scans = np.zeros(len(places.now)), 0
            self._viewed = scan.odometry
        places.poses = refined(self._known, places.poses, some)
        check = checked(self._known, places.poses, some)
        now, places.explained, places.through = (
            check.likelihood, check.explained, check.through)
        likelihood = places.before + (places.now + now) / (places.scans + 1)
        best = np.argsort(-likelihood, kind='stable')[:_CLOSELY]
        best = best[likelihood[best] > likelihood[best[0]] - _NEARLY]
        # Some differ by a few beams only: the edge of a shelf, a wall 5 cm further away.
        many = some_of(points, closely=True)
        places.poses[best] = refined(self._known, places.poses[best], many)
        check = checked(self._known, places.poses[best], many)
        now[best], places.explained[best], places.through[best] = (
            check.likelihood, check.explained, check.through)
        places.now = places.now + now
        places.scans += 1
        _thin(places)

    def _decided(self, scan: Scan) -> FoundPose | None:
        places = self._places
        assert places is not None and self._searched is not None
        likelihood = places.likelihood
        likely = int((likelihood > likelihood[0] - _MARGIN).sum())
        self.counts['places'] = likely
        several = bool((places.before < 0.0).any())
        fits = (places.explained[0] >= _EXPLAINED_LEAST and places.through[0] <= _THROUGH_MOST
                and places.now[0] / places.scans >= _LIKELY_LEAST)
        self.is_ambiguous = fits and likely > 1
        if fits and likely == 1:
            if places.scans >= _SCANS_LEAST or several:
                return self._answer(places.poses[0], scan)
            self.state = 'searching: one place fits; looking again'
            return None
        self.state = (f'ambiguous between {likely} places: move the robot' if fits else
                      f'nothing fits: at the best place {100 * places.explained[0]:.0f} % of the '
                      f'beams do, and {100 * places.through[0]:.0f} % go through its walls: the '
                      'robot is outside of the map, or much has changed')
        if scan.stamp_ns - self._searched.stamp_ns > _AGAIN_NS:
            self._start(scan, self._points)
        return None

    def _answer(self, pose: Floats, scan: Scan) -> FoundPose | None:
        lines, covariance, share = self._lines.near(pose), np.diag((0.1, 0.1, 0.05)) ** 2, 0.0
        if lines is not None:
            aligned = lines.align(self._points, pose)
            if not astray(aligned.pose, pose, 0.2, 0.08):
                pose, share = aligned.pose, aligned.share
                known = aligned.information / self.tuning.match_noise_m ** 2 + np.diag(
                    (4.0, 4.0, 100.0))
                covariance = np.linalg.inv(known) + np.diag(_COMMON ** 2)
        self.counts['found'] += 1
        self.state = 'found'
        return FoundPose(scan.stamp_ns, self._known.outside(pose), self._known.turned(covariance),
                         share)


def _thin(places: _Hypotheses) -> None:
    """Drop unlikely hypotheses, and all but the best one of each place."""
    likelihood = places.likelihood
    order = np.argsort(-likelihood, kind='stable')
    order = order[likelihood[order] > likelihood[order[0]] - _HOPELESS]
    poses, kept = places.poses, list[int]()
    while len(order) and len(kept) < _FOLLOWED_MOST:
        best = int(order[0])
        kept.append(best)
        off = poses[order] - poses[best]
        near = (np.hypot(off[:, 0], off[:, 1]) < _SAME_M) & (
            np.abs(wrapped(off[:, 2])) < _SAME_RAD)
        order = order[~near]
    places.take(np.array(kept))


def _merged(known: _Hypotheses, found: _Hypotheses) -> _Hypotheses:
    """Add the results of another search, which start without evidence."""
    off = found.poses[:, None] - known.poses
    near = (np.hypot(off[..., 0], off[..., 1]) < _SAME_M) & (
        np.abs(wrapped(off[..., 2])) < _SAME_RAD)
    new = np.flatnonzero(~near.any(1))
    found.take(new)
    found.now *= max(1, known.scans)
    found.before += known.before.max(initial=0.0)
    both = _Hypotheses.joined([known, found], known.scans)
    _thin(both)
    return both
