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

"""The settings of the world that all simulated devices of a robot share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from rt_robot_os.base.schema import setting

# Value of ``map`` for an unbounded floor without walls.
OPEN_FLOOR: Final = 'open'


@dataclass(frozen=True, slots=True)
class WorldSettings:
    """
    The settings of the world, from its section or its file.

    The strings are parsed by :mod:`rt_robot_os.sim.world.scene`.
    """

    file: str = setting(  # noqa: A003
        '', 'a YAML file with these keys at its top level; keys of the section override it')
    map: str = setting(  # noqa: A003
        '', f'the map with the walls: the YAML file of a ROS map, or {OPEN_FLOOR} for an '
            'unbounded floor; when absent there is no world, and each '
            'simulated device is separate')
    start: tuple[float, ...] = setting(
        (0.0, 0.0, 0.0), 'start of the robot: x, y in m and yaw in rad, in the map')
    seed: int = setting(1, 'seed of all random numbers in the world', minimum=0, maximum=2**53)
    robot_radius_m: float = setting(
        0.18, 'radius of the robot: it stops at walls and people', 'm', 0.01, 5.0)
    motor_lag_s: float = setting(
        0.06, 'time constant of the wheels, first order', 's', 0.001, 10.0)
    motor_acceleration_rad_s2: float = setting(
        60.0, 'limit of the acceleration of a wheel', 'rad/s2', 0.1, 1e5)
    motor_speed_rad_s: float = setting(
        20.0, 'speed of a wheel at full voltage', 'rad/s', 0.1, 1e4)
    coast_s: float = setting(
        0.4, 'time constant with which a wheel without voltage coasts', 's', 0.001, 100.0)
    wheel_radius_error: tuple[float, ...] = setting(
        (0.0, 0.0), 'share by which the left and the right wheel are larger than configured',
        minimum=-0.5, maximum=0.5)
    slip: float = setting(
        0.0, "share of the wheels' travel that is lost", minimum=0.0, maximum=1.0)
    slip_noise: float = setting(
        0.0, 'standard deviation of the slip of each wheel, drawn every 0.1 s', minimum=0.0,
        maximum=1.0)
    latitude_deg: float = setting(
        48.0, "latitude of the map's origin", 'degrees', -89.0, 89.0)
    longitude_deg: float = setting(
        11.0, "longitude of the map's origin", 'degrees', -180.0, 180.0)
    altitude_m: float = setting(500.0, 'height of the floor above the sea', 'm', -500.0, 9000.0)
    east_rad: float = setting(
        0.0, 'direction of the east in the map, from its x axis', 'rad', -6.3, 6.3)
    ceiling_m: float = setting(2.4, 'height of the rooms', 'm', 0.5, 100.0)
    people: tuple[str, ...] = setting(
        (), 'people: name, speed in m/s, then x y of each way point, and back to the first; such '
            'as "anna 0.8 1.0 2.0 4.0 2.0"')
    landmarks: tuple[str, ...] = setting(
        (), 'marks on the ceiling: number, x, y, yaw; such as "24836 1.5 2.0 0.0"')
    nodes: tuple[str, ...] = setting(
        (), 'wireless nodes: name x y height [id N] [on PERSON] [quantity ...], such as "hall 3.0 '
        '1.5 2.2"; without a number they count from 1; a person carries a worn node along')
    light_lux: float = setting(150.0, 'ambient light', 'lx', 0.0, 1e6)
    lights: tuple[str, ...] = setting(
        (), 'lamps and windows: x, y, added lx directly below; such as "2.0 3.0 400"')
    temperature_c: float = setting(21.0, 'ambient temperature', 'C', -60.0, 100.0)
    heat: tuple[str, ...] = setting(
        (), 'warm and cold places: x, y, added degrees, radius in m; such as "0.5 2.0 6 1.0"')
    events: tuple[str, ...] = setting(
        (), 'events, in seconds after the start: "kidnap X Y YAW at S", "person NAME X Y at '
        'S [for S]" (stands there), "walk NAME at S", "fall NAME at S [for S]", "rise NAME at S", '
        '"sit NAME at S [for S]", "sleep NAME at S [for S]", "speak NAME SECONDS at S", "vital '
        'NAME SIGN VALUE at S [for S]", "press NAME help at S" (a button that is worn; or fine), '
        '"answer NAME fine at S" (their reaction after a fall; or help, silent), "slip SHARE at S '
        '[for S]", "lamp SHARE at S [for S]", "heat NODE DEGREES at S [for S]" (grows), "smoke '
        'NODE at S [for S]", "water NODE at S [for S]", "node NAME off at S [for S]", "node NAME '
        'on at S", "node NAME reboot at S", "node NAME move X Y at S", "alarm NAME at S [for S]"')
