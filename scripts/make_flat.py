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
Make config/maps/flat.yaml and flat.pgm, and the pictures of the flat in docs/images.

    PYTHONPATH=. .venv/bin/python scripts/make_flat.py

It gives the same map and the same plan each time. All lengths are in m; x goes to the right, y up.
"""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence
import math
from pathlib import Path

import numpy as np
from rt_robot_os.devices.capture.room_view import RoomView
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.settings.world import load_world
from rt_robot_os.sim.world import World

ROOT = Path(__file__).resolve().parents[1]
MAPS = ROOT / 'config' / 'maps'
PICTURE = ROOT / 'docs' / 'images' / 'flat.svg'
CAMERA_PICTURE = ROOT / 'docs' / 'images' / 'world_camera.png'

RESOLUTION_M = 0.05
WIDTH_M, HEIGHT_M = 10.0, 8.0
MARGIN_M = 0.5

# Left, bottom, right, top.
WALLS = (
    (0.0, 0.0, 10.0, 0.2), (0.0, 7.8, 10.0, 8.0), (0.0, 0.0, 0.2, 8.0), (9.8, 0.0, 10.0, 8.0),
    (5.6, 0.2, 5.7, 4.5),    # living room, kitchen
    (0.2, 4.4, 9.8, 4.5),    # below, above
    (4.6, 4.5, 4.7, 7.8),    # bedroom, study
)
DOORS = (
    (5.6, 3.2, 5.7, 4.1),    # living room - kitchen
    (2.0, 4.4, 2.9, 4.5),    # living room - bedroom
    (7.4, 4.4, 8.3, 4.5),    # kitchen - study
    (4.6, 5.2, 4.7, 6.1),    # bedroom - study
)
FURNITURE = (
    (0.2, 1.2, 1.1, 3.2),    # sofa
    (1.6, 1.8, 2.1, 2.7),    # low table
    (1.2, 0.2, 2.6, 0.6),    # sideboard
    (5.3, 0.4, 5.6, 1.9),    # shelf
    (0.2, 3.9, 0.8, 4.4),    # chest
    (6.3, 0.2, 9.8, 0.8),    # kitchen counter
    (9.2, 0.8, 9.8, 1.5),    # refrigerator
    (0.2, 5.7, 2.2, 7.3),    # bed
    (0.2, 7.3, 0.6, 7.8),   # bedside tables
    (0.2, 5.25, 0.6, 5.7),
    (2.7, 7.2, 4.6, 7.8),    # wardrobe
    (5.3, 7.1, 6.9, 7.8),    # desk
    (9.5, 4.8, 9.8, 6.6),    # bookcase
)
# Corner of a table or a chair, how wide, how deep: a lidar sees four legs.
LEGS = (
    (7.2, 2.1, 1.4, 0.8), (7.4, 2.95, 0.4, 0.4), (8.0, 1.55, 0.4, 0.4), (5.9, 6.5, 0.4, 0.4),
)
# Middle and radius.
ROUND = ((5.35, 2.2, 0.2), (8.9, 7.0, 0.45))
# Middle, half its length, half its width, slant.
SLANTED = ((7.7, 5.7, 0.45, 0.3, math.radians(30.0)),)

# The straight run and the eight that benchmarks drive.
RUN = ((3.44, 1.00), (3.44, 2.30))
EIGHT = (3.7, 2.6, 2.0, 1.0)


Box = tuple[float, float, float, float]


def made() -> GridMap:
    """Draw the flat."""
    grid = built((WIDTH_M, HEIGHT_M), WALLS, DOORS, FURNITURE, LEGS)
    x, y = grid.centres()
    cells = grid.cells.copy()
    for middle_x, middle_y, radius in ROUND:
        cells[np.hypot(x - middle_x, y - middle_y) < radius] = 100
    for middle_x, middle_y, long, wide, slant in SLANTED:
        dx, dy = x - middle_x, y - middle_y
        along = np.cos(slant) * dx + np.sin(slant) * dy
        across = np.cos(slant) * dy - np.sin(slant) * dx
        cells[(abs(along) < long) & (abs(across) < wide)] = 100
    return GridMap(cells, RESOLUTION_M, grid.origin)


def built(size_m: tuple[float, float], walls: Sequence[Box], doors: Sequence[Box],
          furniture: Sequence[Box], legs: Sequence[Box] = ()) -> GridMap:
    """
    Draw walls with doors, and what stands about; a margin around them is unknown.

    :param legs: a corner, how wide and how deep: of tables and chairs there are four legs.
    """
    shape = (round((size_m[1] + 2 * MARGIN_M) / RESOLUTION_M),
             round((size_m[0] + 2 * MARGIN_M) / RESOLUTION_M))
    empty = GridMap(np.full(shape, -1), RESOLUTION_M, (-MARGIN_M, -MARGIN_M, 0.0))
    x, y = empty.centres()
    cells = empty.cells.copy()

    def fill(box: Box, value: int) -> None:
        left, bottom, right, top = box
        cells[(x > left) & (x < right) & (y > bottom) & (y < top)] = value

    fill((0.0, 0.0, *size_m), 0)
    for boxes, value in ((walls, 100), (doors, 0), (furniture, 100)):
        for box in boxes:
            fill(box, value)
    for left, bottom, wide, deep in legs:
        for a in (left, left + wide - RESOLUTION_M):
            for b in (bottom, bottom + deep - RESOLUTION_M):
                fill((a, b, a + RESOLUTION_M, b + RESOLUTION_M), 100)
    return GridMap(cells, RESOLUTION_M, empty.origin)


def drawing(world: World) -> Iterator[str]:
    """Draw the world as SVG: outlines, marks, nodes, ways, the run and the eight."""
    scale, top = 60.0, HEIGHT_M + MARGIN_M

    def at(x: float, y: float) -> str:
        return f'{(x + MARGIN_M) * scale:.1f},{(top - y) * scale:.1f}'

    def dot(x: float, y: float, radius: float, style: str) -> str:
        where_x, where_y = at(x, y).split(',')
        return f'<circle cx="{where_x}" cy="{where_y}" r="{radius}" {style}/>'

    def text(x: float, y: float, words: str) -> str:
        where_x, where_y = at(x, y).split(',')
        return f'<text x="{where_x}" y="{where_y}">{words}</text>'

    width, height = (WIDTH_M + 2 * MARGIN_M) * scale, (HEIGHT_M + 2 * MARGIN_M) * scale
    yield (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" '
           'font-family="sans-serif" font-size="11" text-anchor="middle">')
    yield '<rect width="100%" height="100%" fill="white"/>'
    lines = ' '.join(f'M{at(a, b)}L{at(c, d)}' for a, b, c, d in world.walls.segments.tolist())
    yield f'<path d="{lines}" stroke="#333" stroke-width="2" fill="none"/>'
    for person in world.settings.people:
        name, _, *numbers = person.split()
        points = [at(float(a), float(b)) for a, b in zip(numbers[::2], numbers[1::2])]
        yield (f'<polygon points="{" ".join(points)}" fill="none" stroke="#c60" '
               'stroke-dasharray="6 4"/>')
        yield text(float(numbers[0]), float(numbers[1]) + 0.25, name)
    for person in world.people:
        yield dot(person.x, person.y, person.radius_m * scale, 'fill="#fc9" stroke="#c60"')
    for mark in world.landmarks:
        end = mark.x + 0.2 * math.cos(mark.yaw), mark.y + 0.2 * math.sin(mark.yaw)
        yield f'<path d="M{at(mark.x, mark.y)}L{at(*end)}" stroke="#06c" stroke-width="2"/>'
        yield dot(mark.x, mark.y, 4, 'fill="#06c"')
        yield text(mark.x, mark.y - 0.25, str(mark.number))
    for node in world.nodes:
        yield dot(node.x, node.y, 5, 'fill="#090"')
        yield text(node.x, node.y + 0.15, node.name)
    (ax, ay), (bx, by) = RUN
    yield f'<path d="M{at(ax, ay)}L{at(bx, by)}" stroke="#c00" stroke-width="3"/>'
    middle_x, middle_y, long, wide = EIGHT
    turns = [math.tau * i / 80 for i in range(81)]
    eight = [at(middle_x + long / 2 * math.sin(t), middle_y + wide / 2 * math.sin(2 * t))
             for t in turns]
    yield f'<polyline points="{" ".join(eight)}" fill="none" stroke="#c00" stroke-width="1.5"/>'
    x, y, yaw = world.base.pose
    yield dot(x, y, world.base.radius_m * scale, 'fill="#ddd" stroke="#000"')
    nose = x + 0.3 * math.cos(yaw), y + 0.3 * math.sin(yaw)
    yield f'<path d="M{at(x, y)}L{at(*nose)}" stroke="#000" stroke-width="2"/>'
    yield '</svg>\n'


def main() -> None:
    """Write everything."""
    made().save(MAPS / 'flat.yaml')
    world = World(load_world(MAPS / 'flat_world.yaml'))
    PICTURE.write_text('\n'.join(drawing(world)), encoding='utf-8')
    picture = RoomView(640, 480).picture({
        'map': str(MAPS / 'flat.yaml'), 'camera': (4.1, 0.9, 1.0, 2.0, 0.08), 'ceiling': 2.4,
        'lux': 300.0, 'people': [(2.75, 3.6), (4.0, 4.0)]})
    from PIL import Image  # only for this picture
    Image.fromarray(picture).save(CAMERA_PICTURE, optimize=True)


if __name__ == '__main__':
    main()
