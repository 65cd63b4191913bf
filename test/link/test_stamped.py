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

"""Headers go off and on as ROS 2 itself writes them, whatever bytes come."""

from __future__ import annotations

from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import pytest

pytest.importorskip('rclpy', reason='rclpy is not installed')

from rclpy.serialization import deserialize_message  # noqa: E402
from rclpy.serialization import serialize_message  # noqa: E402
from rt_robot_os.link.stamped_messages import HeaderWriter  # noqa: E402
from rt_robot_os.link.stamped_messages import STAMPED_BYTES  # noqa: E402
from rt_robot_os.link.stamped_messages import stamped_type  # noqa: E402
from rt_robot_os.link.stamped_messages import take_off  # noqa: E402
from rt_robot_os.topics import Layout  # noqa: E402
from rt_robot_os.topics.resolve import message_class  # noqa: E402

BODY = {'Accel': 'accel', 'Point': 'point', 'Pose': 'pose', 'Quaternion': 'quaternion',
        'Twist': 'twist', 'Vector3': 'vector', 'Wrench': 'wrench'}
FRAME_IDS = st.text(st.characters(exclude_characters='\0', exclude_categories=['Cs']), max_size=40)


def filled(message: str) -> Any:
    """Give a message whose numbers are all different."""
    numbers = iter(range(1, 20))

    def fill(part: Any) -> Any:
        for name, kind in part.get_fields_and_field_types().items():
            if kind == 'double':
                setattr(part, name, float(next(numbers)))
            else:
                fill(getattr(part, name))
        return part

    return fill(message_class(message)())


@pytest.mark.parametrize('message', STAMPED_BYTES)
@given(frame_id=FRAME_IDS, seconds=st.integers(0, 2 ** 31 - 1),
       nanoseconds=st.integers(0, 10 ** 9 - 1))
def test_there_and_back_agrees_with_rclpy(
        message: str, frame_id: str, seconds: int, nanoseconds: int) -> None:
    kind = message_class(stamped_type(message))
    body = filled(message)
    whole = kind()
    whole.header.frame_id = frame_id
    whole.header.stamp.sec, whole.header.stamp.nanosec = seconds, nanoseconds
    setattr(whole, BODY[message.rpartition('/')[2]], body)
    stamp_ns, bare = take_off(serialize_message(whole), STAMPED_BYTES[message])
    assert stamp_ns == seconds * 10 ** 9 + nanoseconds
    assert Layout.compile(message).check(memoryview(bare)) is None
    assert deserialize_message(bare, type(body)) == body
    again = HeaderWriter(frame_id).put_on(memoryview(bare), stamp_ns)
    assert deserialize_message(again, kind) == whole


@given(data=st.binary(max_size=120), good=st.booleans())
def test_bytes_that_are_no_message_are_refused_and_nothing_else_is_raised(
        data: bytes, good: bool) -> None:
    data = b'\x00\x01\x00\x00' + data if good else data
    try:
        _, bare = take_off(data, 48)
    except ValueError as error:
        assert str(error)
    else:
        assert len(bare) == 52
