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


"""The simulated wheels: they turn as they were told last, for ever."""

from __future__ import annotations

from rt_robot_os.sim.device import common_settings
from rt_robot_os.sim.device import SimulatedDevice
from wheels.wire import ORDER
from wheels.wire import telemetry


class SimulatedWheels(SimulatedDevice):
    """Wheels with encoders."""

    SETTINGS = common_settings(50.0, 200.0)
    BAUD = 0
    speed_mm_s = ticks = 0
    heard = b''

    def sample(self, time_s: float) -> bytes:
        self.ticks += self.speed_mm_s
        return telemetry(self.ticks, self.speed_mm_s)

    def handle_command(self, data: bytes) -> None:
        self.heard = (self.heard + data)[-1000:]
        end = 0
        for match in ORDER.finditer(self.heard):
            self.speed_mm_s = int(match[1])
            end = match.end()
        self.heard = self.heard[end:]

    def foreign(self) -> bytes:
        return b'R0480\r'
