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

"""Does the Kobuki driver move the base as commanded, and tell all that the base sends."""

from __future__ import annotations

from collections.abc import Iterator
import math
from pathlib import Path
import struct
from typing import Any

from board_robot import board_robot
from board_robot import fill
import numpy as np
import pytest
from rt_robot_os.devices.kobuki import wire
from rt_robot_os.devices.kobuki.driver import Kobuki
from rt_robot_os.devices.kobuki.simulated import SimulatedKobuki
from rt_robot_os.devices.kobuki.wire import KobukiDecoder
from rt_robot_os.devices.motor_faults import MotorFault
from rt_robot_os.devices.state import DeviceState
from rt_robot_os.sim.world import World
from rt_robot_os.sim.world_settings import WorldSettings
from rt_robot_os.testing import ActuatorContract
from rt_robot_os.testing import DecoderContract
from rt_robot_os.testing.fakes import scripted

CORE = wire.CoreSensors(4711, 2, 1, 4, 65535, 1, -20, 20, 4, 22, 167, 3)


class TestKobuki(ActuatorContract):
    actuator = Kobuki
    simulated = SimulatedKobuki
    speed = 0.3

    def fill(self, message: Any, speed: float) -> None:
        fill(message, speed)

    def moves(self, simulated: Any) -> bool:
        return any(simulated.told)


class TestKobukiDecoder(DecoderContract):
    stream = (wire.packet([wire.core(CORE), (wire.DOCK, b'abc'), wire.inertia(1.0, 0.5),
                           wire.gyro(1, [(0.1, 0.2, 0.3)] * 2)])
              + wire.velocity_command(0.2, 0.5) + wire.packet([wire.core(CORE)]))
    tokens = (b'\xaa', b'\xaa\x55', b'\xaa\x55\x15', b'\xaa\x55\x15\x01\x0f', b'\xaa\x55\xa0\x01',
              b'\x55', wire.packet([wire.core(CORE)]))

    def decoder(self) -> Any:
        return KobukiDecoder()

    def frame_size(self, frame: Any) -> int:
        return int(frame.size)

    def covered(self, frame: bytes) -> Any:
        return range(len(frame))


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[Any]:
    with robot_of(tmp_path, {}) as made:
        yield made


def robot_of(folder: Path, sim: dict[str, Any], **settings: Any) -> Any:
    return board_robot(folder, Kobuki, SimulatedKobuki, sim, **settings)


# --- what it tells and is told -------------------------------------------------------------------

def test_it_drives_as_commanded_and_says_so(robot: Any) -> None:
    robot.steer(0.3)
    robot.run(3000)
    assert robot.managed.state is DeviceState.ACTIVE, robot.managed.reason
    assert robot.simulated.base.velocity == pytest.approx((0.3, 0.0), abs=0.003)
    position, velocity = robot.take(
        'joint_states', lambda msg: ([*msg.position], [*msg.velocity]))[-1]
    assert velocity == pytest.approx([0.3 / 0.035] * 2, rel=0.03)
    assert position == pytest.approx([*robot.simulated.base.wheel_angles], abs=0.2)
    assert robot.take('battery', lambda msg: (msg.voltage, msg.power_supply_status))[-1] == (
        pytest.approx(16.4), 2)
    assert set(robot.take('bumper')) == {0}
    assert robot.faults() == 0
    counters = robot.counters()
    assert (counters['hardware'], counters['firmware']) == ('1.0.4', '1.2.0')
    assert len(counters['unique_id']) == 24
    statistics = robot.device.statistics()
    assert (statistics.rejected_bytes, statistics.ignored_frames) == (0, 0)


