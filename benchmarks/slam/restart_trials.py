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
Restart in a saved map at random places: how often a robot finds itself, how fast, how right.

Time is that of the scans (10 a second); between two of them the search may use so much of a CPU
as there is time. What it used is measured, everything else is simulated and comes from a seed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from dataclasses import dataclass
from dataclasses import field
import math
import time
from typing import Any
from typing import Final

import numpy as np

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.mapping.slam.global_localization import GlobalLocalizer
from rt_robot_os.features.mapping.slam.graph import MapGraph
from rt_robot_os.features.mapping.slam.known_map import KnownMap
from rt_robot_os.features.mapping.slam.scan import Scan
from rt_robot_os.features.mapping.slam.transforms import between
from rt_robot_os.features.mapping.slam.transforms import composed
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.walls import disc_distances
from rt_robot_os.motion.walls import Walls

_PERIOD_S: Final = 0.1
_CLEAR_M: Final = 0.25
_RIGHT_M: Final = 0.2
_RIGHT_RAD: Final = math.radians(3.0)
#: Legs of a chair are as small, and so many cells apart from all else.
_SMALL_CELLS: Final = 9
_SMALL_REACH: Final = 4
_PERSON_M: Final = 0.18
_LEG_M: Final = 0.025


@dataclass(frozen=True)
class Conditions:
    """
    How a robot is started.

    :ivar beams: of its laser; fov_rad its field of view, range_m its reach, noise_m of a range.
    :ivar people: who stand about, 0.6 to 3 m from it.
    :ivar chairs: chairs that are where the map has none.
    :ivar turn_rad_s: it turns on the spot; speed_m_s: it drives, where there is room.
    :ivar limit_s: then it is asked no more.
    :ivar load: part of a CPU that the search has.
    """

    beams: int = 360
    fov_rad: float = math.tau
    range_m: float = 12.0
    noise_m: float = 0.01
    people: int = 2
    chairs: int = 1
    turn_rad_s: float = 0.0
    speed_m_s: float = 0.0
    limit_s: float = 10.0
    load: float = 0.9


@dataclass
class Trials:
    """
    What came of restarts.

    :ivar right: within 0.2 m and 3 degrees in time; ``wrong``: another answer; ``none``: no
        answer in time.
    :ivar times_s: of the right ones, sorted; ``errors_m`` and ``errors_deg`` of the same.
    :ivar longest_piece_ms: of CPU, of all calls.
    :ivar misses: where the others began, and what was said.
    """

    right: int = 0
    wrong: int = 0
    none: int = 0
    times_s: list[float] = field(default_factory=list)
    errors_m: list[float] = field(default_factory=list)
    errors_deg: list[float] = field(default_factory=list)
    longest_piece_ms: float = 0.0
    misses: list[tuple[str, list[float], str]] = field(default_factory=list)

    def summary(self) -> dict[str, Any]:
        """Return the numbers in short."""
        def worst(values: list[float], part: float) -> float:
            return round(float(np.quantile(values, part)), 3) if values else math.nan
        found = {name: value for name, value in asdict(self).items() if isinstance(value, int)}
        return {**found, 'time_p50_s': worst(self.times_s, 0.5),
                'time_p95_s': worst(self.times_s, 0.95), 'time_max_s': worst(self.times_s, 1.0),
                'error_p95_m': worst(self.errors_m, 0.95),
                'error_p95_deg': worst(self.errors_deg, 0.95),
                'longest_piece_ms': round(self.longest_piece_ms, 1)}


def restart_trials(count: int, seed: int, world: GridMap, saved: GridMap | None = None,
                   graph: MapGraph | None = None, conditions: Conditions | None = None,
                   make: Callable[..., Any] = GlobalLocalizer) -> Trials:
    """
    Restart a robot at random places of a world.

    :param world: the true map, with what stands in it.
    :param saved: in which it looks for itself, in the same frame; None: the true one.
    :param make: of (grid, graph): what finds it; as :class:`GlobalLocalizer`.
    """
    given = conditions or Conditions()
    rng = np.random.default_rng(seed)
    trials = Trials()
    room = _room(world)
    finder = make(saved or world, graph)
    for _ in range(count):
        row, column = rng.choice(np.argwhere(room > _CLEAR_M))
        start = np.array((*world.centre(int(row), int(column)), rng.uniform(-math.pi, math.pi)))
        _one(finder, _Robot(world, room, start, given, rng), given, trials)
    return trials


def _room(world: GridMap) -> Floats:
    """Return how far each free cell is from what is not, in m, as far as matters."""
    known = KnownMap(world)
    for _ in known.build():
        pass
    along = (np.arange(world.columns) + 0.5) * world.resolution_m
    up = (np.arange(world.rows) + 0.5) * world.resolution_m
    across, above = np.meshgrid(along, up)
    return np.where(world.cells == 0, known.away(across, above), 0.0)


