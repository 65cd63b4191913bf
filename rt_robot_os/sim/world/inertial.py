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
The motion of an inertial sensor: turned by hand, on the robot, or worn by a person.

Vectors are in the axes of the sensor; the world's are east, north, up.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from typing import Final
from typing import Protocol
from typing import TYPE_CHECKING

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import STANDARD_GRAVITY_M_S2
from rt_robot_os.motion.angles import roll_pitch_yaw_of
from rt_robot_os.motion.quaternion import about_up
from rt_robot_os.motion.quaternion import conjugate
from rt_robot_os.motion.quaternion import multiply
from rt_robot_os.motion.quaternion import Quaternion
from rt_robot_os.motion.quaternion import rotate
from rt_robot_os.motion.quaternion import Vector
from rt_robot_os.sim.base import Site
from rt_robot_os.sim.world import bodies
from rt_robot_os.sim.world.wearable import WearableMotion

if TYPE_CHECKING:
    from rt_robot_os.sim.world.world import World

ON_SETTING: Final = Field('on', str, '',
                          'The person of the world who wears it; when absent the robot '
                          'carries it.')


class Inertial(Protocol):
    """The motion of a sensor at a time since its start; in the world always the current motion."""

    def attitude(self, time_s: float) -> Vector:
        """Return roll, pitch and yaw in rad, yaw from -pi to pi."""

    def quaternion(self, time_s: float) -> Quaternion:
        """Return the attitude as w, x, y, z."""

    def angular_velocity(self, time_s: float) -> Vector:
        """Return its angular velocity, in rad/s."""

    def force(self, time_s: float) -> Vector:
        """Return the specific force, in m/s^2: at rest gravity, upwards."""

    def gravity(self, time_s: float) -> Vector:
        """Return gravity alone, upwards, in m/s^2."""

    def field(self, time_s: float) -> Vector:
        """Return the magnetic field, in tesla."""


class HandMotion:
    """Turned by hand; see :mod:`rt_robot_os.sim.world.bodies`."""

    attitude = staticmethod(bodies.attitude)
    quaternion = staticmethod(bodies.quaternion)
    angular_velocity = staticmethod(bodies.angular_velocity)

    def force(self, time_s: float) -> Vector:
        """Return gravity: the acceleration by a hand is neglected."""
        return self.gravity(time_s)

    def gravity(self, time_s: float) -> Vector:
        """Return gravity, upwards."""
        return bodies.body_vector(time_s, bodies.GRAVITY_M_S2)

    def field(self, time_s: float) -> Vector:
        """Return the earth's magnetic field."""
        return bodies.body_vector(time_s, bodies.EARTH_FIELD_T)


class RobotMotion:
    """
    Mounted on the robot, which stands upright on the floor.

    :param world: with the robot.
    :param site: its world and mounting.
    """

    def __init__(self, world: World, site: Site) -> None:
        self._base = world.base
        self._east = world.settings.east_rad
        mounting = site.mounting()
        self._ahead, self._left, _ = mounting.position_m
        self._mounted = mounting.quaternion()
        self._to_sensor = conjugate(self._mounted)

    def _turn(self) -> Quaternion:
        return multiply(about_up(self._base.pose[2] - self._east), self._mounted)

    def attitude(self, time_s: float) -> Vector:
        """Return roll, pitch and yaw in rad."""
        return roll_pitch_yaw_of(*self._turn())

    def quaternion(self, time_s: float) -> Quaternion:
        """Return the attitude as w, x, y, z."""
        x, y, z, w = self._turn()
        return w, x, y, z

    def angular_velocity(self, time_s: float) -> Vector:
        """Return the angular velocity of the robot, about the axes of the sensor."""
        return rotate(self._to_sensor, (0.0, 0.0, self._base.velocity[1]))

    def force(self, time_s: float) -> Vector:
        """Return gravity and the accelerations at its mounting, off the centre."""
        ahead, left = self._base.acceleration
        turning, rate = self._base.angular_acceleration, self._base.velocity[1]
        return rotate(self._to_sensor, (
            ahead - turning * self._left - rate * rate * self._ahead,
            left + turning * self._ahead - rate * rate * self._left, STANDARD_GRAVITY_M_S2))

    def gravity(self, time_s: float) -> Vector:
        """Return gravity, upwards."""
        return rotate(self._to_sensor, bodies.GRAVITY_M_S2)

    def field(self, time_s: float) -> Vector:
        """Return the earth's magnetic field."""
        return rotate(conjugate(self._turn()), bodies.EARTH_FIELD_T)


def inertial(site: Site, settings: Mapping[str, Any] | None = None) -> Inertial:
    """
    Return the motion of a sensor at its site.

    :param settings: those of the simulated device, with ``ON_SETTING``; None: it is not worn.
    :raises ConfigError: the wearer is not a person of the world.
    """
    if site.world is None:
        return HandMotion()
    if settings is None or not settings['on']:
        return RobotMotion(site.world, site)
    person = site.world.people_model.find(settings['on'])
    if person is None:
        raise ConfigError([f'on: {settings["on"]}: '
                           f'{site.world.people_model.problem(settings["on"])}'])
    return WearableMotion(site.world, person, site)
