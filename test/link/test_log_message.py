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

"""Reports as ROS logs them: the bytes are those that others read."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import pytest

from rt_robot_os.link.log_message import LOG
from rt_robot_os.link.log_message import log_message
from rt_robot_os.link.log_message import logger_name
from rt_robot_os.link.log_message import nearest_severity

rosbags = pytest.importorskip('rosbags.typesys', reason='rosbags is not installed')

STORE = rosbags.get_typestore(rosbags.Stores.ROS2_JAZZY)
TEXTS = st.text(st.characters(exclude_categories=('Cs', 'Cc')), max_size=40)


@given(st.integers(0, 2**31 * 10**9 - 1), st.sampled_from((10, 20, 30, 40, 50)), TEXTS, TEXTS)
def test_a_message_is_read_back(wall_ns: int, severity: int, name: str, text: str) -> None:
    cdr = log_message(wall_ns, severity, name, text)
    found = STORE.deserialize_cdr(cdr, LOG)
    assert found.stamp.sec * 10**9 + found.stamp.nanosec == wall_ns
    assert (found.level, found.name, found.msg) == (severity, name, text)
    assert (found.file, found.function, found.line) == ('', '', 0)
    assert bytes(STORE.serialize_cdr(found, LOG)) == cdr


def test_a_part_of_the_core_has_a_logger_below_the_nodes() -> None:
    assert logger_name('arm.robot', 'device/left imu') == 'arm.robot.device.left_imu'
    assert logger_name('robot', '') == 'robot.core'


def test_a_severity_that_ros_does_not_have_is_the_nearest() -> None:
    assert [int(nearest_severity(each)) for each in (-5, 21, 36, 999)] == [10, 20, 40, 50]
