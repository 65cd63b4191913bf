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
Localise a robot on a saved map, which stays unmodified.

Each scan is matched with the map independently, so errors do not accumulate: neither while the
robot stands nor over hours. Map and odometry are weighted by their uncertainty. When scans do not
match for a while, it reports that instead of a pose that looks certain.
"""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Final

import numpy as np

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.mapping.slam.alignment import Aligned
from rt_robot_os.features.mapping.slam.correlation import SearchWindow
from rt_robot_os.features.mapping.slam.graph import MapGraph
from rt_robot_os.features.mapping.slam.known_lines import astray
from rt_robot_os.features.mapping.slam.known_lines import KnownLines
from rt_robot_os.features.mapping.slam.known_lines import load_libraries
from rt_robot_os.features.mapping.slam.known_map import KnownMap
from rt_robot_os.features.mapping.slam.located import Located
from rt_robot_os.features.mapping.slam.place_check import checked
from rt_robot_os.features.mapping.slam.place_check import PlaceFit
from rt_robot_os.features.mapping.slam.place_check import some_of
from rt_robot_os.features.mapping.slam.scan import Scan
from rt_robot_os.features.mapping.slam.scan import surface_of
from rt_robot_os.features.mapping.slam.transforms import between
from rt_robot_os.features.mapping.slam.transforms import composed
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.features.mapping.slam.tuning import MapperTuning
from rt_robot_os.motion.grid_map import GridMap

#: Odometry since the last match: constant standard deviations, and those per distance and turn,
#: whose errors have one sign.
_AT_ONCE: Final = (0.01, 0.005)
_OF_WAY: Final = (0.1, 0.03)
_OF_TURN: Final = (0.02, 0.1)
#: Errors of the map, which matching does not include: of a graph, and of a grid with its cells.
_COMMON: Final = (0.025, 0.006)
_OF_CELLS: Final = (0.5, 0.006)
#: Largest deviation of a match from the expected pose: in standard deviations, and a constant.
_WITHIN: Final = 3.5
_BESIDES: Final = (0.1, 0.05)
#: Smallest and largest search window for an unmatched scan.
_WINDOW_M: Final = (0.3, 1.5)
_WINDOW_RAD: Final = (0.15, 0.6)
#: A good match has at least this share of points on lines, and of the beams that could hit the
#: map at most this share through it.
_SHARE_LEAST: Final = 0.3
_THROUGH_MOST: Final = 0.25
#: Lost after this time without a match while beams pass walls; or after this time and distance
#: when beams only end early, as a crowd causes.
_LOST_NS: Final = 2 * NS_PER_S
_CROWD_NS: Final = 15 * NS_PER_S
_CROWD_M: Final = 2.0
#: Odometry that is faster has been reset.
_FASTEST_M_S: Final = 5.0
_FASTEST_RAD_S: Final = 15.0
_POINTS_LEAST: Final = 20
#: Margin for points of a scan that is searched in a window.
_MARGIN_M: Final = 2.0
_START: Final = np.diag((0.2, 0.2, 0.1)) ** 2


@dataclass(frozen=True)
class _Fit:
    aligned: Aligned
    check: PlaceFit

    @property
    def through(self) -> float:
        """Return the share of beams through walls, of those that are not cut short."""
        seen = float(self.check.explained[0] + self.check.through[0])
        return float(self.check.through[0]) / seen if seen > 0.0 else 0.0

    @property
    def is_good(self) -> bool:
        return self.aligned.share >= _SHARE_LEAST and self.through <= _THROUGH_MOST


class MapLocalizer:
    """
    Localisation on an immutable map.

    :param grid: the map.
    :param graph: from which it was drawn: makes the result more exact.
    :param start: shape (3,): of the laser on the map, at the first scan.
    :param covariance: shape (3, 3), of the start, in m and rad along the map's axes; None: known
        to 0.2 m and 0.1 rad.
    :param odometry: shape (3,): of the laser when it was at the start; None: that of the first
        scan.
    :param known: ``GlobalLocalizer.known_map`` of the same grid; None: it is made again. Distances
        that it lacks are computed near the robot.
    :raises ConfigError: nothing in the grid is free, or nothing occupied.
    :ivar lost: why the pose was lost, so that a global search is needed; empty while it is known.
    :ivar counts: ``scans``, ``searched`` (a window was), ``unmatched`` (odometry was used),
        ``jumps`` (of odometry, which were ignored), ``lost``.
    """

    def __init__(self, grid: GridMap, graph: MapGraph | None, start: Floats,
                 covariance: Floats | None = None, tuning: MapperTuning | None = None,
                 odometry: Floats | None = None, known: KnownMap | None = None) -> None:
        self.tuning = tuning or MapperTuning()
        self.lost = ''
        self.counts = dict.fromkeys(('scans', 'searched', 'unmatched', 'jumps', 'lost'), 0)
        load_libraries()
        self._known = KnownMap(grid) if known is None else known
        self._lines = KnownLines(self._known, graph)
        along, angle = (_COMMON if graph is not None else
                        (_OF_CELLS[0] * self._known.cell_m, _OF_CELLS[1]))
        self._common: Floats = np.diag((along, along, angle)) ** 2
        self.relocate(start, covariance, odometry)

    def relocate(self, pose: Floats, covariance: Floats | None = None,
                 odometry: Floats | None = None) -> None:
        """Continue from another pose, as after a search; parameters as of the class."""
        pose = np.asarray(pose, dtype=np.float64)
        given = _START if covariance is None else covariance
        self.lost = ''
        self._pose = self._known.inside(pose[None])[0]
        self._anchor = self._pose, self._known.turned(given, inward=True)
        self._odometry = None if odometry is None else np.asarray(odometry, dtype=np.float64)
        self._stamp_ns: int | None = None
        self._way, self._turn = 0.0, 0.0
        self._fitted_ns: int | None = None

    def add(self, scan: Scan) -> Located:
        """
        Process the next scan.

        :return: its pose; ``is_lost``: it matched nowhere and odometry was used.
        :raises ValueError: odometry is not finite.
        """
        if not np.isfinite(scan.odometry).all():
            raise ValueError(f'odometry says {scan.odometry.tolist()} at {scan.stamp_ns} ns')
        self.counts['scans'] += 1
        guess, covariance = self._predicted(scan)
        points = surface_of(scan, self.tuning.range_max_m).points
        self._known.measure_near(guess, _MARGIN_M + float(np.hypot(*points.T).max(initial=0.0)))
        fit = self._match(points, guess, covariance) if len(points) >= _POINTS_LEAST else None
        if fit is not None and fit.is_good:
            return self._matched(scan, fit, covariance)
        self.counts['unmatched'] += 1
        self._pose = guess
        self._watch(scan, fit, len(points))
        return Located(self._known.outside(guess), self._known.turned(covariance),
                       0.0 if fit is None else fit.aligned.share, True)

    def _matched(self, scan: Scan, fit: _Fit, covariance: Floats) -> Located:
        # A scan has no information along a corridor: there the estimate is that of odometry.
        information = (np.linalg.inv(covariance)
                       + fit.aligned.information / self.tuning.match_noise_m ** 2)
        known = np.asarray(np.linalg.inv(information), dtype=np.float64)
        self._pose, self._fitted_ns = fit.aligned.pose, scan.stamp_ns
        self._anchor, self._way, self._turn = (self._pose, known), 0.0, 0.0
        self.lost = ''
        known = known + self._common
        return Located(self._known.outside(self._pose), self._known.turned(known),
                       fit.aligned.share)

    # ---- odometry ------------------------------------------------------------------------------

    def _predicted(self, scan: Scan) -> tuple[Floats, Floats]:
        """Return the pose by odometry, in the frame of the grid, and its covariance."""
        if self._odometry is None:
            self._odometry = scan.odometry
        step = between(self._odometry, scan.odometry)
        way, turn = float(np.hypot(step[0], step[1])), abs(float(step[2]))
        if self._stamp_ns is not None:
            passed_s = max(0.05, (scan.stamp_ns - self._stamp_ns) / NS_PER_S)
            if way > _FASTEST_M_S * passed_s or turn > _FASTEST_RAD_S * passed_s:
                self.counts['jumps'] += 1
                step, way, turn = np.zeros(3), 0.1, 0.1
        self._odometry, self._stamp_ns = scan.odometry, scan.stamp_ns
        self._way, self._turn = self._way + way, self._turn + turn
        guess = composed(self._pose, step)
        base, covariance = self._anchor
        jacobian = np.eye(3)
        jacobian[0, 2], jacobian[1, 2] = base[1] - guess[1], guess[0] - base[0]
        along = _AT_ONCE[0] + _OF_WAY[0] * self._way + _OF_TURN[0] * self._turn
        angle = _AT_ONCE[1] + _OF_WAY[1] * self._way + _OF_TURN[1] * self._turn
        return guess, (jacobian @ covariance @ jacobian.T
                       + np.diag((along, along, angle)) ** 2)

    # ---- the map -------------------------------------------------------------------------------

    def _match(self, points: Floats, guess: Floats, covariance: Floats) -> _Fit | None:
        lines = self._lines.near(guess)
        if lines is None:
            return None
        some = some_of(points)
        noise = self.tuning.match_noise_m ** 2
        prior = np.asarray(np.linalg.inv(covariance) * noise, dtype=np.float64)
        sigma_m = math.sqrt(float(np.linalg.eigvalsh(covariance[:2, :2])[-1]))
        sigma_rad = math.sqrt(float(covariance[2, 2]))
        allowed = _BESIDES[0] + _WITHIN * sigma_m, _BESIDES[1] + _WITHIN * sigma_rad
        aligned = lines.align(points, guess, guess, prior)
        fit = _Fit(aligned, checked(self._known, aligned.pose[None], some))
        if fit.is_good and not astray(aligned.pose, guess, *allowed):
            return fit
        self.counts['searched'] += 1
        window = SearchWindow(guess, min(max(_WITHIN * sigma_m, _WINDOW_M[0]), _WINDOW_M[1]),
                              min(max(_WITHIN * sigma_rad, _WINDOW_RAD[0]), _WINDOW_RAD[1]),
                              max(sigma_m, 0.05), max(sigma_rad, 0.03))
        again = self._lines.search(guess, points, window, prior)
        if again is not None and not astray(again.pose, guess, window.reach_m + 0.2,
                                            window.reach_rad + 0.1):
            found = _Fit(again, checked(self._known, again.pose[None], some))
            if found.is_good or found.check.likelihood[0] > fit.check.likelihood[0]:
                return found
        # Too far off: odometry is used.
        return fit if not fit.is_good else None

    def _watch(self, scan: Scan, fit: _Fit | None, points: int) -> None:
        """Detect that the pose is lost."""
        if self._fitted_ns is None:
            self._fitted_ns = scan.stamp_ns
        for_ns = scan.stamp_ns - self._fitted_ns
        walls = fit is not None and fit.through > _THROUGH_MOST
        why = ''
        if walls and for_ns >= _LOST_NS:
            assert fit is not None
            why = f'{100 * fit.through:.0f} % of the beams go through walls of the map'
        elif for_ns >= _CROWD_NS and self._way > _CROWD_M:
            why = (f'only {points} beams hit something' if fit is None else
                   f'only {100 * fit.aligned.share:.0f} % of the points are on the map')
        if why:
            self.counts['lost'] += not self.lost
            self.lost = f'{why} for {for_ns / NS_PER_S:.0f} s'
