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

"""Simulated devices come back when the process that supervises them was killed."""

from __future__ import annotations

import os
from pathlib import Path
import signal
import tempfile

from processes import wait_until
import pytest

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.core.simulators import device_folder
from rt_robot_os.core.simulators import Simulators
from rt_robot_os.devices.maxbotix.driver import MaxBotix
from rt_robot_os.settings import load
from rt_robot_os.testing.fakes import bind
from rt_robot_os.testing.fakes import settings_of

pytest.importorskip('sensor_msgs.msg', reason='the ROS 2 messages are not installed')

ROBOT = """
robot:
  ros__parameters:
    devices: [sonar]
    sonar: {type: maxbotix, port: sim, sim: {rate_hz: 50.0}}
"""


def test_simulated_devices_come_back_each_time_their_keeper_is_killed(tmp_path: Path) -> None:
    (tmp_path / 'robot.yaml').write_text(ROBOT)
    simulators = Simulators()
    said: list[str] = []
    with tempfile.TemporaryDirectory(prefix='rt') as short:  # a socket's path must be
        folder = device_folder(Path(short) / 'robot.sock')
        ports = simulators.start(load([tmp_path / 'robot.yaml']), folder)
        driver = MaxBotix('sonar', settings_of(MaxBotix, port=ports['sonar']))
        samples = bind(driver)[0].samples

        def measures() -> bool:
            said.extend(simulators.reports())
            try:
                if driver.fileno() is None:
                    driver.open()
                driver.read(1)
            except DeviceError:
                driver.close()
            return bool(samples)

        try:
            for kills in (1, 2):
                wait_until(measures, 'a sample')
                keeper = simulators._supervisor
                assert keeper is not None and keeper.process is not None
                os.kill(keeper.process.pid, signal.SIGKILL)
                wait_until(
                    lambda: said.extend(simulators.reports()) or simulators.restarts >= kills,
                    'a restart')
                driver.close()
                samples.clear()
            wait_until(measures, 'a sample again')
        finally:
            driver.close()
            simulators.stop()
    assert any('was ended by SIGKILL; it is started again' in each for each in said)
    assert not folder.exists()
