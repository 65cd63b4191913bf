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
Draw docs/images/assisted_living.svg from a run of the assisted flat.

    PYTHONPATH=. python3 scripts/make_assisted_living_picture.py [SECONDS]

It starts the robot without ROS, with the same world, and asks the world every half second where
everybody is. It needs no ROS, and two minutes.
"""

from __future__ import annotations

from collections.abc import Iterator
import math
from pathlib import Path
import sys
import tempfile
import time

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.core.simulators import device_folder
from rt_robot_os.ros.core_process import CoreProcess
from rt_robot_os.settings import load
from rt_robot_os.settings import to_json
from rt_robot_os.settings.world import load_world
from rt_robot_os.sim.commands import send_command
from rt_robot_os.sim.world import World
from svg_labels import Label
from svg_labels import placed
from svg_labels import Segment

ROOT = Path(__file__).resolve().parents[1]
CONFIG = ROOT / 'config'
PICTURE = ROOT / 'docs' / 'images' / 'assisted_living.svg'
WORLD = CONFIG / 'maps' / 'assisted_living_world.yaml'
SCALE, TOP, MARGIN = 60.0, 8.5, 0.5
LYING_M = 1.75
ANNA, BOB = ('stroke="#c60" stroke-dasharray="5 4"', 'stroke="#a84" stroke-dasharray="2 4"')
ROBOT = 'stroke="#06c" stroke-width="2.5"'

Row = dict[str, list[str]]


def watched(seconds: float) -> list[Row]:
    """Run the robot, and return all positions, a row each half second."""
    rows: list[Row] = []
    settings = load([CONFIG / 'assisted_living.yaml'],
                    {'core.cpu': -2, 'core.scheduler_priority': 0})
    with tempfile.TemporaryDirectory(prefix='rta') as folder:
        path = Path(folder) / 'robot.sock'
        core = CoreProcess(to_json(settings), path)
        core.start()
        try:
            end = time.monotonic() + seconds
            while time.monotonic() < end:
                time.sleep(0.5)
                try:
                    told = send_command(device_folder(path), 'world where')
                except DeviceError:
                    continue
                rows.append({words[0]: words[1:] for words in map(str.split, told.splitlines())})
        finally:
            core.stop()
    return rows


def point(x: float, y: float) -> tuple[float, float]:
    """Return a point of the picture."""
    return (x + MARGIN) * SCALE, (TOP - y) * SCALE


def at(x: float, y: float) -> str:
    """Return a point of the picture as its paths have it."""
    left, top = point(x, y)
    return f'{left:.1f},{top:.1f}'


def dot(x: float, y: float, radius: float, style: str) -> str:
    """Draw a disc; its radius is in the units of the picture."""
    left, top = point(x, y)
    return f'<circle cx="{left:.1f}" cy="{top:.1f}" r="{radius}" {style}/>'


def way(rows: list[Row], name: str, style: str) -> str:
    """Draw the path of a person or of the robot."""
    points = ' '.join(at(float(row[name][0]), float(row[name][1])) for row in rows)
    return f'<polyline points="{points}" fill="none" {style}/>'


def lying(last: Row) -> list[Segment]:
    """Return the middle line of a person on the floor, then the lines that fill the body."""
    world = World(load_world(WORLD))
    world.advance(0)
    world.advance(62 * 10 ** 9)
    x, y = map(float, last['anna'][:2])
    heading = world.people[0].heading
    half = LYING_M / 2 - 0.17  # the line has round ends
    along = half * math.cos(heading), half * math.sin(heading)
    head, feet = (point(x + side * along[0], y + side * along[1]) for side in (-1, 1))
    return [(head[0] + aside, head[1], feet[0] + aside, feet[1])
            for aside in (0, -9, -6, -3, 3, 6, 9)]


def segments_of(rows: list[Row], name: str) -> list[Segment]:
    """Return a path as lines of the picture."""
    points = [point(*map(float, row[name][:2])) for row in rows[::4]]
    return [(*first, *second) for first, second in zip(points, points[1:])]


def drawing(rows: list[Row]) -> Iterator[str]:
    """Draw walls, nodes, paths, the place of the fall and the robot."""
    world = World(load_world(WORLD))
    yield ('<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 660 565" '
           'font-family="sans-serif" font-size="12">')
    yield '<rect width="100%" height="100%" fill="white"/>'
    lines = ' '.join(f'M{at(a, b)}L{at(c, d)}' for a, b, c, d in world.walls.segments.tolist())
    yield f'<path d="{lines}" stroke="#333" stroke-width="2" fill="none"/>'
    up = [row for row in rows if row['anna'][2] == 'walking']
    yield way(up, 'anna', ANNA)
    yield way(rows, 'bob', BOB)
    yield way(rows, 'base_link', ROBOT)
    start, last = rows[0]['base_link'], rows[-1]
    yield dot(float(start[0]), float(start[1]), 11, 'fill="none" stroke="#06c"')
    covered = lying(last)
    yield ('<path d="M{:.1f},{:.1f}L{:.1f},{:.1f}" stroke="#f96" stroke-width="20" '
           'stroke-linecap="round"/>'.format(*covered[0]))
    bx, by, yaw = map(float, last['base_link'][:3])
    for side in (-0.5, 0.5):
        end = bx + 2.0 * math.cos(yaw + side), by + 2.0 * math.sin(yaw + side)
        yield f'<path d="M{at(bx, by)}L{at(*end)}" stroke="#9bd" stroke-width="1"/>'
        covered.append((*point(bx, by), *point(*end)))
    covered += [(*point(a, b), *point(c, d))
                for a, b, c, d in world.walls.segments.tolist()]
    for name in ('anna', 'bob', 'base_link'):
        covered += segments_of(up if name == 'anna' else rows, name)
    yield dot(bx, by, 11, 'fill="#cdf" stroke="#06c" stroke-width="2"')
    labels = [named(bx, by, 'robot', 11.0),
              named(float(start[0]), float(start[1]), 'start', 11.0),
              named(*map(float, last['anna'][:2]), 'anna, fallen', 24.0)]
    for node in world.nodes:
        if not node.person:
            yield dot(node.x, node.y, 5, 'fill="#090"')
            labels.append(named(node.x, node.y, node.name, 5.0))
    yield from placed(labels, covered, (4.0, 4.0, 656.0, 536.0), 12.0)
    yield from legend()
    yield '</svg>\n'


def named(x: float, y: float, name: str, radius: float) -> Label:
    """Return the label of a place of the flat."""
    return Label(*point(x, y), (name,), radius)


def legend() -> Iterator[str]:
    """Name the lines and dots below the flat."""
    for number, (style, name) in enumerate(((ANNA, 'path of anna'), (BOB, 'path of bob'),
                                            (ROBOT, 'path of the robot'))):
        left = 40 + 150 * number
        yield (f'<path d="M{left},546H{left + 30}" fill="none" {style}/>'
               f'<text x="{left + 36}" y="550">{name}</text>')
    yield '<circle cx="505" cy="546" r="5" fill="#090"/><text x="515" y="550">sensor node</text>'


def main() -> int:
    """Run and draw."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 100.0
    PICTURE.write_text('\n'.join(drawing(watched(seconds))), encoding='utf-8')
    return 0


if __name__ == '__main__':
    sys.exit(main())
