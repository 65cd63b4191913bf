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

"""A module that reports a low battery."""

from __future__ import annotations

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.modules import Field
from rt_robot_os.modules import Input
from rt_robot_os.modules import Module
from rt_robot_os.modules import Output


class LowBattery(Module):
    """
    Publish true when the voltage has been below the limit for a while.

    A starting motor lowers the voltage for a moment, which is not an empty battery. Once reported,
    it remains: the voltage recovers without load, but the battery is not charged.
    """

    battery = Input('battery', message='sensor_msgs/msg/BatteryState')
    low = Output('battery/low', 'std_msgs/msg/Bool')

    SETTINGS = (
        Field('limit_v', float, 10.5, 'Voltage below which it is low.', 'V', 1.0, 99.0, live=True),
        Field('hold_s', float, 2.0, 'Duration before it is reported.', 's', 0.0, 60.0, live=True),
    )

    def activate(self) -> None:
        """Start without knowledge of the battery."""
        self._good_ns = 0
        self._seen = False

    def changed(self, name: str) -> None:
        """Evaluate again with the new limit."""
        self.low.msg.data = False

    def step(self) -> None:
        """Run one job: process the samples since the last one, and publish the result."""
        while self.battery.take():
            now_ns = self.battery.stamp_ns
            if self.battery.msg.voltage >= self.settings['limit_v'] or not self._seen:
                self._good_ns = now_ns
                self._seen = True
            elif now_ns - self._good_ns >= self.settings['hold_s'] * NS_PER_S:
                self.low.msg.data = True
        if self._seen:
            self.low.publish()
