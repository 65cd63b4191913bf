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

"""Packers: several fields of a slot in one call."""

from __future__ import annotations

import struct
from typing import Any

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest

from rt_robot_os.base.errors import LayoutError
from rt_robot_os.topics.layout import Layout

pytest.importorskip('sensor_msgs', reason='the ROS 2 message packages are not installed')

IMU = Layout.compile('sensor_msgs/Imu', {'header.frame_id': 'imu_link'})
STATUS = Layout.compile('diagnostic_msgs/DiagnosticArray', {'status': [
    {'name': 'a', 'values': [{'key': 'k', 'value': 'v'}]}, {'name': 'b'}, {}]})
NAMES = ('header.stamp', 'orientation', 'orientation_covariance', 'angular_velocity',
         'angular_velocity_covariance', 'linear_acceleration.y', 'linear_acceleration_covariance')


def test_values_go_in_and_come_out_in_the_order_of_the_names() -> None:
    buffer = IMU.new_buffer()
    packer = IMU.packer('angular_velocity', 'linear_acceleration')
    packer.pack(buffer, 1, 2, 3, 4, 5, 6)
    assert packer.unpack(buffer) == (1, 2, 3, 4, 5, 6)
    m = IMU.view(buffer)
    assert (*m.angular_velocity, *m.linear_acceleration) == (1, 2, 3, 4, 5, 6)
    assert packer.names == tuple(f'{name}.{axis}' for name in (
        'angular_velocity', 'linear_acceleration') for axis in 'xyz')
    backwards = IMU.packer('linear_acceleration', 'angular_velocity', 'header.stamp.sec')
    assert backwards.unpack(buffer) == (4, 5, 6, 1, 2, 3, 0)
    backwards.pack(buffer, 9, 8, 7, 6, 5, 4, 3)
    assert (*m.angular_velocity, *m.linear_acceleration) == (6, 5, 4, 9, 8, 7)
    assert m.header.stamp.sec == 3


@settings(max_examples=40, deadline=None)
@given(st.permutations(NAMES), st.integers(1, len(NAMES)))
def test_a_packer_touches_its_own_fields_only(names: list[str], count: int) -> None:
    packer = IMU.packer(*names[:count])
    buffer = IMU.new_buffer()
    view = IMU.view(buffer)
    for name in ('orientation', 'angular_velocity', 'linear_acceleration'):
        setattr(view, name, [-1.0] * len(tuple(getattr(view, name))))
    before = {field.name: bytes(buffer[field.offset:field.offset + field.nbytes])
              for field in IMU.fields()}
    values = tuple(range(1, len(packer.names) + 1))
    packer.pack(buffer, *values)
    assert packer.unpack(buffer) == values
    assert IMU.check(buffer) is None
    for field in IMU.fields():
        packed = any(name.split('[')[0] == field.name for name in packer.names)
        now = bytes(buffer[field.offset:field.offset + field.nbytes])
        assert packed or now == before[field.name]


def test_counts_between_fields_survive() -> None:
    buffer = STATUS.new_buffer()
    packer = STATUS.packer('header', 'status')
    assert packer.names == ('header.stamp.sec', 'header.stamp.nanosec', 'status[0].level',
                            'status[1].level', 'status[2].level')
    packer.pack(buffer, 1, 2, b'\1', b'\2', b'\3')
    assert STATUS.check(buffer) is None
    assert packer.unpack(buffer) == (1, 2, b'\1', b'\2', b'\3')
    joints = Layout.compile('sensor_msgs/JointState', {'position': 2, 'velocity': 2})
    buffer = joints.new_buffer()
    both = joints.packer('position', 'velocity')
    both.pack(buffer, 1, 2, 3, 4)
    assert joints.check(buffer) is None
    assert both.unpack(buffer) == (1, 2, 3, 4)


def test_many_values_are_packed_too() -> None:
    layout = Layout.compile('sensor_msgs/LaserScan', {'ranges': 682})
    buffer = layout.new_buffer()
    packer = layout.packer('ranges', 'angle_min')
    values = tuple(float(i) for i in range(683))
    packer.pack(buffer, *values)
    assert packer.unpack(buffer) == values
    with pytest.raises(TypeError, match='683 values for sensor_msgs/msg/LaserScan, not 2'):
        packer.pack(buffer, 1, 2)
    with pytest.raises(LayoutError, match='cannot pack'):
        packer.pack(buffer, *values[:-1], 'x')


def test_a_wrong_value_is_named_and_a_missing_one_is_a_type_error() -> None:
    packer = IMU.packer('header.stamp', 'angular_velocity')
    with pytest.raises(LayoutError, match='Imu: cannot pack header.stamp.sec=.x.'):
        packer.pack(IMU.new_buffer(), 'x', 0, 1, 2, 3)
    with pytest.raises(LayoutError, match='header.stamp.nanosec=-1'):
        packer.pack(IMU.new_buffer(), 0, -1, 1, 2, 3)
    with pytest.raises(TypeError, match='angular_velocity_z'):
        packer.pack(IMU.new_buffer(), 0, 0, 1, 2)
    assert 'angular_velocity.z' in repr(packer)


def test_bytes_that_are_too_short_are_refused() -> None:
    packer = IMU.packer('linear_acceleration')
    with pytest.raises(LayoutError, match='cannot pack'):
        packer.pack(bytearray(10), 1, 2, 3)
    with pytest.raises(struct.error):
        packer.unpack(bytes(10))


@pytest.mark.parametrize(('layout', 'names', 'words'), [
    (IMU, [], 'no fields; name at least one'),
    (IMU, ['angular_velocty'], "'angular_velocty'.*did you mean 'angular_velocity'"),
    (IMU, ['header.frame_id'], 'header.frame_id has no numbers'),
    (IMU, ['orientation', 'orientation.x'], "'orientation.x' is packed twice"),
    (Layout.compile('sensor_msgs/Image', tail=3), ['data'], 'data is the tail'),
    (Layout.compile('sensor_msgs/JointState'), ['position'], 'position has no numbers'),
])
def test_a_packer_that_cannot_be_is_refused(layout: Layout, names: list[str],
                                            words: Any) -> None:
    with pytest.raises(LayoutError, match=words):
        layout.packer(*names)
