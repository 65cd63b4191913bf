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

"""A simulated MaxBotix range finder in the world, or in front of a moving wall."""

from __future__ import annotations

from rt_robot_os.base.schema import Field
from rt_robot_os.devices.maxbotix.wire import reading
from rt_robot_os.devices.maxbotix.wire import UNITS
from rt_robot_os.sim.device import common_settings
from rt_robot_os.sim.world import RANGE_NOISE_M
from rt_robot_os.sim.world import SimulatedRange
from rt_robot_os.sim.world import wall_settings


class SimulatedMaxBotix(SimulatedRange):
    """A MaxBotix range finder; below its shortest distance it keeps sending that."""

    SETTINGS = common_settings(10.0, 50.0) + wall_settings(0.2, 6.0) + (
        Field('unit', str, 'mm', 'Unit of the model.', choices=tuple(UNITS)),
        Field('minimum_m', float, 0.3, 'Shortest distance.', 'm', 0.0, 20.0),
        Field('maximum_m', float, 5.0, 'Longest distance.', 'm', 0.0, 20.0),
    )
    BAUD = 9600
    RAYS = 15

    def sample(self, time_s: float) -> bytes:
        """Return one reading."""
        s = self.settings
        unit_m, digits, no_target = UNITS[s['unit']]
        distance_m = self.distance_m(time_s) + self.random.gauss(0.0, RANGE_NOISE_M)
        if distance_m > s['maximum_m']:
            return reading(no_target[0], digits)
        return reading(round(max(distance_m, s['minimum_m']) / unit_m), digits)
