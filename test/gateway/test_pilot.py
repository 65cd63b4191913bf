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

"""What may move the robot from afar, in virtual time: tickets, leases, open hands, limits."""

from __future__ import annotations

import itertools
import math
from typing import Any

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest

from rt_robot_os.gateway.drive_limits import TeleopLimits
from rt_robot_os.gateway.teleop_controller import TeleopController
from rt_robot_os.messages.uplink.driving import DriveBegin
from rt_robot_os.messages.uplink.driving import DriveCommand

MS = 1_000_000
HOLD_MS = 100
TICKET_MS = 300


class Robot:
    """A pilot with its clock, and what the wheels are told at each moment."""

    def __init__(self, **limits: float) -> None:
        self.controller = TeleopController(TeleopLimits(**limits))
        self.now_ms = 1_000_000
        self.speed = 0.0
        self.seq = itertools.count(1)

    def until(self, now_ms: int) -> None:
        """Let time pass; the gateway's timer ends what no longer holds."""
        while self.now_ms < now_ms:
            self.now_ms += 1
            self._obey(self.controller.hold_ended(self.now_ms * MS))

    def _obey(self, order: Any) -> None:
        if order is not None:
            self.speed = order.linear_m_s

    def begin(self, lease: str = 'a', by: str = 'carol') -> int:
        self._obey(self.controller.begin(DriveBegin(lease, by)))
        return self.beat()

    def end(self, lease: Any = None) -> None:
        self._obey(self.controller.end(lease))

    def beat(self) -> int:
        return self.controller.beat(self.now_ms * MS)

    def drive(self, beat: Any, linear: Any = 0.2, grip: Any = True, **more: Any) -> None:
        message = {'lease': 'a', 'seq': next(self.seq), 'beat': beat, 'grip': grip,
                   'linear_m_s': linear, 'angular_rad_s': 0.0, 'held_ms': 0.0, **more}
        try:
            command = DriveCommand.from_json(message)
        except ValueError:
            self.controller.reject()
            return
        self._obey(self.controller.take(command, self.now_ms * MS))

    def armed(self) -> int:
        """Begin a lease, and show an open hand; return the ticket."""
        beat = self.begin()
        self.drive(beat, 0.0, grip=False)
        return beat


@pytest.fixture
def robot() -> Robot:
    return Robot()


def test_it_moves_while_commands_come_and_stands_a_tenth_of_a_second_after_the_last(
        robot: Robot) -> None:
    beat = robot.armed()
    for _ in range(5):
        robot.drive(beat)
        assert robot.speed == 0.2
        robot.until(robot.now_ms + 40)
        beat = robot.beat()
    robot.until(robot.now_ms + HOLD_MS - 40)
    assert robot.speed == 0.0
    assert robot.controller.counters['holds_ended'] == 1


def test_nothing_moves_before_the_hand_was_seen_open(robot: Robot) -> None:
    beat = robot.begin()
    robot.drive(beat)
    assert robot.speed == 0.0 and robot.controller.counters['not_armed'] == 1
    robot.drive(beat, 0.0, grip=False)
    robot.drive(beat)
    assert robot.speed == 0.2


def test_after_a_gap_it_does_not_start_again_under_a_closed_hand(robot: Robot) -> None:
    robot.drive(robot.armed())
    robot.until(robot.now_ms + TICKET_MS + 1)
    robot.drive(robot.beat())
    assert robot.speed == 0.0 and not robot.controller.is_armed
    robot.drive(robot.beat(), 0.0, grip=False)
    robot.drive(robot.beat())
    assert robot.speed == 0.2


def test_a_shorter_gap_costs_a_moment_of_speed_and_no_new_grip(robot: Robot) -> None:
    robot.drive(robot.armed())
    robot.until(robot.now_ms + 200)
    assert robot.speed == 0.0
    robot.drive(robot.beat())
    assert robot.speed == 0.2


def test_the_ticket_of_a_lease_that_is_over_moves_nothing(robot: Robot) -> None:
    beat = robot.armed()
    robot.drive(beat)
    robot.begin('b', 'dave')
    assert robot.speed == 0.0
    robot.drive(beat)
    robot.drive(robot.beat())
    assert robot.speed == 0.0 and robot.controller.counters['foreign'] == 2
    robot.drive(beat, 0.0, grip=False, lease='b')
    assert robot.controller.counters['stale'] == 1  # given to the other


def test_a_robot_that_began_anew_gives_other_numbers() -> None:
    assert Robot().begin() != Robot().begin()


@pytest.mark.parametrize('how', ['end', 'lost'])
def test_the_end_of_a_lease_and_of_the_connection_stop_at_once(robot: Robot, how: str) -> None:
    beat = robot.armed()
    robot.drive(beat)
    robot.end('a' if how == 'end' else None)
    assert robot.speed == 0.0
    robot.drive(beat)
    assert robot.speed == 0.0


