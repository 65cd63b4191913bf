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

"""Shared by boards that measure their battery: settings, and the message."""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import Any
from typing import Final

from rt_robot_os.base.schema import Field

# Of sensor_msgs/msg/BatteryState.
UNKNOWN: Final = 0
CHARGING: Final = 1
DISCHARGING: Final = 2
NOT_CHARGING: Final = 3
FULL: Final = 4


def battery_settings(*, empty_v: float = 0.0, full_v: float = 0.0) -> tuple[Field, ...]:
    """Declare the voltages from which the charge is computed."""
    return (
        Field('battery_empty_v', float, empty_v, 'Voltage of the empty battery; below it '
              'motor_faults has the bit 256. 0: it is not known.', 'V', 0.0, 1000.0),
        Field('battery_full_v', float, full_v, 'Voltage of the full battery, for its percentage; '
              '0: it is not known.', 'V', 0.0, 1000.0),
    )


class BatteryFiller:
    """Fill in a ``sensor_msgs/msg/BatteryState``; a value that is not measured is NaN."""

    def __init__(self, settings: Mapping[str, Any]) -> None:
        """
        Store the voltages.

        :param settings: with those of :func:`battery_settings`.
        """
        self._empty_v: float = settings['battery_empty_v']
        self._full_v: float = settings['battery_full_v']

    def is_low(self, voltage_v: float) -> bool:
        """Return whether the battery is empty."""
        return voltage_v < self._empty_v

    def fill(self, msg: Any, voltage_v: float, current_a: float = math.nan,
             status: int = UNKNOWN) -> None:
        """
        Fill it in.

        :param current_a: negative when the battery is discharged, as in ROS.
        """
        msg.voltage, msg.current = voltage_v, current_a
        msg.temperature = msg.charge = msg.capacity = msg.design_capacity = math.nan
        msg.percentage = self._percentage(voltage_v)
        msg.power_supply_status = status
        msg.present = True

    def _percentage(self, voltage_v: float) -> float:
        span_v = self._full_v - self._empty_v
        if span_v <= 0.0 or self._full_v <= 0.0:
            return math.nan
        return min(max((voltage_v - self._empty_v) / span_v, 0.0), 1.0)
