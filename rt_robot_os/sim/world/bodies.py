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
The world of simulated devices without a shared one: a body turned by hand, the air, a wall.

Each is a function of the time since the start, so that several devices of a robot are consistent:
the angular velocity is the derivative of the attitude, the acceleration is gravity in the axes of
the body, the magnetic field is the earth's, and the air is the standard atmosphere.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
import math
import random
from typing import Any
from typing import ClassVar
from typing import Final
from typing import TypeVar

from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import STANDARD_GRAVITY_M_S2
from rt_robot_os.motion.atmosphere import pressure_pa
from rt_robot_os.sim.base import NOWHERE
from rt_robot_os.sim.base import Site
from rt_robot_os.sim.device import SimulatedDevice

T = TypeVar('T')
Vector = tuple[float, float, float]

NOISE_SETTING: Final = Field('noise', float, 1.0, 'Noise, as a multiple of the usual one.',
                             minimum=0.0, maximum=1000.0)

# East, north, up: the field in central Europe.
EARTH_FIELD_T: Final = (0.0, 2.0e-5, -4.4e-5)
GRAVITY_M_S2: Final = (0.0, 0.0, STANDARD_GRAVITY_M_S2)

_SWING_RAD: Final = (math.radians(20), math.radians(12))
_SWING_HZ: Final = (0.23, 0.31)
_TURN_RAD_S: Final = math.radians(15)


def noisy(vector: Vector, deviation: float, chance: random.Random) -> Vector:
    """Return a vector with added noise of a standard deviation."""
    x, y, z = vector
    gauss = chance.gauss
    return x + gauss(0.0, deviation), y + gauss(0.0, deviation), z + gauss(0.0, deviation)


# --- a body that is turned by hand: roll and pitch swing, yaw rotates ---------------------------

def attitude(time_s: float) -> Vector:
    """Return roll, pitch and yaw in rad, yaw from -pi to pi; east, north, up."""
    roll = _SWING_RAD[0] * math.sin(2 * math.pi * _SWING_HZ[0] * time_s)
    pitch = _SWING_RAD[1] * math.sin(2 * math.pi * _SWING_HZ[1] * time_s)
    return roll, pitch, math.remainder(_TURN_RAD_S * time_s, 2 * math.pi)


def angular_velocity(time_s: float) -> Vector:
    """Return the rate of the attitude in rad/s about the device's axes."""
    roll, pitch, _ = attitude(time_s)
    swing = [amplitude * 2 * math.pi * hz * math.cos(2 * math.pi * hz * time_s)
             for amplitude, hz in zip(_SWING_RAD, _SWING_HZ)]
    return (swing[0] - _TURN_RAD_S * math.sin(pitch),
            swing[1] * math.cos(roll) + _TURN_RAD_S * math.cos(pitch) * math.sin(roll),
            -swing[1] * math.sin(roll) + _TURN_RAD_S * math.cos(pitch) * math.cos(roll))


def quaternion(time_s: float) -> tuple[float, float, float, float]:
    """Return the attitude as w, x, y, z."""
    (cr, sr), (cp, sp), (cy, sy) = (
        (math.cos(angle / 2), math.sin(angle / 2)) for angle in attitude(time_s))
    return (cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy)


def body_vector(time_s: float, world: Vector) -> Vector:
    """Rotate a vector from east, north, up to the device's axes."""
    roll, pitch, yaw = attitude(time_s)
    east, north, up = world
    cr, sr = math.cos(roll), math.sin(roll)
    cp, sp = math.cos(pitch), math.sin(pitch)
    ahead = math.cos(yaw) * east + math.sin(yaw) * north
    left = -math.sin(yaw) * east + math.cos(yaw) * north
    ahead, above = cp * ahead - sp * up, sp * ahead + cp * up
    return ahead, cr * left + sr * above, -sr * left + cr * above


# --- the air around a barometer that is moved up and down ----------------------------------------

def air_settings(noise_pa: float) -> tuple[Field, ...]:
    """
    Declare the settings of the air.

    :param noise_pa: of the chip, at its usual settings.
    """
    return (
        Field('altitude_m', float, 34.0, 'Mean altitude of its motion, without a world.', unit='m',
              minimum=-500.0, maximum=9000.0),
        Field('swing_m', float, 1.0, 'Amplitude of its motion.', unit='m', minimum=0.0,
              maximum=500.0),
        Field('swing_s', float, 20.0, 'Period of its motion.', unit='s', minimum=0.1,
              maximum=1e5),
        Field('temperature_c', float, 22.0, 'Temperature.', unit='C', minimum=-40.0, maximum=85.0),
        Field('noise_pa', float, noise_pa, 'Standard deviation of the pressure.', unit='Pa',
              minimum=0.0, maximum=1e4),
    )


