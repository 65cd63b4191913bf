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

"""Labels of drawn points, placed where they cover neither each other nor a line, inside the picture."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Iterator
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

Box = tuple[float, float, float, float]
Segment = tuple[float, float, float, float]

# Of a sans-serif font, in parts of its size.
CHARACTER_WIDTH, LINE_HEIGHT = 0.55, 1.15
GAP = 3.0
STEPS = 8  # points of a line that are checked for each box
# What a label may cost where it lies.
OUTSIDE, ON_LABEL, ON_LINE, FURTHER = 1000.0, 100.0, 3.0, 0.2


@dataclass(frozen=True)
class Label:
    """
    A text beside a point.

    :ivar x: of the point, in units of the picture; downwards for ``y``.
    :ivar lines: the text, a string a line.
    :ivar radius: of what is drawn at the point.
    :ivar last_fill: colour of the last line; empty: as the others.
    """

    x: float
    y: float
    lines: tuple[str, ...]
    radius: float = 5.0
    last_fill: str = ''


def placed(labels: Sequence[Label], segments: Iterable[Segment], bounds: Box,
           size: float) -> Iterator[str]:
    """
    Place labels one after the other, each where it costs least, and draw them with a white rim.

    :param segments: lines that a label should not cover.
    :param bounds: left, top, right and bottom of what is shown.
    :param size: of the font, in units of the picture.
    """
    lines = list(segments)
    used = [(each.x - each.radius, each.y - each.radius, each.x + each.radius,
             each.y + each.radius) for each in labels]
    for number, label in enumerate(labels):
        others = used[:number] + used[number + 1:]
        boxes = list(_candidates(label, size))
        costs = [_cost(box, others, lines, bounds) + FURTHER * turn
                 for turn, box in enumerate(boxes)]
        box = boxes[costs.index(min(costs))]
        used.append(box)
        yield _drawn(label, box, size)


def _candidates(label: Label, size: float) -> Iterator[Box]:
    width = CHARACTER_WIDTH * size * max(map(len, label.lines))
    height = LINE_HEIGHT * size * len(label.lines)
    x, y = label.x, label.y
    for near in (label.radius + GAP * ring for ring in (1, 4, 9)):
        corner = 0.7 * near
        for left, top in (
                (x - width / 2, y - near - height), (x - width / 2, y + near),
                (x + near, y - height / 2), (x - near - width, y - height / 2),
                (x + corner, y - corner - height), (x + corner, y + corner),
                (x - corner - width, y - corner - height), (x - corner - width, y + corner)):
            yield left, top, left + width, top + height


def _cost(box: Box, others: Sequence[Box], lines: Sequence[Segment], bounds: Box) -> float:
    left, top, right, bottom = box
    cost = 0.0
    if left < bounds[0] or top < bounds[1] or right > bounds[2] or bottom > bounds[3]:
        cost += OUTSIDE
    cost += ON_LABEL * sum(left < c and a < right and top < d and b < bottom
                           for a, b, c, d in others)
    for ax, ay, bx, by in lines:
        cost += ON_LINE * any(
            left <= ax + (bx - ax) * i / STEPS <= right
            and top <= ay + (by - ay) * i / STEPS <= bottom for i in range(STEPS + 1))
    return cost


def _drawn(label: Label, box: Box, size: float) -> str:
    x = (box[0] + box[2]) / 2
    rows = []
    for number, line in enumerate(label.lines):
        y = box[1] + LINE_HEIGHT * size * (number + 0.78)
        fill = (f' fill="{label.last_fill}"' if label.last_fill
                and number == len(label.lines) - 1 else '')
        rows.append(f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="middle" font-size="{size:g}" '
                    f'paint-order="stroke" stroke="white" stroke-width="3" '
                    f'stroke-linejoin="round"{fill}>{escape(line)}</text>')
    return ''.join(rows)
