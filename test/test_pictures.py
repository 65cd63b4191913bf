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

"""The drawings of the documentation can be read: labels are inside, and cover no other."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from xml.etree import ElementTree

import pytest

IMAGES = Path(__file__).parents[1] / 'docs' / 'images'
DRAWINGS = 'sensor_network', 'assisted_living'
# Of sans-serif fonts, in parts of their size: the narrowest and the widest of the usual ones.
NARROW, WIDE, ASCENT, DESCENT = 0.5, 0.6, 0.7, 0.2

Box = tuple[float, float, float, float]


def texts(drawing: ElementTree.Element, character_width: float) -> list[tuple[str, Box]]:
    """Return each text with the place that it takes in a font."""
    found = []
    for each in drawing.iter('{http://www.w3.org/2000/svg}text'):
        text = each.text or ''
        size = float(each.get('font-size', drawing.get('font-size', '12')))
        anchor = each.get('text-anchor', drawing.get('text-anchor', 'start'))
        width = character_width * size * len(text)
        left = float(each.get('x', '0')) - (width / 2 if anchor == 'middle' else 0.0)
        base = float(each.get('y', '0'))
        found.append((text, (left, base - ASCENT * size, left + width, base + DESCENT * size)))
    return found


@pytest.mark.parametrize('name', DRAWINGS)
def test_labels_are_inside_the_drawing(name: str) -> None:
    drawing = ElementTree.parse(IMAGES / f'{name}.svg').getroot()
    left, top, width, height = map(float, drawing.get('viewBox', '').split())
    found = texts(drawing, WIDE)
    assert len(found) > 5
    for text, (a, b, c, d) in found:
        assert left <= a and top <= b and c <= left + width and d <= top + height, text


@pytest.mark.parametrize('name', DRAWINGS)
def test_labels_do_not_cover_each_other(name: str) -> None:
    found = texts(ElementTree.parse(IMAGES / f'{name}.svg').getroot(), NARROW)
    assert [(one, other) for (one, (a, b, c, d)), (other, (e, f, g, h)) in combinations(found, 2)
            if a < g and e < c and b < h and f < d] == []
