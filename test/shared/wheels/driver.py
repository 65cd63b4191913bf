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


"""The driver of the wheels."""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import Any

from rt_robot_os.devices import Actuator
from rt_robot_os.devices import Input
from rt_robot_os.devices import Output
from rt_robot_os.devices import serial_settings
from rt_robot_os.devices import SerialDevice
from wheels.wire import order
from wheels.wire import Report
from wheels.wire import STOP
from wheels.wire import WheelsDecoder

_FASTEST_MM_S = 2000


class Wheels(Actuator, SerialDevice[Report]):
    """Two wheels that turn alike."""

    description = 'wheels for tests'
    SETTINGS = serial_settings(baud=0, frame_id='base_link', topic='unused', rate_hz=50.0)
    command = Input('cmd_vel', wake=True, message='geometry_msgs/msg/Twist')
    speed = Output('wheels/speed', 'geometry_msgs/msg/Vector3Stamped',
                   {'header.frame_id': 'base_link'})
    delay_s = 0.0

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        super().__init__(name, settings, WheelsDecoder())

    def actuate(self, now_ns: int) -> None:
        speed_mm_s = self.command.msg.linear.x * 1000.0
        if not math.isfinite(speed_mm_s):
            speed_mm_s = 0.0
        limited = round(max(-_FASTEST_MM_S, min(speed_mm_s, _FASTEST_MM_S)))
        self.send(order(limited, limited))
        self.delay_s = (now_ns - self.command.stamp_ns) / 1e9

    def safe_state(self) -> None:
        self.send(STOP)

    def handle(self, frame: Report, arrival_ns: int) -> int:
        # Some is of the bytes, some of the input, and some of the time: a replay needs all three.
        vector = self.speed.msg.vector
        vector.x, vector.y = frame.speed_mm_s / 1000.0, self.delay_s
        vector.z = self.command.msg.linear.x if self.is_commanded else 0.0
        self.speed.publish(arrival_ns)
        return 1
