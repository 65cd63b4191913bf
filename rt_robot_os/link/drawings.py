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


"""
Rows of numbers in the core as markers in ROS.

The features know what their rows mean and draw them. This table names their functions, which are
imported when a converter is made: in the node and in the recorder, never in the real-time core.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence
from importlib import import_module
from typing import Final
from typing import TypeAlias

from rt_robot_os.messages.cdr import labelled_numbers
from rt_robot_os.messages.marker_array import Drawing
from rt_robot_os.messages.marker_array import marker_array

#: From the label of the first dimension and the numbers; None when it does not know the numbers.
#: Raises ValueError when they are not valid.
Draw: TypeAlias = Callable[[str, Sequence[float]], 'Drawing | None']

#: ``module:function`` of each; the first that knows the numbers draws them.
DRAWINGS: Final = (
    'rt_robot_os.features.mapping.graph_markers:draw_graph',
    'rt_robot_os.features.wsn.network_markers:draw_network',
)


def to_markers(frame_id: str) -> Callable[[memoryview, int], bytes]:
    """
    Make a converter from rows of numbers to markers.

    It deletes the markers of its last message that are not in the next one.

    :param frame_id: of the positions.
    """
    drawings = [_imported(target) for target in DRAWINGS]
    shown: set[tuple[str, int]] = set()

    def convert(cdr: memoryview, wall_ns: int) -> bytes:
        label, numbers = labelled_numbers(cdr)
        drawing = _draw(drawings, label, numbers)
        now = {(each.namespace, each.id) for each in drawing.markers}
        gone = sorted(shown - now)
        shown.clear()
        shown.update(now)
        return marker_array(drawing.markers, gone, frame_id, wall_ns, drawing.lifetime_s)

    return convert


def _imported(target: str) -> Draw:
    module, _, name = target.partition(':')
    draw: Draw = getattr(import_module(module), name)
    return draw


def _draw(drawings: Sequence[Draw], label: str, numbers: Sequence[float]) -> Drawing:
    for draw in drawings:
        drawing = draw(label, numbers)
        if drawing is not None:
            return drawing
    raise ValueError(f'no feature draws these {len(numbers)} numbers')
