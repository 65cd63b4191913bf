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

"""``/drive`` over a real server: who may, taking over, the end of a session, the audit."""

from __future__ import annotations

from collections.abc import Iterator
import json
from pathlib import Path
import threading
from typing import Any

from fake_robot import FakeRobot
from fake_robot import RobotScript
from monitor_server import logged_in
from monitor_server import Page
from monitor_server import quick_services
from monitor_server import served
from processes import wait_until
import pytest
from rt_robot_os.messages.uplink.messages import encode
from rt_robot_os.monitor.security.roles import Role
from rt_robot_os.monitor.services import Services
from sqlalchemy import select
from websockets.exceptions import ConnectionClosed
from websockets.exceptions import InvalidStatus

PATH = '/drive?robot=robot'
LIMITS = {'linear_m_s': 0.3, 'angular_rad_s': 0.8}


@pytest.fixture
def services(tmp_path: Path) -> Services:
    return quick_services(tmp_path)


@pytest.fixture
def address(services: Services) -> Iterator[str]:
    with served(services) as found:
        yield found


@pytest.fixture
def robot(address: str) -> Iterator[FakeRobot]:
    with FakeRobot(f'ws://{address}', script=RobotScript(limits=LIMITS)) as found:
        yield found


def cab(address: str, headers: dict[str, str]) -> Page:
    return Page(address, headers, PATH)


def command(page: Page, seq: int, beat: int = 5, **more: Any) -> None:
    page.say(**{'kind': 'drive', 'seq': seq, 'beat': beat, 'grip': True, 'linear_m_s': 0.2,
                'angular_rad_s': 0.1, 'held_ms': 4.0, **more})


def noted(services: Services) -> list[tuple[str, str, dict[str, Any]]]:
    from rt_robot_os.monitor.security.tables import audit
    with services.store.reading() as connection:
        rows = connection.execute(select(audit.c.name, audit.c.action, audit.c.details).where(
            audit.c.action.like('drive.%')).order_by(audit.c.seq)).all()
    return [(name, action, details if isinstance(details, dict) else json.loads(details))
            for name, action, details in rows]


def test_a_command_goes_to_the_robot_and_its_beat_to_whoever_drives(
        address: str, services: Services, robot: FakeRobot) -> None:
    with cab(address, logged_in(services, 'carol', Role.OPERATOR)) as carol:
        seat = carol.next('seat')
        assert (seat['state'], seat['connected'], seat['limits']) == ('free', True, LIMITS)
        command(carol, 1)  # nothing is taken yet: this goes nowhere
        carol.say(kind='take', over=False)
        assert carol.next('seat', state='yours')['by'] == 'carol'
        lease = robot.wait_for('drive_begin', by='carol')['lease']
        robot.send(encode('beat', {'n': 77, 'lease': lease, 'armed': True, 'utc_ns': 1}))
        assert carol.next('beat')['n'] == 77
        command(carol, 2, 77, linear_m_s=5.0)
        sent = robot.wait_for('drive', lease=lease)
        assert (sent['seq'], sent['beat'], sent['grip']) == (2, 77, True)
        assert 0.29 < sent['linear_m_s'] <= 0.3
    assert robot.wait_for('drive_end')['lease'] == lease
    wait_until(lambda: len(noted(services)) == 2, 'two rows in the audit')
    assert noted(services)[0][:2] == ('carol', 'drive.take')
    assert noted(services)[1] == ('carol', 'drive.end', {'why': 'window closed', 'commands': 1})
    assert len([each for each in robot.received if each['kind'] == 'drive']) == 1


