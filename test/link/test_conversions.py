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

"""Messages that ROS has in another type: the bytes are those that others write and read."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from rt_robot_os.link.conversions import check_pose
from rt_robot_os.link.conversions import from_path
from rt_robot_os.link.conversions import to_path
from rt_robot_os.link.conversions import to_transforms
from rt_robot_os.link.conversions import transform
from rt_robot_os.link.conversions import transforms_of
from rt_robot_os.topics import Layout

rosbags = pytest.importorskip('rosbags.typesys', reason='rosbags is not installed')

STORE = rosbags.get_typestore(rosbags.Stores.ROS2_JAZZY)
TYPES = STORE.types
WALL_NS = 1_700_000_000_123_456_789
ROOM = 20 + 8 * 3 * 100

COORDINATES = st.floats(-1e6, 1e6)
POSES = st.lists(st.tuples(COORDINATES, COORDINATES, st.floats(-3.1, 3.1)), max_size=12)
FRAMES = st.text('abcdefgh_/\u00e4', min_size=1, max_size=20)


def read(cdr: bytes, message: str) -> Any:
    return STORE.deserialize_cdr(cdr, message)


def written(message: Any) -> bytes:
    return bytes(STORE.serialize_cdr(message, message.__msgtype__))


def header(frame_id: str) -> Any:
    stamp = TYPES['builtin_interfaces/msg/Time'](*divmod(WALL_NS, 1_000_000_000))
    return TYPES['std_msgs/msg/Header'](stamp, frame_id)


def pose(x: float, y: float, quaternion: Sequence[float]) -> Any:
    return TYPES['geometry_msgs/msg/Pose'](
        TYPES['geometry_msgs/msg/Point'](x, y, 0.0),
        TYPES['geometry_msgs/msg/Quaternion'](*quaternion))


def turned(yaw: float) -> Sequence[float]:
    return 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)


def path(poses: Sequence[Sequence[float]], frame_id: str = 'map', own: str = '') -> bytes:
    stamped = TYPES['geometry_msgs/msg/PoseStamped']
    return written(TYPES['nav_msgs/msg/Path'](header(frame_id), [
        stamped(header(own), pose(x, y, turned(yaw))) for x, y, yaw in poses]))


def numbers(values: Sequence[float]) -> bytes:
    layout = TYPES['std_msgs/msg/MultiArrayLayout']([], 0)
    return written(TYPES['std_msgs/msg/Float64MultiArray'](layout, np.array(values, float)))


# ---- transforms ------------------------------------------------------------------------------

@given(FRAMES, FRAMES, st.tuples(*[COORDINATES] * 7))
def test_a_transform_of_the_core_is_read_as_a_list_of_one(
        frame_id: str, child: str, values: tuple[float, ...]) -> None:
    one = bytes((0, 1, 0, 0)) + transform(frame_id, child, values, 5)
    assert read(one, 'geometry_msgs/msg/TransformStamped').child_frame_id == child
    found = read(to_transforms()(memoryview(one), WALL_NS), 'tf2_msgs/msg/TFMessage').transforms
    assert [(each.header, each.child_frame_id) for each in found] == [(header(frame_id), child)]
    move, turn = found[0].transform.translation, found[0].transform.rotation
    assert (move.x, move.y, move.z, turn.x, turn.y, turn.z, turn.w) == values


@given(st.lists(st.tuples(FRAMES, FRAMES, COORDINATES), max_size=5))
def test_many_transforms_are_the_bytes_that_others_write(
        rows: list[tuple[str, str, float]]) -> None:
    found = transforms_of([transform(a, b, (x, 0, 0, 0, 0, 0, 1), WALL_NS) for a, b, x in rows])
    message = read(found, 'tf2_msgs/msg/TFMessage')
    assert [(each.header.frame_id, each.child_frame_id, each.transform.translation.x)
            for each in message.transforms] == rows
    again = read(written(message), 'tf2_msgs/msg/TFMessage')
    assert again == message and len(written(message)) == len(found)


# ---- paths -----------------------------------------------------------------------------------

@given(POSES, FRAMES)
def test_a_way_is_read_as_a_path_in_its_frame(poses: list[Any], frame_id: str) -> None:
    row = [each for one in poses for each in one]
    found = read(to_path(frame_id)(memoryview(numbers(row)), WALL_NS), 'nav_msgs/msg/Path')
    assert found.header == header(frame_id)
    assert all(each.header == found.header for each in found.poses)
    assert [(p.pose.position.x, p.pose.position.y,
             pytest.approx(2 * math.atan2(p.pose.orientation.z, p.pose.orientation.w), abs=1e-9))
            for p in found.poses] == poses


@given(POSES, st.sampled_from(['', 'map']))
def test_a_path_becomes_the_row_of_numbers_that_it_was(poses: list[Any], own: str) -> None:
    found = from_path('map', ROOM)(path(poses, own=own))
    data = read(found, 'std_msgs/msg/Float64MultiArray').data
    assert list(data) == pytest.approx([each for one in poses for each in one], abs=1e-9)


@pytest.mark.parametrize('count', [0, 1, 100])
def test_a_topic_of_the_core_takes_a_path(count: int) -> None:
    pytest.importorskip('std_msgs.msg', reason='the ROS 2 messages are not installed')
    layout = Layout.compile('std_msgs/msg/Float64MultiArray', tail=300)
    found = from_path('map', layout.max_size)(path([(1.0, 2.0, 0.5)] * count))
    assert layout.check(found) is None
    assert layout.length(found) == len(found)
    buffer = layout.new_buffer()
    buffer[:len(found)] = found
    assert list(layout.view(buffer).data) == pytest.approx([1.0, 2.0, 0.5] * count)


@pytest.mark.parametrize(('cdr', 'problem'), [
    (path([(0, 0, 0)], 'odom'),
     "frame_id 'odom': it must be 'map'; transform it to that frame first"),
    (path([(0, 0, 0)], ''), "frame_id '': it must be 'map'"),
    (path([(0, 0, 0), (1, 0, 0)], own='odom'), "pose 0 frame_id 'odom': it must be 'map'"),
    (path([(0, math.nan, 0)]), 'pose 0 has a number that is not finite'),
    (path([(0, 0, 0), (math.inf, 0, 0)]), 'pose 1 has a number that is not finite'),
    (path([(0, 0, 0)] * 101), '101 poses, and the topic of the core can hold 100'),
    (path([(0, 0, 0)])[:-60], 'bytes end within the message'),
    (bytes((0, 0, 0, 0)), 'the encapsulation 00 00 00 00 is not that of little-endian CDR')])
def test_a_path_that_must_not_pass_is_refused(cdr: bytes, problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        from_path('map', ROOM)(cdr)


@given(st.binary(max_size=300), st.integers(0, 300))
def test_no_bytes_do_more_than_be_refused(noise: bytes, at: int) -> None:
    whole = path([(1.0, 2.0, 0.5)] * 3)
    for cdr in (b'\x00\x01\x00\x00' + noise, whole[:at] + noise + whole[at + len(noise):]):
        for convert in (from_path('map', ROOM), check_pose('map', ROOM)):
            try:
                found = convert(cdr)
            except ValueError:
                continue
            assert len(found) <= max(ROOM, len(cdr))


# ---- goals -----------------------------------------------------------------------------------

def goal(quaternion: Sequence[float], frame_id: str = 'map', x: float = 1.0) -> bytes:
    return written(TYPES['geometry_msgs/msg/PoseStamped'](header(frame_id),
                                                          pose(x, 2.0, quaternion)))


@given(st.floats(-3.1, 3.1), st.floats(0.1, 10.0))
def test_a_goal_passes_with_a_quaternion_of_length_1(yaw: float, length: float) -> None:
    found = read(check_pose('map', 0)(goal([length * each for each in turned(yaw)])),
                 'geometry_msgs/msg/PoseStamped')
    assert found.header == header('map') and found.pose.position.x == 1.0
    turn = found.pose.orientation
    assert (turn.x, turn.y, turn.z, turn.w) == pytest.approx(turned(yaw), abs=1e-9)


def test_an_initial_pose_keeps_its_covariance() -> None:
    estimate = TYPES['geometry_msgs/msg/PoseWithCovariance'](
        pose(1.0, 2.0, (0.0, 0.0, 2.0, 0.0)), np.arange(36.0))
    found = read(check_pose('map', 0)(written(
        TYPES['geometry_msgs/msg/PoseWithCovarianceStamped'](header('map'), estimate))),
        'geometry_msgs/msg/PoseWithCovarianceStamped')
    assert list(found.pose.covariance) == list(range(36))
    assert found.pose.pose.orientation.z == 1.0


def test_a_topic_that_names_no_frame_is_told_what_to_do() -> None:
    with pytest.raises(ValueError, match="frame_id 'map': .* declare it with fixed: {header.fr"):
        check_pose('', 0)(goal((0, 0, 0, 1)))


@pytest.mark.parametrize(('cdr', 'problem'), [
    (goal((0, 0, 0, 1), 'base_link'), "frame_id 'base_link': it must be 'map'"),
    (goal((0, 0, 0, 0)), 'it has a quaternion of length 0: it must be 1'),
    (goal((0, 0, 0, 1), x=math.nan), 'it has a number that is not finite'),
    (goal((0, 0, math.inf, 1)), 'it has a number that is not finite')])
def test_a_goal_that_must_not_pass_is_refused(cdr: bytes, problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        check_pose('map', 0)(cdr)
