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
everybody is. ROS is not needed; some two minutes are.
"""

from __future__ import annotations

from collections.abc import Iterator
import math
from pathlib import Path
import sys
import tempfile
import time

from rt_robot_os.clients.ros.core_process import CoreProcess
from rt_robot_os.core.simulators import device_folder
from rt_robot_os.errors import DeviceError
from rt_robot_os.settings import load
from rt_robot_os.settings import to_json
from rt_robot_os.settings.world import load_world
from rt_robot_os.sim.orders import order
from rt_robot_os.sim.world import World

ROOT = Path(__file__).resolve().parents[1]
CONFIG = ROOT / 'config'
PICTURE = ROOT / 'docs' / 'images' / 'assisted_living.svg'
WORLD = CONFIG / 'maps' / 'assisted_living_world.yaml'
SCALE, TOP, MARGIN = 60.0, 8.5, 0.5
LYING_M = 1.75

Row = dict[str, list[str]]


def watched(seconds: float) -> list[Row]:
    """Run the robot, and note where everybody is."""
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
                    told = order(device_folder(path), 'world where')
                except DeviceError:
                    continue
                rows.append({words[0]: words[1:] for words in map(str.split, told.splitlines())})
        finally:
            core.stop()
    return rows


def at(x: float, y: float) -> str:
    """Return a point of the picture."""
    return f'{(x + MARGIN) * SCALE:.1f},{(TOP - y) * SCALE:.1f}'


def dot(x: float, y: float, radius: float, style: str) -> str:
    """Draw a disc; its radius is in the units of the picture."""
    where_x, where_y = at(x, y).split(',')
    return f'<circle cx="{where_x}" cy="{where_y}" r="{radius}" {style}/>'


def text(x: float, y: float, words: str) -> str:
    """Write a word."""
    where_x, where_y = at(x, y).split(',')
    return f'<text x="{where_x}" y="{where_y}">{words}</text>'


def way(rows: list[Row], name: str, style: str) -> str:
    """Draw where somebody went."""
    points = ' '.join(at(float(row[name][0]), float(row[name][1])) for row in rows)
    return f'<polyline points="{points}" fill="none" {style}/>'


def drawing(rows: list[Row]) -> Iterator[str]:
    """Draw walls, nodes, ways, the place of the fall and the robot beside it."""
    world = World(load_world(WORLD))
    yield ('<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 660 540" '
           'font-family="sans-serif" font-size="12" text-anchor="middle">')
    yield '<rect width="100%" height="100%" fill="white"/>'
    lines = ' '.join(f'M{at(a, b)}L{at(c, d)}' for a, b, c, d in world.walls.segments.tolist())
    yield f'<path d="{lines}" stroke="#333" stroke-width="2" fill="none"/>'
    up = [row for row in rows if row['anna'][2] == 'walking']
    yield way(up, 'anna', 'stroke="#c60" stroke-dasharray="5 4"')
    yield way(rows, 'bob', 'stroke="#ca8" stroke-dasharray="2 4"')
    yield way(rows, 'base_link', 'stroke="#06c" stroke-width="2.5"')
    start, last = rows[0]['base_link'], rows[-1]
    yield dot(float(start[0]), float(start[1]), 11, 'fill="none" stroke="#06c"')
    x, y = map(float, last['anna'][:2])
    world.advance(0)
    world.advance(62 * 10 ** 9)
    heading = world.people[0].heading
    half = LYING_M / 2 - 0.17  # the line has round ends
    ends = [at(x + side * half * math.cos(heading), y + side * half * math.sin(heading))
            for side in (-1, 1)]
    yield (f'<path d="M{ends[0]}L{ends[1]}" stroke="#f96" stroke-width="20" '
           'stroke-linecap="round"/>')
    yield text(x + 0.75, y + 0.75, 'anna fell here')
    for node in world.nodes:
        if not node.person:
            yield dot(node.x, node.y, 5, 'fill="#090"') + text(node.x, node.y + 0.17, node.name)
    bx, by, yaw = map(float, last['base_link'][:3])
    for side in (-0.5, 0.5):
        end = bx + 2.0 * math.cos(yaw + side), by + 2.0 * math.sin(yaw + side)
        yield f'<path d="M{at(bx, by)}L{at(*end)}" stroke="#9bd" stroke-width="1"/>'
    yield dot(bx, by, 11, 'fill="#cdf" stroke="#06c" stroke-width="2"')
    yield text(bx, by - 0.45, 'the robot')
    yield '</svg>\n'


def main() -> int:
    """Run and draw."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 100.0
    PICTURE.write_text('\n'.join(drawing(watched(seconds))), encoding='utf-8')
    return 0


if __name__ == '__main__':
    sys.exit(main())
