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
Drives of a simulated robot through buildings whose true map is known: what a mapper is tried with.

Nothing here looks at a clock; the same arguments make the same drive on every machine.
"""

from __future__ import annotations

from dataclasses import dataclass
import math
from pathlib import Path
from typing import Any
from typing import Final

import numpy as np

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.mapping.slam.scan import Scan
from rt_robot_os.features.mapping.slam.transforms import between
from rt_robot_os.features.mapping.slam.transforms import composed
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.linux.file_urls import path_of
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.walls import disc_distances
from rt_robot_os.motion.walls import Walls

Way = tuple[tuple[float, float], ...]

#: Through all rooms of the flat, through the study and back to where it began; 38 m.
FLAT_WAY: Final[Way] = (
    (3.44, 1.0), (4.4, 1.1), (4.4, 2.6), (3.2, 3.2), (1.5, 3.5), (2.45, 3.7), (2.45, 4.9),
    (1.0, 4.95), (3.2, 5.3), (3.2, 6.6), (3.9, 5.65), (5.1, 5.65), (6.0, 5.8), (6.6, 6.6),
    (7.7, 6.7), (8.6, 6.0), (8.8, 5.1), (7.85, 4.9), (7.85, 4.0), (9.2, 3.6), (9.2, 1.9),
    (9.2, 3.6), (6.6, 3.7), (6.5, 1.3), (6.4, 3.6), (4.9, 3.65), (4.4, 2.6), (3.44, 1.0))
#: Along the hall of the house and into every room; 83 m.
HOUSE_WAY: Final[Way] = (
    (2.5, 3.8), (3.45, 4.4), (3.45, 5.9), (2.45, 5.9), (2.45, 7.4), (2.0, 9.5), (2.45, 7.4),
    (2.45, 5.9), (6.75, 5.9), (6.75, 7.4), (6.2, 9.0), (6.75, 7.4), (6.75, 5.9), (10.95, 5.9),
    (10.95, 7.4), (10.5, 9.2), (10.95, 7.4), (10.95, 5.9), (14.15, 5.9), (14.15, 9.8),
    (14.15, 5.9), (16.45, 5.9), (16.45, 9.5), (16.45, 5.9), (14.95, 5.9), (14.95, 4.2),
    (16.5, 3.0), (14.95, 4.2), (14.95, 5.9), (11.65, 5.9), (11.65, 2.5), (11.65, 5.9),
    (8.45, 5.9), (8.45, 4.3), (7.0, 4.0), (7.0, 3.05), (5.2, 3.05), (4.0, 3.6), (2.5, 3.8))
#: Once round a corridor of 60 m; nothing is seen twice before the end.
RING_WAY: Final[Way] = (
    (4.0, 2.0), (22.0, 2.0), (22.0, 12.0), (2.0, 12.0), (2.0, 2.0), (5.0, 2.0))

_STEPS_HZ: Final = 50
_REACHED_M: Final = 0.12
_TURN_RAD_S: Final = 0.8
_STEEP_RAD: Final = 0.5
_SPEED_UP_M_S2: Final = 0.5
_TURN_UP_RAD_S2: Final = 2.0
_TRACK_M: Final = 0.3
#: Wheels slip for so long, then otherwise.
_SLIP_S: Final = 0.5
_WALKER_M: Final = 0.18
_ROOM_M: Final = 0.45
_WALKER_M_S: Final = 0.5
#: Glass comes in panes of this width.
_PANE_M: Final = 0.5
#: A moving scan is cast from so many places.
_PLACES: Final = 12
_FIRST_S: Final = 1.0


@dataclass(frozen=True)
class Drive:
    """
    What a robot saw and what its wheels said, and where it was.

    :ivar scans: stamped at their first beam.
    :ivar truth: shape (scans, 3): where the laser was at each stamp, in the frame of the grid.
    :ivar grid: the true map.
    :ivar laser: shape (3,): where the laser is on the robot.
    :ivar odometry_ns: shape (n,), when the wheels were read, at 50 Hz.
    :ivar odometry: shape (n, 3), of the robot; it begins at 0, 0, 0.
    :ivar robot: shape (n, 3): where the robot was then.
    """

    scans: tuple[Scan, ...]
    truth: Floats
    grid: GridMap
    laser: Floats
    odometry_ns: Floats
    odometry: Floats
    robot: Floats

    @property
    def length_m(self) -> float:
        """Return how far the robot went."""
        return float(np.hypot(*np.diff(self.robot[:, :2], axis=0).T).sum())

    def in_its_map(self) -> Floats:
        """Return the truth as a mapper without absolute fixes gives it; shape (scans, 3)."""
        return between(np.broadcast_to(self.truth[0], self.truth.shape), self.truth)


@dataclass(frozen=True)
class Sight:
    """
    What a laser sees, and how well.

    :ivar beams: of a scan.
    :ivar field_rad: that they take up; a whole turn goes round.
    :ivar noise_m: standard deviation of a range.
    :ivar range_max_m: further away is no echo.
    :ivar scan_hz: scans in a second.
    :ivar is_skewed: the beams are measured one after another while the robot moves.
    :ivar is_deskewed: such a scan says where odometry was at each beam.
    :ivar glass: share of the walls that gives no echo.
    """

    beams: int = 360
    field_rad: float = math.tau
    noise_m: float = 0.01
    range_max_m: float = 12.0
    scan_hz: float = 10.0
    is_skewed: bool = False
    is_deskewed: bool = True
    glass: float = 0.0

    @property
    def increment(self) -> float:
        """Return the angle from beam to beam."""
        closed = self.field_rad > math.tau - 1e-6
        return self.field_rad / (self.beams if closed else self.beams - 1)


def flat_drive(seed: int = 1, way: Way = FLAT_WAY, walkers: int = 0, **options: Any) -> Drive:
    """
    Drive through the flat of ``config/maps``.

    :param walkers: people who walk through the rooms, at most 2.
    :param options: of :func:`drive`.
    """
    ways: tuple[Way, ...] = (
        ((2.45, 3.95), (2.45, 5.0), (3.6, 6.0), (4.4, 5.65), (6.4, 6.0), (4.4, 5.65)),
        ((6.5, 1.2), (8.9, 1.2), (9.1, 3.7), (6.6, 3.7)))
    return drive(shipped_map('flat'), way, seed, ways[:walkers], **options)


def house_drive(seed: int = 1, way: Way = HOUSE_WAY, walkers: int = 0, **options: Any) -> Drive:
    """Drive through the house of ``config/maps``; as :func:`flat_drive`."""
    ways: tuple[Way, ...] = (
        ((14.95, 3.2), (14.95, 5.9), (8.45, 5.9), (8.45, 4.0), (7.0, 4.0), (8.45, 4.0)),
        ((6.75, 8.0), (6.75, 5.9), (2.45, 5.9), (2.45, 8.0), (2.45, 5.9)))
    return drive(shipped_map('house'), way, seed, ways[:walkers], **options)


def ring_drive(seed: int = 1, **options: Any) -> Drive:
    """Drive once round the corridor of :func:`ring_map`: a loop of 60 m."""
    return drive(ring_map(), RING_WAY, seed, **options)


def shipped_map(name: str) -> GridMap:
    """
    Load a map of ``config/maps``, from the source or from where the package is installed.

    :raises ConfigError: it is in neither.
    """
    file = Path(__file__).resolve().parents[3] / 'config' / 'maps' / f'{name}.yaml'
    if not file.exists():
        file = Path(path_of(f'package://rt_robot_os/config/maps/{name}.yaml', 'the map'))
    return GridMap.load(file)


def ring_map() -> GridMap:
    """Return a corridor 2 m wide around a block, with cupboards along its walls."""
    cell = 0.05
    cells = np.full((round(14.0 / cell), round(24.0 / cell)), -1, dtype=np.int8)

    def fill(x0: float, y0: float, x1: float, y1: float, value: int) -> None:
        cells[round(y0 / cell):round(y1 / cell), round(x0 / cell):round(x1 / cell)] = value

    fill(0.8, 0.8, 23.2, 13.2, 100)
    fill(1.0, 1.0, 23.0, 13.0, 0)
    fill(3.0, 3.0, 21.0, 11.0, 100)
    fill(3.2, 3.2, 20.8, 10.8, -1)
    for x, width, deep in ((3.5, 0.8, 0.3), (7.2, 1.4, 0.4), (11.0, 0.6, 0.3), (13.5, 1.0, 0.4),
                           (18.6, 1.2, 0.3)):
        fill(x, 1.0, x + width, 1.0 + deep, 100)
        fill(22.6 - x, 13.0 - deep, 22.6 - x + width, 13.0, 100)
    for y, width, deep in ((4.2, 0.8, 0.3), (6.6, 1.2, 0.4), (10.3, 0.6, 0.3)):
        fill(23.0 - deep, y, 23.0, y + width, 100)
        fill(1.0, 13.2 - y, 1.0 + deep, 13.2 - y + width, 100)
    for x in (5.0, 9.4, 16.2):
        fill(x, 2.8, x + 0.5, 3.0, 100)
        fill(x + 2.2, 11.0, x + 2.9, 11.2, 100)
    return GridMap(cells, cell)


def drive(grid: GridMap, way: Way, seed: int = 1, walkers: tuple[Way, ...] = (), *,
          speed_m_s: float = 0.3, slip: float = 0.03, wheel: float = 0.005,
          laser: tuple[float, float, float] = (0.1, 0.0, 0.0), **sight: Any) -> Drive:
    """
    Drive along a way, look and count the turns of the wheels.

    :param walkers: the closed ways of people who walk.
    :param slip: standard deviation of how much further than true each wheel counts.
    :param wheel: by how much the left wheel is larger than configured, as a share.
    :param sight: of :class:`Sight`.
    """
    seen = Sight(**sight)
    rng = np.random.default_rng(seed)
    robot, speeds = _driven(way, speed_m_s)
    times_s = _FIRST_S + np.arange(len(robot)) / _STEPS_HZ
    odometry = _counted(speeds, slip, wheel, rng)
    mounted = np.array(laser)
    walls = Walls.of(grid)
    stamps_s = np.arange(_FIRST_S, times_s[-1] - 1.0 / seen.scan_hz, 1.0 / seen.scan_hz)
    truth = composed(_at(stamps_s, times_s, robot), mounted)
    at_odometry = composed(_at(stamps_s, times_s, odometry), mounted)
    panes = rng.integers(1, 1 << 31)
    scans = []
    for number, stamp_s in enumerate(stamps_s):
        beams_s = stamp_s + np.arange(seen.beams) / seen.beams / seen.scan_hz
        origins = (composed(_at(beams_s, times_s, robot), mounted) if seen.is_skewed
                   else np.broadcast_to(truth[number], (seen.beams, 3)))
        ranges = _ranges(walls, origins, [_walker_at(each, float(stamp_s)) for each in walkers],
                         seen, int(panes))
        ranges += rng.normal(0.0, seen.noise_m, seen.beams)
        poses = None
        if seen.is_skewed and seen.is_deskewed:
            counted = composed(_at(beams_s, times_s, odometry), mounted)
            poses = between(np.broadcast_to(at_odometry[number], counted.shape), counted)
        scans.append(Scan(round(stamp_s * NS_PER_S), at_odometry[number], ranges,
                          -seen.field_rad / 2, seen.increment, poses))
    return Drive(tuple(scans), truth, grid, mounted, np.rint(times_s * NS_PER_S), odometry, robot)


def _driven(way: Way, speed_m_s: float) -> tuple[Floats, Floats]:
    """Return where a robot is that follows a way, and its speeds; both at 50 Hz."""
    (x, y), after = way[0], way[1]
    yaw = math.atan2(after[1] - y, after[0] - x)
    v = w = 0.0
    poses, speeds, ahead = [(x, y, yaw)], [(0.0, 0.0)], 1
    step_s = 1.0 / _STEPS_HZ
    while ahead < len(way):
        dx, dy = way[ahead][0] - x, way[ahead][1] - y
        if math.hypot(dx, dy) < _REACHED_M:
            ahead += 1
            continue
        off = math.remainder(math.atan2(dy, dx) - yaw, math.tau)
        wanted = 0.0 if abs(off) > _STEEP_RAD else speed_m_s
        turn = max(-_TURN_RAD_S, min(_TURN_RAD_S, 2.0 * off))
        v += max(-_SPEED_UP_M_S2 * step_s, min(_SPEED_UP_M_S2 * step_s, wanted - v))
        w += max(-_TURN_UP_RAD_S2 * step_s, min(_TURN_UP_RAD_S2 * step_s, turn - w))
        middle = yaw + w * step_s / 2
        x, y = x + v * step_s * math.cos(middle), y + v * step_s * math.sin(middle)
        yaw += w * step_s
        poses.append((x, y, yaw))
        speeds.append((v, w))
    return np.array(poses), np.array(speeds)


def _counted(speeds: Floats, slip: float, wheel: float, rng: np.random.Generator) -> Floats:
    """Return where odometry believes to be, of wheels that slip and of which one is larger."""
    blocks = 1 + len(speeds) // round(_SLIP_S * _STEPS_HZ)
    more = 1.0 + np.abs(rng.normal(0.0, slip, (blocks, 2)))
    more = np.repeat(more, round(_SLIP_S * _STEPS_HZ), axis=0)[:len(speeds)]
    turn = speeds[:, 1] * _TRACK_M / 2
    left = (speeds[:, 0] - turn) * more[:, 0] / (1.0 + wheel)
    right = (speeds[:, 0] + turn) * more[:, 1]
    way, turned = (left + right) / 2 / _STEPS_HZ, (right - left) / _TRACK_M / _STEPS_HZ
    yaw = np.cumsum(turned)
    middle = yaw - turned / 2
    return np.stack((np.cumsum(way * np.cos(middle)), np.cumsum(way * np.sin(middle)), yaw), -1)


def _at(times_s: Floats, known_s: Floats, poses: Floats) -> Floats:
    """Return poses between those that are known; their yaw must not be wrapped."""
    return np.stack([np.interp(times_s, known_s, poses[:, axis]) for axis in range(3)], -1)


def _walker_at(way: Way, time_s: float) -> tuple[float, float]:
    points = np.array((*way, way[0]))
    lengths = np.hypot(*np.diff(points, axis=0).T)
    along = np.concatenate(((0.0,), np.cumsum(lengths)))
    gone = time_s * _WALKER_M_S % along[-1]
    return float(np.interp(gone, along, points[:, 0])), float(np.interp(gone, along, points[:, 1]))


def _ranges(walls: Walls, origins: Floats, people: list[tuple[float, float]], seen: Sight,
            panes: int) -> Floats:
    """Return what each beam measures from its own origin, without noise."""
    angles = origins[:, 2] - seen.field_rad / 2 + seen.increment * np.arange(seen.beams)
    ranges = np.empty(seen.beams)
    for part in np.array_split(np.arange(seen.beams), _PLACES if seen.is_skewed else 1):
        x, y = origins[part[len(part) // 2], :2].tolist()
        along = angles[part]
        found = walls.cast(x, y, along, seen.range_max_m)
        for px, py in people:
            if math.hypot(px - x, py - y) > _ROOM_M:  # otherwise they have stepped aside
                np.minimum(found, disc_distances(px - x, py - y, along, _WALKER_M),
                           out=found)
        if seen.glass:
            near = np.where(np.isfinite(found), found, 0.0)
            column = np.floor((x + near * np.cos(along)) / _PANE_M).astype(np.int64)
            row = np.floor((y + near * np.sin(along)) / _PANE_M).astype(np.int64)
            # A number for each pane that looks like chance.
            mixed = (column * 73856093 ^ row * 19349663 ^ panes) * 2654435761 % (1 << 32)
            found[mixed < seen.glass * (1 << 32)] = math.inf
        ranges[part] = found
    return ranges
