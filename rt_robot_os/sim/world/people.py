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

"""People who walk through the world on their routes, fall, lie and get up again."""

from __future__ import annotations

import math
from typing import Final

from rt_robot_os.sim.world.events import SILENT
from rt_robot_os.sim.world.posture import PERSON_HEIGHT_M
from rt_robot_os.sim.world.posture import Posture
from rt_robot_os.sim.world.posture import Stance
from rt_robot_os.sim.world.scene import WalkingRoute
from rt_robot_os.sim.world.vitals import SimulatedVitals

PERSON_RADIUS_M: Final = 0.22
#: Length of a lying person.
LYING_M: Final = PERSON_HEIGHT_M

# Clearance that people keep from the robot, and how long they wait for it before they turn back:
# the robot waits for them as well.
_ROOM_M: Final = 0.1
_PATIENCE_S: Final = 1.5
# From above a lying person is a row of discs.
_LYING_RADIUS_M: Final = 0.17
_LYING_DISCS: Final = 7
_ACTIVITIES: Final = {Posture.UPRIGHT: 'stand', Posture.RISING: 'rise', Posture.FALLEN: 'fall',
                      Posture.SITTING: 'sit', Posture.ASLEEP: 'lie'}

Disc = tuple[float, float, float]


class SimulatedPerson:
    """
    A person on a route; when the robot blocks it they wait, then turn back.

    :ivar name: their name.
    :ivar x: position in m; when lying, of the middle of the body.
    :ivar y: as x.
    :ivar heading: viewing direction in rad; when lying, from the feet to the head.
    :ivar stands: they were commanded to stand.
    :ivar stance: their posture.
    :ivar vitals: their vital signs.
    :ivar answer: their reaction some seconds after a fall: ``help``, ``fine`` or ``silent``.
    :ivar speaks_until_s: end of their speech.
    :ivar moved_s: time of their last motion.
    :ivar activity: current activity, in the terms of ``body_motion`` ...
    :ivar activity_since_s: ... since when, and ...
    :ivar activity_before: ... the previous one.
    :ivar time_s: of the world, at the last step.
    """

    radius_m = PERSON_RADIUS_M

    def __init__(self, way: WalkingRoute, seed: int = 1) -> None:
        """
        Put them at the first point of their route.

        :param seed: of the world.
        """
        self.name = way.name
        self._way = way
        self.x, self.y = way.points[0]
        self.stands = False
        self.stance = Stance()
        self.vitals = SimulatedVitals(way.name, seed)
        self.answer = SILENT
        self.speaks_until_s = -math.inf
        self.moved_s = -math.inf
        self.activity = self.activity_before = 'stand'
        self.activity_since_s = 0.0
        self.time_s = 0.0
        self._waited_s = 0.0
        self._direction = 1
        self._next = 1 % len(way.points)
        ahead_x, ahead_y = way.points[self._next]
        self.heading = math.atan2(ahead_y - self.y, ahead_x - self.x)

    # ---- commands ------------------------------------------------------------------------------

    def stand(self, x: float, y: float) -> None:
        """Appear at a position and stay there, upright."""
        self.x, self.y = x, y
        self.stands = True
        self._assume(Posture.UPRIGHT)

    def walk(self) -> None:
        """Continue to the next point of the route; a person lying or sitting gets up first."""
        self.stands = False
        self.rise()

    def rise(self) -> None:
        """Get up, and continue as before."""
        if self.stance.posture is not Posture.UPRIGHT:
            self._assume(Posture.RISING)

    def fall(self, heading: float) -> None:
        """Fall, and lie there; the shock appears in the vital signs."""
        if self.stance.posture is Posture.FALLEN:
            return
        self.heading = heading
        self._assume(Posture.FALLEN)
        self.vitals.frighten(self.time_s)

    def sit(self) -> None:
        """Sit down where they are."""
        self._assume(Posture.SITTING)

    def sleep(self, heading: float) -> None:
        """Lie down at their position, on a bed."""
        if not self.lies:
            self.heading = heading
        self._assume(Posture.ASLEEP)

    # ---- what others observe--------------------------------------------------------------------

    @property
    def height_m(self) -> float:
        """Return the height of their highest point."""
        return self.stance.shape(self.time_s).top_m

    @property
    def lies(self) -> bool:
        """Return whether they are closer to lying than to upright."""
        return self.stance.shape(self.time_s).tilt_rad > math.pi / 4

    @property
    def speaks(self) -> bool:
        """Return whether they speak."""
        return self.time_s < self.speaks_until_s

    @property
    def doing(self) -> str:
        """Return one word: walking, standing, falling, lying, rising, sitting or asleep."""
        posture = self.stance.posture
        if posture is Posture.UPRIGHT:
            return 'standing' if self.stands else 'walking'
        if posture is Posture.FALLEN:
            return 'lying' if self.stance.share(self.time_s) >= 1.0 else 'falling'
        return posture.name.lower()

    def discs(self) -> tuple[Disc, ...]:
        """Return their area on the floor: x, y and radius of discs, in m."""
        if not self.lies:
            return (self.x, self.y, PERSON_RADIUS_M),
        along_x, along_y = math.cos(self.heading), math.sin(self.heading)
        first = _LYING_RADIUS_M - LYING_M / 2
        step = -2.0 * first / (_LYING_DISCS - 1)
        places = (first + index * step for index in range(_LYING_DISCS))
        return tuple((self.x + at * along_x, self.y + at * along_y, _LYING_RADIUS_M)
                     for at in places)

    def figure(self) -> tuple[float, float, float, float]:
        """
        Return their figure for drawing.

        Their highest point and the height of the surface below them in m, 1.0 when lying, and the
        direction from the feet to the head in rad.
        """
        shape = self.stance.shape(self.time_s)
        return shape.top_m, shape.base_m, float(self.lies), self.heading

    def worn_m(self, height_m: float) -> float:
        """
        Return the height of a worn device.

        :param height_m: its height while they stand.
        """
        shape = self.stance.shape(self.time_s)
        return shape.worn_m + shape.worn_share * height_m

    # ---- time ----------------------------------------------------------------------------------

    def step(self, time_s: float, robot_x: float, robot_y: float, robot_radius_m: float) -> None:
        """Advance to a time, and walk, unless the robot blocks the route."""
        self.time_s += time_s
        stance = self.stance
        if stance.posture is not Posture.UPRIGHT:
            if stance.share(self.time_s) < 1.0:
                self.moved_s = self.time_s
            elif stance.posture is Posture.RISING:
                self._assume(Posture.UPRIGHT)
            return
        before = self.x, self.y
        self._walk(time_s, robot_x, robot_y, robot_radius_m)
        moved = before != (self.x, self.y)
        if moved:
            self.moved_s = self.time_s
        self._start_activity('walk' if moved else 'stand')

    def _assume(self, posture: Posture) -> None:
        self.stance.assume(posture, self.time_s)
        self._start_activity(_ACTIVITIES[posture])

    def _start_activity(self, activity: str) -> None:
        if activity != self.activity:
            self.activity, self.activity_before = activity, self.activity
            self.activity_since_s = self.time_s

    def _walk(self, time_s: float, robot_x: float, robot_y: float, robot_radius_m: float) -> None:
        left = 0.0 if self.stands else self._way.speed_m_s * time_s
        room = robot_radius_m + PERSON_RADIUS_M + _ROOM_M
        for _ in self._way.points:  # points may coincide
            x, y = self._way.points[self._next]
            dx, dy = x - self.x, y - self.y
            distance = math.hypot(dx, dy)
            if left <= 0.0:
                return
            part = min(left / distance, 1.0) if distance else 1.0
            new_x, new_y = self.x + part * dx, self.y + part * dy
            before = math.hypot(self.x - robot_x, self.y - robot_y)
            if math.hypot(new_x - robot_x, new_y - robot_y) < min(room, before):
                self._wait(time_s)
                return
            self._waited_s = 0.0
            if distance:
                self.heading = math.atan2(dy, dx)
            self.x, self.y = new_x, new_y
            if part < 1.0:
                return
            left -= distance
            self._next_point()

    def _wait(self, time_s: float) -> None:
        self._waited_s += time_s
        if self._waited_s > _PATIENCE_S:
            self._waited_s = 0.0
            self._direction = -self._direction
            self._next_point()

    def _next_point(self) -> None:
        self._next = (self._next + self._direction) % len(self._way.points)
