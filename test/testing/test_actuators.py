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


"""The contract of actuators, held by wheels that do not stop by themselves."""

from __future__ import annotations

from typing import Any

from rt_robot_os.testing import ActuatorContract
from wheels.driver import Wheels
from wheels.twin import SimulatedWheels


class TestWheels(ActuatorContract):
    actuator = Wheels
    twin = SimulatedWheels
    speed = 0.5

    def fill(self, message: Any, speed: float) -> None:
        message.linear.x = speed

    def moves(self, twin: Any) -> bool:
        return bool(twin.speed_mm_s)
