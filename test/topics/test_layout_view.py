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

"""What a robot programmer does with a message view."""

from __future__ import annotations

from typing import Any

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import numpy as np
import pytest

from rt_robot_os.base.errors import LayoutError
from rt_robot_os.topics.layout import Layout

pytest.importorskip('sensor_msgs', reason='the ROS 2 message packages are not installed')

FLAT = Layout.compile('geometry_msgs/PoseStamped', {'header.frame_id': 'map'})
IMU = Layout.compile('sensor_msgs/Imu', {'header.frame_id': 'imu_link'})
DIAGNOSTICS = Layout.compile('diagnostic_msgs/DiagnosticArray', {'status': [
    {'name': 'a', 'values': [{'key': 'k', 'value': 'v'}]}, {'name': 'b'}]})


def fresh(layout: Layout) -> Any:
    return layout.view(layout.new_buffer())


def test_numbers_are_read_and_written_by_the_names_of_the_message() -> None:
    m = fresh(IMU)
    m.angular_velocity.x = 0.1
    m.header.stamp.sec = -2 ** 31
    m.header.stamp.nanosec += 7
    assert (m.angular_velocity.x, m.header.stamp.sec, m.header.stamp.nanosec) == (
        0.1, -2 ** 31, 7)
    m.angular_velocity.x = 3  # a whole number is fine
    assert m.angular_velocity.x == 3.0
    m.angular_velocity.x = np.float32(0.5)
    assert m.angular_velocity.x == 0.5


def test_a_view_follows_its_buffer() -> None:
    buffer = IMU.new_buffer()
    m = IMU.view(buffer)
    vector = m.angular_velocity
    other = IMU.new_buffer()
    IMU.view(other).angular_velocity = (1, 2, 3)
    buffer[:] = other
    assert tuple(vector) == (1, 2, 3)


def test_a_nested_message_is_unpacked_and_assigned_at_once() -> None:
    m = fresh(IMU)
    m.angular_velocity = (0.1, 0.2, 0.3)
    x, y, z = m.angular_velocity
    assert (x, y, z) == (0.1, 0.2, 0.3)
    for value in ([1, 2, 3], np.array([1, 2, 3]), (v for v in (1, 2, 3)),
                  {'x': 1, 'y': 2, 'z': 3}):
        m.angular_velocity = (0, 0, 0)
        m.angular_velocity = value
        assert tuple(m.angular_velocity) == (1, 2, 3)
    m.linear_acceleration = m.angular_velocity
    assert tuple(m.linear_acceleration) == (1, 2, 3)
    assert np.array(m.linear_acceleration).tolist() == [1, 2, 3]
    assert np.asarray(m.linear_acceleration, 'f4').dtype == np.float32


def test_a_nested_message_is_assigned_by_leaves_or_by_fields() -> None:
    m = fresh(FLAT)
    m.pose = (1, 2, 3, 0, 0, 0, 1)
    assert tuple(m.pose) == (1, 2, 3, 0, 0, 0, 1)
    m.pose = ((4, 5, 6), (0, 1, 0, 0))
    assert tuple(m.pose) == (4, 5, 6, 0, 1, 0, 0)
    m.pose = {'position': {'z': 9}}
    assert tuple(m.pose.position) == (4, 5, 9)
    m.header = (7, 8, 'map')
    assert tuple(m.header) == (7, 8, 'map')
    assert tuple(m) == (7, 8, 'map', 4, 5, 9, 0, 1, 0, 0)


def test_a_ros_message_is_assigned_whole() -> None:
    from geometry_msgs.msg import PoseStamped
    from geometry_msgs.msg import PoseWithCovariance
    message = PoseStamped()
    message.header.frame_id = 'map'
    message.header.stamp.sec = 4
    message.pose.position.y = 2.5
    m = fresh(FLAT)
    m.pose = message.pose
    m.header = message.header
    assert (m.header.stamp.sec, m.pose.position.y, m.pose.orientation.w) == (4, 2.5, 1.0)
    odometry = fresh(Layout.compile('nav_msgs/Odometry'))
    pose = PoseWithCovariance()
    pose.covariance[35] = 4.0
    odometry.pose = pose
    assert odometry.pose.covariance[35] == 4.0
    odometry.pose.pose = m.pose
    assert odometry.pose.pose.position.y == 2.5