def test_the_end_of_another_lease_ends_nothing(robot: Robot) -> None:
    robot.drive(robot.armed())
    robot.end('before')
    assert robot.speed == 0.2


def test_a_number_that_does_not_rise_is_left_out(robot: Robot) -> None:
    beat = robot.armed()
    robot.drive(beat, seq=10)
    robot.drive(beat, 0.0, seq=10)
    robot.drive(beat, 0.1, seq=9)
    assert robot.speed == 0.2 and robot.controller.counters['disordered'] == 2


@pytest.mark.parametrize('what', [
    {'linear_m_s': math.nan}, {'linear_m_s': math.inf}, {'linear_m_s': '0.1'},
    {'linear_m_s': True}, {'linear_m_s': None}, {'angular_rad_s': -math.inf},
    {'held_ms': math.nan}, {'held_ms': []}, {'seq': 1.5}, {'seq': True}, {'seq': 'x'}])
def test_what_is_no_command_moves_nothing(robot: Robot, what: dict[str, Any]) -> None:
    robot.drive(robot.armed(), **what)
    assert robot.speed == 0.0 and robot.controller.counters['malformed'] == 1


@pytest.mark.parametrize('beat', [None, True, 1.0, '1', -1, 0, [], 1 << 60])
def test_what_is_no_ticket_moves_nothing(robot: Robot, beat: Any) -> None:
    robot.armed()
    robot.drive(beat)
    counters = robot.controller.counters
    assert robot.speed == 0.0 and counters['stale'] + counters['malformed'] == 1


@given(linear=st.floats(-1e9, 1e9), angular=st.floats(-1e9, 1e9))
def test_no_command_is_faster_than_the_robot_allows(linear: float, angular: float) -> None:
    limits = TeleopLimits(linear_m_s=0.3, angular_rad_s=0.8)
    v, w = limits.bounded(linear, angular)
    assert math.hypot(v / 0.3, w / 0.8) <= 1.0 + 1e-9
    assert v * angular == pytest.approx(w * linear, rel=1e-6, abs=1e-6)  # the same curve


def test_a_robot_that_nobody_may_drive_stands() -> None:
    robot = Robot(linear_m_s=0.0)
    robot.drive(robot.armed())
    assert robot.speed == 0.0 and not robot.controller.limits.may_drive


def test_the_round_trip_is_without_the_time_that_the_ticket_lay_with_the_sender(
        robot: Robot) -> None:
    beat = robot.armed()
    robot.until(robot.now_ms + 70)
    robot.drive(beat, held_ms=40.0)
    assert robot.controller.rtt_ms == pytest.approx(30.0)
    robot.drive(beat, held_ms=-5.0)
    assert robot.controller.rtt_ms == pytest.approx(70.0)


def test_a_command_that_is_too_late_still_tells_how_slow_the_link_is(robot: Robot) -> None:
    beat = robot.armed()
    robot.until(robot.now_ms + 450)
    robot.drive(beat, held_ms=30.0)
    assert robot.speed == 0.0 and robot.controller.rtt_ms == pytest.approx(420.0)


def test_a_closed_hand_in_the_middle_steers_too(robot: Robot) -> None:
    beat = robot.armed()
    robot.drive(beat)
    robot.drive(beat, 0.0)
    assert robot.speed == 0.0
    robot.until(robot.now_ms + 50)
    robot.drive(beat)
    assert robot.speed == 0.2


# Each command: when it is sent, how long it waits on the way, whether the hand is closed.
COMMANDS = st.lists(st.tuples(st.integers(0, 900), st.integers(0, 1500), st.booleans()),
                    max_size=40)


@settings(max_examples=60)
@given(commands=COMMANDS, beat_ms=st.integers(20, 100))
def test_no_command_moves_the_robot_three_tenths_of_a_second_after_it_was_sent(
        commands: list[tuple[int, int, bool]], beat_ms: int) -> None:
    """Whatever waited wherever, in whatever order it arrives: each speed is of a known command."""
    robot = Robot()
    start_ms = robot.now_ms
    tickets = [(0, robot.begin())]
    sent: dict[float, int] = {}
    arrivals: dict[int, list[tuple[int, int, float, bool]]] = {}
    for number, (at_ms, delay_ms, grip) in enumerate(sorted(commands), 1):
        speed = number / 1000
        sent[speed] = at_ms
        arrivals.setdefault(at_ms + delay_ms, []).append((number, at_ms, speed, grip))
    for elapsed in range(1, 2600):
        robot.until(start_ms + elapsed)
        if elapsed % beat_ms == 0 and elapsed < 900:
            tickets.append((elapsed, robot.beat()))
        for number, at_ms, speed, grip in arrivals.get(elapsed, ()):
            beat = [ticket for given_ms, ticket in tickets if given_ms <= at_ms][-1]
            robot.drive(beat, speed if grip else 0.0, grip, seq=number)
        if robot.speed:
            assert elapsed - sent[robot.speed] <= TICKET_MS
    assert robot.speed == 0.0
