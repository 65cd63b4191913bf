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

"""Markers of a sensor network: the bytes are those that RViz and Foxglove read."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Any

from hypothesis import assume
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest

from rt_robot_os.features.wsn.network_markers import LIFETIME_S
from rt_robot_os.link.drawings import to_markers
from rt_robot_os.messages.marker_array import LINE_LIST
from rt_robot_os.messages.marker_array import MARKERS
from rt_robot_os.messages.network_rows import names_label
from rt_robot_os.messages.network_rows import NodeRow
from rt_robot_os.messages.network_rows import NodeState
from rt_robot_os.messages.network_rows import WIDTH
from rt_robot_os.topics import Layout

rosbags = pytest.importorskip('rosbags.typesys', reason='rosbags is not installed')

STORE = rosbags.get_typestore(rosbags.Stores.ROS2_JAZZY)
WALL_NS = 1_700_000_000_123_456_789
NAN = math.nan
SINK = NodeRow(0, 1.0, 2.0, 0.3, 0.0, -1, 0, 0, NodeState.SINK, *[NAN] * 4, 0, 0, 0, 0, 0.1)
HALL = NodeRow(1, 3.0, 1.5, 2.2, 0.0, 0, 1, 420, NodeState.GOOD, 2.81, 90.0, 0.98, 1.0, 98, 2, 0,
               0, 0.5)
FAR = NodeRow(7, 6.0, 2.0, 1.0, 1.5, 1, 2, 900, NodeState.SILENT, NAN, NAN, NAN, NAN, 5, 0, 0, 0,
              42.0)
LOST = FAR._replace(id=9, x=NAN, y=NAN, z=NAN, stddev_m=NAN)


def sample(rows: Sequence[Sequence[float]], label: str = '') -> memoryview:
    """Return rows as the topic of the core has them."""
    layout = Layout.compile('std_msgs/msg/Float64MultiArray', {'layout.dim': [{'label': label}]},
                            tail=100 * WIDTH)
    buffer = layout.new_buffer()
    layout.view(buffer).data = [number for row in rows for number in row]
    return buffer[:layout.length(buffer)]


def shown(cdr: bytes) -> dict[tuple[str, int], Any]:
    """Return the markers of a message by namespace and number."""
    message = STORE.deserialize_cdr(cdr, MARKERS)
    # What others would write of it is the same: no byte is read in a wrong place.
    assert bytes(STORE.serialize_cdr(message, MARKERS)) == cdr
    return {(each.ns, each.id): each for each in message.markers}


def test_nodes_have_spheres_labels_and_lines_to_their_parents() -> None:
    found = shown(to_markers('map')(sample(
        [SINK, HALL, FAR, LOST], names_label({1: 'hall', 7: 'far'})), WALL_NS))
    assert set(found) == {
        *((kind, number) for kind in ('nodes', 'labels') for number in (0, 1, 7)),
        ('uncertainty', 7), ('links', 0)}
    sphere = found['nodes', 1]
    assert (sphere.pose.position.x, sphere.pose.position.y, sphere.pose.position.z) == (
        3.0, 1.5, 2.2)
    assert sphere.pose.orientation.w == 1.0 and sphere.header.frame_id == 'map'
    assert (sphere.header.stamp.sec, sphere.header.stamp.nanosec) == divmod(WALL_NS, 10 ** 9)
    assert sphere.color.g > sphere.color.r and sphere.lifetime.sec == LIFETIME_S
    assert found['labels', 1].text == 'hall\n2.81 V 98 %'
    assert found['labels', 7].text == 'far\nsilent 42 s' and found['labels', 0].text == 'sink'
    assert found['nodes', 7].color.r > 0.8 and found['nodes', 7].color.a == 0.5
    assert found['uncertainty', 7].scale.x == 3.0
    lines = found['links', 0]
    # A node that is silent has no line.
    assert lines.type == LINE_LIST and len(lines.points) == len(lines.colors) == 2
    assert (lines.points[0].x, lines.points[1].x) == (3.0, 1.0) and lines.scale.x > 0.0


def test_what_vanished_is_deleted_once() -> None:
    convert = to_markers('map')
    convert(sample([SINK, HALL, FAR]), WALL_NS)
    found = shown(convert(sample([SINK, HALL]), WALL_NS))
    gone = {key for key, each in found.items() if each.action == 2}
    assert gone == {('nodes', 7), ('labels', 7), ('uncertainty', 7)}
    assert not any(each.action == 2 for each in shown(
        convert(sample([SINK, HALL]), WALL_NS)).values())


def test_a_network_without_links_has_no_empty_list_of_lines() -> None:
    assert ('links', 0) not in shown(to_markers('map')(sample([SINK]), WALL_NS))


def test_each_mirror_deletes_its_own() -> None:
    one, other = to_markers('map'), to_markers('map')
    one(sample([SINK, HALL]), WALL_NS)
    assert all(each.action == 0 for each in shown(other(sample([SINK]), WALL_NS)).values())


@settings(max_examples=40)
@given(st.lists(st.lists(st.floats(width=32) | st.sampled_from((0.0, 1.0, 6.0)),
                         min_size=WIDTH, max_size=WIDTH), max_size=6),
       st.text('abc=1 2\u00e4\n', max_size=20))
def test_any_numbers_give_a_message(rows: list[list[float]], label: str) -> None:
    assume(not rows or rows[0][0] != -1.0)  # the graph of a map begins so
    convert = to_markers('map')
    for _ in range(2):
        shown(convert(sample(rows, label), WALL_NS))
