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
What all barometers have: three topics, and the altitude of the standard atmosphere.

The altitude is a ``geometry_msgs/msg/PoseWithCovarianceStamped``: it has a stamp and a variance,
and robot_localization accepts it unmodified. Only ``z`` is known; the other components have the
variance 1e6.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any
from typing import Final

import numpy as np

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.i2c.device import I2cDevice
from rt_robot_os.devices.i2c.device import Transactions
from rt_robot_os.motion.atmosphere import altitude_m
from rt_robot_os.motion.atmosphere import altitude_slope_m_pa
from rt_robot_os.motion.atmosphere import SEA_LEVEL_PA

_UNKNOWN: Final = 1e6
_Z: Final = 2 * 6 + 2


def barometer_settings(pressure_stddev_pa: float) -> tuple[Field, ...]:
    """
    Declare the settings of a barometer, without those of its bus.

    :param pressure_stddev_pa: default noise.
    """
    return (
        Field('temperature_topic', str, 'baro/temperature',
              "Topic of the chip's temperature; empty publishes none."),
        Field('altitude_topic', str, 'baro/altitude', 'Topic of the altitude; empty publishes '
              'none.'),
        Field('altitude_frame_id', str, 'map', 'Coordinate frame of the altitude.'),
        Field('sea_level_pa', float, SEA_LEVEL_PA, 'Pressure at altitude 0 (QNH).', unit='Pa',
              minimum=80_000.0, maximum=110_000.0, live=True),
        Field('pressure_stddev_pa', float, pressure_stddev_pa, 'Standard deviation of the '
              'pressure. The chip reports none: the default is its noise at usual settings, '
              'without its offset.', unit='Pa', minimum=0.0),
        Field('temperature_stddev_c', float, 0.5, 'Standard deviation of the temperature.',
              unit='C', minimum=0.0),
    )


def averaging_settings(
    pressure: int, oversampling: tuple[int, ...], filters: tuple[int, ...],
) -> tuple[Field, ...]:
    """
    Declare the averaging settings of a Bosch chip.

    :param pressure: default number of readings for a pressure.
    :param oversampling: the possible numbers.
    :param filters: the possible coefficients.
    """
    return (
        Field('pressure_oversampling', int, pressure, 'Readings averaged for a pressure.',
              choices=oversampling),
        Field('temperature_oversampling', int, 1, 'Readings averaged for a temperature.',
              choices=oversampling),
        Field('filter', int, 0, 'Coefficient of the low-pass filter in the chip; 0 is off.',
              choices=filters),
    )


class Barometer(I2cDevice):
    """A barometer on an I2C bus."""

    # The range of the chip: a reading beyond it is wrong.
    PRESSURE_RANGE_PA = (30_000.0, 125_000.0)
    TEMPERATURE_RANGE_C = (-40.0, 85.0)

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """Store the settings; nothing is opened."""
        super().__init__(name, settings)
        self._sea_level_pa: float = settings['sea_level_pa']
        self._pressure_stddev_pa: float = settings['pressure_stddev_pa']
        self._pressure_variance = self._pressure_stddev_pa ** 2
        self._temperature_variance: float = settings['temperature_stddev_c'] ** 2
        self._covariance = np.diag([_UNKNOWN] * 6).reshape(36)
        self._last_stamp_ns = 0
        self._temperature_at = 1 if settings['temperature_topic'] else 0
        self._altitude_at = 1 + self._temperature_at if settings['altitude_topic'] else 0

    def expect_time_for(self, conversion_ns: int) -> None:
        """
        Check that the conversions of a sample fit into its period.

        :param conversion_ns: longest time of all conversions of a sample.
        :raises ConfigError: they take longer than the period.
        """
        if conversion_ns > self.period_ns:
            raise ConfigError([
                f'{self.name}: output_rate_hz {self.settings["output_rate_hz"]:g} is more than '
                f'the {NS_PER_S / conversion_ns:.1f} Hz that this oversampling allows: lower it '
                'or the oversampling'])

    @abstractmethod
    def identify(self) -> Transactions[object] | None:
        """Check that it is the right chip, and reset it."""

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return the publications: pressure; temperature and altitude if their topics are set."""
        s = self.settings
        frame = {'header.frame_id': s['frame_id']}
        kinds = [(s['topic'], 'sensor_msgs/msg/FluidPressure', frame)]
        if s['temperature_topic']:
            kinds.append((s['temperature_topic'], 'sensor_msgs/msg/Temperature', frame))
        if s['altitude_topic']:
            kinds.append((s['altitude_topic'], 'geometry_msgs/msg/PoseWithCovarianceStamped',
                          {'header.frame_id': s['altitude_frame_id']}))
        return tuple(TopicSpec(topic, message, fixed, s['depth'], s['output_rate_hz'])
                     for topic, message, fixed in kinds)

    def changed(self, name: str) -> None:
        """Apply a changed pressure at sea level; in the loop."""
        self._sea_level_pa = self.settings['sea_level_pa']

    def publish(self, pressure_pa: float, temperature_c: float, stamp_ns: int) -> int:
        """
        Publish one measurement, unless it is outside the range of the chip; in the loop.

        :param stamp_ns: when it was measured.
        :return: number of samples published.
        :raises DeviceError: several measurements are outside the range.
        """
        low, high = self.PRESSURE_RANGE_PA
        coldest, hottest = self.TEMPERATURE_RANGE_C
        if not (low <= pressure_pa <= high and coldest <= temperature_c <= hottest):
            return self.reject(f'{pressure_pa:.0f} Pa at {temperature_c:.1f} C is beyond what the '
                               'chip can measure')
        stamp_ns = max(stamp_ns, self._last_stamp_ns)
        self._last_stamp_ns = stamp_ns
        self.accept(stamp_ns)
        publishers = self._publishers
        publisher = publishers[0]
        msg = publisher.msg
        msg.fluid_pressure = pressure_pa
        msg.variance = self._pressure_variance
        publisher.publish(stamp_ns)
        if self._temperature_at:
            publisher = publishers[self._temperature_at]
            msg = publisher.msg
            msg.temperature = temperature_c
            msg.variance = self._temperature_variance
            publisher.publish(stamp_ns)
        if self._altitude_at:
            self._publish_altitude(pressure_pa, stamp_ns)
        return len(publishers)

    def _publish_altitude(self, pressure_pa: float, stamp_ns: int) -> None:
        sea_level_pa = self._sea_level_pa
        stddev_m = altitude_slope_m_pa(pressure_pa, sea_level_pa) * self._pressure_stddev_pa
        covariance = self._covariance
        covariance[_Z] = stddev_m * stddev_m
        publisher = self._publishers[self._altitude_at]
        pose = publisher.msg.pose
        pose.pose.position = (0.0, 0.0, altitude_m(pressure_pa, sea_level_pa))
        pose.pose.orientation = (0.0, 0.0, 0.0, 1.0)
        pose.covariance[:] = covariance
        publisher.publish(stamp_ns)
