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

"""The sensor network as it is shipped, on ptys: readings, the picture, and a tree that mends."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')
pytest.importorskip('visualization_msgs', reason='its messages are not installed')

from geometry_msgs.msg import Point  # noqa: E402, I100
from rt_robot_os.core.simulators import device_folder  # noqa: E402
from rt_robot_os.sim.commands import send_command  # noqa: E402
from sensor_msgs.msg import Temperature  # noqa: E402
from std_msgs.msg import Float64  # noqa: E402
from visualization_msgs.msg import Marker  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402

pytestmark = pytest.mark.one_build

Until = Callable[..., Any]
Place = tuple[float, float]

CONFIG = Path(__file__).resolve().parents[2] / 'config' / 'sensor_network.yaml'
# On any CPU, without asking for real time; people stand, so that only what dies changes a
# way, and all goes quicker than as it is shipped.
HERE = """
/**:
  ros__parameters:
    core: {cpu: -2, scheduler_priority: 0}
    world: {people: [anna 0 14.95 3.2, bob 0 6.75 8.0]}
    sink: {sim: {period_ms: 1000.0, beacon_period_ms: 2000.0}}
    network: {silent_s: 3.0, silent_periods: 2.0, rate_hz: 5.0}
"""
NODES = 30
DEAD = 0.9, 0.1  # red


def at(point: Point) -> Place:
    return round(point.x, 2), round(point.y, 2)


class Picture:
    """What the newest markers show."""

    def __init__(self, markers: MarkerArray) -> None:
        shown = [each for each in markers.markers if each.action == Marker.ADD]
        self.names = {at(each.pose.position): each.text.split('\n')[0]
                      for each in shown if each.ns == 'labels'}
        self.dead = {self.names[at(each.pose.position)] for each in shown if each.ns == 'nodes'
                     and (each.color.r, each.color.g) == pytest.approx(DEAD)}
        ends = [at(point) for each in shown if each.ns == 'links' for point in each.points]
        self.parents = {self.names[child]: self.names[parent]
                        for child, parent in zip(ends[::2], ends[1::2])}

    def children(self, name: str) -> set[str]:
        return {child for child, parent in self.parents.items() if parent == name}


def test_thirty_nodes_report_and_the_tree_mends_itself(world: Any, until: Until) -> None:
    pictures = world.listen(MarkerArray, '/wsn/nodes')
    pulses = world.listen(Float64, '/wsn/anna/pulse_per_min')
    alarms = world.listen(Float64, '/wsn/anna/alarm')
    kitchen = world.listen(Temperature, '/wsn/kitchen/temperature')
    path = world.folder / 'here.yaml'
    path.write_text(HERE)
    robot = world.robot(None, '--params-file', str(CONFIG), '--params-file', str(path))
    until(lambda: kitchen and pulses, 'readings')
    assert kitchen[-1].temperature == pytest.approx(21.0, abs=1.5)
    assert kitchen[-1].header.frame_id == 'kitchen'
    assert 50 < pulses[-1].data < 100

    def picture() -> Picture:
        return Picture(pictures[-1])

    until(lambda: pictures and len(picture().parents) == NODES and not picture().dead,
          'thirty nodes in the picture')
    folder = device_folder(world.folder / 'robot.sock')
    send_command(folder, 'world alarm anna')
    until(lambda: alarms and alarms[-1].data == 1.0, 'an alarm')
    before = picture()
    relay = max((name for name in before.names.values() if name not in ('sink', 'anna', 'bob')),
                key=lambda name: len(before.children(name)))
    assert before.children(relay), 'it takes several hops'
    send_command(folder, f'world node {relay} off')
    until(lambda: relay in picture().dead, f'{relay} dead in the picture')
    until(lambda: not picture().children(relay) and picture().dead == {relay}
          and len(picture().parents) == NODES - 1, 'other ways for all others')
    assert robot.end() == 0
