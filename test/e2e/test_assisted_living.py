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

"""The assisted flat as it is shipped, with real processes: a fall, an answer, an alarm."""

from __future__ import annotations

from collections.abc import Callable
import json
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')
pytest.importorskip('mcap', reason='recordings need mcap')

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402, I100
from nav_msgs.msg import Odometry  # noqa: E402
from rclpy.qos import QoSDurabilityPolicy  # noqa: E402
from rclpy.qos import QoSProfile  # noqa: E402
from recorded_graph import Recorded  # noqa: E402
from std_msgs.msg import String  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

pytestmark = pytest.mark.one_build

Until = Callable[..., Any]

CONFIG = Path(__file__).resolve().parents[2] / 'config' / 'assisted_living.yaml'
# On any CPU, without asking for real time: other tests run beside it. She falls at once.
HERE = """
/**:
  ros__parameters:
    core: {cpu: -2, scheduler_priority: 0}
    world: {start: [2.45, 4.0, 1.57], people: [anna 0 3.3 5.8 3.4 5.8, bob 0 9.0 3.5],
            events: [fall anna at 4]}
    agent: {confirm_s: 2.0, observe: [picture]}
    camera: {observations_folder: FOLDER}
"""


def test_somebody_falls_and_the_robot_goes_there_looks_and_calls_until_it_is_acknowledged(
        world: Any, until: Until) -> None:
    kept = QoSProfile(depth=64, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
    alarms = world.listen(DiagnosticArray, '/alarms', kept)
    transitions = world.listen(String, '/agent/transitions')
    events = world.listen(String, '/alarms/events')
    seen = world.listen(String, '/agent/observed')
    odometry = world.listen(Odometry, '/odom')
    path = world.folder / 'here.yaml'
    path.write_text(HERE.replace('FOLDER', str(world.folder / 'seen')))
    world.robot(None, '--params-file', str(CONFIG), '--params-file', str(path))

    def states() -> list[str]:
        return [json.loads(each.data)['to'] for each in list(transitions)]

    def happened() -> list[str]:
        return [json.loads(each.data)['event'] for each in list(events)]

    until(lambda: 'suspected' in happened(), 'a suspicion')
    recorded = Recorded(world, until, CONFIG, '/alarms', '/wsn/nodes', '/tf_static')
    recorded.wait_for('/wsn/nodes')
    recorded.end()
    recorded.check('/alarms', '/wsn/nodes', '/tf', '/tf_static', '/agent/state')
    until(lambda: 'confirm' in states(), 'the question')
    until(lambda: any(abs(each.twist.twist.linear.x) > 0.05 for each in list(odometry)), 'a way')
    until(lambda: 'raised' in happened(), 'an alarm')
    until(lambda: 'observe' in states(), 'the robot beside her')
    until(lambda: seen, 'a picture')
    found = json.loads(seen[0].data)
    assert found['kind'] == 'picture' and Path(found['file']).stat().st_size > 1000
    status = until(lambda: next((each.status[0] for each in list(alarms)[-1:]
                                 if each.status[0].level == b'\x02'), None), 'a list of alarms')
    assert 'anna' in status.name
    answer = world.call(Trigger, '/robot/alarms/acknowledge', Trigger.Request())
    assert answer.success, answer.message
    until(lambda: 'acknowledged' in happened(), 'that somebody has taken it on')
