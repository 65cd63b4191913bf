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

"""The driver of ros_arduino_bridge and its simulated device."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from contextlib import contextmanager
import math
from pathlib import Path
from typing import Any

import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.devices.arduino_bridge import wire
from rt_robot_os.devices.arduino_bridge.driver import ArduinoBridge
from rt_robot_os.devices.arduino_bridge.simulated import SimulatedArduinoBridge
from rt_robot_os.devices.arduino_bridge.wire import ReplyDecoder
from rt_robot_os.devices.motor_faults import MotorFault
from rt_robot_os.devices.state import DeviceState
from rt_robot_os.sim.faults import MOTOR_FAULTS
from rt_robot_os.testing import ActuatorContract
from rt_robot_os.testing import DecoderContract
from rt_robot_os.testing import settings_of
from rt_robot_os.testing.actuator_rig import ActuatorRig

ROBOT = {'wheel_radius_m': 0.0325, 'wheel_separation_m': 0.2, 'ticks_per_revolution': 1440.0,
         'maximum_wheel_speed_m_s': 1.0}


class TestArduinoBridge(ActuatorContract):
    actuator = ArduinoBridge
    simulated = SimulatedArduinoBridge
    speed = 0.3
    changes = {**ROBOT, 'reset_wait_s': 0.0}
    sim = {'boot_s': 0.1}

    def fill(self, message: Any, speed: float) -> None:
        message.linear.x = speed

    def moves(self, simulated: Any) -> bool:
        return bool(simulated.moving or any(simulated.pwm))


class TestReplyDecoder(DecoderContract):
    stream = b'OK\r\n57600\r\n-12 1440\r\n0 -3\r\nInvalid Command\r\n1023\r\n 57600\r\n'
    tokens = (b'\r\n', b'\n', b'OK', b'OK\r\n', b'-', b'12 ', b'12 13\r\n', b'57600\r\n', b'x\r\n')

    def decoder(self) -> Any:
        return ReplyDecoder()

    def frame_size(self, frame: Any) -> int:
        return int(frame.size)

    def covered(self, frame: bytes) -> tuple[int, ...]:
        return ()


# --- a robot of one board ------------------------------------------------------------------------

class Robot:
    """
    The board under the manager, and what it publishes.

    :ivar samples: of joint_states: time in ms, left and right angle, left and right speed.
    """

    def __init__(self, rig: ActuatorRig) -> None:
        self.rig = rig
        self.simulated: Any = rig.simulated
        self.samples: list[tuple[float, float, float, float, float]] = []
        self._joints = rig.bus.subscribe('joint_states', 'test')
        self._faults = rig.bus.subscribe('motor_faults', 'test')
        self.seen = 0
        self._each: list[Callable[[], object]] = [self._look]
        rig.each = lambda: [each() for each in self._each]

    def _look(self) -> None:
        while self._joints.take():
            message = self._joints.msg
            self.samples.append((self._joints.stamp_ns / 1e6, *map(float, message.position),
                                 *map(float, message.velocity)))
        while self._faults.take():
            self.seen |= self._faults.msg.data

    @property
    def faults(self) -> MotorFault:
        """Return the bits as they were told last."""
        return MotorFault(int(self._faults.msg.data))

    def each(self, function: Callable[[], object]) -> None:
        self._each.append(function)

    def drive(self, speed: float, milliseconds: int) -> None:
        self.rig.steer(speed)
        self.rig.run(milliseconds)

    def counters(self) -> dict[str, Any]:
        return self.rig.counters()

    def moves(self) -> bool:
        return bool(self.simulated.moving or any(self.simulated.pwm))

    def true_rad(self) -> tuple[float, float]:
        left, right = self.simulated.base.wheel_angles
        return left, right

    def stand(self) -> None:
        """Stop, and wait until the wheels have run down and that has been published."""
        self.rig.steer(None)
        self.rig.run(6000)

    def steps(self) -> list[float]:
        """Return how far the left wheel went from each sample to the next."""
        return [b[1] - a[1] for a, b in zip(self.samples, self.samples[1:])]


TICK_RAD = math.tau / 1440


@contextmanager
def robot(folder: Path, fill: Any = None, sim: Any = None, **settings: Any) -> Iterator[Robot]:
    def forward(message: Any, speed: float) -> None:
        message.linear.x = speed
    rig = ActuatorRig(folder, ArduinoBridge, SimulatedArduinoBridge, fill or forward,
                      {'boot_s': 0.1, **(sim or {})},
                      **{**ROBOT, 'reset_wait_s': 0.0, 'output_rate_hz': 50.0, **settings})
    try:
        yield Robot(rig)
    finally:
        rig.close()


def test_it_drives_as_fast_as_it_is_told(tmp_path: Path) -> None:
    with robot(tmp_path) as made:
        made.drive(0.3, 3000)
        assert made.simulated.base.velocity[0] == pytest.approx(0.3, rel=0.06)
        speed = [sum(sample[3:]) / 2 for sample in made.samples[-20:]]
        assert sum(speed) / 20 * 0.0325 == pytest.approx(0.3, rel=0.06)
        made.stand()
        assert made.samples[-1][1:3] == pytest.approx(made.true_rad(), abs=1.5 * TICK_RAD)
        counters = made.counters()
        assert (counters['lost_replies'], counters['shifted_replies']) == (0, 0)
        assert made.seen == 0


@pytest.mark.parametrize('wiring', [
    {'inverted_left': True}, {'inverted_right': True}, {'swapped': True},
    {'inverted_left': True, 'swapped': True},
    {'inverted_left': True, 'inverted_right': True, 'swapped': True}], ids=str)
def test_wheels_may_be_wired_in_any_way(tmp_path: Path, wiring: dict[str, bool]) -> None:
    def turning(message: Any, speed: float) -> None:
        message.linear.x, message.angular.z = speed, 2 * speed
    with robot(tmp_path, turning, **wiring) as made:
        made.drive(0.2, 1500)
        linear, angular = made.simulated.base.velocity
        assert linear == pytest.approx(0.2, rel=0.15)
        assert angular == pytest.approx(0.4, rel=0.25)
        made.stand()
        assert made.samples[-1][1:3] == pytest.approx(made.true_rad(), abs=1.5 * TICK_RAD)


def test_too_fast_a_command_keeps_its_curve(tmp_path: Path) -> None:
    def turning(message: Any, speed: float) -> None:
        message.linear.x, message.angular.z = speed, 5 * speed
    with robot(tmp_path, turning, maximum_wheel_speed_m_s=0.3) as made:
        made.drive(2.0, 2000)
        linear, angular = made.simulated.base.velocity
        assert linear + 0.1 * angular == pytest.approx(0.3, rel=0.06)
        assert angular / linear == pytest.approx(5.0, rel=0.1)
        assert made.counters()['limited_commands'] > 50


@pytest.mark.parametrize('speed', [math.nan, math.inf, -math.inf, 1e300, -1e300, 1001.0])
def test_a_command_that_is_no_speed_stops_it(tmp_path: Path, speed: float) -> None:
    with robot(tmp_path) as made:
        made.drive(0.3, 500)
        assert made.moves()
        made.drive(speed, 25)
        assert not made.moves()
        assert made.counters()['wrong_commands'] >= 1
        made.drive(speed, 200)
        assert made.faults & MotorFault.COMMAND_REFUSED
        assert made.rig.managed.faults == 0
        made.drive(0.3, 200)
        assert made.moves()


# --- wheels that do not obey ---------------------------------------------------------------------

@pytest.mark.parametrize('fault, side', [('left_encoder', 'left'), ('right_encoder', 'right')])
def test_a_broken_encoder_stops_it_within_half_a_second(
        tmp_path: Path, fault: str, side: str) -> None:
    with robot(tmp_path) as made:
        made.drive(0.3, 2000)
        before = made.simulated.base.pose
        made.simulated.inject(fault, 3.0)
        made.rig.run(500)
        assert not made.moves()
        assert made.faults == MotorFault[f'{side.upper()}_STANDSTILL']
        assert made.rig.managed.state is DeviceState.ACTIVE
        reason = made.rig.managed.statistics().reason
        assert f'the {side} wheel stands still although it is commanded to turn' in reason
        assert math.dist(before[:2], made.simulated.base.pose[:2]) < 0.5
        # Whoever goes on commanding has noticed nothing.
        made.rig.run(2000)
        assert not made.moves()
        assert made.counters()['standstills'] == 1
        made.rig.run(1000)
        made.drive(0.0, 100)
        made.drive(0.3, 1000)
        assert made.moves()
        assert made.faults == 0
        assert made.rig.managed.statistics().reason == ''


def test_after_silence_a_fault_lets_it_drive_again(tmp_path: Path) -> None:
    with robot(tmp_path) as made:
        made.drive(0.3, 500)
        made.simulated.inject('left_encoder', 1.0)
        made.rig.run(1200)
        assert not made.moves()
        made.rig.steer(None)
        made.rig.run(500)
        made.drive(0.3, 300)
        assert made.moves()


def test_a_motor_that_turns_the_wrong_way_does_not_run_away(tmp_path: Path) -> None:
    with robot(tmp_path) as made:
        made.rig.run(200)
        made.simulated.encoder_signs = -1.0, 1.0
        told = made.simulated.base.set_duty
        made.simulated.base.set_duty = lambda left, right: told(-left, right)
        made.drive(0.3, 700)
        assert not made.moves()
        assert MotorFault.LEFT_WRONG_WAY & made.faults
        assert 'swap the wires of its motor' in made.rig.managed.statistics().reason


# --- boards that are unplugged, reset, swapped ---------------------------------------------------

def test_unplugged_while_it_drives_nothing_jumps_and_nothing_moves_by_itself(
        tmp_path: Path) -> None:
    with robot(tmp_path) as made:
        made.drive(0.3, 2000)
        made.rig.steer(None)
        made.simulated.inject('unplug', 0.5)
        made.rig.run(480)
        assert made.rig.managed.state is DeviceState.FAULT
        assert made.moves(), 'the board knows nothing of it and goes on'
        made.rig.run(400)
        assert made.rig.managed.state is DeviceState.ACTIVE
        assert not made.moves()
        made.drive(0.3, 2000)
        assert max(map(abs, made.steps())) < 0.5
        assert made.counters()['counter_resets'] == 0


def test_another_board_in_its_place_moves_nothing(tmp_path: Path) -> None:
    with robot(tmp_path) as made:
        made.drive(0.3, 1000)
        made.stand()
        there = made.samples[-1][1:3]
        made.rig.unplug()
        made.simulated.count_offsets = -123456, 98765
        made.rig.run(1000)
        assert made.rig.managed.state is DeviceState.ACTIVE
        assert made.samples[-1][1:3] == there


@pytest.mark.parametrize('driven_ms', [300, 3000])
def test_a_reset_while_it_drives_moves_nothing(tmp_path: Path, driven_ms: int) -> None:
    with robot(tmp_path, sim={'boot_s': 0.4}, pid_gains=[30, 20, 0, 60]) as made:
        made.rig.run(200)
        made.drive(0.3, driven_ms)
        made.simulated.inject('reset', 0.05)
        made.rig.run(600)
        assert made.faults & MotorFault.COUNTS_NEW
        assert made.faults & MotorFault.LINE
        made.rig.run(1500)
        assert made.moves(), 'commands go on, so does it'
        assert made.simulated.gains.p == 30
        made.stand()
        assert made.counters()['counter_resets'] == 1
        assert max(map(abs, made.steps())) < 0.5
        # What it ran down meanwhile nobody counted.
        lost = [true - shown for true, shown in zip(made.true_rad(), made.samples[-1][1:3])]
        assert all(-2 * TICK_RAD < each < 3.0 for each in lost)


def test_lost_bytes_cost_no_odometry(tmp_path: Path) -> None:
    def turning(message: Any, speed: float) -> None:
        message.linear.x, message.angular.z = speed, 2 * speed
    with robot(tmp_path, turning) as made:
        made.drive(0.2, 500)
        made.simulated.inject('loss', 10.0)
        for speed in (0.2, -0.2, 0.3, 0.1, -0.3):
            made.drive(speed, 2000)
        counters = made.counters()
        assert counters['shifted_replies'] > 10
        assert made.rig.managed.faults == 0
        made.stand()
        assert made.samples[-1][1:3] == pytest.approx(made.true_rad(), abs=2 * TICK_RAD)


def test_stops_get_through_a_line_that_loses_bytes(tmp_path: Path) -> None:
    with robot(tmp_path) as made:
        made.rig.run(200)
        made.simulated.inject('loss', 60.0)
        for _ in range(10):
            made.drive(0.3, 600)
            made.rig.steer(None)
            made.rig.run(700)
            assert not made.moves()


def test_it_begins_without_a_jerk(tmp_path: Path) -> None:
    # The firmware remembers what its encoders showed before the wheels ran down.
    with robot(tmp_path) as made:
        lowest: list[int] = []
        made.drive(0.3, 1000)
        made.stand()
        made.each(lambda: lowest.append(min(made.simulated.pwm)))
        made.drive(0.3, 500)
        assert made.moves()
        assert min(lowest) == 0


def test_a_board_that_does_not_answer_is_told(tmp_path: Path) -> None:
    with robot(tmp_path, sim={'faults': ['silent at 0 for 100']}) as made:
        made.rig.run(8000)
        assert made.rig.managed.state in (DeviceState.FAULT, DeviceState.OPENING)
        assert 'does not answer b: check its cable' in made.rig.managed.reason


def test_a_firmware_without_a_base_is_told(tmp_path: Path) -> None:
    with robot(tmp_path) as made:
        answer = made.simulated._answer
        made.simulated._answer = lambda command, *rest: (
            wire.INVALID if command in 'emru' else answer(command, *rest))
        made.drive(0.3, 2000)
        assert made.rig.managed.faults >= 1
        reasons = [report.text for report in made.rig.reports.since(0)[2]]
        assert any('build the firmware with USE_BASE' in each for each in reasons)
        assert not made.moves()


# --- what else it does ---------------------------------------------------------------------------

def test_the_battery_is_read_from_its_pin(tmp_path: Path) -> None:
    with robot(tmp_path, sim={'battery_v': 11.1}, battery_pin=3, battery_empty_v=10.5,
               battery_full_v=12.6) as made:
        battery = made.rig.bus.subscribe('battery', 'test')
        made.rig.run(2500)
        assert battery.latest()
        assert battery.msg.voltage == pytest.approx(11.1, abs=0.02)
        assert battery.msg.percentage == pytest.approx(0.29, abs=0.01)
        assert math.isnan(battery.msg.current)
        assert made.faults == 0
        made.simulated.settings['battery_v'] = 9.9
        made.rig.run(1500)
        assert made.faults == MotorFault.BATTERY_LOW


@pytest.mark.parametrize('gains', [[20, 12, 0], [20, 12, 0, 0]])
def test_gains_are_four(gains: list[int]) -> None:
    with pytest.raises(ConfigError, match='base: pid_gains .*: give four, Kp, Kd, Ki, Ko'):
        ArduinoBridge('base', settings_of(ArduinoBridge, port='x', **ROBOT, pid_gains=gains))


def test_a_space_before_the_speed_of_the_line_does_not_matter() -> None:
    reply, = ReplyDecoder().feed(b' 57600\r\n')
    assert reply.numbers == (57600,)


def test_its_bytes_are_recognised() -> None:
    assert wire.is_arduino_bridge(b'mand\r\nInvalid Command\r\nInvalid Command\r\nInv')
    assert not wire.is_arduino_bridge(b'OK\r\nOK\r\nOK\r\n')


# --- whatever befalls the line -------------------------------------------------------------------

@pytest.mark.parametrize('fault', sorted(set(MOTOR_FAULTS) - {
    'left_encoder', 'right_encoder', 'overcurrent', 'unplug', 'reset'}))
def test_whatever_befalls_the_line_costs_no_odometry(tmp_path: Path, fault: str) -> None:
    with robot(tmp_path) as made:
        made.drive(0.3, 1000)
        made.simulated.inject(fault, 0.8)
        made.rig.run(3000)
        assert made.rig.managed.state is DeviceState.ACTIVE, made.rig.managed.reason
        assert made.moves(), 'commands go on, so does it'
        made.stand()
        assert made.samples[-1][1:3] == pytest.approx(made.true_rad(), abs=2 * TICK_RAD)
        assert made.counters()['counter_resets'] == 0


def test_a_speed_that_the_firmware_rounds_off_is_no_broken_encoder(tmp_path: Path) -> None:
    # Two ticks a round: its loop leaves such an error alone, and nothing turns.
    with robot(tmp_path, ticks_per_revolution=360.0) as made:
        made.drive(0.035, 3000)
        assert made.true_rad() == (0.0, 0.0)
        assert made.faults == 0
    with robot(tmp_path, ticks_per_revolution=360.0, pid_gains=[20, 12, 0, 20]) as made:
        made.drive(0.035, 3000)
        assert made.simulated.base.velocity[0] == pytest.approx(0.035, rel=0.15)
        assert made.faults == 0
