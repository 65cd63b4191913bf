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

"""The motion of an inertial sensor that a person wears at the waist."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rt_robot_os.motion.angles import roll_pitch_yaw_of
from rt_robot_os.motion.mounting import mounting_of
from rt_robot_os.motion.quaternion import about_up
from rt_robot_os.motion.quaternion import conjugate
from rt_robot_os.motion.quaternion import multiply
from rt_robot_os.motion.quaternion import Quaternion
from rt_robot_os.motion.quaternion import rotate
from rt_robot_os.motion.quaternion import Vector
from rt_robot_os.sim.base import Site
from rt_robot_os.sim.world import bodies
from rt_robot_os.sim.world.body_motion import body_motion
from rt_robot_os.sim.world.body_motion import FeltMotion
from rt_robot_os.sim.world.people import SimulatedPerson

if TYPE_CHECKING:
    from rt_robot_os.sim.world.world import World


class WearableMotion:
    """
    Worn by a person; the mounting rotates the sensor on the body, its position is ignored.

    :param world: with the person.
    :param person: the wearer.
    :param site: the mounting of the sensor.
    """

    def __init__(self, world: World, person: SimulatedPerson, site: Site) -> None:
        self._world = world
        self._person = person
        self._east = world.settings.east_rad
        self._mounted = mounting_of(site.device).quaternion()
        self._to_sensor = conjugate(self._mounted)

    def _felt(self) -> FeltMotion:
        person = self._person
        return body_motion(person.activity, self._world.time_s - person.activity_since_s,
                           before=person.activity_before)

    def _turn(self) -> Quaternion:
        felt = self._felt()
        (cr, sr), (cp, sp) = ((math.cos(angle / 2), math.sin(angle / 2))
                              for angle in (felt.roll_rad, felt.pitch_rad))
        tilted = sr * cp, cr * sp, -sr * sp, cr * cp
        heading = about_up(self._person.heading - self._east)
        return multiply(multiply(heading, tilted), self._mounted)

    def attitude(self, time_s: float) -> Vector:
        """Return roll, pitch and yaw in rad."""
        return roll_pitch_yaw_of(*self._turn())

    def quaternion(self, time_s: float) -> Quaternion:
        """Return the attitude as w, x, y, z."""
        x, y, z, w = self._turn()
        return w, x, y, z

    def angular_velocity(self, time_s: float) -> Vector:
        """Return the angular velocity of the body, about the axes of the sensor."""
        return rotate(self._to_sensor, self._felt().rate_rad_s)

    def force(self, time_s: float) -> Vector:
        """Return the specific force at the waist."""
        return rotate(self._to_sensor, self._felt().force_m_s2)

    def gravity(self, time_s: float) -> Vector:
        """Return gravity, upwards."""
        return rotate(conjugate(self._turn()), bodies.GRAVITY_M_S2)

    def field(self, time_s: float) -> Vector:
        """Return the earth's magnetic field."""
        return rotate(conjugate(self._turn()), bodies.EARTH_FIELD_T)
