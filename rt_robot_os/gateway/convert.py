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
Messages of the robot as values of JSON: what a page shows, by the type of the topic.

Numbers are finite; unknown values are null. A pose is ``{x, y, yaw}``, a path ``{points}``, rows
of a sensor network ``{nodes}``. A scan is thinned, a string with JSON becomes that JSON, a message
with one number becomes that number, and any other message becomes an object of its fields.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
import json
import math
from types import MappingProxyType
from typing import Any
from typing import Final

from rt_robot_os.gateway.decoding import decode_message
from rt_robot_os.gateway.decoding import finite
from rt_robot_os.messages.cdr import labelled_numbers
from rt_robot_os.messages.cdr import string_in
from rt_robot_os.messages.network_rows import names_of
from rt_robot_os.messages.network_rows import rows_of
from rt_robot_os.messages.node_reading import NodeReading
from rt_robot_os.motion.angles import yaw_of

#: Most rays of a scan and points of a path that are shown, and digits after the decimal point.
RAYS_MOST: Final = 181
POINTS_MOST: Final = 300
_DIGITS: Final = 4
_TEXT_MOST: Final = 64_000
#: Field names of the number in messages with one number.
_NUMBERS: Final = MappingProxyType({
    'sensor_msgs/msg/Temperature': 'temperature',
    'sensor_msgs/msg/RelativeHumidity': 'relative_humidity',
    'sensor_msgs/msg/Illuminance': 'illuminance',
    'sensor_msgs/msg/FluidPressure': 'fluid_pressure',
    'sensor_msgs/msg/Range': 'range'})
_NODES: Final = 'wsn/nodes'
_PATHS: Final = frozenset({'plan', 'path'})


def value_of(topic: str, type_name: str, cdr: bytes) -> Any:
    """
    Return the value of a message.

    :param cdr: with its encapsulation.
    :raises ValueError: the bytes are not such a message.
    :raises LayoutError: the type is not installed here.
    """
    if type_name == 'std_msgs/msg/String':
        return text_value(string_in(cdr))
    if type_name == 'std_msgs/msg/Float64MultiArray':
        return _numbers(topic, cdr)
    message = decode_message(type_name, cdr)
    if type_name in _SHAPES:
        return _SHAPES[type_name](message)
    if type_name in _NUMBERS:
        return message[_NUMBERS[type_name]]
    if type_name == 'sensor_msgs/msg/BatteryState' and topic.startswith('wsn/'):
        return message['voltage']
    if len(message) == 1 and 'data' in message:
        return message['data']
    message.pop('header', None)
    return message


def text_value(text: str) -> Any:
    """Return the JSON value in a string, with finite numbers, or else the string."""
    if text[:1] in ('{', '['):
        try:
            return json.loads(text, parse_constant=lambda name: None)
        except (ValueError, RecursionError):
            pass
    return text[:_TEXT_MOST]


def _numbers(topic: str, cdr: bytes) -> Any:
    label, numbers = labelled_numbers(memoryview(cdr))
    if topic == _NODES:
        return {'nodes': [each.to_dict() for each in nodes_of(label, numbers)]}
    if topic in _PATHS:
        points = [[_round(x), _round(y)] for x, y in zip(numbers[0::3], numbers[1::3])]
        return {'points': thinned(points, POINTS_MOST)}
    return {'data': [finite(each) for each in numbers[:POINTS_MOST]]}


def nodes_of(label: str, numbers: tuple[float, ...]) -> list[NodeReading]:
    """Read the rows of a sensor network."""
    names = names_of(label)
    return [NodeReading.of_row(names.get(int(row.id), f'node{int(row.id)}'), row)
            for row in rows_of(numbers) if math.isfinite(row.id)]


def thinned(items: list[Any], most: int) -> list[Any]:
    """Drop items evenly; the first and the last are kept."""
    if len(items) <= most:
        return items
    step = (len(items) - 1) / (most - 1)
    return [items[round(index * step)] for index in range(most)]


def _pose(pose: Mapping[str, Any]) -> dict[str, Any]:
    place, turn = pose['position'], pose['orientation']
    known = all(turn[each] is not None for each in 'xyzw')
    return {'x': _round(place['x']), 'y': _round(place['y']),
            'yaw': _round(yaw_of(*(turn[each] for each in 'xyzw'))) if known else None}


def _estimate(message: Mapping[str, Any]) -> dict[str, Any]:
    covariance = message['pose']['covariance']
    spread = (covariance[0] or 0.0) + (covariance[7] or 0.0)
    return {**_pose(message['pose']['pose']), 'stddev_m': _round(math.sqrt(max(0.0, spread)))}


def _scan(message: Mapping[str, Any]) -> dict[str, Any]:
    """Keep the nearest of neighbouring rays, so that only points behind it are dropped."""
    ranges = message['ranges']
    low, high = message['range_min'] or 0.0, message['range_max'] or math.inf
    good = [each if each is not None and low <= each <= high else None for each in ranges]
    step = -(-len(good) // RAYS_MOST) or 1
    groups = [good[at:at + step] for at in range(0, len(good), step)]
    nearest = [min((each for each in group if each is not None), default=None)
               for group in groups]
    increment = message['angle_increment'] or 0.0
    first = (message['angle_min'] or 0.0) + increment * (step - 1) / 2
    return {'angle_min': _round(first), 'angle_increment': increment * step,
            'ranges': [each if each is None else round(each, 2) for each in nearest]}


def _speed(message: Mapping[str, Any]) -> dict[str, Any]:
    twist = message['twist']['twist']
    return {'linear_m_s': _round(twist['linear']['x']),
            'angular_rad_s': _round(twist['angular']['z'])}


def _battery(message: Mapping[str, Any]) -> dict[str, Any]:
    return {'percentage': message['percentage'], 'voltage': message['voltage']}


def _round(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else round(value, _DIGITS)


_SHAPES: Final[Mapping[str, Callable[[Mapping[str, Any]], Any]]] = MappingProxyType({
    'geometry_msgs/msg/PoseStamped': lambda message: _pose(message['pose']),
    'geometry_msgs/msg/PoseWithCovarianceStamped': _estimate,
    'nav_msgs/msg/Odometry': _speed,
    'sensor_msgs/msg/BatteryState': _battery,
    'sensor_msgs/msg/LaserScan': _scan})
