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

"""After whatever befell a motor board: nothing moves by itself, and everything works again."""

from __future__ import annotations

from pathlib import Path
import random
from typing import Any

from board_robot import board_robot
from board_robot import WHEELS
import pytest
from rt_robot_os.devices.kobuki.driver import Kobuki
from rt_robot_os.devices.kobuki.simulated import SimulatedKobuki
from rt_robot_os.devices.roboclaw.driver import RoboClaw
from rt_robot_os.devices.roboclaw.simulated import SimulatedRoboClaw
from rt_robot_os.devices.state import DeviceState

FAULTS = ('loss', 'reset', 'silent', 'garbage', 'corrupt', 'short', 'left_encoder', 'overcurrent')
BOARDS = {
    'kobuki': (Kobuki, SimulatedKobuki, {}),
    'roboclaw': (RoboClaw, SimulatedRoboClaw, WHEELS),
}


def moves(robot: Any) -> bool:
    simulated = robot.simulated
    return bool(simulated.unit.drive.moves) if hasattr(simulated, 'unit') else any(simulated.told)


def befall(robot: Any, chance: random.Random) -> None:
    """Have something happen, and let some time pass."""
    what = chance.choice((*FAULTS, *FAULTS, 'steer', 'steer', 'stop', 'nobody', 'unplug'))
    if what in FAULTS:
        robot.simulated.inject(what, chance.choice((0.05, 0.3, 0.7)))
    elif what == 'unplug':
        robot.unplug()
    else:
        robot.steer({'steer': chance.choice((-0.4, 0.4)), 'stop': 0.0, 'nobody': None}[what])
    robot.run(chance.choice((30, 100, 400)))


@pytest.mark.parametrize('seed', range(3))
@pytest.mark.parametrize('board', BOARDS)
def test_after_a_storm(tmp_path: Path, board: str, seed: int) -> None:
    driver, simulated, settings = BOARDS[board]
    chance = random.Random(seed)
    with board_robot(tmp_path, driver, simulated, {'seed': seed}, **settings) as robot:
        robot.run(300)
        for _ in range(12):
            befall(robot, chance)
        robot.steer(None)
        robot.run(2000)
        assert not moves(robot)
        assert robot.managed.state is DeviceState.ACTIVE, robot.managed.reason
        # A command to stand says that somebody noticed what stopped it.
        robot.steer(0.0)
        robot.run(100)
        before = robot.odometry_error_rad()
        robot.steer(0.4)
        robot.run(500)
        assert moves(robot), robot.managed.statistics().reason
        robot.steer(0.0)
        robot.run(500)
        assert robot.odometry_error_rad() == pytest.approx(before, abs=0.1)
