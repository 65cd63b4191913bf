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
The world that all simulated devices of a robot share.

It has no clock: a device advances it to the current time before reading it. It advances in fixed
steps from the first such time, so it depends on the seed and on the robot's motion, and not on how
often it is read.
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import replace
import heapq
import math
from pathlib import Path
from typing import Any
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.messages.survey import numbered
from rt_robot_os.motion.angles import wrapped
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.motion.walls import disc_distances
from rt_robot_os.motion.walls import nearest_point
from rt_robot_os.motion.walls import Walls
from rt_robot_os.sim.world.drive_base import DriveBase
from rt_robot_os.sim.world.drive_base import LONGEST_STEPS
from rt_robot_os.sim.world.drive_base import Pair
from rt_robot_os.sim.world.drive_base import STEP_NS
from rt_robot_os.sim.world.events import OF_NODES
from rt_robot_os.sim.world.events import OF_PEOPLE
from rt_robot_os.sim.world.events import parse_event
from rt_robot_os.sim.world.events import WorldEvent
from rt_robot_os.sim.world.fields import HeatSource
from rt_robot_os.sim.world.fields import light_lux
from rt_robot_os.sim.world.fields import warmth_c
from rt_robot_os.sim.world.people import LYING_M
from rt_robot_os.sim.world.people import SimulatedPerson
from rt_robot_os.sim.world.people_model import PeopleModel
from rt_robot_os.sim.world.people_model import USUAL
from rt_robot_os.sim.world.scene import clashes
from rt_robot_os.sim.world.scene import READERS
from rt_robot_os.sim.world.wireless import Wireless
from rt_robot_os.sim.world_settings import OPEN_FLOOR
from rt_robot_os.sim.world_settings import WorldSettings

Floats = npt.NDArray[np.float64]

# People are moved once in this number of steps.
_PEOPLE_STEPS: Final = 10
_PEOPLE_S: Final = _PEOPLE_STEPS * STEP_NS / NS_PER_S


