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

"""What a page gets of each message: plain, finite, small."""

from __future__ import annotations

from collections.abc import Iterator
import json
import math
from pathlib import Path
import struct
from typing import Any

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest

pytest.importorskip('std_msgs', reason='ROS 2 messages are not installed')

from rt_robot_os.base.errors import LayoutError  # noqa: E402
from rt_robot_os.base.schema import star_match  # noqa: E402
from rt_robot_os.core.app import Core  # noqa: E402
from rt_robot_os.gateway.convert import RAYS_MOST  # noqa: E402
from rt_robot_os.gateway.convert import value_of  # noqa: E402
from rt_robot_os.gateway.settings import GatewaySettings  # noqa: E402
from rt_robot_os.messages.cdr import string_message  # noqa: E402
from rt_robot_os.messages.network_rows import WIDTH  # noqa: E402
from rt_robot_os.settings.load import load  # noqa: E402
from rt_robot_os.topics import Layout  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
ESTIMATE = 'geometry_msgs/msg/PoseWithCovarianceStamped'


def made(type_name: str, values: dict[str, Any], shape: dict[str, Any] | None = None,
         tail: int | None = None) -> bytes:
    return Layout.compile(type_name, shape, tail=tail).from_dict(values)


def test_a_pose_is_where_and_how_it_is_turned() -> None:
    cdr = made(ESTIMATE, {'pose': {'pose': {
        'position': {'x': 1.25, 'y': -2.0}, 'orientation': {'z': math.sin(0.5), 'w': math.cos(0.5)}
    }, 'covariance': [0.09, *[0.0] * 6, 0.16, *[0.0] * 28]}}, {'header.frame_id': 'map'})
    assert value_of('pose', ESTIMATE, cdr) == {'x': 1.25, 'y': -2.0, 'yaw': 1.0, 'stddev_m': 0.5}
    cdr = made(ESTIMATE, {'pose': {'pose': {'position': {'x': math.nan}}}},
               {'header.frame_id': 'map'})
    assert value_of('pose', ESTIMATE, cdr)['x'] is None


def test_a_scan_is_thinned_to_the_nearest_and_what_is_no_range_is_null() -> None:
    ranges = [4.0] * 682
    ranges[100], ranges[200], ranges[300] = 0.5, math.nan, math.inf
    cdr = made('sensor_msgs/msg/LaserScan', {
        'angle_min': -2.0, 'angle_increment': 0.006, 'range_min': 0.1, 'range_max': 30.0,
        'ranges': ranges}, {'header.frame_id': 'laser', 'ranges': 682})
    found = value_of('scan', 'sensor_msgs/msg/LaserScan', cdr)
    assert len(found['ranges']) <= RAYS_MOST and 0.5 in found['ranges']
    at = found['ranges'].index(0.5)
    angle = found['angle_min'] + at * found['angle_increment']
    assert angle == pytest.approx(-2.0 + 100 * 0.006, abs=2 * 0.006)


def test_ways_and_nodes_and_numbers_and_texts() -> None:
    numbers = 'std_msgs/msg/Float64MultiArray'
    row = [3.0, 1.0, 2.0, *[math.nan] * (WIDTH - 3)]
    row[8] = 1.0
    cdr = made(numbers, {'data': row}, {'layout.dim': [{'label': '3=hall'}]}, tail=WIDTH)
    node, = value_of('wsn/nodes', numbers, cdr)['nodes']
    assert (node['id'], node['name'], node['state']) == (3, 'hall', 'good')
    assert node['battery_v'] is None
    cdr = made(numbers, {'data': [1.0, 2.0, 0.1, 3.0, 4.0, 0.2]}, tail=6)
    assert value_of('plan', numbers, cdr) == {'points': [[1.0, 2.0], [3.0, 4.0]]}
    assert value_of('t', 'std_msgs/msg/Bool', made('std_msgs/msg/Bool', {'data': True})) is True
    cdr = made('sensor_msgs/msg/Temperature', {'temperature': 36.5}, {'header.frame_id': 'b'})
    assert value_of('health/anna/body_temperature', 'sensor_msgs/msg/Temperature', cdr) == 36.5
    text = 'std_msgs/msg/String'
    assert value_of('a', text, string_message('{"a": NaN}')) == {'a': None}
    assert value_of('a', text, string_message('{"a": ')) == '{"a": '
    assert value_of('a', text, string_message('[' * 100_000))


def topics(folder: Path) -> Iterator[Any]:
    for name in ('assisted_living', 'robot', 'camera'):
        yield from Core(load([ROOT / f'config/{name}.yaml']), folder / 'x.sock').bus.topics


def test_every_message_of_the_shipped_robots_becomes_json(tmp_path: Path) -> None:
    seen = set()
    for topic in topics(tmp_path):
        cdr = bytes(topic.layout.new_buffer()[:topic.layout.size])
        value = value_of(topic.name, topic.layout.type_name, cdr)
        assert len(json.dumps(value, allow_nan=False)) < 100_000
        seen.add(topic.layout.type_name)
    assert len(seen) > 25


TYPES = ('geometry_msgs/msg/PoseStamped', 'nav_msgs/msg/Odometry', 'sensor_msgs/msg/BatteryState',
         'sensor_msgs/msg/Imu', 'sensor_msgs/msg/JointState', 'sensor_msgs/msg/LaserScan',
         'sensor_msgs/msg/NavSatFix', 'sensor_msgs/msg/Range', 'std_msgs/msg/Float32',
         'std_msgs/msg/Float64MultiArray', 'std_msgs/msg/String', 'std_msgs/msg/UInt8MultiArray',
         'geometry_msgs/msg/TwistStamped', ESTIMATE, 'diagnostic_msgs/msg/DiagnosticArray')


@settings(deadline=None)
@given(st.sampled_from(TYPES), st.binary(max_size=400), st.sampled_from(['wsn/nodes', 'plan']))
def test_bytes_that_are_no_such_message_raise_one_error_or_become_json(
        type_name: str, data: bytes, topic: str) -> None:
    try:
        value = value_of(topic, type_name, b'\x00\x01\x00\x00' + data)
    except (ValueError, LayoutError, struct.error, LookupError, TypeError):
        return  # which the table of signals counts
    json.dumps(value, allow_nan=False)


def test_the_first_line_that_fits_says_how_often() -> None:
    rates = GatewaySettings().live_rates()

    def rate(topic: str) -> float:
        return next(hz for pattern, hz in rates if star_match(pattern, topic) is not None)

    assert rate('health/anna/imu') == 0.0 and rate('health/anna/pulse_per_min') == 5.0
    assert rate('pose') == 10.0 and rate('wsn/kitchen/temperature') == 2.0
