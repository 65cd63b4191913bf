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

"""The way of what a robot says through the server to whoever watches it."""

from __future__ import annotations

from collections.abc import Iterator
import json
from pathlib import Path
import time
from typing import Any

from fake_robot import FakeRobot
from fake_robot import RobotScript
from fake_robot import token_of
from monitor_server import let_robot_in
from monitor_server import logged_in
from monitor_server import Page
from monitor_server import quick_services
from monitor_server import served
import pytest
from rt_robot_os.base.errors import StoreError
from rt_robot_os.messages.uplink.messages import encode
from rt_robot_os.monitor.security.roles import Role
from rt_robot_os.monitor.services import Services
from websockets.exceptions import ConnectionClosed
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect


@pytest.fixture(scope='module')
def services(tmp_path_factory: pytest.TempPathFactory) -> Services:
    return quick_services(tmp_path_factory.mktemp('monitor'), heartbeat_s=0.2)


@pytest.fixture(scope='module')
def address(services: Services) -> Iterator[str]:
    with served(services) as found:
        yield found


@pytest.fixture(scope='module')
def me(services: Services) -> dict[str, str]:
    return logged_in(services)


@pytest.fixture
def script(services: Services, request: pytest.FixtureRequest) -> RobotScript:
    """Return what a robot of its own says, which lives with somebody of its own."""
    robot = f'r{abs(hash(request.node.name))}'
    let_robot_in(services, robot)
    return RobotScript(robot, people=(f'anna-{robot}',))


def test_a_signal_and_an_alarm_of_a_robot_come_to_a_browser(
        address: str, me: dict[str, str], script: RobotScript) -> None:
    anna = script.people[0]
    with Page(address, me) as page:
        assert script.robot not in [each['id'] for each in page.next('state')['robots']]
        with FakeRobot(f'ws://{address}', script=script) as robot:
            assert page.next('robot', id=script.robot)['connected'] is True
            page.say(kind='watch', robot=script.robot, signals=['health/*'], rate_hz=10)
            robot.wait_for('want', signals=['health/*'], signals_hz=10.0)
            robot.send(script.live({f'health/{anna}/pulse': 61, 'speed': {}}))
            robot.wait_for('taken', n=1)
            signals = page.next('signals')['signals']
            assert {name: value for name, (_, value) in signals.items()} == {
                f'health/{anna}/pulse': 61}
            robot.raise_alarm('a1')
            assert page.next('alarm')['id'] == 'a1'
    with Page(address, me) as page:
        assert ('a1', script.robot) in [(each['id'], each['robot'])
                                        for each in page.next('state')['alarms']]


def test_a_robot_that_says_nothing_is_shown_as_silent_and_what_is_missing_as_a_gap(
        address: str, me: dict[str, str], script: RobotScript) -> None:
    with Page(address, me) as page:
        robot = FakeRobot(f'ws://{address}', script=script)
        robot.connect()
        page.next('robot', id=script.robot, connected=True, silent=True)
        robot.send(encode('beat', {'n': 1}))
        page.next('robot', id=script.robot, connected=True, silent=False)
        robot.disconnect()
        page.next('robot', id=script.robot, connected=False)
        robot.connect()
        gap = page.next('gap', robot=script.robot)
        assert gap['from_ns'] < gap['to_ns']
        robot.disconnect()


def test_records_that_come_again_are_stored_and_shown_once(
        address: str, me: dict[str, str], script: RobotScript, services: Services) -> None:
    anna = script.people[0]
    batch = script.records(script.alarm('a1'), script.observation(anna, 'pulse_per_min', 61.0))
    later = script.records(script.alarm('a1', event='resolved', state='resolved'))
    before = services.store.counts['fresh']
    with Page(address, me) as page, FakeRobot(f'ws://{address}', script=script) as robot:
        for text in (batch, later, batch, later, batch):
            robot.send(text)
        robot.keep(script.alarm('a2'))
        states = [(each['id'], each['state'])
                  for each in (page.next('alarm', robot=script.robot) for _ in range(3))]
        assert states == [('a1', 'raised'), ('a1', 'resolved'), ('a2', 'raised')]
    assert services.store.counts['fresh'] == before + 4
    assert len(services.store.observations(anna)) == 1