def test_its_counters_wrap_and_its_odometry_does_not(robot: Any) -> None:
    # 65536 ticks are 5.6 m: let the left counter begin before its end, the right one at half.
    robot.simulated.count_offsets = 1500, 32768 + 1500
    robot.run(500)
    resets = robot.counters()['counter_resets']
    robot.steer(0.7)
    robot.run(2000)
    assert robot.device.counters.position_rad[0] > 3000 * wire.TICK_RAD
    assert robot.odometry_error_rad() < 0.5
    assert robot.counters()['counter_resets'] == resets


@pytest.mark.parametrize('linear, angular', [(0.2, 0.5), (-0.2, 0.5), (0.0, -1.0), (0.2, -0.5)])
def test_it_turns_the_way_that_is_commanded(
        tmp_path: Path, linear: float, angular: float) -> None:
    def turning(message: Any, speed: float) -> None:
        message.linear.x, message.angular.z = linear, angular

    with robot_of(tmp_path, {}, fill=turning) as robot:
        robot.steer(1.0)
        robot.run(1500)
        assert robot.simulated.base.velocity == pytest.approx((linear, angular), abs=0.01)
        assert robot.odometry_error_rad() < 0.5
        rate, (z, w) = robot.take('imu/data', lambda msg: (
            msg.angular_velocity.z, (msg.orientation.z, msg.orientation.w)))[-1]
        assert rate == pytest.approx(angular, abs=0.02)
        assert 2 * math.atan2(z, w) == pytest.approx(robot.simulated.base.pose[2], abs=0.05)


def test_wheels_of_another_size_are_told_so(tmp_path: Path) -> None:
    # Worn wheels: as the driver has it, not as the base thinks.
    with robot_of(tmp_path, {}, wheel_radius_m=0.034) as robot:
        robot.simulated.base.fit(0.034, wire.SEPARATION_M)
        robot.steer(0.3)
        robot.run(1500)
        assert robot.simulated.base.velocity[0] == pytest.approx(0.3, abs=0.004)


def test_the_gyroscope_can_be_left_out(tmp_path: Path) -> None:
    with robot_of(tmp_path, {}, imu=False) as robot:
        robot.run(500)
        assert 'imu/data' not in robot.readers
        assert robot.managed.state is DeviceState.ACTIVE


def test_what_the_gyroscope_does_not_know_is_said(robot: Any) -> None:
    robot.run(500)
    message = robot.take('imu/data', lambda msg: (
        float(msg.linear_acceleration_covariance[0]), np.array(msg.orientation_covariance),
        float(msg.angular_velocity_covariance[8])))[-1]
    assert message[0] == -1.0
    assert message[1][0] >= 1e5 and message[1][8] == pytest.approx(0.01)
    assert message[2] == pytest.approx(1e-4)


@pytest.mark.parametrize('charger, status, words', [
    (0, 2, 'discharging'), (2, 4, 'charged in the dock'), (6, 1, 'charging in the dock'),
    (18, 4, 'charged at the adapter'), (22, 1, 'charging at the adapter')])
def test_the_charger(tmp_path: Path, charger: int, status: int, words: str) -> None:
    with robot_of(tmp_path, {'charger': charger}) as robot:
        robot.run(300)
        assert robot.take('battery', lambda msg: msg.power_supply_status) == [status]
        assert robot.counters()['charger'] == words


@pytest.mark.parametrize('contact_deg, bits', [
    (0, 2), (29, 2), (31, 4), (-45, 1), (89, 4), (120, 0), (180, 0)])
def test_the_bumper(robot: Any, contact_deg: float, bits: int) -> None:
    robot.run(300)
    robot.take('bumper')
    at = math.radians(contact_deg)
    reach = robot.simulated.base.radius_m + 0.003
    point = reach * math.cos(at), reach * math.sin(at)
    robot.simulated.base._obstacles = lambda x, y, m: [point]
    robot.run(25)
    assert (robot.take('bumper') or [0])[-1] == bits


