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

"""Arrays, sequences of numbers and tails of a message view: NumPy in the buffer."""

from __future__ import annotations

from array import array
from typing import Any

import numpy as np
import pytest

from rt_robot_os.base.errors import LayoutError
from rt_robot_os.topics.layout import Layout

pytest.importorskip('sensor_msgs', reason='the ROS 2 message packages are not installed')

IMU = Layout.compile('sensor_msgs/Imu', {'header.frame_id': 'imu_link'})


def fresh(layout: Layout) -> Any:
    return layout.view(layout.new_buffer())


def test_arrays_are_numpy_views_into_the_buffer() -> None:
    buffer = IMU.new_buffer()
    m = IMU.view(buffer)
    m.orientation_covariance[:] = range(9)
    m.orientation_covariance[4] = 40.0
    assert m.orientation_covariance.tolist() == [0, 1, 2, 3, 40, 5, 6, 7, 8]
    assert IMU.view(bytes(buffer)).orientation_covariance[4] == 40.0
    for value in ([1.0] * 9, (1,) * 9, np.ones((3, 3)), np.ones(9, 'f4'), array('d', [1.0] * 9),
                  [[1, 1, 1]] * 3, (1 for _ in range(9)), memoryview(array('f', [1.0] * 9))):
        m.orientation_covariance = [0.0] * 9
        m.orientation_covariance = value
        assert m.orientation_covariance.tolist() == [1.0] * 9


@pytest.mark.parametrize('value', [
    [1.0] * 8, [1.0] * 10, [], [1.0], 5, None, 'nine texts', b'123456789', ['1'] * 9,
    {'a': 1}, np.ones((3, 4)), [1.0] * 8 + ['x'], [[1.0, 2.0], [3.0]]])
def test_an_array_refuses_what_does_not_fit_and_keeps_its_values(value: Any) -> None:
    m = fresh(IMU)
    m.orientation_covariance = [2.0] * 9
    with pytest.raises(LayoutError, match=r'sensor_msgs/msg/Imu\.orientation_covariance'):
        m.orientation_covariance = value
    assert m.orientation_covariance.tolist() == [2.0] * 9


def test_sequences_of_bytes_take_bytes() -> None:
    m = fresh(Layout.compile('sensor_msgs/Image', {'data': 3}))
    m.data = b'abc'
    assert bytes(m.data) == b'abc'
    m.data = bytearray(b'xyz')
    assert m.data.tolist() == [120, 121, 122]
    octets = fresh(Layout.compile('std_msgs/ByteMultiArray', {'data': 2}))
    octets.data = [b'5', b'\xff']
    assert octets.data.tolist() == [53, 255]
    octets.data = b'\1\2'
    assert octets.data.dtype == np.uint8


def test_sequences_of_booleans_are_numpy_booleans() -> None:
    pytest.importorskip('rcl_interfaces')
    m = fresh(Layout.compile('rcl_interfaces/ParameterValue', {'bool_array_value': 2}))
    m.bool_array_value[1] = True
    assert m.bool_array_value.dtype == np.bool_
    assert m.bool_array_value.tolist() == [False, True]


def test_a_tail_of_numbers_takes_each_length_up_to_its_maximum() -> None:
    layout = Layout.compile('sensor_msgs/LaserScan', {'ranges': 1}, tail=4)
    buffer = layout.new_buffer()
    m = layout.view(buffer)
    assert m.intensities.tolist() == []
    for value in ([1.0, 2.0, 3.0, 4.0], [], np.array([5.0]), (6, 7), array('f', [1, 2, 3])):
        m.intensities = value
        assert m.intensities.tolist() == list(value)
        assert layout.length(buffer) == layout.size + 4 * len(value)
    m.intensities[1] = 9
    assert m.intensities.tolist() == [1, 9, 3]
    with pytest.raises(LayoutError, match=r'LaserScan\.intensities.* at most 4 .* 5'):
        m.intensities = [0.0] * 5
    with pytest.raises(LayoutError, match=r'LaserScan\.intensities'):
        m.intensities = 'x'
    assert m.intensities.tolist() == [1, 9, 3]


def test_a_tail_of_bytes_takes_bytes_and_arrays() -> None:
    layout = Layout.compile('sensor_msgs/CompressedImage', {'format': 'jpeg'}, tail=10)
    buffer = layout.new_buffer()
    m = layout.view(buffer)
    for value in (b'abc', bytearray(b'abc'), memoryview(b'abc'), np.frombuffer(b'abc', 'u1'),
                  [97, 98, 99]):
        m.data = b''
        m.data = value
        assert bytes(m.data) == b'abc'
    with pytest.raises(LayoutError, match='at most 10 elements and cannot be set to 11'):
        m.data = b'x' * 11
    with pytest.raises(LayoutError, match=r'CompressedImage\.data \(uint8\)'):
        m.data = ['x']


def test_a_tail_of_text_counts_bytes() -> None:
    layout = Layout.compile('std_msgs/String', tail=6)
    buffer = layout.new_buffer()
    m = layout.view(buffer)
    assert m.data == ''
    for text in ('żół', 'abcdef', '', 'x'):
        m.data = text
        assert m.data == text
        assert layout.length(buffer) == 9 + len(text.encode())
    m.data = b'raw'
    assert m.data == 'raw'
    for wrong in ('żółw', 'a\0b', b'\xff', 5.5, None):
        with pytest.raises(LayoutError, match=r'std_msgs/msg/String\.data'):
            m.data = wrong
    assert m.data == 'raw'


def test_read_only_bytes_give_a_read_only_view() -> None:
    layout = Layout.compile('sensor_msgs/LaserScan', {'ranges': 1}, tail=4)
    m = layout.view(layout.from_dict({'intensities': [1.0, 2.0]}))
    assert m.intensities.tolist() == [1, 2]
    for field, value in (('angle_min', 1.0), ('ranges', [1.0]), ('intensities', [1.0]),
                         ('header', (1, 2, ''))):
        with pytest.raises(LayoutError, match=r'read-only bytes; copy them'):
            setattr(m, field, value)
    text = Layout.compile('std_msgs/String', tail=4)
    with pytest.raises(LayoutError, match='read-only'):
        text.view(text.from_dict({'data': 'abcd'})).data = 'x'
