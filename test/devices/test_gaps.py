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

"""After a gap, in which nothing was served, a board is told to stop before anything else."""

from __future__ import annotations

from collections.abc import Iterator
import fcntl
from pathlib import Path
import select
import struct
import termios
from typing import Any

from board_robot import board_robot
from board_robot import BoardRobot
from board_robot import WHEELS
import pytest
from rt_robot_os.devices.arduino_bridge.driver import ArduinoBridge
from rt_robot_os.devices.arduino_bridge.simulated import SimulatedArduinoBridge
from rt_robot_os.devices.gaps import Gaps
from rt_robot_os.devices.kobuki.driver import Kobuki
from rt_robot_os.devices.kobuki.simulated import SimulatedKobuki
from rt_robot_os.devices.odrive.driver import Odrive
from rt_robot_os.devices.odrive.simulated import SimulatedOdrive
from rt_robot_os.devices.roboclaw.driver import RoboClaw
from rt_robot_os.devices.roboclaw.simulated import SimulatedRoboClaw
from rt_robot_os.kernel import VirtualClock

MS = 1_000_000
S = 1_000_000_000
BOARDS: dict[str, tuple[Any, Any, dict[str, Any], dict[str, Any]]] = {
    'arduino_bridge': (ArduinoBridge, SimulatedArduinoBridge, {'boot_s': 0.1},
                       {**WHEELS, 'reset_wait_s': 0.0, 'output_rate_hz': 50.0}),
    'kobuki': (Kobuki, SimulatedKobuki, {}, {}),
    'odrive': (Odrive, SimulatedOdrive, {}, {
        'wheel_radius_m': 0.05, 'wheel_separation_m': 0.3}),
    'roboclaw': (RoboClaw, SimulatedRoboClaw, {}, dict(WHEELS))}


def wait_for_bytes(descriptor: int | None, count: int) -> None:
    """Wait until so many bytes can be read from a pty, which hands over in its own time."""
    assert descriptor is not None
    for _ in range(60_000):
        if struct.unpack('i', fcntl.ioctl(descriptor, termios.FIONREAD, bytes(4)))[0] >= count:
            return
        select.select([], [], [], 0.001)
    raise AssertionError(f'{count} bytes did not arrive')


@pytest.fixture(params=sorted(BOARDS))
def robot(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[BoardRobot]:
    driver, simulated, sim, settings = BOARDS[request.param]
    with board_robot(tmp_path, driver, simulated, sim, command_timeout_s=5.0, **settings) as made:
        made.steer(0.2)
        made.run(3000)
        assert made.device.is_moving()
        made.steer(None)
        yield made


def test_a_board_is_told_to_stop_and_commands_of_before_the_gap_move_nothing(
        robot: BoardRobot) -> None:
    before_ns = robot.kernel.now_ns()
    moved: list[bool] = []

    def look() -> None:
        moved.append(robot.device.is_moving())
        if len(moved) in (1, 20):  # what waited, within its time-out of 5 s
            robot.publish(0.2, before_ns - 1)

    robot.disturb = look
    robot.kernel.clock.spend(1500 * MS)
    robot.run(500)
    assert not any(moved[1:]), 'in its first round already it is told to stop'
    counters = robot.counters()
    assert (counters['gaps'], counters['late_commands']) == (1, 2)
    assert counters['gap_maximum_ms'] >= 1500
    notes = [each.text for each in robot.reports.since(0)[2]]
    assert any('not served for 1.5 s' in each for each in notes)
    robot.steer(0.2)
    robot.run(200)
    assert robot.device.is_moving(), 'a command of after the gap'


def test_a_short_hold_up_is_no_gap(robot: BoardRobot) -> None:
    robot.kernel.clock.spend(200 * MS)
    robot.run(40)
    assert robot.device.is_moving() and 'gaps' not in robot.counters()


def test_the_time_of_a_gap_is_no_silence_of_the_device(robot: BoardRobot) -> None:
    faults = robot.managed.faults
    robot.kernel.clock.spend(60 * S)
    robot.run(1500)
    assert robot.managed.faults == faults and robot.managed.state.value == 'active'


def test_what_lay_in_the_port_may_be_as_old_as_the_gap(tmp_path: Path) -> None:
    driver, simulated, sim, settings = BOARDS['kobuki']  # it sends by itself
    with board_robot(tmp_path, driver, simulated, sim, **settings) as robot:
        robot.run(1000)
        joints = robot.readers['joint_states']
        while joints.take():
            pass
        began_ns = robot.kernel.now_ns()
        descriptor, sent = robot.device.fileno(), robot.simulated.port.bytes_sent
        for _ in range(5):
            robot.kernel.clock.spend(100 * MS)
            robot.simulated.pump(robot.kernel.now_ns())
        wait_for_bytes(descriptor, robot.simulated.port.bytes_sent - sent)
        woke_ns = robot.kernel.now_ns()
        robot.run(40)
        stamps = []
        while joints.take():
            stamps.append(joints.stamp_ns)
        assert stamps == sorted(stamps)
        assert len(stamps) > 10 and max(stamps) <= began_ns < woke_ns, 'none counts as new'
        robot.run(200)
        assert joints.latest() and joints.stamp_ns > woke_ns + 200 * MS


class Sleepy(VirtualClock):
    """A clock of a machine that is suspended."""

    slept_ns = 0

    def suspended_ns(self) -> int:
        return self.slept_ns


def test_a_suspension_is_a_gap_although_the_clock_did_not_count_it() -> None:
    clock = Sleepy()
    gaps = Gaps(clock)
    assert not gaps.round(10 * MS, 10 * MS)
    clock.slept_ns = 3600 * S
    assert gaps.round(20 * MS, 10 * MS) == 3600 * S + 10 * MS
    assert (gaps.count, gaps.since_ns) == (1, 10 * MS)
    assert not gaps.round(30 * MS, 10 * MS)


def test_rounds_that_are_rare_are_no_gaps() -> None:
    gaps = Gaps(VirtualClock())
    assert not any(gaps.round(number * S, S) for number in range(1, 5))
    assert gaps.round(8 * S, S) == 4 * S
