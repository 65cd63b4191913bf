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
Process scans: extend the map, or localise the robot on an existing one.

It has no link, no threads and no clock: scans are passed to :meth:`Engine.add_scan`, which returns
the pose. Only one thread may use it at a time.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.mapping.drawing import Drawing
from rt_robot_os.features.mapping.robot_pose import Hint
from rt_robot_os.features.mapping.robot_pose import keyframe_poses
from rt_robot_os.features.mapping.robot_pose import LastScan
from rt_robot_os.features.mapping.robot_pose import LoadedMap
from rt_robot_os.features.mapping.robot_pose import robot_pose_of
from rt_robot_os.features.mapping.robot_pose import RobotPose
from rt_robot_os.features.mapping.scan_intake import PosedScan
from rt_robot_os.features.mapping.settings import LOCALIZATION
from rt_robot_os.features.mapping.settings import MAPPING
from rt_robot_os.features.mapping.settings import MappingSettings
from rt_robot_os.features.mapping.slam.checks import ScanChecks
from rt_robot_os.features.mapping.slam.global_localization import GlobalLocalizer
from rt_robot_os.features.mapping.slam.graph import MapGraph
from rt_robot_os.features.mapping.slam.known_map import KnownMap
from rt_robot_os.features.mapping.slam.located import Located
from rt_robot_os.features.mapping.slam.map_localizer import MapLocalizer
from rt_robot_os.features.mapping.slam.mapper import Mapper
from rt_robot_os.features.mapping.slam.transforms import between
from rt_robot_os.features.mapping.slam.transforms import composed
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.motion.grid_map import GridMap

#: Unmatched scans in a row after which the robot counts as lost.
_LOST_AFTER_SCANS: Final = 10
#: Failed checks in a row of an assumed pose after which the whole map is searched.
_FAILED_CHECKS_MOST: Final = 5
#: An assumed pose is verified by as many scans in a row that match the map with this share.
_VERIFIED_SHARE: Final = 0.7
_CHECKS_NEEDED: Final = 3
_EMPTY_GRAPH: Final = MapGraph()


