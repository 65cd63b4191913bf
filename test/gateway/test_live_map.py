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

"""The robot's live map as the server gets it: what is known of it, where it is, and no more."""

from __future__ import annotations

import base64
import math
from typing import Any
import zlib

from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
import pytest

pytest.importorskip('nav_msgs', reason='ROS 2 messages are not installed')

from rt_robot_os.base.errors import ConfigError  # noqa: E402
from rt_robot_os.gateway.map_topic import message_of  # noqa: E402, I100
from rt_robot_os.messages.uplink.maps import MapMessage  # noqa: E402
from rt_robot_os.motion.grid_map import GridMap  # noqa: E402
from rt_robot_os.topics import Layout  # noqa: E402


def message(cells: Any, origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
            size_m: float = 0.05, frame: str = 'map') -> bytes:
    """Make an OccupancyGrid as a client publishes it."""
    rows, columns = cells.shape
    layout = Layout.compile('nav_msgs/msg/OccupancyGrid', {'header.frame_id': frame},
                            tail=rows * columns)
    x, y, yaw = origin
    return layout.from_dict({
        'info': {'resolution': size_m, 'width': columns, 'height': rows, 'origin': {
            'position': {'x': x, 'y': y}, 'orientation': {'z': math.sin(yaw / 2),
                                                          'w': math.cos(yaw / 2)}}},
        'data': cells.ravel().tolist()})


def shown(found: MapMessage) -> GridMap:
    """Make the map of a message as a page does."""
    assert MapMessage.from_json(found.content()) == found
    cells = np.frombuffer(zlib.decompress(base64.b64decode(found.cells)), np.int8)
    return GridMap(cells.reshape(found.height, found.width), found.resolution_m, found.origin)


@examples(max_examples=25, deadline=None)
@given(arrays(np.int8, st.tuples(st.integers(1, 12), st.integers(1, 12)),
              elements=st.sampled_from([-1, -1, -1, 0, 100])),
       st.tuples(st.floats(-9, 9), st.floats(-9, 9), st.floats(-3, 3)),
       st.text('ab/_', max_size=9))
def test_what_is_shown_is_where_it_was(cells: Any, origin: tuple[float, float, float],
                                       frame: str) -> None:
    cdr = message(cells, origin, frame=frame)
    if not (cells >= 0).any():
        with pytest.raises(ConfigError, match='cells are unknown'):
            message_of(cdr)
        return
    here, there = GridMap(cells, 0.05, origin), shown(message_of(cdr))
    assert max(there.cells.shape) <= max(cells.shape)
    for known in (there.cells[0], there.cells[-1], there.cells[:, 0], there.cells[:, -1]):
        assert (known >= 0).any(), 'a rim of which nothing is known'
    for row, column in np.argwhere(cells >= 0):
        x, y = here.centre(row, column)
        assert there.value(x, y) == cells[row, column]


def test_a_map_that_is_too_long_becomes_coarser_and_keeps_its_walls() -> None:
    random = np.random.default_rng(1)
    cells = np.where(random.random((301, 200)) < 0.1, 100, 0).astype(np.int8)
    found = message_of(message(cells), 4000)
    assert len(found.cells) <= 4000 and found.resolution_m in (0.1, 0.2, 0.4)
    here, there = GridMap(cells, 0.05, (0.0, 0.0, 0.0)), shown(found)
    for row, column in np.argwhere(cells == 100):
        assert there.value(*here.centre(row, column)) == 100


@pytest.mark.parametrize('cut', [0, 3, 20, 60, -1])
def test_half_a_map_is_none(cut: int) -> None:
    with pytest.raises(ValueError, match='CDR|end within'):
        message_of(message(np.zeros((3, 3), np.int8))[:cut])
