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


"""Speed limit for the stopping distance of a robot after a failure of its computer."""

from __future__ import annotations

import math
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.modules.base import Module

#: Setting of modules that limit velocities without sensing obstacles.
RUN_ON_MAX: Final = Field(
    'run_on_max_m', float, 0.5, 'Speeds are limited so that the robot stops within this distance '
    'after a failure of its computer, if its motor boards declare when they stop; 0: no limit',
    'm', 0.0, 100.0, live=True, before=0.0)


def run_on_speed_m_s(module: Module) -> float:
    """Return the maximum speed that ``run_on_max_m`` of a module allows; safe in the loop."""
    distance_m: float = module.settings[RUN_ON_MAX.name]
    return module.run_on.speed_m_s(distance_m) if distance_m else math.inf
