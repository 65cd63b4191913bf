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


"""The interface of an attitude filter: its inputs, its outputs and its tuning."""

from __future__ import annotations

from abc import ABC
from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from rt_robot_os.motion.quaternion import IDENTITY
from rt_robot_os.motion.quaternion import Quaternion
from rt_robot_os.motion.quaternion import Vector


@dataclass(frozen=True)
class FilterTuning:
    """
    The tuning of a filter, in units that mean the same to each of them.

    :ivar inclination_time_s: how long the accelerometer is averaged: short follows it, long
        trusts the gyroscope.
    :ivar heading_time_s: the same of the magnetometer.
    :ivar bias_in_motion: learn the bias of the gyroscope while the sensor moves.
    :ivar bias_at_rest: learn it, fast, while the sensor rests.
    :ivar bias_maximum_rad_s: limit of the estimated bias, for each axis.
    :ivar rest_rate_rad_s: a sensor whose rate deviates less from its average may be at rest.
    :ivar rest_acceleration_m_s2: the same of its acceleration.
    :ivar field_rejection: ignore a magnetic field that is not the earth's.
    """

    inclination_time_s: float = 3.0
    heading_time_s: float = 9.0
    bias_in_motion: bool = True
    bias_at_rest: bool = True
    bias_maximum_rad_s: float = 0.035
    rest_rate_rad_s: float = 0.035
    rest_acceleration_m_s2: float = 0.5
    field_rejection: bool = True


class AttitudeFilter(ABC):
    """
    Estimate how a sensor is turned, from its angular velocity, acceleration and magnetic field.

    The world's axes are east, north, up; north is where a compass points. Without magnetic field
    the heading begins as if the sensor had been turned up by the shortest way, and drifts.

    :ivar attitude: turns the sensor's axes to the world's.
    :ivar bias: of the gyroscope in rad/s, included in its readings.
    :ivar bias_stddev: standard deviation of the bias in rad/s, in the worst direction.
    :ivar aligned: up is known, from a first acceleration.
    :ivar heading_known: north is known, from a first magnetic field.
    :ivar at_rest: the sensor does not move.
    :ivar acceleration_rejected: the last acceleration was not used.
    :ivar field_rejected: the last magnetic field was not used.
    """

    name: ClassVar[str] = ''

    def __init__(self, tuning: FilterTuning) -> None:
        self.tuning = tuning
        self.attitude: Quaternion = IDENTITY
        self.bias: Vector = (0.0, 0.0, 0.0)
        self.bias_stddev = 0.0
        self.aligned = False
        self.heading_known = False
        self.at_rest = False
        self.acceleration_rejected = False
        self.field_rejected = False

    @abstractmethod
    def update(self, rate: Vector, acceleration: Vector | None, field: Vector | None,
               dt_s: float) -> Quaternion:
        """
        Process a sample; safe in the real-time loop.

        The numbers are finite, ``dt_s`` is above zero.

        :param rate: rad/s, in the sensor's axes.
        :param acceleration: m/s^2, upwards at rest; None when there is none.
        :param field: of any unit that stays the same; None when there is no new one.
        :param dt_s: since the sample before; the rate is that of this time.
        :return: :attr:`attitude`.
        """

    @abstractmethod
    def restart(self) -> None:
        """
        Find up (and north) again with the next samples, after a gap; safe in the real-time loop.

        The bias is kept, and the heading too where there is no magnetic field.
        """

    @abstractmethod
    def tune(self, tuning: FilterTuning) -> None:
        """Change the tuning between two samples; safe in the real-time loop."""
