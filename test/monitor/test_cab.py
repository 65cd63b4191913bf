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

"""Who may drive a robot: leases, taking over, what goes to the robot and to each client."""

from __future__ import annotations

import json
from typing import Any

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import invariant
from hypothesis.stateful import precondition
from hypothesis.stateful import rule
from hypothesis.stateful import RuleBasedStateMachine
import pytest

from rt_robot_os.messages.uplink.driving import DriveBeat
from rt_robot_os.messages.uplink.greeting import DriveLimits
from rt_robot_os.messages.uplink.messages import UplinkMessage
from rt_robot_os.monitor.live.teleop_session import HeldByAnotherError
from rt_robot_os.monitor.live.teleop_session import TeleopClient
from rt_robot_os.monitor.live.teleop_session import TeleopSession

LIMITS = {'linear_m_s': 0.3, 'angular_rad_s': 0.8}
FAST = DriveLimits.from_json(LIMITS)


class SendQueue:
    """The sending side of a connection; what is live is sent at once."""

    def __init__(self) -> None:
        self.said: list[dict[str, Any]] = []

    def send(self, text: str) -> bool:
        self.said.append(json.loads(text))
        return True

    def offer(self, make: Any) -> None:
        text = make()
        if text is not None:
            self.send(text)

    def kinds(self, kind: str) -> list[dict[str, Any]]:
        return [each for each in self.said if each['kind'] == kind]


class Robot:
    """A session, and what its robot is told."""

    def __init__(self) -> None:
        self.heard: list[tuple[str, dict[str, Any]]] = []
        self.connected = True
        self.session = TeleopSession('robot', self._forward)
        self.session.robot_is(True, FAST)

    def _forward(self, robot: str, message: UplinkMessage) -> bool:
        assert robot == 'robot'
        if self.connected:
            self.heard.append((message.KIND, message.content()))
        return self.connected

    def client(self, name: str) -> TeleopClient:
        client = TeleopClient(name, f'session of {name}', SendQueue())  # type: ignore[arg-type]
        self.session.enter(client)
        return client

    def drives(self) -> list[dict[str, Any]]:
        return [content for kind, content in self.heard if kind == 'drive']


def said(client: TeleopClient) -> Any:
    return client.queue


def command(seq: int = 1, **more: Any) -> dict[str, Any]:
    return {'kind': 'drive', 'seq': seq, 'beat': 7, 'grip': True, 'linear_m_s': 0.2,
            'angular_rad_s': 0.0, 'held_ms': 3.0, **more}


@pytest.fixture
def robot() -> Robot:
    return Robot()


def test_sitting_down_tells_who_drives_and_moves_nothing(robot: Robot) -> None:
    carol = robot.client('carol')
    state = said(carol).kinds('seat')[-1]
    assert (state['state'], state['by'], state['connected']) == ('free', '', True)
    assert state['limits'] == LIMITS and robot.heard == []
    assert not robot.session.drive(carol, command()) and robot.heard == []


def test_the_one_who_has_it_drives_within_the_limits_of_the_robot(robot: Robot) -> None:
    carol = robot.client('carol')
    robot.session.take(carol, False)
    assert robot.session.drive(carol, command(linear_m_s=9.0, angular_rad_s=0.0))
    sent = robot.drives()[-1]
    assert sent['linear_m_s'] == pytest.approx(0.3) and sent['by'] == 'carol'
    assert sent['lease'] == robot.session.lease.key and sent['held_ms'] == 3.0


def test_taking_over_takes_a_word_stops_first_and_tells_the_other_by_whom(robot: Robot) -> None:
    carol, dave = robot.client('carol'), robot.client('dave')
    robot.session.take(carol, False)
    with pytest.raises(HeldByAnotherError):
        robot.session.take(dave, False)
    assert robot.session.drive(carol, command(1))
    first = robot.session.lease.key
    assert robot.session.take(dave, True) is carol
    assert robot.heard[-2:] == [
        ('drive_end', {'lease': first, 'by': 'dave', 'why': 'taken over'}),
        ('drive_begin', {'lease': robot.session.lease.key, 'by': 'dave'})]
    assert said(carol).kinds('lost') == [{'kind': 'lost', 'by': 'dave', 'why': 'taken'}]
    assert said(carol).kinds('seat')[-1]['state'] == 'other'
    assert said(dave).kinds('seat')[-1]['state'] == 'yours'
    assert not robot.session.drive(carol, command(2))
    assert robot.session.drive(dave, command(1))


def test_whoever_leaves_gives_it_back_and_the_robot_stands(robot: Robot) -> None:
    carol, dave = robot.client('carol'), robot.client('dave')
    robot.session.take(carol, False)
    key = robot.session.lease.key
    assert robot.session.leave(carol, 'window closed')
    assert robot.heard[-1] == (
        'drive_end', {'lease': key, 'by': 'carol', 'why': 'window closed'})
    assert said(dave).kinds('seat')[-1]['state'] == 'free'
    assert not robot.session.leave(dave, 'window closed')
    assert len([kind for kind, _ in robot.heard if kind == 'drive_end']) == 1


