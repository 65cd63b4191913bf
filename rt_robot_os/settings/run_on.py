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


"""How far the motor boards of a robot move it after its computer has failed, from its settings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from rt_robot_os.devices.motor_board import MotorBoard
from rt_robot_os.devices.registry import DRIVERS
from rt_robot_os.modules.run_on import RUN_ON_MAX
from rt_robot_os.motion.run_on import RunOn
from rt_robot_os.motion.run_on import slowest
from rt_robot_os.settings.model import RobotSettings

#: The largest acceptable distance if nothing is known about obstacles, in m.
WAY_MAX_M: Final[float] = RUN_ON_MAX.default


@dataclass(frozen=True, slots=True)
class MovingBoard:
    """
    A motor board of a robot.

    :ivar run_on: as the board declares it.
    :ivar speed_m_s: the largest speed of a wheel, after the limits of modules.
    :ivar slowed_by: the module that limits this speed; empty for none.
    :ivar remedy: how to shorten the distance.
    """

    name: str
    run_on: RunOn
    speed_m_s: float
    slowed_by: str
    remedy: str

    @property
    def way_m(self) -> float:
        """Return how far the robot continues at that speed."""
        return self.run_on.way_m(self.speed_m_s)

    def __str__(self) -> str:
        """Return a sentence."""
        slowed = f', to which {self.slowed_by} slows it' if self.slowed_by else ''
        return (f'{self.name}: without this computer its motors stop after '
                f'{self.run_on.silence_s:.1f} s: {self.way_m:.2f} m at {self.speed_m_s:.2f} m/s'
                f'{slowed}')


def moving_boards(settings: RobotSettings) -> tuple[MovingBoard, ...]:
    """Return the motor boards of a robot."""
    drivers = [(device, DRIVERS.load(device.type)) for device in settings.devices]
    boards = [(device, driver, driver.run_on(device.settings)) for device, driver in drivers
              if issubclass(driver, MotorBoard)]
    # The modules assume the worst board.
    worst = slowest(run_on for _, _, run_on in boards)
    limits = [(worst.speed_m_s(way_m), module.name) for module in settings.modules
              if (way_m := module.settings.get(RUN_ON_MAX.name))]
    found = []
    for device, driver, run_on in boards:
        own_m_s = float(device.settings['maximum_wheel_speed_m_s'])
        lowest_m_s, by = min(limits, default=(own_m_s, ''))
        found.append(MovingBoard(device.name, run_on, min(own_m_s, lowest_m_s),
                                 by if lowest_m_s < own_m_s else '', driver.IF_SLOW))
    return tuple(found)
