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

"""Does the RoboClaw driver move the robot as commanded, and only then, whatever the unit does."""

from __future__ import annotations

from collections.abc import Iterator
import math
from pathlib import Path
import random
from typing import Any

from board_robot import board_robot
from board_robot import fill
from board_robot import WHEELS
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.devices.motor_faults import MotorFault
from rt_robot_os.devices.roboclaw import wire
from rt_robot_os.devices.roboclaw.driver import RoboClaw
from rt_robot_os.devices.roboclaw.simulated import SimulatedRoboClaw
from rt_robot_os.devices.state import DeviceState
from rt_robot_os.sim.world import World
from rt_robot_os.sim.world_settings import WorldSettings
from rt_robot_os.testing import ActuatorContract
from rt_robot_os.testing import settings_of


class TestRoboClaw(ActuatorContract):
    actuator = RoboClaw
    simulated = SimulatedRoboClaw
    speed = 0.3
    changes = WHEELS

    def fill(self, message: Any, speed: float) -> None:
        fill(message, speed)

    def moves(self, simulated: Any) -> bool:
        return bool(simulated.unit.drive.moves)


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[Any]:
    with robot_of(tmp_path, {}) as made:
        yield made


def robot_of(folder: Path, sim: dict[str, Any], **settings: Any) -> Any:
    return board_robot(folder, RoboClaw, SimulatedRoboClaw, sim, **{**WHEELS, **settings})


# --- what it tells and is told -------------------------------------------------------------------

def test_it_drives_as_commanded_and_says_so(robot: Any) -> None:
    robot.steer(0.3)
    robot.run(2000)
    assert robot.managed.state is DeviceState.ACTIVE, robot.managed.reason
    assert robot.simulated.base.velocity[0] == pytest.approx(0.3, rel=0.01)
    samples = robot.take('joint_states', lambda msg: ([*msg.position], [*msg.velocity]))
    assert len(samples) == pytest.approx(14, abs=2), 'the last that the topic keeps'
    position, velocity = samples[-1]
    assert velocity == pytest.approx([6.0, 6.0], rel=0.03)
    assert position == pytest.approx([*robot.simulated.base.wheel_angles], abs=0.3)
    assert robot.take('battery', lambda msg: msg.voltage)[-1] == pytest.approx(12.3)
    assert robot.faults() == 0
    counters = robot.counters()
    assert counters['version'] == 'USB Roboclaw 2x15a v4.2.4'
    assert counters['temperature_c'] == 30.0
    assert counters['current_m1_a'] == 1.2
    assert (counters['timeouts'], counters['retries'], counters['late_turns']) == (0, 0, 0)
    statistics = robot.device.statistics()
    assert statistics.rejected_bytes == statistics.rejected_frames == 0


@pytest.mark.parametrize(('last', 'told'), [(0.3, True), (0.0, False)])
def test_silence_is_worth_a_warning_only_while_it_drives(
        robot: Any, last: float, told: bool) -> None:
    robot.steer(0.3)
    robot.run(500)
    robot.steer(last)
    robot.run(100)
    robot.steer(None)
    robot.run(500)
    assert robot.counters()['command_timeouts'] == 1
    _, _, reports = robot.reports.since(0)
    assert any('no command for 0.3 s' in each.text for each in reports) == told


def test_the_counters_are_read_at_their_rate(robot: Any) -> None:
    robot.run(1000)
    before = robot.device.statistics().samples
    robot.run(3000)
    # 30 Hz of counters, and about one of the battery.
    assert robot.device.statistics().samples - before == pytest.approx(93, abs=2)


@pytest.mark.parametrize('wiring', [
    {}, {'swapped': True}, {'inverted_left': True}, {'inverted_right': True, 'swapped': True}])