def test_beats_are_for_the_one_whose_lease_they_name(robot: Robot) -> None:
    carol, dave = robot.client('carol'), robot.client('dave')
    robot.session.take(carol, False)
    robot.session.beat(DriveBeat(8, 5, robot.session.lease.key, 3, armed=True, runs=True))
    robot.session.beat(DriveBeat(9, lease='before'))
    robot.session.beat(DriveBeat(10))
    assert said(carol).kinds('beat') == [{
        'kind': 'beat', 'n': 8, 'utc_ns': 5, 'seq': 3, 'armed': True, 'moves': False,
        'rtt_ms': None, 'runs': True}]
    assert said(dave).kinds('beat') == []


def test_a_robot_that_comes_back_is_told_who_drives(robot: Robot) -> None:
    carol = robot.client('carol')
    robot.session.take(carol, False)
    robot.connected = False
    robot.session.robot_is(False, DriveLimits())
    assert said(carol).kinds('seat')[-1]['connected'] is False
    assert not robot.session.drive(carol, command(1)) and robot.session.lost == 1
    robot.connected = True
    robot.session.robot_is(True, FAST)
    assert robot.heard[-1] == ('drive_begin', {'lease': robot.session.lease.key, 'by': 'carol'})


@pytest.mark.parametrize('wrong', [
    {'seq': '1'}, {'seq': True}, {'seq': -1}, {'seq': 1 << 60}, {'beat': None}, {'beat': 1.5},
    {'linear_m_s': 'x'}, {'linear_m_s': True}, {'angular_rad_s': float('inf')},
    {'held_ms': float('nan')}, {'linear_m_s': []}])
def test_what_is_no_command_does_not_go_to_the_robot(robot: Robot, wrong: Any) -> None:
    carol = robot.client('carol')
    robot.session.take(carol, False)
    assert not robot.session.drive(carol, command(**wrong))
    assert robot.drives() == [] and robot.session.refused == 1


@pytest.mark.parametrize('limits', [{}, {'linear_m_s': 'fast'}, {'linear_m_s': -1.0},
                                    {'linear_m_s': float('inf')}, {'linear_m_s': True}])
def test_a_robot_with_limits_that_are_none_stands(robot: Robot, limits: Any) -> None:
    robot.session.robot_is(True, DriveLimits.from_json(limits))
    carol = robot.client('carol')
    robot.session.take(carol, False)
    robot.session.drive(carol, command())
    assert robot.drives()[-1]['linear_m_s'] == 0.0


def test_numbers_of_commands_rise(robot: Robot) -> None:
    carol = robot.client('carol')
    robot.session.take(carol, False)
    assert robot.session.drive(carol, command(5))
    assert not robot.session.drive(carol, command(5))
    assert not robot.session.drive(carol, command(4))


class OneDriver(RuleBasedStateMachine):
    """Whatever four people do: at most one drives, and the robot knows of no other."""

    people = st.integers(0, 3)

    def __init__(self) -> None:
        super().__init__()
        self.robot = Robot()
        self.clients: list[TeleopClient | None] = [None] * 4
        self.holder: int | None = None
        self.seq = 0

    @rule(who=people)
    def enter(self, who: int) -> None:
        if self.clients[who] is None:
            self.clients[who] = self.robot.client(f'person {who}')

    @rule(who=people, over=st.booleans())
    def take(self, who: int, over: bool) -> None:
        client = self.clients[who]
        if client is None:
            return
        if self.holder in (None, who) or over:
            self.robot.session.take(client, over)
            self.holder = who
        else:
            with pytest.raises(HeldByAnotherError):
                self.robot.session.take(client, over)

    @rule(who=people)
    def give(self, who: int) -> None:
        client = self.clients[who]
        if client is not None:
            assert self.robot.session.give(client, 'given back') == (self.holder == who)
            self.holder = None if self.holder == who else self.holder

    @rule(who=people)
    def leave(self, who: int) -> None:
        client = self.clients[who]
        if client is not None:
            self.robot.session.leave(client, 'window closed')
            self.clients[who] = None
            self.holder = None if self.holder == who else self.holder

    @rule(who=people)
    def drive(self, who: int) -> None:
        client = self.clients[who]
        if client is not None:
            self.seq += 1
            assert self.robot.session.drive(client, command(self.seq)) == (self.holder == who)

    @precondition(lambda self: self.robot.connected)
    @rule()
    def robot_goes_and_comes(self) -> None:
        self.robot.session.robot_is(False, DriveLimits())
        self.robot.session.robot_is(True, FAST)

    @invariant()
    def the_robot_knows_the_one_lease(self) -> None:
        lease = ''
        for kind, content in self.robot.heard:
            if kind == 'drive_begin':
                lease = content['lease']
            elif kind == 'drive_end':
                assert content['lease'] == lease
                lease = ''
            else:
                assert content['lease'] == lease
        assert lease == self.robot.session.lease.key
        assert (self.robot.session.lease.holder is None) == (self.holder is None)
        if self.holder is not None:
            assert self.robot.session.lease.holder is self.clients[self.holder]


OneDriver.TestCase.settings = settings(max_examples=25, stateful_step_count=30)
TestOneDriver = OneDriver.TestCase
