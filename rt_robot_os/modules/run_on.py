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


"""The speed at which a robot goes on no farther than it may when its computer falls silent."""

from __future__ import annotations

import math
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.modules.base import Module

#: Setting of the modules that limit velocities without knowing what is in the way.
RUN_ON_MAX: Final = Field(
    'run_on_max_m', float, 0.5, 'Commands are slowed so that the robot goes on no farther than '
    'this when its computer falls silent, as far as its motor boards declare it; 0: not slowed',
    'm', 0.0, 100.0, live=True, before=0.0)


def run_on_speed_m_s(module: Module) -> float:
    """Return the largest speed that ``run_on_max_m`` of a module allows; safe in the loop."""
    way_m: float = module.settings[RUN_ON_MAX.name]
    return module.run_on.speed_m_s(way_m) if way_m else math.inf