def test_wheels_wired_otherwise_turn_the_same_way(
        tmp_path: Path, wiring: dict[str, Any]) -> None:
    with robot_of(tmp_path, {}, **wiring) as robot:
        robot._fill = lambda message, speed: setattr(message.angular, 'z', speed)
        robot.steer(1.0)
        robot.run(1500)
        assert robot.simulated.base.velocity == pytest.approx((0.0, 1.0), abs=0.02)
        assert robot.odometry_error_rad() < 0.3
        assert robot.device.counters.velocity_rad_s == pytest.approx((-3.0, 3.0), abs=0.2)


def test_in_the_world_it_moves_the_robot_there(robot: Any) -> None:
    robot.simulated.world = World(WorldSettings(map='open', start=(1.0, 2.0, math.pi / 2)))
    robot.simulated.prepare()
    robot.steer(0.3)
    robot.run(2000)
    x, y, yaw = robot.simulated.world.base.pose
    assert (x, yaw) == (pytest.approx(1.0), pytest.approx(math.pi / 2))
    wheel_rad = robot.device.counters.position_rad[0]
    assert y - 2.0 == pytest.approx(wheel_rad * 0.05, abs=0.02)


def test_its_own_watchdog_is_set_and_stops_it(robot: Any) -> None:
    robot.steer(0.3)
    robot.run(500)
    assert robot.simulated.unit.timeout_tenths == 3
    # This computer stands still: nothing is sent any more.
    now_ns = robot.kernel.now_ns()
    robot.simulated.pump(now_ns + 250_000_000)
    assert robot.simulated.unit.drive.moves
    robot.simulated.pump(now_ns + 560_000_000)
    assert not robot.simulated.unit.drive.moves


def test_an_acceleration_is_left_to_the_unit_and_a_stop_is_at_once(tmp_path: Path) -> None:
    with robot_of(tmp_path, {}, acceleration_m_s2=0.5) as robot:
        robot.run(200)
        robot.steer(0.5)
        robot.run(520)
        assert robot.simulated.base.velocity[0] == pytest.approx(0.25, abs=0.05)
        robot.run(800)
        assert robot.simulated.base.velocity[0] == pytest.approx(0.5, abs=0.01)
        robot.steer(0.0)
        robot.run(30)
        assert not robot.simulated.unit.drive.moves


def test_the_velocity_control_is_left_alone_unless_it_is_set(tmp_path: Path) -> None:
    with robot_of(tmp_path, {}) as robot:
        robot.run(300)
        assert robot.simulated.unit.gains == {}
    gains = {'velocity_p': 1.0, 'velocity_i': 0.5, 'velocity_d': 0.25, 'velocity_qpps': 44000}
    with robot_of(tmp_path, {}, **gains) as robot:
        robot.run(300)
        expected = wire.gains(0x80, wire.SET_PID_1, 1.0, 0.5, 0.25, 44000).data[2:-2]
        assert robot.simulated.unit.gains == {wire.SET_PID_1: expected, wire.SET_PID_2: expected}
    with pytest.raises(ConfigError, match='velocity_qpps 0: measure the speed'):
        RoboClaw('base', settings_of(RoboClaw, port='x', velocity_p=1.0, **WHEELS))


@pytest.mark.parametrize('speed', [1e300, -1e300, math.nan])
def test_a_command_beyond_reason_stops_it(robot: Any, speed: float) -> None:
    robot.steer(0.3)
    robot.run(500)
    robot.steer(speed)
    robot.run(100)
    assert not robot.simulated.unit.drive.moves
    assert robot.faults() & MotorFault.COMMAND_REFUSED
    robot.steer(0.3)
    robot.run(100)
    assert robot.simulated.unit.drive.moves


def test_a_stop_goes_before_everything_else(tmp_path: Path) -> None:
    # At 9600 baud one turn takes 40 ms on the line.
    with robot_of(tmp_path, {}, answer_timeout_s=0.1, output_rate_hz=10.0) as robot:
        robot.simulated._line.byte_ns = 1_041_666
        robot.steer(0.3)
        robot.run(1010)
        assert robot.simulated.unit.drive.moves
        for step in range(12):
            robot.run(7 + step)
            robot.steer(None)
            robot.publish(0.3)
            robot.run(100)
            assert robot.simulated.unit.drive.moves
            robot.publish(0.0)
            robot.run(2)
            assert not robot.simulated.unit.drive.moves, 'the stop waited for an answer'
        robot.run(500)
        assert robot.counters()['retries'] == 0, 'nothing was lost'
        assert not robot.faults() & MotorFault.LINE
        assert robot.device.statistics().rejected_bytes == 0


