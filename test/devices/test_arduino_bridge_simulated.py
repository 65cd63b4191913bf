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

"""
The bytes of a real ros_arduino_bridge, compared with the driver's and the simulated board's.

The recording is of the firmware on an emulated ATmega328P with motors of first order; it lies
outside of the repository, and the tests that need it are skipped without it.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from benchmarks.devices.transcript import Board
from benchmarks.devices.transcript import Cable
from benchmarks.devices.transcript import Line
from benchmarks.devices.transcript import read
import pytest

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.arduino_bridge import wire
from rt_robot_os.devices.arduino_bridge.simulated import SimulatedArduinoBridge
from rt_robot_os.devices.arduino_bridge.wire import ReplyDecoder
from rt_robot_os.sim.base import Site
from rt_robot_os.sim.world.world import World
from rt_robot_os.sim.world_settings import OPEN_FLOOR
from rt_robot_os.sim.world_settings import WorldSettings

START_NS = 100 * NS_PER_S
PING_END_NS = 7893 * NS_PER_MS


@pytest.fixture(scope='module')
def recording(data_dir: Path) -> list[Line]:
    path = data_dir / 'motor' / 'ros_arduino_bridge_firmware_1.txt'
    if not path.exists():
        pytest.skip(f'no recording at {path}')
    lines = read(path.read_text(), path.name)
    assert len(lines) > 150
    return lines


# --- the recording -------------------------------------------------------------------------------

def test_every_answer_of_the_firmware_is_read(recording: list[Line]) -> None:
    stream = b''.join(each.data for each in recording if each.kind == 'board->host')
    decoder = ReplyDecoder()
    replies = [reply for byte in stream for reply in decoder.feed(bytes((byte,)))]
    assert decoder.rejected_bytes == decoder.rejected_frames == decoder.pending_bytes == 0
    said = [reply.text or ' '.join(map(str, reply.numbers)).encode() for reply in replies]
    assert said == stream.split(b'\r\n')[:-1]
    assert said[:3] == [b'57600', b'0 0', b'OK'] and said[-1] == wire.INVALID


def test_the_orders_are_those_that_the_firmware_was_given(recording: list[Line]) -> None:
    given = {each.data for each in recording if each.kind == 'host->board'}
    assert {wire.BAUD, wire.ENCODERS, wire.HALT, wire.speeds(20, 20), wire.speeds(30, -30),
            wire.gains(20, 12, 0, 50), wire.analog(0), wire.speeds(-25, -10)} <= given


def test_the_twin_answers_and_drives_as_the_firmware_did(recording: list[Line]) -> None:
    board = Board()
    expected: list[bytes] = []
    told_ns = 0
    checked = 0
    for line in recording:
        board.run_to(line.time_ns)
        if line.kind == 'host->board':
            board.cable.to_board += line.data
            told_ns = line.time_ns
        elif line.kind == 'board->host':
            expected.append(line.data)
        elif min(line.time_ns - told_ns, abs(line.time_ns - PING_END_NS)) > 90 * NS_PER_MS:
            # Within a round of the loop, and what that makes of a jerk at the end of the ping.
            late = 0 < line.time_ns - PING_END_NS < NS_PER_S // 2
            assert [pwm / 255 for pwm in board.simulated.pwm] == pytest.approx(
                line.pwm, abs=0.16 if late else 0.035), line
            checked += 1
    board.run(board.now_ns + 50 * NS_PER_MS)
    answers = board.cable.from_board.splitlines(keepends=True)
    assert checked > 80 and len(answers) == len(expected)
    # The board missed some edges of its left encoder while it was busy: up to 8 % of them.
    for answer, wanted in zip(answers, expected):
        if b' ' in wanted and not wanted.startswith(wire.INVALID):
            left, right = map(int, answer.split())
            wanted_left, wanted_right = map(int, wanted.split())
            assert right == pytest.approx(wanted_right, abs=30)
            assert left == pytest.approx(wanted_left, abs=15 + 0.11 * abs(wanted_left))
        else:
            assert answer == wanted


# What the firmware on an emulated ATmega328P counted, with the motors of the recording: an order
# at a time in ms, or what it answered to `e` then. In its loop a product of 16 bits overflows when
# the wheels went far by `o` before `m` closes the loop.
FAR = [[(500, b'o -119 188'), (2000, b'm -37 -6'), (2300, (-2454, 2816)), (2900, (-3312, 2456))],
       [(500, b'o 150 188'), (2200, b'm 20 20'), (2300, (2873, 3621)), (2800, (2477, 3225)),
        (3100, b'm -20 -20'), (3600, (2603, 3348))]]


@pytest.mark.parametrize('course', FAR)
def test_it_turns_round_as_the_firmware_did(course: list[tuple[int, Any]]) -> None:
    board = Board()
    for at_ms, what in course:
        board.run_to(at_ms * NS_PER_MS)
        if isinstance(what, bytes):
            board.cable.to_board += what + b'\r'
        else:
            counts = tuple(map(int, board.answers(b'e\r').split()))
            assert counts == pytest.approx(what, abs=30), at_ms


# --- odd cases -----------------------------------------------------------------------------------

@pytest.mark.parametrize('order, answer', [
    (b'e 1 2 3\r', b'0 0\r\n'), (b'b b\r', b'57600\r\n'), (b'z\r', b'Invalid Command\r\n'),
    (b'\r', b'Invalid Command\r\n'), (b'x\r', b'OK\r\n'), (b'm\r', b'OK\r\n'),
    (b'e\n\r', b'Invalid Command\r\n'), (b'\ne\r', b'0 0\r\n'), (b' e\r', b'Invalid Command\r\n'),
    (b'u 20:12:0:0\r', b'OK\r\n'), (b'u\r', b'OK\r\n'), (b'm -- xx\r', b'OK\r\n'),
    (b'e\rb\r', b'0 0\r\n57600\r\n'), (b'\xff\r', b'Invalid Command\r\n')])
def test_what_people_send_by_hand(order: bytes, answer: bytes) -> None:
    assert Board().answers(order) == answer


def test_one_speed_alone_is_that_of_the_left_wheel() -> None:
    board = Board()
    assert board.answers(b'm 12\r', 1000) == b'OK\r\n'
    left, right = board.simulated.ticks
    assert left > 200 and right == 0


def test_a_speed_beyond_reason_is_full_voltage() -> None:
    board = Board()
    assert board.answers(b'm 9999 2\r', 200) == b'OK\r\n'
    assert board.simulated.pwm[0] == 255 and abs(board.simulated.pwm[1]) < 30


def test_it_stops_by_itself_after_two_seconds() -> None:
    board = Board()
    board.answers(b'm 20 20\r', 1990)
    assert board.simulated.moving
    board.run(board.now_ns + 20 * NS_PER_MS)
    assert not board.simulated.moving and board.simulated.pwm == (0, 0)


def test_a_stop_lets_the_wheels_run_down() -> None:
    board = Board()
    board.answers(b'm 20 20\r', 1500)
    before = board.simulated.ticks[0]
    board.answers(wire.HALT, 500)
    assert 30 < board.simulated.ticks[0] - before < 100


def test_a_ping_without_echo_holds_everything_up() -> None:
    board = Board()
    assert board.answers(b'p 1\re\r', 600) == b''
    assert board.answers(b'', 200) == b'0\r\n0 0\r\n'


def test_counts_begin_anew_when_it_is_told_so() -> None:
    board = Board()
    board.answers(b'm 20 20\r', 1000)
    board.answers(wire.HALT, 1000)
    assert board.simulated.ticks[0] > 100
    assert board.answers(b'r\re\r') == b'OK\r\n0 0\r\n'


def test_a_reset_forgets_everything() -> None:
    board = Board(boot_s=0.2)
    board.answers(b'm 20 20\ru 1:2:3:4\r', 1000)
    board.simulated.inject('reset', 0.05)
    board.run(board.now_ns + 100 * NS_PER_MS)
    assert not board.simulated.moving and board.simulated.pwm == (0, 0)
    assert board.answers(wire.ENCODERS, 50) == b'', 'it boots'
    board.run(board.now_ns + 1500 * NS_PER_MS)
    assert board.answers(wire.ENCODERS).endswith(b'\r\n')
    assert abs(board.simulated.ticks[0]) < 60 and board.simulated.gains.p == 20


def test_it_moves_the_robot_of_the_world() -> None:
    world = World(WorldSettings(map=OPEN_FLOOR, start=(1.0, 2.0, math.pi / 2)))
    device = {'wheel_radius_m': 0.05, 'wheel_separation_m': 0.3, 'ticks_per_revolution': 2000.0,
              'inverted_left': True, 'inverted_right': True}
    cable: Any = Cable()
    simulated = SimulatedArduinoBridge('simulated', {}, cable, site=Site(world, device))
    for ms in range(2000):
        if ms % 500 == 0:
            cable.to_board += wire.speeds(-20, -20)
        simulated.pump(START_NS + ms * NS_PER_MS)
    x, y, yaw = world.base.pose
    turned = -sum(simulated.ticks) / 2 / 2000.0 * math.tau
    assert turned > 2.0
    assert (x, yaw) == pytest.approx((1.0, math.pi / 2), abs=1e-3)
    assert y - 2.0 == pytest.approx(turned * 0.05, abs=1e-3)
