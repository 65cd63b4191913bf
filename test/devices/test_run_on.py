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


"""The declared motion of motor boards without commands, compared with the simulated boards."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from board_robot import board_robot
from board_robot import WHEELS
import pytest

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.devices.arduino_bridge.driver import ArduinoBridge
from rt_robot_os.devices.arduino_bridge.simulated import SimulatedArduinoBridge
from rt_robot_os.devices.kobuki.driver import Kobuki
from rt_robot_os.devices.kobuki.simulated import SimulatedKobuki
from rt_robot_os.devices.maxbotix.driver import MaxBotix
from rt_robot_os.devices.odrive.driver import Odrive
from rt_robot_os.devices.odrive.simulated import SimulatedOdrive
from rt_robot_os.devices.roboclaw.driver import RoboClaw
from rt_robot_os.devices.roboclaw.simulated import SimulatedRoboClaw
from rt_robot_os.motion.run_on import RunOn
from rt_robot_os.testing import settings_of

pytest.importorskip('sensor_msgs', reason='ROS 2 messages are not installed')

TICKLESS = {name: value for name, value in WHEELS.items() if name != 'ticks_per_revolution'}
ARDUINO = {**WHEELS, 'reset_wait_s': 0.0, 'pid_gains': [20, 12, 0, 20],
           'maximum_wheel_speed_m_s': 0.5}
BOARDS = [
    pytest.param(ArduinoBridge, SimulatedArduinoBridge, ARDUINO, id='arduino_bridge'),
    pytest.param(ArduinoBridge, SimulatedArduinoBridge, {**ARDUINO, 'auto_stop_s': 0.5},
                 id='fast_arduino_bridge'),
    pytest.param(RoboClaw, SimulatedRoboClaw, WHEELS, id='roboclaw'),
    pytest.param(RoboClaw, SimulatedRoboClaw, {**WHEELS, 'watchdog_s': 0.9}, id='slow_roboclaw'),
    pytest.param(Kobuki, SimulatedKobuki, {}, id='kobuki'),
    pytest.param(Odrive, SimulatedOdrive, TICKLESS, id='odrive'),
    pytest.param(Odrive, SimulatedOdrive, {**TICKLESS, 'watchdog_s': 1.0}, id='slow_odrive')]


@pytest.mark.parametrize(('driver', 'simulated', 'settings'), BOARDS)
def test_a_board_goes_on_no_farther_than_it_declares(
        tmp_path: Path, driver: Any, simulated: Any, settings: dict[str, Any]) -> None:
    sim = {'boot_s': 0.1} if driver is ArduinoBridge else {}
    with board_robot(tmp_path, driver, simulated, sim, **settings) as robot:
        robot.steer(0.4)
        robot.run(3000)
        speed_m_s, (x, _, _) = robot.simulated.base.velocity[0], robot.simulated.base.pose
        assert speed_m_s == pytest.approx(0.4, rel=0.1)
        # This computer is gone: nothing is read or written any more.
        begun_ns = robot.kernel.now_ns()
        for ms in range(1, 12_000, 2):
            robot.simulated.pump(begun_ns + ms * NS_PER_MS)
        assert robot.simulated.base.velocity[0] == pytest.approx(0.0, abs=1e-3)
        way_m = robot.simulated.base.pose[0] - x
        declared_m = robot.device.run_on(robot.device.settings).way_m(speed_m_s)
        assert 0.5 * declared_m < way_m < declared_m


def test_the_board_that_is_slow_to_notice_is_slow_by_default() -> None:
    way_m = {}
    for driver in (ArduinoBridge, RoboClaw, Kobuki, Odrive):
        needed = {} if driver is Kobuki else TICKLESS if driver is Odrive else WHEELS
        settings = settings_of(driver, port='x', **needed)
        way_m[driver.__name__] = driver.run_on(settings).way_m(settings['maximum_wheel_speed_m_s'])
    assert way_m['ArduinoBridge'] < 0.5, way_m
    assert max(way_m.values()) < 0.75, way_m


def test_a_firmware_that_was_built_to_stop_earlier_may_be_driven_faster() -> None:
    slow, fast = (ArduinoBridge.run_on(settings_of(ArduinoBridge, port='x', **WHEELS, **changes))
                  for changes in ({}, {'auto_stop_s': 0.5, 'coast_s': 0.1}))
    assert (slow.silence_s, fast.silence_s) == pytest.approx((2.033, 0.533))
    assert (slow.coast_s, fast.coast_s) == (0.4, 0.1)


def test_a_sensor_moves_nothing() -> None:
    assert MaxBotix.run_on(settings_of(MaxBotix, port='x')) == RunOn()
