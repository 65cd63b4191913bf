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

"""One user and one robot take a bounded part of the server, whatever they send."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import ExitStack
import json
from pathlib import Path
import re
import time
from types import SimpleNamespace
from typing import Any

from broad import examples
from fake_robot import FakeRobot
from fake_robot import RobotScript
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies
from monitor_server import logged_in
from monitor_server import Page
from monitor_server import quick_services
from monitor_server import served
import pytest
from rt_robot_os.messages.uplink.live import WantedSignals
from rt_robot_os.messages.uplink.messages import UplinkMessage
from rt_robot_os.monitor.live import hub as hub_module
from rt_robot_os.monitor.live.fan_out import WANTED_MOST
from rt_robot_os.monitor.live.hub import Hub
from rt_robot_os.monitor.live.memory_use import memory_of
from rt_robot_os.monitor.live.patterns import matcher
from rt_robot_os.monitor.live.rights import Rights
from rt_robot_os.monitor.live.robot_state import RobotState
from rt_robot_os.monitor.live.robot_state import SIGNAL_BYTES
from rt_robot_os.monitor.live.robot_state import SIGNALS_BYTES
from rt_robot_os.monitor.live.turns import BURST_S
from rt_robot_os.monitor.live.turns import WATCH_S
from rt_robot_os.monitor.live.turns import WATCHES_MOST
from rt_robot_os.monitor.live.turns import WatchQuota
from rt_robot_os.monitor.security.connections import Connected
from rt_robot_os.monitor.security.connections import OF_A_SESSION
from rt_robot_os.monitor.security.connections import OF_A_USER
from rt_robot_os.monitor.security.roles import Role
from rt_robot_os.monitor.services import Services
from websockets.exceptions import ConnectionClosed
from websockets.exceptions import InvalidStatus

_PATIENCE_S = 30.0
_SHORT = strategies.text('ab*', max_size=8)


@pytest.fixture
def services(tmp_path: Path) -> Services:
    """Make a server with the robot of anna."""
    return quick_services(tmp_path)


@pytest.fixture
def address(services: Services) -> Iterator[str]:
    """Serve it."""
    with served(services) as found:
        yield found


def wait_until(condition: Any) -> None:
    end = time.monotonic() + _PATIENCE_S
    while not condition():
        assert time.monotonic() < end, 'it never came about'
        time.sleep(0.02)


@settings(max_examples=examples(300), deadline=None)
@given(patterns=strategies.lists(_SHORT, max_size=3), name=strategies.text('ab', max_size=10))
def test_a_star_is_any_characters(patterns: list[str], name: str) -> None:
    words = '|'.join('.*'.join(map(re.escape, each.split('*'))) for each in patterns)
    expected = bool(patterns) and re.fullmatch(words, name) is not None
    assert matcher(patterns)(name) == expected


class Counted(str):
    """A name that counts the characters that are searched in it."""

    searched = 0

    def find(self, part: str, *span: int) -> int:  # type: ignore[override]
        """Search as a string does."""
        found = super().find(part, *span)
        Counted.searched += (found if found >= 0 else span[1]) - span[0] + len(part)
        return found


def test_a_name_is_searched_about_once_however_many_stars_there_are() -> None:
    Counted.searched = 0
    assert not matcher(('*a*a*a*b*',))(Counted('a' * 2000))
    assert Counted.searched <= 2 * 2000


def test_a_session_and_a_user_have_so_many_connections_and_get_them_back() -> None:
    connected = Connected()
    one, *others = (SimpleNamespace(id=f's{number}', user='vera') for number in range(10))
    assert [connected.add(one) for _ in range(OF_A_SESSION + 1)].count(True) == OF_A_SESSION
    assert sum(connected.add(each) for each in others for _ in range(OF_A_SESSION)) == (
        OF_A_USER - OF_A_SESSION)
    assert connected.add(SimpleNamespace(id='other', user='carl'))
    assert [connected.remove(one) for _ in range(OF_A_SESSION)] == [False] * (
        OF_A_SESSION - 1) + [True]
    assert connected.add(one)


def test_two_hundred_sockets_of_one_session_leave_room_for_others(
        services: Services, address: str) -> None:
    viewer = logged_in(services, 'vera', Role.VIEWER, ('anna',))
    other = logged_in(services, 'carl', Role.VIEWER, ('anna',))
    with ExitStack() as stack:
        for _ in range(OF_A_SESSION):
            stack.enter_context(Page(address, viewer)).next('state')
        with pytest.raises(InvalidStatus), Page(address, viewer):
            pass
        with Page(address, other) as page:
            page.next('state')
    # What has ended costs nothing, and may be opened again.
    wait_until(lambda: not services.accounts._sessions)
    with Page(address, viewer) as page:
        page.next('state')
        assert len(services.accounts._sessions) == 1
    assert services.accounts.connected.refused == 1


def test_a_user_waits_for_what_watches_cost_and_others_do_not() -> None:
    turns = WatchQuota()
    free = int(BURST_S / WATCH_S)
    assert [turns.wait_s('vera', 0, 100.0) for _ in range(free)] == [0.0] * free
    assert turns.wait_s('vera', 0, 100.0) == pytest.approx(WATCH_S)
    assert turns.wait_s('carl', 0, 100.0) == 0.0
    assert turns.wait_s('carl', 32 * 2000 * 200, 100.0) > 40.0
    assert turns.wait_s('vera', 0, 100.0 + BURST_S) == 0.0


def test_watches_of_one_user_are_bounded_over_all_connections(
        services: Services, address: str) -> None:
    viewer = logged_in(services, 'vera', Role.VIEWER, ('anna',))
    with ExitStack() as stack:
        pages = [stack.enter_context(Page(address, viewer)) for _ in range(4)]
        for number in range(WATCHES_MOST + 1):
            pages[number // 16].say(kind='watch', id=str(number), robot='none', signals=['a'])
            pages[number // 16].say(kind='ping', t=number)
            if number < WATCHES_MOST:
                assert pages[number // 16].next('pong')['t'] == number
        assert f'{WATCHES_MOST} of a user' in pages[-1].next('error')['text']
        pages[0].say(kind='watch', id='0', robot='none', signals=[])
        pages[0].say(kind='ping', t=1)
        pages[0].next('pong', t=1)
        pages[-1].say(kind='watch', id='x', robot='none', signals=['a'])
        pages[-1].say(kind='watch', id='y', robot='none', signals=['*'] + [
            f'*{number}' for number in range(40)])
        assert 'names with a star' in pages[-1].next('error')['text']


class Recorder:
    """A connection of a robot that remembers what it was told."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self.said: list[Any] = []

    def send(self, message: UplinkMessage) -> bool:
        """Receive a message."""
        self.said.append(message)
        return True


