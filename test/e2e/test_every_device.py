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


"""The configuration of all devices, as its user starts it: everything active, nothing lost."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402, I100
from diagnostic_msgs.msg import DiagnosticStatus  # noqa: E402
from rt_robot_os.settings import load  # noqa: E402
from sensor_msgs.msg import LaserScan  # noqa: E402

pytestmark = pytest.mark.one_build

CONFIG = Path(__file__).resolve().parents[2] / 'config' / 'all_devices.yaml'


def test_all_simulated_devices_run_at_once_and_the_diagnostics_are_green(
        world: Any, until: Callable[..., Any]) -> None:
    wanted = {device.name for device in load([CONFIG]).devices}
    seen = world.listen(DiagnosticArray, '/diagnostics')
    scans = world.listen(LaserScan, '/scan')
    # Without real time, as on any machine that tests run on: said, and in no device's line.
    robot = world.robot(CONFIG.read_text().replace(
        '  ros__parameters:\n',
        '  ros__parameters:\n    core: {cpu: -2, scheduler_priority: 0}\n', 1))

    def devices() -> dict[str, Any]:
        statuses = seen[-1].status if seen else ()
        return {status.name.split('device ')[-1]: status for status in statuses
                if 'device ' in status.name}

    def green() -> bool:
        found = devices()
        return wanted <= found.keys() and all(
            found[name].level == DiagnosticStatus.OK for name in wanted)

    until(green, f'all of {sorted(wanted)} green')
    until(lambda: scans, 'a scan')
    assert len(scans[-1].ranges) > 600
    assert robot.end() == 0
