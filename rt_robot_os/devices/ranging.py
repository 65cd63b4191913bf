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
Shared by range finders with one beam: settings, the message, and REP 117.

REP 117: a target nearer than the range is -inf, none within the range is +inf; both are readings
and are published. Without a reading nothing is published.
"""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field

# sensor_msgs/msg/Range; the real-time core does not import ROS.
ULTRASOUND: Final = 0
INFRARED: Final = 1


def range_settings(
    *, minimum_m: float, maximum_m: float, field_of_view_rad: float, stddev_m: float,
) -> tuple[Field, ...]:
    """Declare the settings of every range finder, with the defaults of one."""
    return (
        Field('minimum_m', float, minimum_m,
              'Shortest distance that it measures; at or below it the reading is -inf.',
              'm', 0.0, 1000.0),
        Field('maximum_m', float, maximum_m,
              'Longest distance that it measures; beyond it the reading is +inf.',
              'm', 0.001, 1000.0),
        Field('field_of_view_rad', float, field_of_view_rad, 'Width of its beam.', 'rad', 0.0,
              math.pi),
        Field('range_stddev_m', float, stddev_m,
              'Standard deviation of a distance; measure yours. 0: unknown.',
              'm', 0.0, 100.0),
    )


class RangeFiller:
    """Fill the messages of one range finder; safe in the real-time loop."""

    def __init__(self, name: str, settings: Mapping[str, Any], radiation: int) -> None:
        """
        Store the limits.

        :param name: of the device, for errors.
        :param radiation: ``ULTRASOUND`` or ``INFRARED``.
        :raises ConfigError: the longest distance is not above the shortest.
        """
        self.minimum_m: float = settings['minimum_m']
        self.maximum_m: float = settings['maximum_m']
        if self.maximum_m <= self.minimum_m:
            raise ConfigError([f'{name}: maximum_m {self.maximum_m:g} must be above minimum_m '
                               f'{self.minimum_m:g}'])
        self._radiation = radiation
        self._field_of_view: float = settings['field_of_view_rad']
        self._variance = settings['range_stddev_m'] ** 2

    def fill(self, msg: Any, distance_m: float) -> None:
        """
        Fill in a ``sensor_msgs/msg/Range``.

        :param distance_m: as measured; infinite when there was no target.
        """
        if distance_m <= self.minimum_m:
            distance_m = -math.inf
        elif distance_m > self.maximum_m:
            distance_m = math.inf
        msg.radiation_type = self._radiation
        msg.field_of_view = self._field_of_view
        msg.min_range = self.minimum_m
        msg.max_range = self.maximum_m
        msg.range = distance_m
        msg.variance = self._variance
