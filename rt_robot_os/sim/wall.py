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


"""Simulated range finders before a wall that comes and goes."""

from __future__ import annotations

import math
from typing import Final

from rt_robot_os.schema import Field
from rt_robot_os.sim.device import SimulatedDevice

NOISE: Final = 0.003  # of a reading, in metres


def wall_settings(minimum_m: float, maximum_m: float) -> tuple[Field, ...]:
    """Declare the wall: how near and how far it comes, at first."""
    return (
        Field('nearest_m', float, minimum_m, 'Where the wall turns back.', 'm', 0.01, 20.0),
        Field('farthest_m', float, maximum_m, 'Where the wall turns back.', 'm', 0.01, 20.0),
        Field('period_s', float, 10.0, 'Time for there and back.', 's', 0.1, 1e4),
    )


class SimulatedRange(SimulatedDevice):
    """A device before a wall."""

    def distance_m(self, time_s: float) -> float:
        """Say where the wall is."""
        s = self.settings
        middle, swing = (s['farthest_m'] + s['nearest_m']) / 2, s['farthest_m'] - s['nearest_m']
        return float(middle - swing / 2 * math.cos(2 * math.pi * time_s / s['period_s']))