# --- what befalls it -----------------------------------------------------------------------------

@pytest.mark.parametrize('after_ms', [400, 3000])
def test_a_unit_that_loses_its_power_costs_no_wrong_odometry(
        robot: Any, after_ms: int) -> None:
    robot.steer(0.3)
    robot.run(after_ms)
    assert robot.odometry_error_rad() < 0.3
    robot.faults()
    before = robot.simulated.base.wheel_angles
    robot.simulated.inject('reset', 0.25)
    robot.run(260)
    # What it turned without power and until it is set up again may be missing, and no more.
    rolled = robot.simulated.base.wheel_angles[0] - before[0]
    for _ in range(100):
        robot.run(10)
        told, true = robot.device.counters.position_rad, robot.simulated.base.wheel_angles
        assert -rolled - 0.9 < told[0] - true[0] < 0.3
    assert robot.counters()['counter_resets'] == 1
    assert robot.faults() & MotorFault.COUNTS_NEW
    assert robot.managed.faults == 0
    # It is set up again, and goes on by the commands that come.
    assert robot.simulated.unit.timeout_tenths == 3
    assert robot.simulated.unit.drive.moves
    assert robot.counters()['set_ups'] == 2


def test_lost_bytes_cost_repetitions_and_no_wrong_odometry(robot: Any) -> None:
    robot.steer(0.3)
    robot.run(500)
    robot.simulated.inject('loss', 5.0)
    robot.run(5500)
    counters = robot.counters()
    assert counters['retries'] > 10
    assert robot.faults() & MotorFault.LINE
    assert counters['counter_resets'] == 0
    assert robot.odometry_error_rad() < 0.3
    assert robot.managed.faults == 0
    assert robot.simulated.unit.drive.moves


@pytest.mark.parametrize('seed', [1, 2, 3])
def test_noise_is_never_a_movement(robot: Any, seed: int) -> None:
    noise = random.Random(seed)
    robot.steer(0.3)
    robot.run(500)

    def disturb() -> None:
        if robot.simulated.port.plugged and noise.random() < 0.05:
            robot.simulated.port.write(noise.randbytes(noise.randrange(1, 20)))

    robot.disturb = disturb
    robot.run(3000)
    robot.disturb = None
    robot.run(500)
    assert robot.counters()['counter_resets'] == 0
    assert robot.odometry_error_rad() < 0.3


@pytest.mark.parametrize('fault, bit', [
    ('left_encoder', MotorFault.LEFT_STANDSTILL), ('right_encoder', MotorFault.RIGHT_STANDSTILL)])
def test_a_broken_encoder_stops_the_robot_within_half_a_second(
        robot: Any, fault: str, bit: MotorFault) -> None:
    robot.steer(0.3)
    robot.run(1000)
    robot.simulated.inject(fault, 10.0)
    robot.run(520)
    assert not robot.simulated.unit.drive.moves
    assert robot.faults() & bit
    assert 'stands still although it is commanded' in robot.managed.statistics().reason
    robot.run(1000)
    assert not robot.simulated.unit.drive.moves, (
        'continued commands are no acknowledgement of the fault')


def test_an_overcurrent_is_told(robot: Any) -> None:
    robot.run(500)
    robot.simulated.inject('overcurrent', 1.0)
    robot.run(500)
    assert robot.faults() >> 16 == 0x4000
    assert robot.managed.statistics().reason == 'it reports overcurrent of M1'
    assert robot.counters()['current_m1_a'] == 31.0
    robot.run(2000)
    assert robot.managed.statistics().reason == ''
    robot.faults()
    robot.run(2000)
    assert robot.faults() == 0


