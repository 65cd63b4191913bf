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
Shared by drivers of inertial measurement units: settings, covariances, the message.

REP 145: a quantity that a device does not give has -1 in the first element of its covariance. The
defaults of the standard deviations are of the order that data sheets state.
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from typing import Any
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import TopicSpec

IDENTITY: Final = (0.0, 0.0, 0.0, 1.0)
NONE: Final = (0.0, 0.0, 0.0)

_HONESTY: Final = ('The device reports none: the default is of the order that data sheets state, '
                   'so measure yours.')


def stddev(name: str, default: float, unit: str, of: str) -> Field:
    """Declare the setting of a standard deviation."""
    return Field(name, float, default, f'Standard deviation of {of}. {_HONESTY}', unit=unit,
                 minimum=0.0)


def imu_settings(
    *, acceleration: float, angular_velocity: float, roll_pitch: float, yaw: float, mag_t: float,
) -> tuple[Field, ...]:
    """
    Declare the settings of every unit with a magnetometer, with the defaults of one unit.

    :param acceleration: standard deviation in m/s^2.
    :param angular_velocity: standard deviation in rad/s.
    :param roll_pitch: standard deviation in rad, as ``yaw``.
    :param mag_t: standard deviation in tesla.
    """
    return (
        Field('mag_topic', str, 'imu/mag', 'Topic of the magnetic field; empty publishes none.'),
        stddev('acceleration_stddev', acceleration, 'm/s^2', 'each axis of the acceleration'),
        stddev('angular_velocity_stddev', angular_velocity, 'rad/s',
               'each axis of the angular velocity'),
        stddev('roll_pitch_stddev', roll_pitch, 'rad', 'roll and pitch'),
        stddev('yaw_stddev', yaw, 'rad', 'yaw, with a magnetometer and no iron near'),
        stddev('mag_stddev_t', mag_t, 'T', 'each axis of the magnetic field'),
    )


def imu_publications(settings: Mapping[str, Any]) -> tuple[TopicSpec, ...]:
    """Return the publications of such a unit: Imu, and MagneticField unless its topic is empty."""
    fixed = {'header.frame_id': settings['frame_id']}
    kinds = [(settings['topic'], 'sensor_msgs/msg/Imu')]
    if settings['mag_topic']:
        kinds.append((settings['mag_topic'], 'sensor_msgs/msg/MagneticField'))
    return tuple(
        TopicSpec(topic, message, fixed, settings['depth'], settings['output_rate_hz'])
        for topic, message in kinds)


class ImuFiller:
    """
    Fill the messages of one unit; safe in the real-time loop.

    The message is in a ring whose slots hold earlier messages, so every field is filled in each
    time.
    """

    def __init__(self, settings: Mapping[str, Any]) -> None:
        """
        Compute the covariances.

        :param settings: with those of :func:`imu_settings`.
        """
        self._linear = diagonal(*3 * (settings['acceleration_stddev'],))
        self._angular = diagonal(*3 * (settings['angular_velocity_stddev'],))
        tilt: float = settings['roll_pitch_stddev']
        self._attitude = diagonal(tilt, tilt, settings['yaw_stddev'])
        self._magnetic = diagonal(*3 * (settings['mag_stddev_t'],))
        self._absent = diagonal(0.0, 0.0, 0.0)
        self._absent[0] = -1.0

    def fill(
        self, msg: Any, acceleration: Sequence[float] | None, rate: Sequence[float] | None,
        orientation: Sequence[float] | None,
    ) -> None:
        """
        Fill in a ``sensor_msgs/msg/Imu``.

        :param acceleration: m/s^2; None, as for the others, when the device gave none.
        :param rate: rad/s.
        :param orientation: x, y, z, w.
        """
        msg.linear_acceleration = acceleration or NONE
        msg.linear_acceleration_covariance[:] = self._linear if acceleration else self._absent
        msg.angular_velocity = rate or NONE
        msg.angular_velocity_covariance[:] = self._angular if rate else self._absent
        msg.orientation = orientation or IDENTITY
        msg.orientation_covariance[:] = self._attitude if orientation else self._absent

    def fill_field(self, msg: Any, field_t: Sequence[float]) -> None:
        """Fill in a ``sensor_msgs/msg/MagneticField``, in tesla."""
        msg.magnetic_field = field_t
        msg.magnetic_field_covariance[:] = self._magnetic


def diagonal(first: float, second: float, third: float) -> npt.NDArray[np.float64]:
    """Return the nine numbers of the covariance of three standard deviations."""
    return np.diag((first * first, second * second, third * third)).reshape(9)
