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

"""The driver of the battery gauge: one ``sensor_msgs/msg/BatteryState`` for each reading."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
import math
from typing import Any

from rt_robot_example.battery_gauge.wire import GaugeDecoder
from rt_robot_example.battery_gauge.wire import Reading
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.devices import SamplePublisher
from rt_robot_os.devices import serial_settings
from rt_robot_os.devices import SerialDevice


class BatteryGauge(SerialDevice[Reading]):
    """A battery gauge on a serial line."""

    description = 'battery gauge of the tutorial, ASCII $B at 9600 baud'
    SETTINGS = (
        *serial_settings(baud=9600, frame_id='base_link', topic='battery', rate_hz=10.0),
        Field('capacity_ah', float, 5.0, 'Capacity of the new battery.', 'Ah',
              0.1, 1000.0),
    )

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        super().__init__(name, settings, GaugeDecoder())

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return the publications; strings are fixed here."""
        s = self.settings
        return (TopicSpec(
            s['topic'], 'sensor_msgs/msg/BatteryState',
            {'header.frame_id': s['frame_id'], 'location': self.name},
            s['depth'], s['output_rate_hz']),)

    def bind(self, publishers: Sequence[SamplePublisher]) -> None:
        """Fill in the constant fields: the message keeps them."""
        super().bind(publishers)
        message = publishers[0].msg
        message.temperature = message.charge = message.capacity = math.nan  # not measured
        message.design_capacity = self.settings['capacity_ah']
        message.present = True

    def handle(self, frame: Reading, arrival_ns: int) -> int:
        """Publish one reading; runs in the real-time loop."""
        publisher = self._publishers[0]
        message = publisher.msg
        message.voltage = frame.voltage
        message.current = frame.current
        message.percentage = frame.percent / 100
        message.power_supply_status = 2 if frame.current < 0.0 else 1  # discharging, charging
        publisher.publish(arrival_ns)
        return 1
