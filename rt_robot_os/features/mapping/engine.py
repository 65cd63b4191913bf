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
What becomes of a scan: the map grows, or the robot finds itself in one that is there.

No link, no threads, no clock: scans come in by :meth:`Engine.take`, and what is to be told comes
out. One thread at a time.
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

#: So many scans in a row that fit nowhere, and the robot is lost;
_LOST_SCANS: Final = 10
#: so many after it was taken to be somewhere, and it looks for itself.
_DOUBT_SCANS: Final = 5
#: It is there when such a share of a scan lies on the map, so often in a row.
_PROVEN_SHARE: Final = 0.7
_PROOFS: Final = 3
_NOTHING: Final = MapGraph()


class Engine:
    """
    A map, and who goes on with it.

    :param start_at: where the robot is at the first scan of a new map.
    :ivar mode: ``mapping`` or ``localization``.
    :ivar is_paused: scans are left out.
    :ivar last_ns: stamp of the newest scan that was looked at.
    :ivar drawing: the map as cells.
    :ivar found: how often it found itself.
    :ivar spoilt: scans that were left out, for :attr:`checks` say why.
    """

    def __init__(self, settings: MappingSettings, start_at: Hint) -> None:
        self.mode = settings.mode
        self.is_paused = False
        self.last_ns = 0
        self.found = self.spoilt = 0
        self.checks = ScanChecks(settings.range_max_m)
        self._settings = settings
        self._tuning = settings.tuning()
        self._start_at = start_at
        self.drawing = Drawing(settings.cell_m)
        self._begin(None, start_at)

    def _begin(self, known: LoadedMap | None, hint: Hint | None) -> None:
        self._known = known
        self._hint = hint
        self._mapper: Mapper | None = None
        self._follower: MapLocalizer | None = None
        self._finder: GlobalLocalizer | None = None
        self._is_sought = False
        self.drawing.begin()
        self._here: LastScan | None = None
        self._is_proven = known is None
        self._fits_nowhere = self._doubted = self._proofs = 0
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

    def adopt(self, known: LoadedMap, hint: Hint | None) -> None:
        """
        Go on with a map that is there.

        :param hint: where the robot is on it; None: it looks for itself.
        """
        if known.graph is None or not known.graph.keyframes:
            self.mode = LOCALIZATION
        self._begin(known, hint)

    def switch(self, mode: str) -> None:
        """
        Let the map grow from now on, or stay as it is.

        :raises ConfigError: there is no map that can.
        """
        if mode == self.mode:
            return
        graph = self.graph
        if mode == MAPPING and (graph is None or not graph.keyframes):
            if self._known is None:  # there is none at all
                self.begin_new()
                return
            raise ConfigError(['this map has no graph: nothing can be added to it; reset begins '
                               'a new one'])
        if graph is None or not graph.keyframes:
            raise ConfigError(['there is no map yet: drive, or load one'])
        if self.mode == MAPPING:
            self.finish_drawing()
        known, here = LoadedMap(graph, self.grid), self._here
        self.mode = mode
        self._begin(known, None)
        self._is_proven = True
        if here is not None:
            self._settle(here.sighting, here.pose, here.covariance)

    def relocate(self, sighting: PosedScan, base: Floats) -> None:
        """Take it that the robot is somewhere on the map, as somebody says."""
        self._finder, self._is_sought = None, False
        if self._known is None and self._mapper is None:
            self._hint = lambda sighting: base
            return
        self._is_proven = True
        self._settle(sighting, sighting.mount.lasers(base), None)

    def fix(self, stamp_ns: int, base: Floats, covariance: Floats) -> None:
        """Take an absolute pose, which the map follows from then on."""
        if self._mapper is not None and self._here is not None and self._is_proven:
            self._mapper.fix(stamp_ns, self._here.sighting.mount.lasers(base), covariance)

    def trust(self) -> None:
        """Take the next place that is hinted at without a proof: odometry says it."""
        self._is_proven = True

    # ---- scans -------------------------------------------------------------------------------

    def take(self, sighting: PosedScan) -> RobotPose | None:
        """
        Take the next scan.

        :return: None when it does not say where the robot is.
        """
        self.last_ns = sighting.scan.stamp_ns
        if sighting.is_cut:
            self._doubt()
        if self.is_paused or self._is_spoilt(sighting):
            return None
        if self._is_sought:
            return self._look(sighting)
        locator = self._mapper or self._follower or self._first(sighting)
        if locator is None:
            return None
        return self._note(sighting, locator.add(sighting.scan))

    def _is_spoilt(self, sighting: PosedScan) -> bool:
        """Return whether a scan would spoil the map, or say that the robot is where it is not."""
        checks, was_wrong = self.checks, self.checks.odometry_is_wrong
        checks.look(sighting.scan, sighting.base, sighting.left_out, sighting.are_two)
        if was_wrong and not checks.spoils:
            self._doubt()
        self.spoilt += bool(checks.spoils)
        return bool(checks.spoils)

    def _doubt(self) -> None:
        """Go on where odometry says, if that proves right: nobody saw where the robot went."""
        self._finder = None  # what it has seen so far may have been seen from elsewhere
        here, known = self.here, self._known
        if self.mode == MAPPING and self.graph is not None:
            known = LoadedMap(self.graph, self.grid if self.drawing.is_done else None)
        if here is None or known is None:
            return
        base, before = here
        self._begin(known, lambda sighting: composed(base, between(before.base, sighting.base)))

    def _first(self, sighting: PosedScan) -> Mapper | MapLocalizer | None:
        """Take the first scan: where is the robot; None: that is not known yet."""
        if self._hint is None:
            self.seek()
            return None
        base = self._hint(sighting)
        if base is None:
            return None
        laser = sighting.mount.lasers(base)
        if self._known is not None:
            return self._settle(sighting, laser, None)
        if self.mode == MAPPING:
            self._mapper = Mapper(self._tuning, start=laser)
        return self._mapper

    def _settle(self, sighting: PosedScan, laser: Floats, covariance: Floats | None,
                searched: KnownMap | None = None) -> Mapper | MapLocalizer | None:
        """Go on from a place of the map, which was searched if the robot has found itself."""
        self._fits_nowhere = self._doubted = self._proofs = 0
        odometry = sighting.scan.odometry
        if self.mode == LOCALIZATION or not self._is_proven:
            self._known = self._whole()  # what is not sure adds nothing to the map
            grid, graph = self._known.grid, self._known.graph
            if grid is None:
                return None
            try:
                self._follower = MapLocalizer(grid, graph, laser, covariance, self._tuning,
                                              odometry,
                                              searched)
            except ConfigError as error:
                self._problem = f'lost: {error.problems[0]}'
            return self._follower
        self._follower = None
        if self._mapper is None:
            graph = self._known.graph if self._known is not None else None
            self._mapper = Mapper.of_graph(graph or MapGraph(), self._tuning)
            self.drawing.is_done = False
        self._mapper.relocated(laser, odometry)
        return self._mapper

    def _whole(self) -> LoadedMap:
        """Return the map with its grid, drawn now where there is none."""
        known = self._known or LoadedMap(self.graph)
        if known.grid is None and known.graph is not None and known.graph.keyframes:
            self.finish_drawing()
            known = replace(known, grid=self.grid)
        return known

    def _note(self, sighting: PosedScan, located: Located) -> RobotPose:
        """Note how a scan fitted; a robot that is nowhere looks for itself."""
        if self._mapper is not None:
            self.drawing.follow(self._mapper.version)
        self._share = located.share
        self._here = LastScan(sighting, located.pose, located.covariance)
        self._fits_nowhere = self._fits_nowhere + 1 if located.is_lost else 0
        place = robot_pose_of(sighting, located)
        if not self._is_proven:
            self._prove(sighting, located)
            place = replace(place, is_sure=False)
        if self._follower is not None and self._follower.lost:
            self.seek()
        return place

    def _prove(self, sighting: PosedScan, located: Located) -> None:
        """Believe where it is taken to be, or no longer."""
        if located.is_lost or located.share < _PROVEN_SHARE:
            self._proofs, self._doubted = 0, self._doubted + 1
            if self._doubted >= _DOUBT_SCANS:
                self.seek()
            return
        self._proofs += 1
        if self._proofs >= _PROOFS:
            self._is_proven = True
            if self.mode == MAPPING:
                self._settle(sighting, located.pose, located.covariance)

    # ---- where it is -------------------------------------------------------------------------

    def seek(self) -> None:
        """Look for the robot on the whole map, as soon as that is drawn."""
        self._is_sought, self._finder, self._is_proven = True, None, False
        self._fits_nowhere = 0

    def _look(self, sighting: PosedScan) -> RobotPose | None:
        if self._finder is None:
            return None
        found = self._finder.look(sighting.scan)
        self._here = None
        if found is None:
            return None
        self.found += 1
        searched = self._finder.known
        self._is_sought, self._finder, self._is_proven = False, None, True
        self._settle(sighting, found.pose, found.covariance, searched)
        self._here = LastScan(sighting, found.pose, found.covariance)
        place = robot_pose_of(sighting, Located(found.pose, found.covariance, found.share))
        return replace(place, is_found=True)

    # ---- what can wait -----------------------------------------------------------------------

    def work(self) -> bool:
        """Do a piece of what can wait, of some 10 ms; True while there is more."""
        if not self.drawing.is_done:
            self._draw()
            return True
        if self._is_sought and self._finder is None:
            self._make_finder()
        if self._finder is not None:
            return self._finder.work()
        return self._mapper is not None and self._mapper.think()

    def _draw(self) -> None:
        self.drawing.draw(self.graph, -1 if self._mapper is None else self._mapper.version,
                          0 if self._here is None else self._here.sighting.scan.stamp_ns)

    def finish_drawing(self) -> None:
        """Draw all that is to be drawn."""
        while not self.drawing.is_done:
            self._draw()

    def _make_finder(self) -> None:
        try:
            self._finder = GlobalLocalizer(self.grid, self.graph, self._tuning)
        except ConfigError as error:
            self._is_sought = False
            self._problem = f'lost: {error.problems[0]}'

    # ---- what there is -----------------------------------------------------------------------

    @property
    def graph(self) -> MapGraph | None:
        """Return the map as a graph; None of a map without one."""
        if self._mapper is not None:
            return self._mapper.graph
        return None if self._known is None else self._known.graph

    @property
    def way(self) -> Floats:
        """Return where ``base_link`` was at the scans that the map is made of; shape (n, 3)."""
        return keyframe_poses(self.graph, self._here)

    @property
    def grid(self) -> GridMap:
        """Return the map as cells, as it was drawn last."""
        return self.drawing.grid

    @property
    def here(self) -> tuple[Floats, PosedScan] | None:
        """Return where ``base_link`` was at the last scan, and that; None when nobody knows."""
        here = self._here
        if here is None or not self._is_proven:
            return None
        return here.sighting.mount.base(here.pose), here.sighting

    def base_at(self, sighting: PosedScan) -> Floats | None:
        """Return where the robot is by odometry since the last scan that said it."""
        known = self.here
        if known is None:
            return None
        return composed(known[0], between(known[1].base, sighting.base))

    @property
    def is_looking(self) -> bool:
        """Return whether it looks for the robot on the whole map."""
        return self._is_sought and not self.is_paused

    @property
    def is_ambiguous(self) -> bool:
        """Return whether it does, and places look alike: then the robot has to move."""
        return self.is_looking and self._finder is not None and self._finder.is_ambiguous

    @property
    def state(self) -> str:
        """Say in one line what goes on."""
        if self._problem:
            return self._problem
        if self.is_paused:
            return 'paused'
        if self.checks.spoils:
            return f'lost: {self.checks.spoils}'
        if self._is_sought:
            said = '' if self._finder is None else self._finder.state.rpartition(': ')[2]
            return f'finding itself: {said}' if said else 'finding itself'
        if self.mode == LOCALIZATION and self._known is None:
            return 'lost: there is no map to find itself in: load one'
        if self._mapper is None and self._follower is None:
            return 'finding itself'
        if not self._is_proven:
            return 'finding itself: is it where it is taken to be?'
        if self._fits_nowhere >= _LOST_SCANS:
            return (f'lost: scans fit nowhere on the map ({self._share:.0%} of their points), '
                    'odometry is followed')
        return 'localisation' if self.mode == LOCALIZATION else MAPPING

    def statistics(self) -> dict[str, Any]:
        """Return its counters."""
        graph = self.graph or _NOTHING
        found: dict[str, Any] = {
            'mode': self.mode, 'share': round(self._share, 3), 'found': self.found,
            'scans_spoilt': self.spoilt,
            'map_keyframes': len(graph.keyframes), 'map_edges': len(graph.edges),
            'map_cells': self.grid.cells.size}
        for name, part in (('mapper', self._mapper), ('follower', self._follower),
                           ('finder', self._finder), ('grid', self.drawing),
                           ('check', self.checks)):
            if part is not None:
                found.update({f'{name}_{key}': value for key, value in part.counts.items()})
        return found