@pytest.mark.parametrize(('value', 'words'), [
    ((1, 2), ['Vector3', '2 values', '3']), ((1, 2, 3, 4), ['4 values', 'x, y, z']),
    (5, ['Vector3', '5', 'in order']), ('abc', ["'abc'"]), (None, ['None']),
    ((1, 2, 'x'), ['Vector3.z', 'double', "'x'"]), ({'x': 1, 'w': 2}, ["'w'", 'x, y, z']),
    (fresh(FLAT).pose, ['Vector3', 'x, y, z']), ({5: 1}, ['5']),
])
def test_a_nested_message_refuses_what_does_not_fit(value: Any, words: list[str]) -> None:
    m = fresh(IMU)
    with pytest.raises(LayoutError) as caught:
        m.angular_velocity = value
    assert all(word in str(caught.value) for word in words), str(caught.value)


@pytest.mark.parametrize('value', ['1', None, [1.0], object()])
def test_a_number_refuses_other_kinds(value: Any) -> None:
    m = fresh(IMU)
    with pytest.raises(LayoutError, match=r'geometry_msgs/msg/Vector3\.x \(double\) cannot be'):
        m.angular_velocity.x = value
    with pytest.raises(LayoutError, match=r'builtin_interfaces/msg/Time\.sec \(int32\)'):
        m.header.stamp.sec = value


@pytest.mark.parametrize(('kind', 'low', 'high'), [
    ('Int8', -128, 127), ('UInt8', 0, 255), ('Int16', -2 ** 15, 2 ** 15 - 1),
    ('UInt16', 0, 2 ** 16 - 1), ('Int32', -2 ** 31, 2 ** 31 - 1), ('UInt32', 0, 2 ** 32 - 1),
    ('Int64', -2 ** 63, 2 ** 63 - 1), ('UInt64', 0, 2 ** 64 - 1),
])
def test_whole_numbers_hold_their_range_and_no_more(kind: str, low: int, high: int) -> None:
    m = fresh(Layout.compile(f'std_msgs/{kind}'))
    for value in (low, high):
        m.data = value
        assert m.data == value
    for value in (low - 1, high + 1, 0.5):
        with pytest.raises(LayoutError, match=kind):
            m.data = value
        assert m.data == high


def test_booleans_and_octets_are_as_in_ros_messages() -> None:
    flag = fresh(Layout.compile('std_msgs/Bool'))
    assert flag.data is False
    flag.data = True
    assert flag.data is True
    level = fresh(Layout.compile('std_msgs/Byte'))
    assert level.data == b'\0'
    level.data = b'\2'
    assert level.data == b'\2'
    level.data = 255
    assert level.data == b'\xff'
    for value in (256, b'ab', 'a', 1.5):
        with pytest.raises(LayoutError, match=r'Byte\.data \(octet\)'):
            level.data = value


def test_an_unknown_attribute_is_an_attribute_error_with_the_type() -> None:
    m = fresh(IMU)
    with pytest.raises(AttributeError, match='sensor_msgs/msg/Imu.*angular_velocty'):
        m.angular_velocty = (1, 2, 3)
    with pytest.raises(AttributeError, match='geometry_msgs/msg/Vector3.*w'):
        m.angular_velocity.w = 1
    with pytest.raises(AttributeError, match='sensor_msgs/msg/Imu.*acceleration'):
        m.acceleration


def test_texts_are_fixed_at_declaration() -> None:
    m = fresh(Layout.compile('sensor_msgs/JointState', {
        'header.frame_id': 'base', 'name': ['left', 'right'], 'position': 2}))
    assert m.name[0] == 'left'
    assert m.name[-1] == 'right'
    assert list(m.name) == ['left', 'right']
    m.name[0] = 'left'
    m.name = ['left', 'right']
    m.header.frame_id = 'base'
    with pytest.raises(LayoutError, match=r"JointState.name\[1\] is fixed at decl.*'right'.*'x'"):
        m.name[1] = 'x'
    with pytest.raises(LayoutError, match=r'JointState.name\[0\] is fixed at declaration'):
        m.name = ['x', 'right']
    with pytest.raises(LayoutError, match='fixed number of elements: 2 .* 1 values'):
        m.name = ['left']
    with pytest.raises(LayoutError, match='fixed number of elements'):
        m.name = 'left'
    with pytest.raises(LayoutError, match="Header.frame_id is fixed at declaration as 'base'"):
        m.header.frame_id = 'odom'
    with pytest.raises(IndexError):
        m.name[2] = 'x'