def test_a_second_driver_has_to_say_so_and_the_first_is_told_by_whom(
        address: str, services: Services, robot: FakeRobot) -> None:
    carols, daves = (logged_in(services, each, Role.OPERATOR) for each in ('carol', 'dave'))
    with cab(address, carols) as carol, cab(address, daves) as dave:
        carol.say(kind='take', over=False)
        first = robot.wait_for('drive_begin', by='carol')['lease']
        dave.next('seat', state='other', by='carol')
        dave.say(kind='take', over=False)
        assert dave.next('refused') == {'kind': 'refused', 'why': 'held', 'by': 'carol'}
        dave.say(kind='take', over=True)
        assert carol.next('lost')['by'] == 'dave'
        robot.wait_for('drive_end', lease=first)
        second = robot.wait_for('drive_begin', by='dave')['lease']
        command(carol, 1)
        command(dave, 1, linear_m_s=0.1)
        sent = robot.wait_for('drive')
        assert (sent['lease'], sent['by']) == (second, 'dave')
    wait_until(lambda: len(noted(services)) == 3, 'three rows in the audit')
    assert noted(services)[1] == ('dave', 'drive.take_over', {'from': 'carol', 'commands': 0})


def test_the_end_of_a_session_stops_the_robot_and_closes_the_window(
        address: str, services: Services, robot: FakeRobot) -> None:
    headers = logged_in(services, 'carol', Role.OPERATOR)
    with cab(address, headers) as carol:
        carol.say(kind='take', over=False)
        robot.wait_for('drive_begin')
        user = services.accounts.users.find('carol')
        threading.Thread(target=services.accounts.end_sessions,
                         kwargs={'user': user.id}).start()
        assert robot.wait_for('drive_end')['why'] == 'session ended'
        with pytest.raises(ConnectionClosed) as closed:
            while True:
                carol.socket.recv(20)
        assert closed.value.rcvd is not None and closed.value.rcvd.code == 4401
    wait_until(lambda: len(noted(services)) == 2, 'two rows in the audit')
    assert noted(services)[1][2]['why'] == 'session ended'
    with pytest.raises(InvalidStatus), cab(address, headers):
        pass


def test_who_may_not_drive_does_not_even_sit_down(
        address: str, services: Services, robot: FakeRobot) -> None:
    for role in (Role.VIEWER, Role.CARER):
        with pytest.raises(InvalidStatus), cab(address, logged_in(services, role.value, role)):
            pass


def test_a_robot_of_others_is_one_that_does_not_exist(
        address: str, services: Services, robot: FakeRobot) -> None:
    for path, people in ((PATH, ('bob',)), ('/drive?robot=other', ('*',)), ('/drive', ('*',))):
        headers = logged_in(services, f'carol{len(path)}{len(people[0])}', Role.OPERATOR, people)
        with Page(address, headers, path) as carol, pytest.raises(ConnectionClosed) as closed:
            carol.socket.recv(20)
        assert closed.value.rcvd is not None and closed.value.rcvd.code == 4404


def test_what_is_no_message_ends_the_connection_and_the_drive(
        address: str, services: Services, robot: FakeRobot) -> None:
    headers = logged_in(services, 'carol', Role.OPERATOR)
    for text in ('[]', '{', '{"kind": 1}', 'NaN', '', '{"kind":"drive"' * 90):
        with cab(address, headers) as carol:
            before = len(robot.received)
            carol.say(kind='take', over=False)
            robot.wait_for('drive_begin', before)
            carol.socket.send(text)
            robot.wait_for('drive_end', before, why='not a valid message')
            with pytest.raises(ConnectionClosed) as closed:
                while True:
                    carol.socket.recv(20)
            assert closed.value.rcvd is not None and closed.value.rcvd.code == 4400


def test_a_robot_that_is_away_or_cannot_be_driven_is_not_taken(
        address: str, services: Services) -> None:
    headers = logged_in(services, 'carol', Role.OPERATOR)
    with FakeRobot(f'ws://{address}', script=RobotScript(limits={})) as robot, cab(
            address, headers) as carol:
        carol.say(kind='take', over=True)
        assert carol.next('refused')['why'] == 'cannot'
        robot.disconnect()
        carol.next('seat', connected=False)
        carol.say(kind='take', over=True)
        assert carol.next('refused')['why'] == 'absent'