def test_the_status_of_old_firmware_is_read_as_well(tmp_path: Path) -> None:
    with robot_of(tmp_path, {'old_status': True}) as robot:
        robot.run(1000)
        robot.simulated.inject('overcurrent', 1.0)
        robot.run(500)
        assert robot.faults() >> 16 == 0x4000
        assert robot.counters()['timeouts'] == 1, 'it has to be found out once'


def test_unplugged_while_driving_nothing_moves_until_a_new_command(robot: Any) -> None:
    robot.steer(0.3)
    robot.run(1000)
    robot.unplug()
    robot.steer(None)
    robot.run(25)
    assert robot.managed.state is DeviceState.FAULT
    robot.run(2000)
    assert robot.managed.state is DeviceState.ACTIVE
    assert not robot.simulated.unit.drive.moves
    # It kept its power, so that its counters tell what it rolled meanwhile.
    assert robot.counters()['counter_resets'] == 0
    robot.steer(0.3)
    robot.run(200)
    assert robot.simulated.unit.drive.moves


def test_plugged_in_again_it_goes_on_with_the_commands_that_come(robot: Any) -> None:
    robot.steer(0.3)
    robot.run(1000)
    robot.unplug()
    robot.run(3000)
    assert robot.managed.faults >= 1
    assert robot.managed.state is DeviceState.ACTIVE
    assert robot.simulated.unit.drive.moves, robot.managed.statistics().reason
    assert robot.faults() == 0


def test_a_watchdog_that_changed_is_set_again(robot: Any) -> None:
    robot.steer(0.3)
    robot.run(1000)
    robot.simulated.unit.timeout_tenths = 0
    robot.run(400)
    assert robot.simulated.unit.timeout_tenths == 3
    robot.run(200)
    assert robot.simulated.unit.drive.moves, 'it goes on by the commands that come'


def test_another_unit_in_its_place_is_noticed(robot: Any) -> None:
    robot.steer(0.3)
    robot.run(1000)
    before = robot.device.counters.position_rad
    robot.steer(None)
    robot.run(1000)
    robot.unplug()
    robot.run(20)
    robot.simulated.unit.version = b'USB Roboclaw 2x30a v4.1.34\n\x00'
    robot.simulated.unit.offsets = [123456, -99]
    robot.run(1000)
    after = robot.device.counters.position_rad
    assert after[0] - before[0] < 3.0
    assert robot.counters()['version'] == 'USB Roboclaw 2x30a v4.1.34'
    texts = [r.text for r in robot.reports.since(0)[2]]
    assert any('another unit: it was a USB Roboclaw 2x15a' in text for text in texts)


def test_a_unit_of_another_kind_is_refused(tmp_path: Path) -> None:
    with robot_of(tmp_path, {}, identity='2x30A') as robot:
        robot.steer(0.3)
        robot.run(1000)
        assert not robot.simulated.unit.drive.moves
        assert 'it is a USB Roboclaw 2x15a v4.2.4, and identity is' in robot.managed.reason


def test_a_unit_with_another_address_is_silent(tmp_path: Path) -> None:
    with robot_of(tmp_path, {}) as robot:
        robot.simulated.unit.address = 0x81
        robot.run(1500)
        assert robot.managed.faults >= 1
        assert 'packet serial mode with this address' in robot.managed.reason


def test_a_unit_that_does_not_know_a_command_is_told_so(tmp_path: Path) -> None:
    with robot_of(tmp_path, {}) as robot:
        size = robot.simulated.unit._size
        robot.simulated.unit._size = lambda buffer: -1 if buffer[1:2] == b'\x0f' else size(buffer)
        robot.run(1500)
        assert robot.managed.state is not DeviceState.ACTIVE
        texts = [r.text for r in robot.reports.since(0)[2]]
        assert texts == ['it answers, but not to command 15 (read serial timeout): update its '
                         'firmware']
