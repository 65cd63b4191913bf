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

"""A robot whose receiver is on a network, with corrections from another place, seen from ROS."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from pathlib import Path
import socket
import subprocess
import sys
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402, I100
from rt_robot_os.devices.ublox.rtcm import message  # noqa: E402
from sensor_msgs.msg import NavSatFix  # noqa: E402

pytestmark = pytest.mark.one_build

Until = Callable[..., Any]

ROBOT = """
robot:
  ros__parameters:
    core: {cpu: -2, scheduler_priority: 0}
    devices: [gps]
    gps:
      type: ublox
      port: tcp://localhost:RECEIVER
      configure: true
      high_precision: true
      corrections: tcp://127.0.0.1:STATION
      output_rate_hz: 5.0
      rate_hz: 50.0
      timeout_s: 5.0
      retry_s: 0.2
    mirrors: [fix]
    fix: {topic: gps/fix}
"""


@pytest.fixture
def receiver(tmp_path: Path) -> Iterator[int]:
    """Run a receiver on a free port of this machine."""
    with socket.create_server(('127.0.0.1', 0)) as free:
        number = int(free.getsockname()[1])
    process = subprocess.Popen(
        [sys.executable, '-c', 'import sys; from rt_robot_os.core.simulator_program import main; '
         'sys.exit(main())', 'gps:ublox', '--dir', str(tmp_path), '--tcp', f'gps={number}'],
        cwd=Path(__file__).parents[2], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == f'gps tcp://127.0.0.1:{number}\n'
    yield number
    process.terminate()
    process.communicate(timeout=60)


def test_a_receiver_on_a_network_gets_corrections_and_is_seen_from_ros(
        receiver: int, world: Any, until: Until) -> None:
    fixes = world.listen(NavSatFix, '/gps/fix')
    diagnostics = world.listen(DiagnosticArray, '/diagnostics')
    with socket.create_server(('127.0.0.1', 0)) as listener:
        listener.settimeout(60)
        world.robot(ROBOT.replace('RECEIVER', str(receiver)).replace(
            'STATION', str(listener.getsockname()[1])))
        station = listener.accept()[0]
        until(lambda: fixes and fixes[-1].position_covariance[0] < 0.001,
              'a fix of high precision')

        def fixed() -> bool:
            station.sendall(message(1005, bytes(17)))
            return bool(fixes[-1].status.status == 2)

        until(fixed, 'a carrier phase solution')

        def told() -> dict[str, str]:
            return {v.key: v.value for m in list(diagnostics)[-3:] for s in m.status
                    if s.name.endswith('device gps') for v in s.values}

        # It keeps sending: what came some seconds ago is not coming any more.
        until(lambda: fixed() and told().get('corrections') == 'coming'
              and told().get('corrections_messages', '').startswith('1005: '),
              'corrections in the diagnostics, and messages by number')
        station.close()
        until(lambda: 'closed the connection' in told().get('corrections', ''),
              'what is wrong with them')
        assert told()['faults'] in ('0', '1')