def _one(finder: Any, robot: _Robot, given: Conditions, trials: Trials) -> None:
    finder.restart()
    start = [round(each, 3) for each in robot.pose.tolist()]
    for number in range(round(given.limit_s / _PERIOD_S)):
        scan = robot.scan(number)
        used = time.thread_time()
        found = finder.add_scan(scan)
        spent = time.thread_time() - used
        trials.longest_piece_ms = max(trials.longest_piece_ms, 1e3 * spent)
        if found is not None:
            off = between(robot.pose, found.pose)
            far, turned = float(np.hypot(off[0], off[1])), abs(float(off[2]))
            if far <= _RIGHT_M and turned <= _RIGHT_RAD:
                trials.right += 1
                trials.times_s.append(number * _PERIOD_S + spent)
                trials.errors_m.append(far)
                trials.errors_deg.append(math.degrees(turned))
            else:
                trials.wrong += 1
                trials.misses.append(('wrong', start, f'{far:.2f} m, {turned:.2f} rad off'))
            return
        while spent < given.load * _PERIOD_S:
            used = time.thread_time()
            more = finder.process_pending()
            piece = time.thread_time() - used
            spent += piece
            trials.longest_piece_ms = max(trials.longest_piece_ms, 1e3 * piece)
            if not more:
                break
    trials.none += 1
    trials.misses.append(('none', start, finder.state))


class _Robot:
    """A robot that stands, turns or drives among people and chairs, with wheels that slip."""

    def __init__(self, world: GridMap, room: Floats, start: Floats, given: Conditions,
                 rng: np.random.Generator) -> None:
        self.pose = start
        self._given, self._rng, self._room, self._world = given, rng, room, world
        cells = world.cells
        discs = []
        if given.chairs:
            cells, legs = _chairs_moved(world, start, given.chairs, rng)
            discs += [(*leg, _LEG_M) for leg in legs]
        for _ in range(given.people):
            away, bearing = rng.uniform(0.6, 3.0), rng.uniform(-math.pi, math.pi)
            discs.append((start[0] + away * math.cos(bearing),
                          start[1] + away * math.sin(bearing), _PERSON_M))
        self._discs = discs
        self._walls = Walls.of(GridMap(cells, world.resolution_m, world.origin))
        self._odometry = np.array((0.0, 0.0, rng.uniform(-math.pi, math.pi)))
        self._angles = np.linspace(-given.fov_rad / 2, given.fov_rad / 2, given.beams,
                                   endpoint=given.fov_rad < math.tau - 0.01)

    def scan(self, number: int) -> Scan:
        """Look, then move."""
        given = self._given
        if number:
            self._move()
        x, y, yaw = self.pose.tolist()
        ranges = self._walls.cast(x, y, yaw + self._angles, given.range_m)
        for px, py, radius in self._discs:
            if math.hypot(px - x, py - y) > radius + 0.1:
                np.minimum(ranges, disc_distances(px - x, py - y, yaw + self._angles, radius),
                           out=ranges)
        ranges = ranges + self._rng.normal(0.0, given.noise_m, given.beams)
        step = float(self._angles[1] - self._angles[0])
        return Scan(round(number * _PERIOD_S * NS_PER_S), self._odometry, ranges,
                    float(self._angles[0]), step)

    def _move(self) -> None:
        given = self._given
        ahead = given.speed_m_s * _PERIOD_S
        x, y, yaw = self.pose.tolist()
        cell = self._world.cell(x + 0.5 * math.cos(yaw), y + 0.5 * math.sin(yaw))
        blocked = ahead and (cell is None or self._room[cell] < _CLEAR_M)
        step = np.array((0.0, 0.0, 0.5 * _PERIOD_S) if blocked
                        else (ahead, 0.0, given.turn_rad_s * _PERIOD_S))
        self.pose = composed(self.pose, step)
        slip = 1.0 + self._rng.normal(0.0, 0.05, 3)
        self._odometry = composed(self._odometry, step * slip)


def _chairs_moved(world: GridMap, start: Floats, count: int, rng: np.random.Generator
                  ) -> tuple[Any, list[tuple[float, float]]]:
    """Take small things away, and put four legs elsewhere for each."""
    cells = world.cells.copy()
    occupied = np.pad(cells >= 50, _SMALL_REACH).astype(np.int64)
    around = np.lib.stride_tricks.sliding_window_view(occupied, (2 * _SMALL_REACH + 1,) * 2)
    legs = np.argwhere((cells >= 50) & (around.sum((2, 3)) <= _SMALL_CELLS))
    for _ in range(count if len(legs) else 0):
        middle = rng.choice(legs)
        near = legs[np.hypot(*(legs - middle).T) * world.resolution_m < 0.6]
        for row, column in near:
            cells[row, column] = 0
    put = []
    for _ in range(count):
        away, bearing = rng.uniform(0.6, 2.5), rng.uniform(-math.pi, math.pi)
        x, y = start[0] + away * math.cos(bearing), start[1] + away * math.sin(bearing)
        put += [(x + dx, y + dy) for dx in (-0.2, 0.2) for dy in (-0.2, 0.2)]
    return cells, put