class World:
    """
    Walls, people, marks, wireless nodes, light and warmth, and the robot among them.

    All lengths are in m, angles in rad counter-clockwise, in the frame of the map. Only one thread
    at a time may use it; it is not for the real-time loop.

    :ivar settings: as given.
    :ivar map: the grid map; None for an open floor.
    :ivar map_path: its YAML file; None for an open floor.
    :ivar base: the body of the robot.
    :ivar people_model: the people, and their events.
    :ivar people: the people themselves.
    :ivar landmarks: the marks on the ceiling.
    :ivar nodes: the wireless nodes, as surveyed.
    :ivar wireless: their current states.
    :ivar time_s: since the first :meth:`advance`.
    :ivar lamps: share of the lamps that is on.
    """

    def __init__(self, settings: WorldSettings) -> None:
        """
        Make the world, and read the map.

        :raises ConfigError: with every problem of the settings and of the map.
        """
        scene = _scene(settings)
        self.settings = settings
        self.map: GridMap | None = None
        self.map_path: Path | None = None
        if settings.map and settings.map != OPEN_FLOOR:
            self.map_path = Path(settings.map)
            self.map = GridMap.load(self.map_path)
            if (problem := self._standing_at(*settings.start[:2])):
                raise ConfigError([f'world.start: {problem}'])
        self.walls = Walls.of(self.map) if self.map else Walls(np.empty((0, 4)))
        self.people_model = PeopleModel(scene['people'], settings.seed, self._room_m)
        self.people: tuple[SimulatedPerson, ...] = self.people_model.people
        self.landmarks = tuple(scene['landmarks'])
        self.nodes = numbered(scene['nodes'], 'world.nodes')
        self.wireless = Wireless(self.nodes, self.people)
        self.lamps = 1.0
        self.base = DriveBase(settings, obstacles=self._obstacles)
        self.time_s = 0.0
        self._lights = tuple(scene['lights'])
        self._heat = tuple(scene['heat'])
        self._burning: dict[str, HeatSource] = {}
        self._start_ns: int | None = None
        self._steps = 0
        self._order = 0
        self._waiting: list[tuple[float, int, WorldEvent]] = []
        self._check(scene['events'], 'world.events')
        for each in scene['events']:
            self._later(each.at_s, each)

    # ---- time ----------------------------------------------------------------------------------

    def advance(self, now_ns: int) -> None:
        """
        Advance to a time; does nothing if it has passed already.

        :param now_ns: absolute, such as CLOCK_MONOTONIC; the first one is the start.
        """
        if self._start_ns is None:
            self._start_ns = now_ns
        target = (now_ns - self._start_ns) // STEP_NS
        if target - self._steps > LONGEST_STEPS:
            self._start_ns += (target - self._steps) * STEP_NS
            return
        while self._steps < target:
            self._step()

    def _step(self) -> None:
        while self._waiting and self._waiting[0][0] <= self.time_s:
            self._apply(heapq.heappop(self._waiting)[2])
        self.base.step()
        self._steps += 1
        self.time_s = self._steps * STEP_NS / NS_PER_S
        if self._steps % _PEOPLE_STEPS == 0 and self.people:
            x, y, _ = self.base.pose
            for person in self.people:
                person.step(_PEOPLE_S, x, y, self.base.radius_m)

    # ---- events --------------------------------------------------------------------------------

    def inject(self, words: Sequence[str]) -> None:
        """
        Apply an event now, such as ``kidnap 1.0 2.0 0.5`` or ``person anna 2.0 1.0 4``.

        :raises ConfigError: it is not possible in this world.
        """
        try:
            what = parse_event(list(words))
        except ValueError as error:
            raise ConfigError([f'world {" ".join(words)}: {error}']) from None
        self._check([what], 'world')
        self._apply(what)

    def _check(self, events: Sequence[WorldEvent], where: str) -> None:
        """
        Check events against the content of the world.

        :raises ConfigError: with every problem.
        """
        problems = []
        for each in events:
            problem = None
            if each.kind in OF_NODES:
                problem = self.wireless.problem(each)
            elif each.kind in OF_PEOPLE:
                problem = self.people_model.problem(each.name)
            elif each.kind == 'heat':
                problem = self.wireless.problem(each)
            elif each.kind == 'kidnap':
                problem = self._standing_at(*each.numbers[:2])
            if problem is not None:
                told = ' '.join([each.kind, *([each.name] if each.name else [])])
                problems.append(f'{where}: {told}: {problem}')
        if problems:
            raise ConfigError(problems)

    def _standing_at(self, x: float, y: float) -> str | None:
        """Return why the robot cannot be put at a position."""
        if self.map is None or not self.map.occupied(x, y):
            return None
        low_x, low_y, high_x, high_y = self.map.bounds
        return (f'the map has an obstacle at {x:g}, {y:g}: choose a free position from '
                f'{low_x:g}, {low_y:g} to {high_x:g}, {high_y:g}')

    def _later(self, at_s: float, what: WorldEvent) -> None:
        self._order += 1  # of two at the same time the first one added comes first
        heapq.heappush(self._waiting, (at_s, self._order, what))

    def _apply(self, what: WorldEvent) -> None:
        back: WorldEvent | None = None
        if what.kind == 'kidnap':
            x, y, yaw = what.numbers
            self.base.teleport(x, y, yaw)
        elif what.kind == 'slip':
            back = WorldEvent('slip', '', (self.settings.slip,))
            self.base.slip, = what.numbers
        elif what.kind == 'lamp':
            back = WorldEvent('lamp', '', (1.0,))
            self.lamps, = what.numbers
        elif what.kind == 'heat':
            back = WorldEvent('heat', what.name, (0.0,))
            self._burn(what.name, *what.numbers)
        elif what.kind in OF_PEOPLE or what.kind == USUAL:
            back = self.people_model.apply(what)
            reply = self.people_model.reaction(what)
            if reply is not None and self.wireless.problem(reply) is None:
                self._later(self.time_s + reply.for_s, replace(reply, for_s=0.0))
        else:
            back = self.wireless.apply(what)
        if back is not None and (for_s := what.for_s or back.for_s):
            self._later(self.time_s + for_s, back)

    def where(self) -> str:
        """
        Return the true positions of everything that moves, one line each.

        The robot as ``base_link x y yaw ahead turning`` (m, rad, m/s, rad/s), then each person as
        ``name x y`` and their activity (walking, standing, falling, lying, rising, sitting,
        asleep), each wireless node as ``node name x y height on`` (or ``off``); last ``time`` with
        the seconds since the start.
        """
        base = ' '.join(f'{number:.6f}' for number in (*self.base.pose, *self.base.velocity))
        people = [f'{each.name} {each.x:.6f} {each.y:.6f} {each.doing}' for each in self.people]
        return '\n'.join([f'base_link {base}', *people, *self.wireless.where(),
                          f'time {self.time_s:.3f}'])

    # ---- measurements ---------------------------------------------------------------------------

    def pose_of(self, mounting: Mounting, age_s: float = 0.0) -> Pose:
        """
        Return x, y and yaw of a frame on the robot; its height is that of the mounting.

        :param age_s: this long ago, extrapolated from the current speed; for short times.
        """
        x, y, yaw = self.base.pose
        if age_s:
            ahead_m_s, turning_rad_s = self.base.velocity
            way, half = ahead_m_s * age_s, turning_rad_s * age_s / 2
            x, y = x - way * math.cos(yaw - half), y - way * math.sin(yaw - half)
            yaw -= 2 * half
        ahead, left, _ = mounting.position_m
        cosine, sine = math.cos(yaw), math.sin(yaw)
        return (x + cosine * ahead - sine * left, y + sine * ahead + cosine * left,
                wrapped(yaw + mounting.yaw_rad))

    def cast(self, x: float, y: float, angles: Floats | Sequence[float],
             maximum_m: float = math.inf, height_m: float = 0.2, rise: float = 0.0) -> Floats:
        """
        Return the distances of obstacles along rays: walls, furniture and people.

        Takes some 0.2 ms for 700 rays.

        :param angles: directions in the map, in any order.
        :param maximum_m: range of the rays.
        :param height_m: of the rays above the floor; above the heads of people they do not hit
            them.
        :param rise: half the vertical opening of a cone of rays, as a slope; 0: horizontal rays.
        :return: in m, inf without an obstacle; 0 from within a wall.
        """
        rays = np.asarray(angles, dtype=np.float64)
        if self.map is not None and self.map.occupied(x, y):
            return np.zeros(rays.size)
        ranges = self.walls.cast(x, y, rays, maximum_m)
        for person in self.people:
            away = math.hypot(person.x - x, person.y - y)
            above_m = height_m - person.height_m
            # From above, the edge of the cone reaches their height only at this distance.
            blind_m = 0.0 if above_m < 0.0 else above_m / rise if rise else math.inf
            if blind_m > maximum_m or blind_m == math.inf or away >= maximum_m + LYING_M:
                continue
            for disc_x, disc_y, radius_m in person.discs():
                there = disc_distances(disc_x - x, disc_y - y, rays, radius_m)
                np.minimum(ranges, np.where((there > maximum_m) | (there < blind_m), math.inf,
                                            there), out=ranges)
        return ranges

    def light_lux(self, x: float, y: float) -> float:
        """Return the light at a position."""
        lamps = light_lux(self._lights, x, y, self.settings.ceiling_m)
        return self.settings.light_lux + self.lamps * lamps

    def temperature_c(self, x: float, y: float) -> float:
        """Return the temperature at a position."""
        fires = sum(each.degrees(self.time_s, x, y) for each in self._burning.values())
        return self.settings.temperature_c + warmth_c(self._heat, x, y) + fires

    def in_sight(self, x: float, y: float, there_x: float, there_y: float) -> bool:
        """Return whether no wall is between two positions."""
        return self.people_model.in_sight(x, y, there_x, there_y)

    def noticed(self, x: float, y: float) -> bool:
        """Return whether a motion detector at a position detects a person's motion."""
        return self.people_model.noticed(x, y)

    def _burn(self, name: str, degrees: float) -> None:
        """Warm up the surroundings of a node gradually, or let them cool down."""
        node = self.wireless.find(name)
        if node is None:
            raise KeyError(name)
        burning = self._burning.setdefault(name, HeatSource(*node.position_m[:2]))
        burning.aim(degrees, self.time_s)

    def _room_m(self, x: float, y: float, angle: float) -> float:
        return float(self.walls.cast(x, y, np.array((angle,)))[0])

    def _obstacles(self, x: float, y: float, reach_m: float) -> list[Pair]:
        points = [nearest_point(wall, x, y) for wall in self.walls.near(x, y, reach_m + 0.05)]
        for person in self.people:
            for disc_x, disc_y, radius_m in person.discs():
                dx, dy = x - disc_x, y - disc_y
                away = math.hypot(dx, dy)
                if away < reach_m + 2 * radius_m:
                    # The robot may move away from a person who overlaps with it.
                    edge = radius_m / away if away > radius_m else 0.0
                    points.append((disc_x + dx * edge, disc_y + dy * edge))
        return points


def _scene(settings: WorldSettings) -> Mapping[str, list[Any]]:
    """
    Parse the strings of the settings.

    :raises ConfigError: with every problem.
    """
    problems: list[str] = []
    found: dict[str, list[Any]] = {}
    for key, reader in READERS.items():
        found[key] = []
        for text in getattr(settings, key):
            try:
                found[key].append(reader(text))
            except ValueError as error:
                problems.append(f'world.{key}: {text!r}: {error}')
        problems += clashes(key, found[key])
    for key, count in (('start', 3), ('wheel_radius_error', 2)):
        if len(getattr(settings, key)) != count:
            problems.append(f'world.{key}: must be {count} numbers')
    if problems:
        raise ConfigError(problems)
    return found
