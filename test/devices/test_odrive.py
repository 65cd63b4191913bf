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

"""The driver of ODrive motor controllers and its simulated device."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import math
from pathlib import Path
import re
from typing import Any

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.arduino_bridge.driver import ArduinoBridge
from rt_robot_os.devices.motor_board import MotorBoard
from rt_robot_os.devices.motor_faults import BOARD_BITS
from rt_robot_os.devices.motor_faults import MotorFault
from rt_robot_os.devices.odrive import wire
from rt_robot_os.devices.odrive.driver import Odrive
from rt_robot_os.devices.odrive.simulated import SimulatedOdrive
from rt_robot_os.devices.odrive.wire import OdriveDecoder
from rt_robot_os.devices.state import DeviceState
from rt_robot_os.sim.faults import MOTOR_FAULTS
from rt_robot_os.sim.pty_port import PtyPort
from rt_robot_os.testing import ActuatorContract
from rt_robot_os.testing import DecoderContract
from rt_robot_os.testing import settings_of
from rt_robot_os.testing.actuator_rig import ActuatorRig
from rt_robot_os.testing.fakes import bind
from rt_robot_os.topics.ports import Output

ROBOT = {'wheel_radius_m': 0.08, 'wheel_separation_m': 0.4}


def said(*texts: str) -> bytes:
    """Return what a controller answers, with checksums."""
    return b''.join(b'%s*%d\r\n' % (text.encode(), wire.checksum(text.encode()))
                    for text in texts)


def forward(message: Any, speed: float) -> None:
    message.linear.x = speed


class TestOdrive(ActuatorContract):
    actuator = Odrive
    simulated = SimulatedOdrive
    speed = 0.3
    changes = {**ROBOT, 'watchdog_s': 5.0}

    def fill(self, message: Any, speed: float) -> None:
        forward(message, speed)

    def moves(self, simulated: Any) -> bool:
        return bool(simulated.is_driving)


class TestOdriveWithoutChecksums(TestOdrive):
    changes = {**ROBOT, 'watchdog_s': 5.0, 'checksums': False}


class TestOdriveDecoder(DecoderContract):
    stream = said('24.150000', '1.500000 -0.250000', '8', 'invalid property', 'unknown command',
                  'nan -inf')
    tokens = (b'\r\n', b'\n', b'*', b'1.5 ', b'1.5*0\r\n', b'12\r\n', b'-', said('0'), b'nan')

    def decoder(self) -> Any:
        return OdriveDecoder()

    def frame_size(self, frame: Any) -> int:
        return int(frame.size)

    def covered(self, frame: bytes) -> range:
        # The carriage return may be missing.
        return range(len(frame) - 2)


class TestOdriveDecoderWithoutChecksums(DecoderContract):
    stream = b'24.150000\r\n1.500000 -0.250000\r\n8\r\ninvalid property\r\n0\r\n'
    tokens = (b'\r\n', b'\n', b'*', b'1.5 ', b'1.5*0\r\n', b'12\r\n', b'-', said('0'))

    def decoder(self) -> Any:
        return OdriveDecoder(checked=False)

    def frame_size(self, frame: Any) -> int:
        return int(frame.size)

    def covered(self, frame: bytes) -> tuple[int, ...]:
        return ()


def test_the_lines_are_those_of_the_manual() -> None:
    assert wire.line(b'r vbus_voltage') == b'r vbus_voltage *93\n'
    assert wire.line(wire.velocity(0, -1.5), checked=False) == b'v 0 -1.50000\n'
    assert wire.write('axis0.requested_state', 8) == b'w axis0.requested_state 8'
    reply, = OdriveDecoder().feed(b'1.500000 -0.250000*14\r\n')
    assert (reply.numbers, reply.refusal) == ((1.5, -0.25), b'')
    # Of a property nine characters are told.
    cut, = OdriveDecoder().feed(said('12345678.'))
    assert cut.numbers == (12345678.0,)


def test_its_bytes_are_recognised() -> None:
    assert wire.is_odrive(b'0*48\r\n' + said('24.15', '1.5 2.5') + b'12')
    assert wire.is_odrive(b'mand\r\nunknown command\r\nunknown command\r\n')
    assert not wire.is_odrive(b'12\r\n24.15\r\n24.16\r\n')


@pytest.mark.parametrize('line, answer', [
    (b'\n', b'unknown command\r\n'), (b'sc\n', b''), (b'f 0\n', b'0.000000 0.000000\r\n'),
    (b'f 7\n', b'invalid motor 7\r\n'), (b'v 0\n', b'invalid command format\r\n'),
    (b'f\n', b'invalid command format\r\n'), (b'r axis0.errors\n', b'invalid property\r\n'),
    (b'r vbus_voltage *93\n', said('12.300000')), (b'r vbus_voltage *94\n', b''),
    (b'r vbus_voltage *93v 0 1\n', said('12.300000')), (b'x *88\n', said('unknown command'))])
def test_the_twin_answers_as_the_firmware_does(tmp_path: Path, line: bytes, answer: bytes
                                               ) -> None:
    simulated = SimulatedOdrive('simulated', {}, PtyPort(tmp_path / 'odrive'), 0)
    heard: list[bytes] = []
    simulated.reply = lambda data: bool(heard.append(data)) or True  # type: ignore[method-assign]
    simulated.handle_command(line)
    assert b''.join(heard) == answer


# --- a robot of one controller ------------------------------------------------------------------

class Robot:
    """The controller under the manager, and what it publishes."""

    def __init__(self, rig: ActuatorRig) -> None:
        self.rig = rig
        self.simulated: Any = rig.simulated
        self.samples: list[tuple[float, float]] = []
        self._joints = rig.bus.subscribe('joint_states', 'test')
        self._faults = rig.bus.subscribe('motor_faults', 'test')
        rig.each = self._look

    def _look(self) -> None:
        while self._joints.take():
            left, right = self._joints.msg.position
            self.samples.append((float(left), float(right)))
        while self._faults.take():
            pass

    @property
    def faults(self) -> int:
        return int(self._faults.msg.data)

    @property
    def board_faults(self) -> int:
        return self.faults >> BOARD_BITS

    @property
    def reason(self) -> str:
        return self.rig.managed.statistics().reason

    def drive(self, speed: float, milliseconds: int) -> None:
        self.rig.steer(speed)
        self.rig.run(milliseconds)

    def stand(self) -> None:
        self.rig.steer(None)
        self.rig.run(2500)

    def steps(self) -> list[float]:
        return [b[0] - a[0] for a, b in zip(self.samples, self.samples[1:])]


@contextmanager
def robot(folder: Path, sim: Any = None, fill: Any = None, **settings: Any) -> Iterator[Robot]:
    rig = ActuatorRig(folder, Odrive, SimulatedOdrive, fill or forward, sim or {},
                      **{**ROBOT, **settings})
    try:
        yield Robot(rig)
    finally:
        rig.close()


@pytest.mark.parametrize('changes', [
    {}, {'gear_ratio': 9.0}, {'left_axis': 1, 'right_axis': 0}, {'inverted_left': True},
    {'swapped': True}, {'firmware': '0.6'}, {'checksums': False}], ids=str)
def test_it_drives_as_fast_as_it_is_told(tmp_path: Path, changes: dict[str, Any]) -> None:
    def turning(message: Any, speed: float) -> None:
        message.linear.x, message.angular.z = speed, speed
    with robot(tmp_path, fill=turning, **changes) as made:
        made.drive(0.3, 2000)
        assert made.simulated.base.velocity == pytest.approx((0.3, 0.3), rel=0.02)
        made.stand()
        assert made.samples[-1] == pytest.approx(made.simulated.base.wheel_angles, abs=1e-4)
        assert made.faults == 0
        assert made.rig.counters()['lost_replies'] == 0
        assert made.rig.managed.faults == 0


def test_no_axis_is_closed_before_the_first_command(tmp_path: Path) -> None:
    with robot(tmp_path) as made:
        made.rig.run(1000)
        assert [axis.state for axis in made.simulated.axes] == [wire.IDLE, wire.IDLE]
        assert [axis.watched for axis in made.simulated.axes] == [True, True]
        assert made.rig.managed.state is DeviceState.ACTIVE


def test_its_watchdog_takes_over_when_the_computer_is_gone(tmp_path: Path) -> None:
    with robot(tmp_path, watchdog_s=0.4) as made:
        made.drive(0.3, 1000)
        made.simulated.inject('unplug', 5.0)
        made.rig.run(450)
        assert [axis.state for axis in made.simulated.axes] == [wire.IDLE, wire.IDLE]
        assert made.simulated.axes[0].error == wire.WATCHDOG_ERROR


@pytest.mark.parametrize('firmware, text', [('0.5', r'error 0x40 \(motor failed\)'),
                                            ('0.6', 'error 0x40: see dump_errors')])
def test_an_error_of_an_axis_stops_both_wheels(tmp_path: Path, firmware: str, text: str) -> None:
    with robot(tmp_path, firmware=firmware) as made:
        made.drive(0.3, 1000)
        made.simulated.inject('overcurrent', 0.5)
        made.rig.run(500)
        assert not made.simulated.is_driving
        assert made.board_faults & 1
        assert re.search(r'axis0 \(left wheel\) has ' + text, made.reason)
        made.rig.run(2000)
        assert not made.simulated.is_driving, 'continued commands are no acknowledgement'
        made.drive(0.0, 100)
        made.drive(0.3, 1000)
        assert made.simulated.is_driving
        assert (made.faults, made.reason) == (0, '')


def test_a_controller_that_is_not_calibrated_is_told(tmp_path: Path) -> None:
    with robot(tmp_path, sim={'calibrated': False}) as made:
        made.drive(0.3, 3000)
        assert not made.simulated.is_driving
        assert 'axis0 (left wheel) has error 0x1 (invalid state)' in made.reason
        assert made.board_faults & 4


def test_a_controller_without_the_second_axis_is_told(tmp_path: Path) -> None:
    with robot(tmp_path) as made:
        made.simulated._numbers = 0, 5
        made.rig.run(1500)
        assert made.rig.managed.faults >= 1
        reasons = [report.text for report in made.rig.reports.since(0)[2]]
        assert any('it refuses requests (invalid ' in each for each in reasons)


@pytest.mark.parametrize('speed', [math.nan, math.inf, 1e300])
def test_a_command_that_is_no_speed_stops_it(tmp_path: Path, speed: float) -> None:
    with robot(tmp_path) as made:
        made.drive(0.3, 1000)
        assert made.simulated.is_driving
        made.drive(speed, 200)
        assert not made.simulated.is_driving
        assert made.faults & MotorFault.COMMAND_REFUSED


@pytest.mark.parametrize('fault, bit', [('left_encoder', 1), ('right_encoder', 2)])
def test_a_broken_encoder_stops_it_within_half_a_second(
        tmp_path: Path, fault: str, bit: int) -> None:
    with robot(tmp_path) as made:
        made.drive(0.3, 1000)
        made.simulated.inject(fault, 10.0)
        made.rig.run(500)
        assert not made.simulated.is_driving
        assert made.faults == bit


def test_unplugged_while_it_drives_nothing_is_lost(tmp_path: Path) -> None:
    with robot(tmp_path, watchdog_s=0.3) as made:
        made.drive(0.3, 1000)
        made.rig.steer(None)
        made.simulated.inject('unplug', 0.6)
        made.rig.run(590)
        assert made.rig.managed.state is DeviceState.FAULT
        made.rig.run(600)
        assert made.rig.managed.state is DeviceState.ACTIVE
        assert not made.simulated.is_driving
        made.stand()
        # Its counters had gone on, by less than wheels can turn in a second.
        assert made.samples[-1] == pytest.approx(made.simulated.base.wheel_angles, abs=1e-4)
        made.drive(0.3, 1000)
        assert made.simulated.is_driving


def test_a_reset_while_it_drives_moves_nothing(tmp_path: Path) -> None:
    with robot(tmp_path) as made:
        made.drive(0.3, 2000)
        made.simulated.inject('reset', 0.2)
        made.rig.run(2500)
        assert max(map(abs, made.steps())) < 0.5
        assert made.rig.counters()['counter_resets'] == 1
        assert [axis.watched for axis in made.simulated.axes] == [True, True]
        made.stand()
        made.drive(0.3, 1000)
        assert made.simulated.is_driving


def test_lost_bytes_cost_no_odometry(tmp_path: Path) -> None:
    with robot(tmp_path) as made:
        made.drive(0.2, 500)
        made.simulated.inject('loss', 8.0)
        for speed in (0.2, -0.2, 0.3, 0.1):
            made.drive(speed, 2000)
        assert made.rig.counters()['lost_replies'] > 10
        assert made.rig.managed.faults == 0
        made.stand()
        assert made.samples[-1] == pytest.approx(made.simulated.base.wheel_angles, abs=1e-4)


def test_voltage_and_current_are_those_of_the_battery(tmp_path: Path) -> None:
    with robot(tmp_path, sim={'battery_v': 23.4}, battery_empty_v=24.0) as made:
        battery = made.rig.bus.subscribe('battery', 'test')
        made.drive(0.3, 2500)
        assert battery.latest()
        assert battery.msg.voltage == pytest.approx(23.4)
        assert battery.msg.current == pytest.approx(-0.4 * 2 * 0.3 / 0.08, rel=0.05)
        assert made.faults == MotorFault.BATTERY_LOW


def test_both_wheels_on_one_axis_are_refused() -> None:
    with pytest.raises(ConfigError, match='base: left_axis and right_axis are both 1'):
        Odrive('base', settings_of(Odrive, port='x', **ROBOT, left_axis=1))


@pytest.mark.parametrize('fault', sorted(set(MOTOR_FAULTS) - {
    'left_encoder', 'right_encoder', 'overcurrent', 'unplug', 'reset'}))
def test_whatever_befalls_the_line_costs_no_odometry(tmp_path: Path, fault: str) -> None:
    with robot(tmp_path, watchdog_s=5.0) as made:
        made.drive(0.3, 1000)
        made.simulated.inject(fault, 0.8)
        made.rig.run(3000)
        assert made.rig.managed.state is DeviceState.ACTIVE, made.reason
        assert made.simulated.is_driving, 'commands go on, so does it'
        made.stand()
        assert made.samples[-1] == pytest.approx(made.simulated.base.wheel_angles, abs=1e-4)
        assert made.rig.counters()['counter_resets'] == 0


class Replies:
    """A port that gives what the test says."""

    def __init__(self, path: str, baud: int | None) -> None:
        self.left: list[bytes] = []
        self.bytes_read = self.dropped_write_bytes = 0

    def fileno(self) -> int:
        return 0

    def read(self) -> bytes:
        return self.left.pop(0) if self.left else b''

    def write(self, data: bytes) -> None:
        """Take anything."""

    def close(self) -> None:
        """Do nothing."""


PIECES = (b'57600\r\n', b'OK\r\n', b'12 -7\r\n', b'0 0\r\n', b'512\r\n', b'Invalid Command\r\n',
          said('24.1'), said('1'), said('8'), said('0'), said('1.25 0.5', '1.5 -0.5'),
          said('invalid property'), said('nan inf', 'nan nan'))


@pytest.mark.parametrize('driver', [Odrive, ArduinoBridge])
def test_no_bytes_whatever_move_it_or_break_it(driver: type[MotorBoard[Any]]) -> None:
    extra = {'ticks_per_revolution': 1440.0, 'reset_wait_s': 0.0, 'battery_pin': 1} if (
        driver is ArduinoBridge) else {}
    piece = st.binary(max_size=20) | st.sampled_from(PIECES)

    @settings(max_examples=60, deadline=None)
    @given(chunks=st.lists(st.lists(piece, max_size=4).map(b''.join), max_size=60),
           period_ms=st.sampled_from([1, 20, 150]))
    def check(chunks: list[bytes], period_ms: int) -> None:
        device: Any = driver('dut', settings_of(driver, port='x', **ROBOT, **extra))
        publishers = dict(zip(device.used(Output), bind(device)))
        device.make_port = Replies
        now_ns = 1_000_000_000
        device.clock_ns = lambda: now_ns
        device.open()
        device.safe_state()
        try:
            for chunk in chunks:
                now_ns += period_ms * 1_000_000
                device._port.left.append(chunk)
                device.write(now_ns)
                device.read(now_ns)
        except DeviceError as error:
            assert 'dut: it' in str(error)
        device.close()
        device.statistics()
        stamps = publishers['joint_states'].stamps
        assert stamps == sorted(stamps)
        angles = [list(sample.position) for sample in publishers['joint_states'].samples]
        assert all(math.isfinite(angle) for pair in angles for angle in pair)
        for (left, right), (left_after, right_after) in zip(angles, angles[1:]):
            fastest = 2.0 / 0.08
            assert max(abs(left_after - left), abs(right_after - right)) < 1.2 * fastest
    check()
