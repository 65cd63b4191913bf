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

"""The graph of a map: as a row of numbers, and as the markers that RViz and Foxglove read."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Any

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest

from rt_robot_os.features.mapping.graph_markers import EdgeKind
from rt_robot_os.features.mapping.graph_markers import graph_numbers
from rt_robot_os.features.mapping.graph_markers import graph_of
from rt_robot_os.features.mapping.graph_markers import NODES_MOST
from rt_robot_os.features.mapping.graph_markers import NUMBERS_MOST
from rt_robot_os.link.drawings import to_markers
from rt_robot_os.messages.marker_array import LINE_LIST
from rt_robot_os.messages.marker_array import MARKERS
from rt_robot_os.messages.marker_array import SPHERE_LIST
from rt_robot_os.topics import Layout

rosbags = pytest.importorskip('rosbags.typesys', reason='rosbags is not installed')

STORE = rosbags.get_typestore(rosbags.Stores.ROS2_JAZZY)
LAYOUT = Layout.compile('std_msgs/msg/Float64MultiArray', {}, tail=NUMBERS_MOST)
WALL_NS = 1_700_000_000_123_456_789
POINTS = [(0.0, 0.0), (1.0, 0.5), (2.0, 0.5), (0.1, -0.1)]
EDGES = [(0, 1, EdgeKind.NEIGHBOUR), (1, 2, EdgeKind.NEIGHBOUR), (2, 3, EdgeKind.NEIGHBOUR),
         (0, 3, EdgeKind.LOOP), (2, 2, EdgeKind.FIX)]


def sample(numbers: Sequence[float]) -> memoryview:
    """Return a row of numbers as the topic of the core has it."""
    buffer = LAYOUT.new_buffer()
    LAYOUT.view(buffer).data = numbers
    return buffer[:LAYOUT.length(buffer)]


def shown(cdr: bytes) -> dict[str, Any]:
    """Return the markers of a message by namespace."""
    message = STORE.deserialize_cdr(cdr, MARKERS)
    assert bytes(STORE.serialize_cdr(message, MARKERS)) == cdr
    return {each.ns: each for each in message.markers}


def test_loops_have_another_colour_than_the_way() -> None:
    found = shown(to_markers('map')(sample(graph_numbers(POINTS, EDGES)), WALL_NS))
    assert set(found) == {'keyframes', 'fixes', 'edges', 'loops'}
    assert found['keyframes'].type == SPHERE_LIST and len(found['keyframes'].points) == 3
    assert [(each.x, each.y) for each in found['fixes'].points] == [(2.0, 0.5)]
    assert found['edges'].type == LINE_LIST and len(found['edges'].points) == 6
    assert [(each.x, each.y) for each in found['loops'].points] == [(0.0, 0.0), (0.1, -0.1)]
    assert found['loops'].color.r > 0.8 > found['edges'].color.r
    assert found['loops'].header.frame_id == 'map'
    # A robot that stands publishes no new graph: it stays in sight.
    assert all(each.lifetime.sec == each.lifetime.nanosec == 0 for each in found.values())


def test_a_map_that_was_reset_takes_its_markers_away() -> None:
    convert = to_markers('map')
    convert(sample(graph_numbers(POINTS, EDGES)), WALL_NS)
    found = shown(convert(sample(graph_numbers([], [])), WALL_NS))
    assert {name: each.action for name, each in found.items()} == dict.fromkeys(
        ('keyframes', 'fixes', 'edges', 'loops'), 2)


def test_a_large_graph_is_thinned_out_and_keeps_its_way_and_loops() -> None:
    points = [(0.01 * number, 0.0) for number in range(5000)]
    edges = [*((i, i + 1, EdgeKind.NEIGHBOUR) for i in range(4999)),
             *((i, 4999 - i, EdgeKind.LOOP) for i in range(2400))]
    numbers = graph_numbers(points, edges)
    assert len(numbers) <= NUMBERS_MOST
    kept, between = graph_of(numbers)
    assert len(kept) == NODES_MOST and kept[1] == points[5]
    assert [each[:2] for each in between if each[2] == EdgeKind.NEIGHBOUR] == [
        (i, i + 1) for i in range(NODES_MOST - 1)]
    assert any(each[2] == EdgeKind.LOOP for each in between)


@pytest.mark.parametrize('numbers', [
    [-1.0, 2.0, 0.0], [-1.0, -1.0], [-1.0, 0.5, 1.0, 1.0], [-1.0, math.nan], [-1.0, math.inf]])
def test_a_cut_graph_is_refused(numbers: list[float]) -> None:
    with pytest.raises(ValueError, match='not a graph'):
        to_markers('map')(sample(numbers), WALL_NS)


NUMBER = st.floats(width=32) | st.integers(-2, 5).map(float)


@settings(max_examples=60)
@given(st.lists(st.tuples(NUMBER, NUMBER), max_size=4), st.lists(NUMBER, max_size=14))
def test_any_numbers_give_a_message_or_are_refused(
        points: list[tuple[float, float]], rest: list[float]) -> None:
    numbers = [-1.0, float(len(points)), *(each for point in points for each in point), *rest]
    shown(to_markers('map')(sample(numbers), WALL_NS))


@settings(max_examples=40)
@given(st.integers(1, 6).flatmap(lambda count: st.tuples(
    st.lists(st.tuples(st.floats(-9, 9), st.floats(-9, 9)), min_size=count, max_size=count),
    st.lists(st.tuples(st.integers(0, count - 1), st.integers(0, count - 1), st.just(1)),
             max_size=8, unique=True))))
def test_what_is_written_is_read(graph: Any) -> None:
    assert graph_of(graph_numbers(*graph)) == graph
