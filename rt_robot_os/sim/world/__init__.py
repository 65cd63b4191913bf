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
The world that simulated devices measure.

:class:`World` is shared by all devices of a robot; without it each device measures a small
separate one (:mod:`rt_robot_os.sim.world.bodies`).
"""

from __future__ import annotations

from typing import Any
from typing import TYPE_CHECKING

from rt_robot_os.sim.world.bodies import Air
from rt_robot_os.sim.world.bodies import air_settings
from rt_robot_os.sim.world.bodies import angular_velocity
from rt_robot_os.sim.world.bodies import attitude
from rt_robot_os.sim.world.bodies import body_vector
from rt_robot_os.sim.world.bodies import EARTH_FIELD_T
from rt_robot_os.sim.world.bodies import GRAVITY_M_S2
from rt_robot_os.sim.world.bodies import NOISE_SETTING
from rt_robot_os.sim.world.bodies import noisy
from rt_robot_os.sim.world.bodies import quaternion
from rt_robot_os.sim.world.bodies import RANGE_NOISE_M
from rt_robot_os.sim.world.bodies import raw_readings
from rt_robot_os.sim.world.bodies import SimulatedRange
from rt_robot_os.sim.world.bodies import Vector
from rt_robot_os.sim.world.bodies import wall_settings
from rt_robot_os.sim.world.drive_base import DriveBase

if TYPE_CHECKING:
    from rt_robot_os.sim.world.world import World

__all__ = [
    'Air', 'DriveBase', 'EARTH_FIELD_T', 'GRAVITY_M_S2', 'NOISE_SETTING', 'RANGE_NOISE_M',
    'SimulatedRange', 'Vector', 'World', 'air_settings', 'angular_velocity', 'attitude',
    'body_vector', 'noisy', 'quaternion', 'raw_readings', 'wall_settings',
]


def __getattr__(name: str) -> Any:
    """Import the world on first use: it needs NumPy, and most simulated devices do not."""
    if name != 'World':
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    from rt_robot_os.sim.world.world import World
    return World