def test_in_the_world_it_bumps_into_who_stands_there(robot: Any) -> None:
    # Somebody stands 1 m ahead.
    robot.simulated.world = World(WorldSettings(map='open', people=('anna 0.0 1.0 0.0',)))
    robot.simulated.prepare()
    robot.steer(0.3)
    robot.run(2000)
    assert set(robot.take('bumper')) == {0}
    robot.run(1500)
    assert robot.take('bumper')[-1] == 2
    robot.steer(None)
    robot.run(1000)
    assert set(robot.take('bumper')) == {2}, 'it still stands against her'
    base = robot.simulated.world.base
    assert 0.3 < base.pose[0] < 0.8
    assert base.wheel_radius_m == 0.035
    robot.steer(-0.3)
    robot.run(500)
    assert robot.take('bumper')[-1] == 0


def test_a_base_that_is_lifted_tells_cliff_and_wheel_drop(robot: Any) -> None:
    robot.run(300)
    robot.simulated.lifted = True
    robot.run(100)
    assert robot.take('bumper')[-1] == 24
    assert robot.faults() >> 16 == 0b1100


def test_a_button_is_told_when_it_is_pressed(robot: Any) -> None:
    robot.run(300)
    robot.take('buttons')
    core = robot.simulated.core_sensors
    robot.simulated.core_sensors = lambda: core()._replace(buttons=4)
    robot.run(25)
    robot.simulated.core_sensors = core
    robot.run(25)
    assert robot.take('buttons') == [4, 0]


# --- what befalls it -----------------------------------------------------------------------------

def test_nothing_is_sent_while_nothing_is_commanded(robot: Any) -> None:
    robot.run(3000)
    before = robot.simulated.commanded_ns
    robot.run(1000)
    assert robot.simulated.commanded_ns == before, 'it would never stop by itself'
    robot.steer(0.2)
    robot.run(500)
    # This computer stands still.
    now_ns = robot.kernel.now_ns()
    robot.simulated.pump(now_ns + 550_000_000)
    assert any(robot.simulated.told)
    robot.simulated.pump(now_ns + 650_000_000)
    assert not any(robot.simulated.told)


def test_a_stop_that_is_lost_is_repeated(robot: Any) -> None:
    robot.steer(0.3)
    robot.run(500)
    handle_command, stops = robot.simulated.handle_command, []

    def lose(data: bytes) -> None:
        if data == wire.velocity_command(0.0, 0.0):
            stops.append(data)
        if len(stops) != 1:
            handle_command(data)

    robot.simulated.handle_command = lose
    robot.steer(None)
    robot.run(400)
    assert len(stops) > 2
    assert not any(robot.simulated.told)


@pytest.mark.parametrize('after_ms', [300, 4000])
def test_a_base_that_was_switched_off_and_on_costs_no_wrong_odometry(
        robot: Any, after_ms: int) -> None:
    robot.steer(0.3)
    robot.run(after_ms)
    assert robot.odometry_error_rad() < 0.5
    robot.faults()
    before = robot.simulated.base.wheel_angles
    robot.simulated.inject('reset', 0.5)
    robot.run(520)
    rolled = robot.simulated.base.wheel_angles[0] - before[0]
    for _ in range(100):
        robot.run(10)
        told, true = robot.device.counters.position_rad, robot.simulated.base.wheel_angles
        assert -rolled - 0.9 < told[0] - true[0] < 0.5
    assert robot.counters()['counter_resets'] >= 1
    assert robot.faults() & MotorFault.COUNTS_NEW
    assert robot.managed.faults == 0
    assert any(robot.simulated.told), 'it goes on by the commands that come'


def test_a_computer_that_stood_still_takes_no_base_for_another() -> None:
    def packets(begin_ms: int, end_ms: int) -> bytes:
        return b''.join(wire.packet([wire.core(CORE._replace(
            time_ms=ms & 0xFFFF, left=ms & 0xFFFF, right=ms & 0xFFFF))])
            for ms in range(begin_ms, end_ms, 20))

    # For five seconds nothing is read; for what came in the last three there was no room.
    chunks = [packets(30_000, 31_000), packets(31_000, 33_000), packets(36_000, 37_000)]
    with scripted(Kobuki, chunks) as (device, _):
        for at_s in (31, 36, 37):
            device.read(at_s * 10**9)
        assert device.counters.resets == 0
        # It would have been brought to rest, and what it went since then be lost.
        assert device.counters.position_rad[0] / wire.TICK_RAD >= 980 + 1980


