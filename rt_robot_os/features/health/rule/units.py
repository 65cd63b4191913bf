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


"""Units of the numbers in rules and of the fields of messages."""

from __future__ import annotations

from collections.abc import Mapping
import math
from types import MappingProxyType
from typing import Final
from typing import NamedTuple


class Unit(NamedTuple):
    """
    A unit.

    :ivar of: the quantity; only units of the same quantity can be converted.
    :ivar factor: to the first unit of the quantity.
    """

    of: str
    factor: float


#: Affine units (degF) are left out: a difference and a reading would need two factors.
UNITS: Final[Mapping[str, Unit]] = MappingProxyType({
    'degC': Unit('temperature', 1.0),
    '1': Unit('share', 1.0), '%': Unit('share', 0.01),
    's': Unit('time', 1.0), 'ms': Unit('time', 0.001), 'min': Unit('time', 60.0),
    'h': Unit('time', 3600.0), 'd': Unit('time', 86_400.0),
    'm': Unit('length', 1.0), 'cm': Unit('length', 0.01), 'mm': Unit('length', 0.001),
    'm/s': Unit('speed', 1.0), 'm/s2': Unit('acceleration', 1.0), 'g': Unit(
        'acceleration', 9.80665),
    'rad': Unit('angle', 1.0), 'deg': Unit('angle', math.pi / 180.0),
    'rad/s': Unit('turning rate', 1.0), 'deg/s': Unit('turning rate', math.pi / 180.0),
    'V': Unit('voltage', 1.0), 'mV': Unit('voltage', 0.001), 'A': Unit('current', 1.0),
    'lx': Unit('illuminance', 1.0), '/min': Unit('rate', 1.0), 'l/min': Unit('flow', 1.0),
    'Pa': Unit('pressure', 1.0), 'hPa': Unit('pressure', 100.0),
    'mmHg': Unit('pressure', 133.322387415),
})

_SPELLED: Final = MappingProxyType({
    '°C': 'degC', 'C': 'degC', 'degc': 'degC', 'percent': '%', 'm/s^2': 'm/s2', 'm/s²': 'm/s2',
    'sec': 's', 'lux': 'lx', 'bpm': '/min', '°': 'deg', 'minutes': 'min', 'seconds': 's',
    'hours': 'h', 'volt': 'V'})

# Units that ROS defines for fields of its messages, by type and field.
_OF_MESSAGES: Final = MappingProxyType({
    'Temperature.temperature': 'degC', 'RelativeHumidity.relative_humidity': '1',
    'Illuminance.illuminance': 'lx', 'FluidPressure.fluid_pressure': 'Pa',
    'BatteryState.voltage': 'V', 'BatteryState.percentage': '1',
    'BatteryState.temperature': 'degC', 'BatteryState.current': 'A', 'Range.range': 'm',
    'LaserScan.ranges': 'm', 'Imu.linear_acceleration': 'm/s2', 'Imu.angular_velocity': 'rad/s',
    'Twist.linear': 'm/s', 'Twist.angular': 'rad/s', 'TwistStamped.twist.linear': 'm/s',
    'TwistStamped.twist.angular': 'rad/s', 'Odometry.twist.twist.linear': 'm/s',
    'Odometry.twist.twist.angular': 'rad/s', 'Odometry.pose.pose.position': 'm',
    'PoseStamped.pose.position': 'm', 'PoseWithCovarianceStamped.pose.pose.position': 'm',
    'Pose.position': 'm', 'PointStamped.point': 'm', 'JointState.position': 'rad',
    'JointState.velocity': 'rad/s'})

# Units at the end of names in this project, longest first.
_OF_NAMES: Final = MappingProxyType({
    'l_per_min': 'l/min', 'per_min': '/min', 'percent': '%', 'mmhg': 'mmHg', 'm_s2': 'm/s2',
    'rad_s': 'rad/s', 'deg_s': 'deg/s', 'm_s': 'm/s', 'degc': 'degC', 'deg': 'deg', 'rad': 'rad',
    'lx': 'lx', 'pa': 'Pa', 'mm': 'mm', 'min': 'min', 'ms': 'ms', 'mv': 'mV', 'm': 'm', 's': 's',
    'h': 'h', 'v': 'V', 'a': 'A', 'g': 'g'})


def canonical_unit(unit: str) -> str:
    """Return the canonical name of a unit."""
    return _SPELLED.get(unit, unit)


def unit_of(topic: str, message: str, path: str) -> str:
    """
    Return the unit of a field; empty when it is unknown.

    :param message: type of the topic, such as ``sensor_msgs/msg/Temperature``.
    """
    kind = message.rpartition('/')[2]
    bare = path.partition('[')[0]
    for end, unit in _OF_MESSAGES.items():
        of_kind, _, field = end.partition('.')
        if of_kind == kind and (bare == field or bare.startswith(f'{field}.')):
            return unit
    last = bare.rpartition('.')[2]
    name = topic.rpartition('/')[2] if last == 'data' else last
    for end, unit in _OF_NAMES.items():
        if name.endswith(f'_{end}'):
            return unit
    return ''


def converted(value: float, unit: str, wanted: str) -> float:
    """
    Convert a number to another unit; one without a unit is returned unchanged.

    :param wanted: unit of the field; empty when that is unknown.
    :raises ValueError: the units are of different quantities, or that of the field is unknown.
    """
    if not unit or unit == wanted:
        return value
    if not wanted:
        raise ValueError('the unit of this field is unknown: write the number without one')
    given, field = UNITS[unit], UNITS[wanted]
    if given.of != field.of:
        raise ValueError(f'{unit} is a unit of {given.of}, but this field is in {wanted}')
    return value * given.factor / field.factor if given.factor != field.factor else value
