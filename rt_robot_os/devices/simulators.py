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

"""The registry of simulated devices, for the simulator and for the settings."""

from __future__ import annotations

from typing import Final

from rt_robot_os.devices.table import DeviceRegistry
from rt_robot_os.devices.table import OLD_SIMULATORS
from rt_robot_os.sim.base import Simulated

SIMULATORS: Final[DeviceRegistry[Simulated]] = DeviceRegistry(
    Simulated,  # type: ignore[type-abstract]
    'simulated device for the driver', lambda parts: parts.simulated, OLD_SIMULATORS,
    optional=True)