def test_what_cannot_be_stored_is_shown_refused_and_taken_when_it_comes_again(
        address: str, me: dict[str, str], script: RobotScript, services: Services,
        monkeypatch: pytest.MonkeyPatch) -> None:
    async def full(*arguments: Any) -> None:
        raise StoreError('no space left on device')

    batch = script.records(script.alarm('a1'))
    # That nothing can be stored is told beside the alarm, before it or after it.
    with Page(address, me) as page, Page(address, me) as other, FakeRobot(
            f'ws://{address}', script=script) as robot:
        with monkeypatch.context() as patch:
            patch.setattr(services.writer, 'put', full)
            services.writer.fault = 'no space left on device'
            robot.send(batch)
            assert page.next('alarm', robot=script.robot)['id'] == 'a1'
            assert robot.wait_for('refused', batch=1)['retry_s'] > 0
            assert other.next('server')['storing'] is False
        services.writer.fault = ''
        robot.send(batch)
        robot.wait_for('stored', batch=1)
        assert other.next('server')['storing'] is True


def test_nonsense_from_a_robot_is_counted_and_ends_nothing(
        address: str, script: RobotScript, services: Services) -> None:
    with FakeRobot(f'ws://{address}', script=script) as robot:
        for text in ('[', '{}', '{"kind":1}', encode('live', {}), encode('live', {
                'n': 1, 'utc_ns': 1, 'signals': {'a': 1, 'b': [1], 'c': [-1, 2]}}),
                encode('records', {'batch': 1, 'records': [1, {}, {'seq': 'x'}]}),
                encode('records', {'records': 7}), encode('answer', {'id': 'x'}),
                encode('unheard_of', {}), encode('map', {'cells': 3}), '{"kind":"live","n":NaN}'):
            robot.send(text)
        robot.keep(script.observation('anna', 'pulse_per_min', 60.0))
        counts = services.hub.robots[script.robot].counts
        for what in ('messages_wrong', 'signals_wrong', 'records_wrong', 'answers_late',
                     'messages_unknown'):
            assert counts[what] > 0, what


