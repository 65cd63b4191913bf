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
Make docs/images/sensor_network.svg: the house's network before and after nodes have died.

    PYTHONPATH=. .venv/bin/python scripts/make_network_pictures.py

The house of config/sensor_network.yaml is simulated, its packets are read as a sink's are, and the
markers of /wsn/nodes are drawn over the map. It gives the same pictures each time.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from html import escape
import math
from pathlib import Path

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.wsn.network_markers import LABELS
from rt_robot_os.features.wsn.network_markers import LINKS
from rt_robot_os.features.wsn.network_markers import markers_of
from rt_robot_os.features.wsn.network_markers import NODES
from rt_robot_os.features.wsn.packets.decode import PacketDecoder
from rt_robot_os.features.wsn.packets.framing import FrameReader
from rt_robot_os.features.wsn.sensor_network.model import NetworkModel
from rt_robot_os.features.wsn.sensor_network.watch import NetworkLimits
from rt_robot_os.features.wsn.sensor_network.watch import NetworkWatch
from rt_robot_os.features.wsn.sink.simulated import SimulatedSink
from rt_robot_os.messages.marker_array import Marker
from rt_robot_os.messages.network_rows import NodeRow
from rt_robot_os.settings.world import load_world
from rt_robot_os.sim.base import Site
from rt_robot_os.sim.pty_port import PtyPort
from rt_robot_os.sim.world import World
from svg_labels import Label
from svg_labels import placed
from svg_labels import Segment

ROOT = Path(__file__).resolve().parents[1]
PICTURE = ROOT / 'docs' / 'images' / 'sensor_network.svg'
SIZE_M = 18.0, 12.0
SCALE, MARGIN = 48.0, 14.0
STEP_S = 0.01
FONT_SIZE = 12.0
TITLE_HEIGHT = 46.0
KILLED = 3


class House:
    """The house, its network, and what a host makes of its packets."""

    def __init__(self) -> None:
        """Read the world."""
        self.world = World(load_world(ROOT / 'config' / 'maps' / 'house_world.yaml'))
        self.simulated = SimulatedSink('sink', {'period_ms': 2000.0, 'power_dbm': -25.0},
                                       PtyPort('/nowhere'), site=Site(self.world))
        self.model = NetworkModel(self.world.nodes)
        self.watch = NetworkWatch(self.model, NetworkLimits())
        self.names = {node.id: node.name for node in self.world.nodes} | {0: 'sink'}
        self._reader = FrameReader()
        self._decoder = PacketDecoder('tinyos1')
        self._steps = 0

    def run(self, seconds: float) -> None:
        """Let time pass."""
        for _ in range(round(seconds / STEP_S)):
            self._steps += 1
            time_s = self._steps * STEP_S
            now_ns = round(time_s * NS_PER_S)
            self.world.advance(now_ns)
            x, y, _ = self.world.base.pose
            self.model.sink_at(x, y, 0.4)
            for frame in self._reader.feed(self.simulated.sample(time_s)):
                self.model.update(self._decoder.decode(frame.packet), now_ns)
        self.watch.evaluate(now_ns)

    def rows(self) -> list[NodeRow]:
        """Return what /wsn/nodes says now."""
        return list(self.model.rows(round(self._steps * STEP_S * NS_PER_S)))


def drawing(world: World, panels: list[tuple[str, str, list[Marker]]]) -> Iterator[str]:
    """Draw panels below one another."""
    width = SIZE_M[0] * SCALE + 2 * MARGIN
    height = SIZE_M[1] * SCALE + 2 * MARGIN + TITLE_HEIGHT
    yield (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} '
           f'{height * len(panels):g}" font-family="sans-serif" font-size="11" '
           'text-anchor="middle">')
    yield '<rect width="100%" height="100%" fill="white"/>'
    for number, (title, note, markers) in enumerate(panels):
        top = number * height
        yield (f'<text x="{MARGIN:g}" y="{top + 18:g}" font-size="15" text-anchor="start">'
               f'{escape(title)}</text>')
        yield (f'<text x="{MARGIN:g}" y="{top + 36:g}" font-size="12" fill="#555" '
               f'text-anchor="start">{escape(note)}</text>')
        yield from _panel(world, markers, top + TITLE_HEIGHT)
    yield '</svg>\n'


def _panel(world: World, markers: list[Marker], top: float) -> Iterator[str]:
    def at(x: float, y: float) -> tuple[float, float]:
        return MARGIN + x * SCALE, top + (SIZE_M[1] - y) * SCALE

    def path(*ends: float) -> str:
        (a, b), (c, d) = at(*ends[:2]), at(*ends[2:])
        return f'M{a:.1f},{b:.1f}L{c:.1f},{d:.1f}'

    lines = ' '.join(path(*each) for each in world.walls.segments.tolist())
    yield f'<path d="{lines}" stroke="#999" stroke-width="1.2" fill="none"/>'
    links: list[Segment] = []
    for each in markers:
        if each.namespace != LINKS:
            continue
        for index in range(0, len(each.points), 2):
            (ax, ay, _), (bx, by, _) = each.points[index:index + 2]
            links.append((*at(ax, ay), *at(bx, by)))
            yield (f'<path d="{path(ax, ay, bx, by)}" stroke="{_colour(each.colours[index])}" '
                   'stroke-width="2" fill="none"/>')
    labels = []
    for each in markers:
        x, y = at(*each.position[:2])
        if each.namespace == NODES:
            yield (f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{each.scale[0] * 28:.1f}" '
                   f'fill="{_colour(each.colour)}" fill-opacity="{each.colour[3]:g}" '
                   'stroke="#333"/>')
        elif each.namespace == LABELS:
            name, *facts = each.text.split('\n')
            silent = tuple(fact for fact in facts[-1:] if fact.startswith('silent'))
            labels.append(Label(x, y, (name, *silent), 8.0, '#b00' if silent else ''))
    yield from placed(labels, links, (2.0, top, SIZE_M[0] * SCALE + 2 * MARGIN - 2.0,
                                      top + SIZE_M[1] * SCALE), FONT_SIZE)


def _note(rows: list[NodeRow], names: dict[int, str]) -> str:
    """Name the nodes that have no place, and so are not drawn."""
    unknown = [names[int(row.id)] for row in rows if not math.isfinite(row.x)]
    return f'Not drawn, as its place is unknown: {", ".join(unknown)}.' if unknown else ''


def _colour(colour: tuple[float, float, float, float]) -> str:
    return '#' + ''.join(f'{round(255 * part):02x}' for part in colour[:3])


def main() -> None:
    """Write the picture."""
    house = House()
    house.run(105)
    before = house.rows()
    hanging = {node.id for node in house.world.nodes if not node.person}
    relays = Counter(int(row.parent) for row in before if row.parent in hanging)
    killed = [house.names[node] for node, _ in relays.most_common(KILLED)]
    panels = [('Thirty nodes report: each line leads to the next hop.',
               _note(before, house.names), list(markers_of(before, house.names)))]
    for name in killed:
        house.world.inject(['node', name, 'off'])
    house.run(45)
    after = house.rows()
    panels.append((f'45 s after {", ".join(killed[:-1])} and {killed[-1]} lost their power: '
                   'the other nodes have new routes.',
                   _note(after, house.names), list(markers_of(after, house.names))))
    PICTURE.write_text('\n'.join(drawing(house.world, panels)), encoding='utf-8')
    lost = [row.id for row in after if row.hops > 0 and row.age_s > 10]
    print(f'{PICTURE}: killed {killed}; silent for 10 s: {[house.names[int(n)] for n in lost]}')


if __name__ == '__main__':
    main()