class Air:
    """Pressure and temperature by time, in the standard atmosphere."""

    def __init__(self, settings: Mapping[str, Any], chance: random.Random,
                 site: Site = NOWHERE) -> None:
        """
        Store the settings.

        :param chance: random numbers for the noise.
        :param site: its world and mounting, which determine altitude and temperature.
        """
        self._settings = settings
        self._random = chance
        self._world = site.world
        self._mounting = site.mounting()

    def altitude_m(self, time_s: float) -> float:
        """Return the altitude."""
        if self._world is not None:
            return self._world.settings.altitude_m + self._mounting.position_m[2]
        s = self._settings
        swing: float = s['swing_m']
        return float(s['altitude_m']) + swing * math.sin(2 * math.pi * time_s / s['swing_s'])

    def measure(self, time_s: float) -> tuple[float, float]:
        """Return pressure in Pa, with noise, and temperature in degrees C."""
        noise: float = self._settings['noise_pa']
        temperature_c = float(self._settings['temperature_c'])
        if self._world is not None:
            x, y, _ = self._world.pose_of(self._mounting)
            temperature_c = self._world.temperature_c(x, y)
        return pressure_pa(self.altitude_m(time_s)) + self._random.gauss(0.0, noise), temperature_c


def raw_readings(
    compensate: Callable[[T, int, int], tuple[float, float]], trimming: T,
    measured: tuple[float, float], lowest: int, highest: int,
) -> tuple[int, int]:
    """
    Find the raw readings that a barometer compensates to physical values.

    :param compensate: the formulas of the chip: trimming, raw pressure and raw temperature to
        pressure and temperature.
    :param measured: pressure in Pa and temperature in degrees C.
    :param lowest: the smallest raw reading; no pressure is that low.
    :return: the nearest raw pressure and raw temperature.
    """
    pressure, temperature = measured
    raw_t = _invert(lambda raw: compensate(trimming, 0, raw)[1], temperature, lowest, highest)
    raw_p = _invert(lambda raw: compensate(trimming, raw, raw_t)[0], pressure, lowest, highest)
    return raw_p, raw_t


def _invert(function: Callable[[int], float], value: float, low: int, high: int) -> int:
    """
    Find the argument whose result is nearest to a value.

    :param function: monotonic from ``low`` to ``high``.
    :return: an argument within the limits; one of them if the value is beyond.
    """
    sign = 1.0 if function(high) >= function(low) else -1.0
    wanted = sign * value
    below, above = low, high
    while above - below > 1:
        middle = (below + above) // 2
        if sign * function(middle) <= wanted:
            below = middle
        else:
            above = middle
    return min((below, above), key=lambda each: abs(sign * function(each) - wanted))


# --- a wall that moves --------------------------------------------------------------------------

RANGE_NOISE_M: Final = 0.003


def wall_settings(minimum_m: float, maximum_m: float) -> tuple[Field, ...]:
    """Declare the motion of the wall: its nearest and farthest distance."""
    return (
        Field('nearest_m', float, minimum_m,
              'Limit of the motion of the wall, without a world.', 'm', 0.01, 20.0),
        Field('farthest_m', float, maximum_m,
              'Limit of the motion of the wall, without a world.', 'm', 0.01, 20.0),
        Field('period_s', float, 10.0, 'Period of its motion.', 's', 0.1, 1e4),
    )


class SimulatedRange(SimulatedDevice):
    """
    A range finder in the world, or in front of a wall.

    :cvar RAYS: number of rays of its beam in the world; the nearest object is measured.
    """

    RAYS: ClassVar[int] = 1

    def distance_m(self, time_s: float, index: int = 0) -> float:
        """
        Return the distance of the nearest object in its beam, inf if there is none.

        :param index: index of the sensor, for a device with several.
        """
        if self.world is not None:
            mounting = self.site.mounting(index)
            x, y, yaw = self.world.pose_of(mounting)
            opening = self.device.get('field_of_view_rad', 0.0) if self.RAYS > 1 else 0.0
            step = opening / max(self.RAYS - 1, 1)
            angles = [yaw + step * (i - (self.RAYS - 1) / 2) for i in range(self.RAYS)]
            return float(self.world.cast(x, y, angles, math.inf, mounting.position_m[2],
                                         math.tan(opening / 2)).min())
        s = self.settings
        middle, swing = (s['farthest_m'] + s['nearest_m']) / 2, s['farthest_m'] - s['nearest_m']
        return float(middle - swing / 2 * math.cos(2 * math.pi * time_s / s['period_s']))
