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


"""
MaxBotix ultrasonic range finders on their serial line (LV, XL, HRLV, HRXL, HRUSB).

One ``sensor_msgs/msg/Range`` for each reading. The unit depends on the model and must be set: a
reading does not contain it; only its number of digits distinguishes millimetres from the others.
The number that a model sends without a target becomes +inf; a distance at or below ``minimum_m``,
where these devices keep sending their shortest distance, becomes -inf.
"""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import Any
from typing import Final

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.devices.device import DeviceStatistics
from rt_robot_os.devices.maxbotix.wire import MaxBotixDecoder
from rt_robot_os.devices.maxbotix.wire import MaxBotixFrame
from rt_robot_os.devices.maxbotix.wire import UNITS
from rt_robot_os.devices.ranging import range_settings
from rt_robot_os.devices.ranging import RangeFiller
from rt_robot_os.devices.ranging import ULTRASOUND
from rt_robot_os.devices.serial.device import serial_settings
from rt_robot_os.devices.serial.device import SerialDevice

_SURE: Final = 3


class MaxBotix(SerialDevice[MaxBotixFrame]):
    """A MaxBotix range finder."""

    SETTINGS = serial_settings(
        baud=9600, frame_id='sonar_link', topic='range', rate_hz=10.0,
    ) + range_settings(
        minimum_m=0.3, maximum_m=5.0, field_of_view_rad=0.35, stddev_m=0.005,
    ) + (
        Field('unit', str, 'mm', 'Unit of the model: mm for HRLV and HRXL (four digits), cm for '
              'XL and AE, inch for LV (three digits).', choices=tuple(UNITS)),
        Field('no_target', list, (),
              'Readings that mean no target; empty: the usual ones of the unit.',
              item=int, minimum=0, maximum=9999),
    )
    description = 'MaxBotix ultrasonic range finder, ASCII R0000'

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Store the settings; nothing is opened.

        :raises ConfigError: the limits contradict each other.
        """
        super().__init__(name, settings, MaxBotixDecoder())
        self._filler = RangeFiller(name, settings, ULTRASOUND)
        self._unit_m, self._digits, usual = UNITS[settings['unit']]
        self._no_target = frozenset(settings['no_target'] or usual)
        self._other_digits = 0
        self._wrong = 0

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return the publications: Range."""
        s = self.settings
        return (TopicSpec(s['topic'], 'sensor_msgs/msg/Range',
                          {'header.frame_id': s['frame_id']}, s['depth'], s['output_rate_hz']),)

    def restart(self) -> None:
        """Reset the check of the unit."""
        self._other_digits = 0

    def write(self, now_ns: int) -> None:
        """
        Check that the device uses the configured unit; nothing is sent.

        :raises DeviceError: it does not.
        """
        if self._other_digits >= _SURE:
            sent = 7 - self._digits
            units = ' or '.join(u for u, (_, digits, _) in UNITS.items() if digits == sent)
            raise DeviceError(f'{self.name}: it sends {sent} digits, which is not '
                              f'{self.settings["unit"]}: set unit: {units}')

    def handle(self, frame: MaxBotixFrame, arrival_ns: int) -> int:
        """Handle one reading; in the loop."""
        if frame.digits != self._digits:
            self._other_digits += 1
            self._wrong += 1
            return 0
        self._other_digits = 0
        publisher = self._publishers[0]
        self._filler.fill(publisher.msg, math.inf if frame.value in self._no_target
                          else frame.value * self._unit_m)
        publisher.publish(arrival_ns)
        return 1

    def is_set_up(self) -> bool:
        """Return whether its readings have the configured unit."""
        return not self._other_digits

    def statistics(self) -> DeviceStatistics:
        """Return the current counters; contradictions are readings of another unit."""
        return self._counters(contradicted=self._wrong)
