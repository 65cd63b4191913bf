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

"""Bytes from outside: judged, never trusted, and no reason to raise."""

from __future__ import annotations

import re

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest

from rt_robot_os.base.errors import LayoutError
from rt_robot_os.topics.layout import Layout

pytest.importorskip('sensor_msgs', reason='the ROS 2 message packages are not installed')

IMU = Layout.compile('sensor_msgs/Imu', {'header.frame_id': 'imu_link'})
JOINTS = Layout.compile('sensor_msgs/JointState', {'name': ['left', 'right'], 'position': 2})
IMAGE = Layout.compile('sensor_msgs/Image', {'encoding': 'rgb8'}, tail=12)
TEXT = Layout.compile('std_msgs/String', tail=5)
FLOATS = Layout.compile('std_msgs/Float64MultiArray', tail=3)
BATTERY = Layout.compile('sensor_msgs/BatteryState')
EMPTY = Layout.compile('std_msgs/Empty')
ALL = (IMU, JOINTS, IMAGE, TEXT, FLOATS, BATTERY, EMPTY)


@pytest.mark.parametrize('layout', ALL, ids=repr)
def test_own_bytes_pass_and_every_truncation_is_refused(layout: Layout) -> None:
    data = layout.prototype
    for kind in (bytes, bytearray, memoryview):
        assert layout.check(kind(data)) is None
    for length in range(len(data)):
        reason = layout.check(data[:length])
        assert reason is not None
        assert reason.startswith(layout.type_name)


@pytest.mark.parametrize(('first', 'words'), [
    (b'\0\0', 'big-endian CDR.*little-endian'), (b'\0\3', 'parameter list'),
    (b'\0\7', 'XCDR2'), (b'\xab\xcd', 'ab cd 00 00 is of no known encoding'),
])
def test_other_encapsulations_are_refused_by_name(first: bytes, words: str) -> None:
    reason = IMU.check(first + IMU.prototype[2:])
    assert reason is not None
    assert re.search(words, reason), reason


def test_the_options_of_the_encapsulation_are_not_looked_at() -> None:
    # XTypes lets a sender say there how many bytes of padding follow.
    assert IMU.check(b'\0\1\0\3' + IMU.prototype[4:]) is None


def test_padding_and_a_little_behind_may_be_garbage() -> None:
    data = bytearray(IMU.prototype)
    used = set()
    for field in IMU.fields():
        used.update(range(field.offset, field.offset + field.nbytes))
        if field.count_offset is not None:
            used.update(range(field.count_offset, field.count_offset + 4))
    padding = [place for place in range(4, len(data)) if place not in used]
    assert padding
    for place in padding:
        data[place] = 0xAA
    assert IMU.check(data) is None
    assert IMU.check(bytes(data) + b'\xbb' * 3) is None
    reason = IMU.check(bytes(data) + b'\xbb' * 4)
    assert reason == ('sensor_msgs/msg/Imu: 328 bytes are too long: this message has 324, and up '
                      'to 3 of padding')
    # rclpy returns up to 8 bytes of garbage for each of velocity and effort, which are empty
    assert JOINTS.check(JOINTS.prototype + b'\xbb' * 16) is None
    assert JOINTS.check(JOINTS.prototype + b'\xbb' * 20) is not None


def test_other_texts_and_counts_are_named() -> None:
    other = Layout.compile('sensor_msgs/Imu', {'header.frame_id': 'other'})
    assert IMU.check(other.prototype) == (
        "sensor_msgs/msg/Imu: field 'header.frame_id' is 'other' where this layout has "
        "'imu_link'; declare it with the other string, or send this one")
    three = Layout.compile('sensor_msgs/JointState', {'name': ['left', 'right', 'x']})
    assert "field 'name' has 3 elements where this layout has 2" in str(
        JOINTS.check(three.prototype))
    renamed = Layout.compile('sensor_msgs/JointState', {'name': ['left', 'wrong'], 'position': 2})
    assert "field 'name[1]' is 'wrong'" in str(JOINTS.check(renamed.prototype))
    longer = Layout.compile('sensor_msgs/JointState', {'name': ['left', 'right'], 'position': 9})
    assert "field 'position' has 9 elements" in str(JOINTS.check(longer.prototype))


def test_a_boolean_is_0_or_1() -> None:
    present = next(field for field in BATTERY.fields() if field.name == 'present')
    data = bytearray(BATTERY.prototype)
    for value in (0, 1):
        data[present.offset] = value
        assert BATTERY.check(data) is None
    data[present.offset] = 2
    assert "'present' is a boolean" in str(BATTERY.check(data))


def test_tails_are_judged_by_their_count() -> None:
    data = IMAGE.from_dict({'data': [1] * 12})
    assert IMAGE.check(data) is None
    assert IMAGE.length(data) == IMAGE.max_size
    assert "end within field 'data'" in str(IMAGE.check(data[:-1]))
    more = Layout.compile('sensor_msgs/Image', {'encoding': 'rgb8'}, tail=13)
    large = more.from_dict({'data': [1] * 13})
    assert "field 'data' has 13 elements; the tail of this layout holds at most 12" in str(
        IMAGE.check(large))
    with pytest.raises(LayoutError, match='tail of 12'):
        IMAGE.length(large)
    text = Layout.compile('std_msgs/String', {'data': 'sixsix'}).prototype
    assert 'at most 5' in str(TEXT.check(text))
    assert TEXT.check(Layout.compile('std_msgs/String', {'data': 'five5'}).prototype) is None


def test_a_text_needs_its_nul() -> None:
    assert 'the length counts the NUL' in str(TEXT.check(b'\0\1\0\0\0\0\0\0'))
    assert 'not terminated by a NUL' in str(TEXT.check(b'\0\1\0\0\2\0\0\0ab'))
    assert TEXT.check(b'\0\1\0\0\2\0\0\0a\0') is None


@settings(max_examples=150, deadline=None)
@given(st.sampled_from(ALL), st.binary(max_size=400))
def test_no_bytes_make_check_raise(layout: Layout, data: bytes) -> None:
    for candidate in (data, b'\0\1\0\0' + data):
        reason = layout.check(candidate)
        assert reason is None or reason.startswith(layout.type_name)


@settings(max_examples=150, deadline=None)
@given(st.sampled_from(ALL), st.data())
def test_mutated_messages_are_refused_or_read(layout: Layout, choose: st.DataObject) -> None:
    data = bytearray(layout.prototype)
    for _ in range(choose.draw(st.integers(1, 3))):
        data[choose.draw(st.integers(0, len(data) - 1))] = choose.draw(st.integers(0, 255))
    data += choose.draw(st.binary(max_size=20))
    if layout.check(data) is None:
        assert layout.length(data) <= min(len(data), layout.max_size)
        plain = layout.to_dict(data)
        # Texts up to a NUL, and replaced characters, may need fewer or more bytes than there were.
        if layout is not TEXT:
            assert repr(layout.to_dict(layout.from_dict(plain))) == repr(plain)