def test_records_that_cannot_be_set_aside_stay_at_the_robot(
        address: str, script: RobotScript, services: Services,
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('rt_robot_os.monitor.store.adding.ASIDE_MOST', 0)
    with FakeRobot(f'ws://{address}', script=script) as robot:
        robot.send(script.records(script.record('hologram', {})))
        assert 'update it' in robot.wait_for('refused', batch=1)['text']
        assert services.hub.robots[script.robot].counts['records_refused'] == 1
        monkeypatch.undo()
        robot.keep(script.record('hologram', {}))


def test_records_of_a_clock_that_is_days_ahead_are_confirmed_and_found(
        address: str, script: RobotScript, services: Services) -> None:
    ahead_ns = 2 * 86400 * 10 ** 9
    script.about['utc_ns'] = time.time_ns() + ahead_ns
    services.accounts.residents.confirm(script.robot, ['ahead'], 'test')
    with FakeRobot(f'ws://{address}', script=script) as robot:
        one = script.observation('ahead', 'pulse_per_min', 60.0)
        robot.keep({**one, 'utc_ns': one['utc_ns'] + ahead_ns})
        found, = services.store.observations('ahead')
        assert abs(found['t_ns'] - one['utc_ns']) < 60 * 10 ** 9
        assert found['quality'] == 'suspect'


def test_a_clock_that_is_years_off_is_shown_and_disturbs_nothing(
        address: str, me: dict[str, str], script: RobotScript) -> None:
    years_s = 3600 * 24 * 3000
    script.about['utc_ns'] = time.time_ns() + 10 ** 9 * years_s
    with Page(address, me) as page, FakeRobot(f'ws://{address}', script=script) as robot:
        assert page.next('robot', id=script.robot)['clock_offset_s'] == pytest.approx(
            years_s, abs=60)
        for utc_ns in (0, 1, (1 << 63) - 1):
            robot.keep({**script.alarm(f'a{utc_ns}'), 'utc_ns': utc_ns})
            shown_ns = page.next('alarm', robot=script.robot)['utc_ns']
            assert abs(shown_ns - time.time_ns()) < 60 * 10 ** 9


def test_nobody_comes_in_without_a_token_or_a_session(address: str, me: dict[str, str]) -> None:
    for headers in ({'Cookie': 'a=b'}, {'Cookie': 'session=' + 'x' * 43}):
        with pytest.raises(InvalidStatus), Page(address, headers):
            pass
    with pytest.raises(InvalidStatus), Page(address, me, origin='https://evil.example'):
        pass
    with pytest.raises(InvalidStatus), FakeRobot(f'ws://{address}', token='x' * 43):
        pass


def test_the_rights_of_who_watches_count_and_a_session_that_ends_closes_it(
        address: str, script: RobotScript, services: Services) -> None:
    anna = script.people[0]
    mary = logged_in(services, 'mary', Role.VIEWER, (anna,))
    eve = logged_in(services, 'eve', Role.VIEWER, ('zoe',))
    script.people = (anna, 'bob')
    with Page(address, mary) as page, Page(address, eve) as other, FakeRobot(
            f'ws://{address}', script=script) as robot:
        for each in (page, other):
            each.say(kind='watch', robot=None, signals=['*'], rate_hz=30)
        assert page.next('robot')['people'] == [anna]
        robot.raise_alarm('b1', subject='bob')
        robot.raise_alarm('a1', subject=anna, text='she calls bob')
        found = page.next('alarm')
        assert (found['id'], found['text']) == ('a1', 'she calls (somebody)')
        robot.send(script.live({f'health/{anna}/pulse': 61, 'health/bob/pulse': 62}))
        assert list(page.next('signals')['signals']) == [f'health/{anna}/pulse']
        other.say(kind='ping', t=1)
        # The answer, and what concerns everybody: no robot of others, no alarm, no signal.
        kinds = [(found := json.loads(other.socket.recv(20)))['kind']]
        while kinds[-1] != 'pong':
            found = json.loads(other.socket.recv(20))
            kinds.append(found['kind'])
        assert set(kinds) <= {'state', 'server', 'pong'}
        user = services.accounts.users.find('mary')
        services.accounts.end_sessions(user=user.id)
        with pytest.raises(ConnectionClosed) as closed:
            page.next('nothing')
        assert closed.value.rcvd is not None and closed.value.rcvd.code == 4401


@pytest.mark.parametrize('watch', [
    {'signals': ['*'] * 300}, {'signals': 'x'}, {'signals': ['****']}, {'robot': 3},
    {'signals': ['*'], 'rate_hz': 'x'}, {'signals': ['*'], 'id': 3}])
def test_a_watch_that_is_none_is_answered(
        address: str, me: dict[str, str], watch: dict[str, Any]) -> None:
    with Page(address, me) as page:
        page.say(kind='watch', **watch)
        assert page.next('error')['text'].startswith('watch:')


def test_a_browser_that_says_too_much_is_closed(address: str, me: dict[str, str]) -> None:
    with Page(address, me) as page:
        with pytest.raises(ConnectionClosed) as closed:
            for _ in range(100_000):
                page.socket.send('{}')
        assert closed.value.rcvd is not None and closed.value.rcvd.code == 1008


def test_what_no_message_can_carry_reaches_nobody_and_harms_nobody(
        address: str, me: dict[str, str], script: RobotScript, services: Services) -> None:
    deep = '[' * 900 + ']' * 900
    with Page(address, me) as page, FakeRobot(f'ws://{address}', script=script) as robot:
        page.say(kind='watch', robot=script.robot, signals=['*'], rate_hz=30)
        robot.wait_for('want', signals=['*'])
        robot.send('{"kind":"live","n":1,"utc_ns":1,"signals":{"b":[1,' + deep + ']}}')
        robot.send('{"kind":"live","n":1,"utc_ns":1,"signals":{"b":[1,' + 50 * deep + ']}}')
        robot.send('{"kind":"live","n":2,"utc_ns":1,"signals":{"a":[1,"\\ud800"],'
                   '"c":[1,"\\u0000\\u202e"],"d":[1,"' + 'x' * 400_000 + '"],"e":[1,1]}}')
        found = page.next('signals', n=2)['signals']
        assert found['e'][1] == 1 and found['d'][1] is None
        assert found['a'][1] == '\\ud800' and found['c'][1] == '\\x00\\u202e'
        robot.send('{"kind":"records","batch":1,"records":[{"seq":1,"importance":0,"type":'
                   '"alarm_event","utc_ns":5,"content":{"alarm":"x1","seq":1,"state":"raised",'
                   '"text":"\\ud800\\u0000' + 'y' * 5000 + '","more":"' + 'z' * 5000 + '"}}]}')
        alarm = page.next('alarm', robot=script.robot)
        assert alarm['text'].startswith('\\ud800\\x00yy') and len(alarm['text']) <= 500
        assert 'more' not in alarm
        robot.wait_for('stored', batch=1)
        page.say(kind='ping', t=1)
        page.next('pong')


def test_more_robots_than_there_may_be_are_turned_away(tmp_path: Path) -> None:
    services = quick_services(tmp_path, robots=1)
    let_robot_in(services, 'second')
    with served(services) as address, FakeRobot(f'ws://{address}'), connect(
            f'ws://{address}/robot/state', proxy=None, additional_headers={
                'Authorization': f"Bearer {token_of('second')}"}) as second:
        with pytest.raises(ConnectionClosed) as closed:
            second.recv(20)
        assert closed.value.rcvd is not None and closed.value.rcvd.code == 1013
