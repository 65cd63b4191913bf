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
How far off an attitude may be, for its covariance.

No filter knows that; these are standard deviations that follow from what is known:

- settled, the errors are those measured with recordings that have a reference (docs/attitude.md);
- one first acceleration may be of a sensor that moves, one first magnetic field is noisy. Such an
  error goes down with the time constant of the filter;
- while a source is rejected or silent, the error grows by the bias that is left of the gyroscope;
- without a magnetometer the heading is relative to the start, and its error grows for ever, except
  at rest;
- a heading of which nothing is known is anywhere from -180 to 180 degrees.
"""

from __future__ import annotations

import math
from typing import Final

from rt_robot_os.features.navigation.attitude.base import AttitudeFilter

_START_INCLINATION: Final = math.radians(3)
_START_HEADING: Final = math.radians(10)
_ANYWHERE: Final = math.pi / math.sqrt(3)
SETTLED_INCLINATION_RAD: Final = math.radians(1.0)
SETTLED_HEADING_RAD: Final = math.radians(2.5)
# How fast a robot may turn in a gap.
_TURNING_RAD_S: Final = 1.0
# A source that has said nothing for so long is silent.
_SILENT_S: Final = 1.0


class Uncertainty:
    """
    Standard deviations of an attitude, in rad about the world's axes.

    :param with_field: north is to come from a magnetometer.
    :param inclination: of a settled filter; 0 takes the measured one.
    :param heading: the same.
    :ivar inclination: of roll and pitch.
    :ivar heading: of yaw.
    """

    __slots__ = ('inclination', 'heading', '_with_field', '_settled_inclination',
                 '_settled_heading', '_silent_s', '_heading_known')

    def __init__(self, with_field: bool, inclination: float = 0.0, heading: float = 0.0) -> None:
        self._with_field = with_field
        self.settle_at(inclination, heading)
        self._silent_s = 0.0
        self._heading_known = False
        self.inclination = _ANYWHERE
        self.heading = _ANYWHERE if with_field else self._settled_heading
        self.restart()

    def settle_at(self, inclination: float, heading: float) -> None:
        """Change the standard deviations of the settled filter."""
        self._settled_inclination = inclination or SETTLED_INCLINATION_RAD
        self._settled_heading = heading or SETTLED_HEADING_RAD

    def restart(self, gap_s: float = 0.0) -> None:
        """
        Start again, or after a gap.

        :param gap_s: during which the sensor may have been turned.
        """
        self.inclination = max(_START_INCLINATION, self._settled_inclination)
        self._heading_known = False
        self.heading = min(_ANYWHERE, self.heading + gap_s * _TURNING_RAD_S)

    def update(self, attitude: AttitudeFilter, with_acceleration: bool, with_field: bool,
               dt_s: float) -> None:
        """
        Follow a filter after a sample; safe in the real-time loop.

        :param with_acceleration: the sample had an acceleration.
        :param with_field: it had a new magnetic field.
        """
        drift = 0.0 if attitude.at_rest else attitude.bias_stddev * dt_s
        tuning = attitude.tuning
        if with_acceleration and not attitude.acceleration_rejected:
            self.inclination += (self._settled_inclination - self.inclination) * dt_s / (
                tuning.inclination_time_s + dt_s)
        else:
            self.inclination = min(_ANYWHERE, self.inclination + drift)
        self._silent_s = 0.0 if with_field else self._silent_s + dt_s
        if with_field and attitude.heading_known and not self._heading_known:
            self._heading_known = True
            self.heading = max(_START_HEADING, self._settled_heading)
        if (self._heading_known and not attitude.field_rejected
                and self._silent_s < _SILENT_S):
            self.heading += (self._settled_heading - self.heading) * dt_s / (
                tuning.heading_time_s + dt_s)
        else:
            self.heading = min(_ANYWHERE, self.heading + drift)