def test_lost_bytes_cost_packets_and_no_wrong_odometry(robot: Any) -> None:
    robot.steer(0.3)
    robot.run(500)
    robot.simulated.inject('loss', 5.0)
    robot.run(5500)
    statistics = robot.device.statistics()
    assert statistics.rejected_bytes > 1000
    assert robot.counters()['counter_resets'] == 0
    assert robot.odometry_error_rad() < 0.5
    assert robot.managed.faults == 0


@pytest.mark.parametrize('fault, bit', [
    ('left_encoder', MotorFault.LEFT_STANDSTILL), ('right_encoder', MotorFault.RIGHT_STANDSTILL)])
def test_a_broken_encoder_stops_the_robot_within_half_a_second(
        robot: Any, fault: str, bit: MotorFault) -> None:
    robot.steer(0.3)
    robot.run(1000)
    robot.simulated.inject(fault, 10.0)
    robot.run(500)
    assert not any(robot.simulated.told)
    assert robot.faults() & bit


def test_an_overcurrent_is_told(robot: Any) -> None:
    robot.run(500)
    robot.simulated.inject('overcurrent', 1.0)
    robot.run(500)
    assert robot.faults() >> 16 == 3
    robot.run(1000)
    robot.faults()
    robot.run(1000)
    assert robot.faults() == 0


def test_a_clock_that_stands_still_is_no_news(robot: Any) -> None:
    robot.steer(0.3)
    robot.run(1000)
    robot.simulated.inject('stuck', 10.0)
    robot.run(900)
    assert not any(robot.simulated.told), 'it drove on what it was told once'
    assert robot.faults() & (
        MotorFault.COUNTS_MISSING | MotorFault.LEFT_STANDSTILL | MotorFault.RIGHT_STANDSTILL)
    robot.steer(None)
    robot.run(3000)
    assert 'its clock stands still' in robot.managed.statistics().reason
    assert robot.counters()['old_packets'] > 50


def test_unplugged_while_driving_nothing_moves_until_a_new_command(robot: Any) -> None:
    robot.steer(0.3)
    robot.run(1000)
    robot.unplug()
    robot.steer(None)
    robot.run(25)
    assert robot.managed.state is DeviceState.FAULT
    robot.run(2000)
    assert robot.managed.state is DeviceState.ACTIVE
    assert not any(robot.simulated.told)
    assert robot.counters()['counter_resets'] == 0
    robot.steer(0.3)
    robot.run(200)
    assert any(robot.simulated.told)


def test_another_base_in_its_place_is_noticed(robot: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    robot.run(1500)
    robot.unplug()
    robot.run(20)
    monkeypatch.setattr(
        'rt_robot_os.devices.kobuki.simulated._UNIQUE_ID', struct.pack('<3I', 1, 2, 3))
    robot.simulated.count_offsets = (4321, -999)
    before = robot.device.counters.position_rad
    robot.run(2000)
    assert robot.device.counters.position_rad == pytest.approx(before, abs=0.1)
    texts = [r.text for r in robot.reports.since(0)[2]]
    assert any(text.startswith('another base: it was') for text in texts)


@pytest.mark.parametrize('speed', [1e300, -1e300, math.nan])
def test_a_command_beyond_reason_stops_it(robot: Any, speed: float) -> None:
    robot.steer(0.3)
    robot.run(500)
    robot.steer(speed)
    robot.run(100)
    assert not any(robot.simulated.told)
    assert robot.faults() & MotorFault.COMMAND_REFUSED
