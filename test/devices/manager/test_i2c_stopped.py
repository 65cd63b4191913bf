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

"""The process of an I2C bus stands still: its chips are at fault, and nothing else notices."""

from __future__ import annotations

from collections.abc import Iterator
import os
from pathlib import Path
import signal
import subprocess
import sys
from typing import Any

from i2c_robot import S
import pytest
from rt_robot_os.base.reports import Reports
from rt_robot_os.base.reports import Severity
from rt_robot_os.devices.manager import SensorManager
from rt_robot_os.devices.registry import DRIVERS
from rt_robot_os.devices.state import DeviceState
from rt_robot_os.devices.state import RecoverySettings
from rt_robot_os.kernel import Kernel
from rt_robot_os.testing import settings_of
from rt_robot_os.topics import Bus
from took_little import took_little

pytest.importorskip('sensor_msgs', reason='ROS 2 messages are not installed')

CHIPS = {'imu': ('mpu6050', 0x68), 'baro': ('bmp280', 0x76), 'high': ('ms5611', 0x77)}


@pytest.fixture
def simulator(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """Run three chips on a bus in another process."""
    process = subprocess.Popen(
        [sys.executable, '-c',
         'import sys; from rt_robot_os.core.simulator_program import main; sys.exit(main())',
         '--dir', str(tmp_path),
         *(f'{name}:{kind}' for name, (kind, _) in CHIPS.items())],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parents[3])
    assert process.stdout is not None
    for _ in CHIPS:
        assert process.stdout.readline()
    yield process
    process.send_signal(signal.SIGCONT)
    process.terminate()
    process.communicate(timeout=60)


class Robot:
    """A real kernel with the three chips, and a task of low priority that is to run on."""

    def __init__(self, folder: Path) -> None:
        self.kernel = Kernel()
        bus, self.reports = Bus(self.kernel), Reports()
        self.manager = SensorManager(self.kernel, bus, self.reports)
        self.devices = {}
        for name, (kind, address) in CHIPS.items():
            driver: Any = DRIVERS.load(kind)
            topics = {f.name: f'{name}/{f.name}' for f in driver.SETTINGS
                      if f.name == 'topic' or f.name.endswith('_topic')}
            device = driver(name, settings_of(
                driver, port=str(folder / name), address=address, **topics))
            self.devices[name] = self.manager.add(
                device, rate_hz=100.0, priority=40, interrupt=True,
                recovery=RecoverySettings(S, S // 10, S // 5))
        self.low = self.kernel.add_task('low', self.look, priority=2, rate_hz=100.0)
        self.until: Any = None

    def look(self) -> None:
        if self.until is not None and self.until():
            self.kernel.stop('seen')

    def run_until(self, condition: Any) -> None:
        """Run until something holds."""
        self.until = condition
        assert self.kernel.run(60 * S) == 'seen', [
            (d.state, d.reason) for d in self.devices.values()]

    def all_in(self, state: DeviceState) -> bool:
        return all(d.state is state for d in self.devices.values())


def test_a_stopped_simulator_holds_up_nothing(
        simulator: subprocess.Popen[str], tmp_path: Path) -> None:
    robot = Robot(tmp_path)
    try:
        robot.run_until(lambda: robot.all_in(DeviceState.ACTIVE))
        for task in robot.kernel.tasks:
            task.reset_statistics()
        simulator.send_signal(signal.SIGSTOP)
        os.waitid(os.P_PID, simulator.pid, os.WSTOPPED | os.WNOWAIT)
        robot.run_until(lambda: all(d.faults >= 2 for d in robot.devices.values()))
        # Each fault was 0.3 s of silence. Had it been waited for, that would be most of the time.
        held_up = [name for name in CHIPS
                   if not took_little(robot.kernel, robot.kernel.task(name))]
        simulator.send_signal(signal.SIGCONT)
        robot.run_until(lambda: robot.all_in(DeviceState.ACTIVE))
    finally:
        robot.manager.close()
    assert held_up == []
    said = {r.source for r in robot.reports.since(0)[2] if r.severity is Severity.ERROR
            and 'no answer for 0.3 s from the process that serves the bus' in r.text}
    assert said == set(CHIPS)