def test_sequences_of_messages_are_indexed_and_assigned() -> None:
    m = fresh(DIAGNOSTICS)
    m.status[0].level = b'\2'
    m.status[1].level = 1
    assert m.status[0].values[0].key == 'k'
    assert [status.name for status in m.status] == ['a', 'b']
    assert [status.level for status in m.status] == [b'\2', b'\1']
    m.status[1] = {'level': 3}
    assert m.status[1].level == b'\3'
    path = fresh(Layout.compile('nav_msgs/Path', {'poses': 3}))
    path.poses[2].pose.position = (1, 2, 3)
    path.poses[0] = path.poses[2]
    path.poses[1:] = [path.poses[0]] * 2
    assert [tuple(pose.pose.position) for pose in path.poses] == [(1, 2, 3)] * 3
    with pytest.raises(LayoutError, match='Path.poses has a fixed number of elements'):
        path.poses = []
    with pytest.raises(LayoutError, match='PoseStamped cannot be set to 5'):
        path.poses[0] = 5


def test_equal_elements_far_apart_do_not_share_bytes() -> None:
    layout = Layout.compile('geometry_msgs/PolygonStamped', {
        'header.frame_id': 'odd', 'polygon.points': 5})
    m = fresh(layout)
    for index, point in enumerate(m.polygon.points):
        point.x, point.y, point.z = index, index + 0.5, -index
    assert [tuple(p) for p in m.polygon.points] == [(i, i + 0.5, -i) for i in range(5)]


def test_a_short_buffer_is_refused_and_a_larger_one_is_fine() -> None:
    with pytest.raises(LayoutError, match='a buffer of 323 bytes is too short .* 324'):
        IMU.view(bytearray(323))
    m = IMU.view(bytearray(IMU.prototype + b'more'))
    m.orientation.w = 0.5
    assert m.orientation.w == 0.5


def test_repr_shows_the_values() -> None:
    m = fresh(FLAT)
    m.pose.position.x = 1.5
    assert repr(m.pose.position) == 'Point(x=1.5, y=0.0, z=0.0)'
    assert "frame_id='map'" in repr(m)
    laser = fresh(Layout.compile('sensor_msgs/LaserScan', {'ranges': 682}))
    assert len(repr(laser)) < 500
    assert "DiagnosticStatus(level=b'\\x00', name='a'" in repr(fresh(DIAGNOSTICS))


def test_dictionaries_go_in_and_come_out() -> None:
    values = DIAGNOSTICS.to_dict(DIAGNOSTICS.prototype)
    assert values['status'][0] == {'level': 0, 'name': 'a', 'message': '', 'hardware_id': '',
                                   'values': [{'key': 'k', 'value': 'v'}]}
    values['status'][1]['level'] = 2
    data = DIAGNOSTICS.from_dict(values)
    assert DIAGNOSTICS.view(data).status[1].level == b'\2'
    assert DIAGNOSTICS.to_dict(DIAGNOSTICS.view(data)) == values
    assert IMU.from_dict({}) == IMU.prototype
    empty = Layout.compile('std_msgs/Empty')
    assert empty.to_dict(empty.from_dict({})) == {}
    for wrong, words in (({'heder': 1}, "did you mean 'header'"), (5, 'give a mapping'),
                         ({'header': {'frame_id': 'x'}}, 'fixed at declaration'),
                         ({'orientation': {'w': 'x'}}, 'Quaternion.w')):
        with pytest.raises(LayoutError, match=words):
            IMU.from_dict(wrong)  # type: ignore[arg-type]


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(), min_size=7, max_size=7), st.lists(st.floats(width=32), max_size=8))
def test_what_is_written_is_read_back(pose: list[float], tail: list[float]) -> None:
    m = fresh(FLAT)
    m.pose = pose
    assert np.array_equal(tuple(m.pose), pose, equal_nan=True)
    layout = Layout.compile('std_msgs/Float32MultiArray', tail=8)
    data = layout.from_dict({'data': tail})
    assert np.array_equal(layout.view(data).data, np.array(tail, 'f4'), equal_nan=True)
    assert layout.length(data) == len(data)