class Engine:
    """
    A map, and the mapper or the localiser that works on it.

    :param start_at: returns the pose of the robot at the first scan of a new map.
    :ivar mode: ``mapping`` or ``localization``.
    :ivar is_paused: scans are dropped.
    :ivar last_ns: stamp of the newest scan that was processed.
    :ivar drawing: the map as a grid.
    :ivar found: how often a search has found the robot.
    :ivar rejected_scans: scans that were dropped for the reason of :attr:`checks`.
    """

    def __init__(self, settings: MappingSettings, start_at: Hint) -> None:
        self.mode = settings.mode
        self.is_paused = False
        self.last_ns = 0
        self.found = self.rejected_scans = 0
        self.checks = ScanChecks(settings.range_max_m)
        self._settings = settings
        self._tuning = settings.tuning()
        self._start_at = start_at
        self.drawing = Drawing(settings.cell_m)
        self._begin(None, start_at)

    def _begin(self, known: LoadedMap | None, hint: Hint | None) -> None:
        self._loaded_map = known
        self._hint = hint
        self._mapper: Mapper | None = None
        self._map_localizer: MapLocalizer | None = None
        self._global_localizer: GlobalLocalizer | None = None
        self._is_searching = False
        self.drawing.restart()
        self._last_scan: LastScan | None = None
        self._is_verified = known is None
        self._unmatched = self._failed_checks = self._passed_checks = 0
        self._share = 0.0
        self._problem = ''
        if known is not None and known.grid is not None:
            self.drawing.show(known.grid, 0)
        elif known is not None:
            self.drawing.is_done = False

    # ---- which map ---------------------------------------------------------------------------

    def begin_new(self) -> None:
        """Begin a new map where the robot is."""
        self.mode = MAPPING
        self._begin(None, self._start_at)

    def use_map(self, known: LoadedMap, hint: Hint | None) -> None:
        """
        Continue with a loaded map.

        :param hint: returns the pose of the robot on it; None: the whole map is searched.
        """
        if known.graph is None or not known.graph.keyframes:
            self.mode = LOCALIZATION
        self._begin(known, hint)

    def set_mode(self, mode: str) -> None:
        """
        Change between ``mapping`` and ``localization``.

        :raises ConfigError: there is no map for that mode.
        """
        if mode == self.mode:
            return
        graph = self.graph
        if mode == MAPPING and (graph is None or not graph.keyframes):
            if self._loaded_map is None:  # there is no map
                self.begin_new()
                return
            raise ConfigError(['this map has no graph: nothing can be added to it; reset begins '
                               'a new one'])
        if graph is None or not graph.keyframes:
            raise ConfigError(['there is no map yet: drive, or load one'])
        if self.mode == MAPPING:
            self.finish_drawing()
        known, here = LoadedMap(graph, self.grid), self._last_scan
        self.mode = mode
        self._begin(known, None)
        self._is_verified = True
        if here is not None:
            self._continue_at(here.posed, here.pose, here.covariance)

    def relocate(self, posed: PosedScan, base: Floats) -> None:
        """Set the pose of the robot on the map, as given by an operator."""
        self._global_localizer, self._is_searching = None, False
        if self._loaded_map is None and self._mapper is None:
            self._hint = lambda posed: base
            return
        self._is_verified = True
        self._continue_at(posed, posed.mount.lasers(base), None)

    def add_absolute_pose(self, stamp_ns: int, base: Floats, covariance: Floats) -> None:
        """Add an absolute pose, to which the map is fitted from then on."""
        if self._mapper is not None and self._last_scan is not None and self._is_verified:
            self._mapper.add_absolute_pose(
                stamp_ns, self._last_scan.posed.mount.lasers(base), covariance)

    def trust_next_hint(self) -> None:
        """Use the next hint without verification, as it comes from odometry."""
        self._is_verified = True

    # ---- scans -------------------------------------------------------------------------------

    def add_scan(self, posed: PosedScan) -> RobotPose | None:
        """
        Process the next scan.

        :return: the pose of the robot; None when it is not known.
        """
        self.last_ns = posed.scan.stamp_ns
        if posed.is_cut:
            self._restart_from_odometry()
        if self.is_paused or self._is_rejected(posed):
            return None
        if self._is_searching:
            return self._search(posed)
        locator = self._mapper or self._map_localizer or self._locator_for_first(posed)
        if locator is None:
            return None
        return self._record_match(posed, locator.add(posed.scan))

    def _is_rejected(self, posed: PosedScan) -> bool:
        """Return whether a scan would corrupt the map or the pose."""
        checks, was_wrong = self.checks, self.checks.odometry_is_wrong
        checks.check(posed.scan, posed.base, posed.left_out, posed.are_two)
        if was_wrong and not checks.rejection_reason:
            self._restart_from_odometry()
        self.rejected_scans += bool(checks.rejection_reason)
        return bool(checks.rejection_reason)

    def _restart_from_odometry(self) -> None:
        """Continue at the pose of odometry, which must be verified: the robot moved unobserved."""
        self._global_localizer = None  # its scans may be from another pose
        here, known = self.last_pose, self._loaded_map
        if self.mode == MAPPING and self.graph is not None:
            known = LoadedMap(self.graph, self.grid if self.drawing.is_done else None)
        if here is None or known is None:
            return
        base, before = here
        self._begin(known, lambda posed: composed(base, between(before.base, posed.base)))

    def _locator_for_first(self, posed: PosedScan) -> Mapper | MapLocalizer | None:
        """Return what processes the first scan; None while the pose is not known."""
        if self._hint is None:
            self.start_search()
            return None
        base = self._hint(posed)
        if base is None:
            return None
        laser = posed.mount.lasers(base)
        if self._loaded_map is not None:
            return self._continue_at(posed, laser, None)
        if self.mode == MAPPING:
            self._mapper = Mapper(self._tuning, start=laser)
        return self._mapper

    def _continue_at(self, posed: PosedScan, laser: Floats, covariance: Floats | None,
                     searched: KnownMap | None = None) -> Mapper | MapLocalizer | None:
        """
        Continue from a pose on the map.

        :param searched: the map as the global search has used it; None without such a search.
        """
        self._unmatched = self._failed_checks = self._passed_checks = 0
        odometry = posed.scan.odometry
        if self.mode == LOCALIZATION or not self._is_verified:
            self._loaded_map = self._map_with_grid()  # an unverified pose must not extend the map
            grid, graph = self._loaded_map.grid, self._loaded_map.graph
            if grid is None:
                return None
            try:
                self._map_localizer = MapLocalizer(
                    grid, graph, laser, covariance, self._tuning, odometry, searched)
            except ConfigError as error:
                self._problem = f'lost: {error.problems[0]}'
            return self._map_localizer
        self._map_localizer = None
        if self._mapper is None:
            graph = self._loaded_map.graph if self._loaded_map is not None else None
            self._mapper = Mapper.of_graph(graph or MapGraph(), self._tuning)
            self.drawing.is_done = False
        self._mapper.relocate(laser, odometry)
        return self._mapper

    def _map_with_grid(self) -> LoadedMap:
        """Return the map with its grid, which is drawn now if it is missing."""
        known = self._loaded_map or LoadedMap(self.graph)
        if known.grid is None and known.graph is not None and known.graph.keyframes:
            self.finish_drawing()
            known = replace(known, grid=self.grid)
        return known

    def _record_match(self, posed: PosedScan, located: Located) -> RobotPose:
        """Record how a scan matched; a lost robot starts a search."""
        if self._mapper is not None:
            self.drawing.set_version(self._mapper.version)
        self._share = located.share
        self._last_scan = LastScan(posed, located.pose, located.covariance)
        self._unmatched = self._unmatched + 1 if located.is_lost else 0
        place = robot_pose_of(posed, located)
        if not self._is_verified:
            self._verify(posed, located)
            place = replace(place, is_sure=False)
        if self._map_localizer is not None and self._map_localizer.lost:
            self.start_search()
        return place

    def _verify(self, posed: PosedScan, located: Located) -> None:
        """Verify an assumed pose by a scan, or give it up."""
        if located.is_lost or located.share < _VERIFIED_SHARE:
            self._passed_checks, self._failed_checks = 0, self._failed_checks + 1
            if self._failed_checks >= _FAILED_CHECKS_MOST:
                self.start_search()
            return
        self._passed_checks += 1
        if self._passed_checks >= _CHECKS_NEEDED:
            self._is_verified = True
            if self.mode == MAPPING:
                self._continue_at(posed, located.pose, located.covariance)

    # ---- global search -----------------------------------------------------------------------

    def start_search(self) -> None:
        """Search the whole map for the robot, as soon as the map is drawn."""
        self._is_searching, self._global_localizer, self._is_verified = True, None, False
        self._unmatched = 0

    def _search(self, posed: PosedScan) -> RobotPose | None:
        if self._global_localizer is None:
            return None
        found = self._global_localizer.add_scan(posed.scan)
        self._last_scan = None
        if found is None:
            return None
        self.found += 1
        searched = self._global_localizer.known_map
        self._is_searching, self._global_localizer, self._is_verified = False, None, True
        self._continue_at(posed, found.pose, found.covariance, searched)
        self._last_scan = LastScan(posed, found.pose, found.covariance)
        place = robot_pose_of(posed, Located(found.pose, found.covariance, found.share))
        return replace(place, is_found=True)

    # ---- background work -----------------------------------------------------------------------

    def process_pending(self) -> bool:
        """Do a piece of background work, of some 10 ms; return whether there is more."""
        if not self.drawing.is_done:
            self._draw()
            return True
        if self._is_searching and self._global_localizer is None:
            self._make_global_localizer()
        if self._global_localizer is not None:
            return self._global_localizer.process_pending()
        return self._mapper is not None and self._mapper.process_pending()

    def _draw(self) -> None:
        self.drawing.draw(self.graph, -1 if self._mapper is None else self._mapper.version,
                          0 if self._last_scan is None else self._last_scan.posed.scan.stamp_ns)

    def finish_drawing(self) -> None:
        """Complete the grid."""
        while not self.drawing.is_done:
            self._draw()

    def _make_global_localizer(self) -> None:
        try:
            self._global_localizer = GlobalLocalizer(self.grid, self.graph, self._tuning)
        except ConfigError as error:
            self._is_searching = False
            self._problem = f'lost: {error.problems[0]}'

    # ---- results ---------------------------------------------------------------------------

    @property
    def graph(self) -> MapGraph | None:
        """Return the graph of the map; None for a map without one."""
        if self._mapper is not None:
            return self._mapper.graph
        return None if self._loaded_map is None else self._loaded_map.graph

    @property
    def path(self) -> Floats:
        """Return the poses of ``base_link`` at the keyframes; shape (n, 3)."""
        return keyframe_poses(self.graph, self._last_scan)

    @property
    def grid(self) -> GridMap:
        """Return the last grid of the map."""
        return self.drawing.grid

    @property
    def last_pose(self) -> tuple[Floats, PosedScan] | None:
        """Return the pose of ``base_link`` at the last scan, and that scan; None when unknown."""
        here = self._last_scan
        if here is None or not self._is_verified:
            return None
        return here.posed.mount.base(here.pose), here.posed

    def base_at(self, posed: PosedScan) -> Floats | None:
        """Return the pose by odometry since the last scan with a known pose."""
        known = self.last_pose
        if known is None:
            return None
        return composed(known[0], between(known[1].base, posed.base))

    @property
    def is_searching(self) -> bool:
        """Return whether the whole map is searched for the robot."""
        return self._is_searching and not self.is_paused

    @property
    def is_ambiguous(self) -> bool:
        """Return whether it is, and several places match: then the robot must move."""
        search = self._global_localizer
        return self.is_searching and search is not None and search.is_ambiguous

    @property
    def state(self) -> str:
        """Return the state in one line."""
        if self._problem:
            return self._problem
        if self.is_paused:
            return 'paused'
        if self.checks.rejection_reason:
            return f'lost: {self.checks.rejection_reason}'
        if self._is_searching:
            search = self._global_localizer
            said = '' if search is None else search.state.rpartition(': ')[2]
            return f'finding itself: {said}' if said else 'finding itself'
        if self.mode == LOCALIZATION and self._loaded_map is None:
            return 'lost: there is no map to find itself in: load one'
        if self._mapper is None and self._map_localizer is None:
            return 'finding itself'
        if not self._is_verified:
            return 'finding itself: is it where it is taken to be?'
        if self._unmatched >= _LOST_AFTER_SCANS:
            return (f'lost: scans fit nowhere on the map ({self._share:.0%} of their points), '
                    'odometry is followed')
        return 'localisation' if self.mode == LOCALIZATION else MAPPING

    def statistics(self) -> dict[str, Any]:
        """Return its counters."""
        graph = self.graph or _EMPTY_GRAPH
        found: dict[str, Any] = {
            'mode': self.mode, 'share': round(self._share, 3), 'found': self.found,
            'scans_spoilt': self.rejected_scans,
            'map_keyframes': len(graph.keyframes), 'map_edges': len(graph.edges),
            'map_cells': self.grid.cells.size}
        for name, part in (('mapper', self._mapper), ('follower', self._map_localizer),
                           ('finder', self._global_localizer), ('grid', self.drawing),
                           ('check', self.checks)):
            if part is not None:
                found.update({f'{name}_{key}': value for key, value in part.counts.items()})
        return found
