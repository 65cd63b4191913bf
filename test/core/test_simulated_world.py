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

"""The simulated devices of a robot in one world: from its settings to the bytes of a driver."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import select
import tempfile
import time
from typing import Any

import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.core.simulator_command import simulator
from rt_robot_os.core.simulators import device_folder
from rt_robot_os.core.simulators import Simulators
from rt_robot_os.devices.maxbotix.driver import MaxBotix
from rt_robot_os.settings import load
from rt_robot_os.sim.commands import execute_command
from rt_robot_os.sim.commands import send_command
from rt_robot_os.sim.world import World
from rt_robot_os.sim.world_settings import WorldSettings
from rt_robot_os.testing.fakes import bind
from rt_robot_os.testing.fakes import settings_of

ROBOT = """
robot:
  ros__parameters:
    world: {map: open, start: [0.0, 0.0, 1.57079633], people: [anna 0.0 0.0 1.0]}
    devices: [sonar, imu]
    imu: {type: mpu6050, port: sim, mounting_m: [0.5, 0.0, 0.0], parent_frame_id: sonar_link}
    sonar: {type: maxbotix, port: sim, mounting_m: [0.1, 0.0, 0.2], sim: {rate_hz: 50.0}}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    (tmp_path / 'robot.yaml').write_text(ROBOT)
    simulators = Simulators()
    with tempfile.TemporaryDirectory(prefix='rt') as short:  # a socket's path must be
        place = device_folder(Path(short) / 'robot.sock')
        simulators.start(load([tmp_path / 'robot.yaml']), place)
        simulators.wait()
        yield place
        simulators.stop()
        assert not place.exists()


def test_a_person_steps_in_the_way_of_a_robot_that_runs(
        folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    driver = MaxBotix('sonar', settings_of(MaxBotix, port=str(folder / 'sonar')))
    samples = bind(driver)[0].samples
    driver.open()

    def measured(low: float, high: float) -> None:
        deadline = time.monotonic() + 60
        del samples[:]
        while not (samples and low < samples[-1].range < high):
            assert time.monotonic() < deadline
            select.select([driver.fileno()], [], [], 0.1)
            driver.read(time.monotonic_ns())

    try:
        measured(0.65, 0.71)  # 1.0 - 0.1 - 0.22
        send_command(folder, 'world person anna 0.0 3.0')
        measured(2.65, 2.71)
        assert simulator(['--dir', str(folder), '--tell', 'world person anna 0.0 2.0']) == 0
        measured(1.65, 1.71)
        assert simulator(['--dir', str(folder), '--tell', 'world where']) == 0
        base, anna, seconds = capsys.readouterr().out.splitlines()
        assert base == 'base_link 0.000000 0.000000 1.570796 0.000000 0.000000'
        assert anna == 'anna 0.000000 2.000000 standing' and float(seconds.split()[1]) > 0.0
        assert simulator(['--dir', str(folder), '--tell', 'world person bob 0.0 2.0']) == 2
        assert 'no such person; there are anna' in capsys.readouterr().err
        with pytest.raises(ConfigError, match='sonar, imu and one of the faults'):
            send_command(folder, 'sonra silent 3')
    finally:
        driver.close()


def test_where_nobody_takes_orders_that_is_told(tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match='no simulated devices receive commands there'):
        send_command(tmp_path, 'world walk anna')


def test_an_order_reaches_the_world_or_a_device_or_is_refused() -> None:
    world = World(WorldSettings(map='open', people=('anna 0 0 0',)))
    done: list[Any] = []

    class Deaf:
        def inject(self, fault: str, duration_s: float) -> None:
            done.append((fault, duration_s))

    devices: Any = {'imu': Deaf()}
    execute_command('', devices, world)
    execute_command('world person anna 1 2', devices, world)
    execute_command('imu silent 3', devices, None)
    assert done == [('silent', 3.0)] and (world.people[0].x, world.people[0].y) == (1.0, 2.0)
    with pytest.raises(ConfigError, match='there is no world'):
        execute_command('world walk anna', devices, None)
    with pytest.raises(ConfigError, match='write DEVICE FAULT SECONDS'):
        execute_command('imu silent long', devices, world)