def test_many_watches_in_a_row_are_one_wish_to_the_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hub_module, 'WANT_S', 0.05)

    async def scene() -> None:
        hub, connection = Hub(2.0, 1.0), Recorder()
        robot = hub.get_or_create('robot')
        hub.connect(robot, connection, 1)  # type: ignore[arg-type]
        outlet = SimpleNamespace(offer=lambda make: None, withdraw=lambda make: None)
        for number in range(WANTED_MOST + 50):
            hub.fan_out.watch(outlet, robot, Rights(None, True),  # type: ignore[arg-type]
                              (f'a{number}',), 5.0)
            hub.want(robot)
        assert len(connection.said) == 1
        while len(connection.said) < 2:
            await asyncio.sleep(0.01)
        # So many that the robot is better asked for everything.
        assert connection.said[1] == WantedSignals(5.0, ('*',))

    asyncio.run(scene())


def test_large_signals_of_a_robot_take_a_bounded_room_and_are_counted() -> None:
    robot = RobotState('robot', 'robot')
    numbers = [index + 0.5 for index in range(10_000)]
    for index in range(40):
        robot.take(index, index, {f'map{index}': [index, numbers]})
    held = [each for each in robot.signals.values() if each.value is not None]
    assert 1 <= len(held) < 40
    assert sum(memory_of(each.value, 1 << 40) for each in held) <= SIGNALS_BYTES
    assert robot.counts['signals_too_long'] == 40 - len(held)
    assert all(json.loads('{' + each.text(frozenset()) + '}') for each in robot.signals.values())
    # What a smaller value gives back is there for others.
    for index in range(40):
        robot.take(100, 100, {f'map{index}': [100, 1]})
    robot.take(101, 101, {'map39': [101, numbers]})
    assert robot.signals['map39'].value == numbers
    robot.take(102, 102, {'one': [102, [numbers] * (SIGNAL_BYTES // 500_000)], 'x' * 300: [1, 1]})
    assert robot.signals['one'].value is None
    assert robot.counts['signals_wrong'] == 1


@given(value=strategies.recursive(
    strategies.none() | strategies.floats() | strategies.text(),
    lambda inner: strategies.lists(inner) | strategies.dictionaries(strategies.text(), inner)))
@settings(max_examples=examples(50), deadline=None)
def test_the_text_of_a_value_is_never_longer_than_its_memory(value: Any) -> None:
    assert len(json.dumps(value, separators=(',', ':'))) <= memory_of(value, 1 << 40)


def test_names_that_a_robot_makes_up_do_not_pile_up(services: Services, address: str) -> None:
    services.accounts.residents.confirm('robot', ['anna'], 'test')
    for start in range(5):
        people = tuple(f'p{start}_{number}' for number in range(64))
        with FakeRobot(f'ws://{address}', script=RobotScript('robot', people)):
            pass
    robot = services.hub.robots['robot']
    assert (robot.people, robot.ever, len(robot.suggested)) == ({'anna'}, {'anna'}, 64)
    assert [each['person'] for each in services.store.people()] == ['anna']


def test_a_page_that_says_too_much_is_closed_while_another_is_served(
        services: Services, address: str) -> None:
    viewer = logged_in(services, 'vera', Role.VIEWER, ('anna',))
    other = logged_in(services, 'carl', Role.VIEWER, ('anna',))
    with Page(address, viewer) as flood, Page(address, other) as page:
        with pytest.raises(ConnectionClosed):
            for number in range(2000):
                flood.say(kind='ping', t=number)
            flood.next('never')
        page.say(kind='ping', t=1)
        assert page.next('pong')['t'] == 1
