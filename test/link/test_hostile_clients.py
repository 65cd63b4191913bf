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

"""Clients that flood, idle, nest and name themselves badly, on the virtual clock; bounded work."""

from __future__ import annotations

from collections.abc import Iterator
import json
from pathlib import Path
from typing import Any

from core_in_process import CoreInProcess
from core_in_process import MS
from core_in_process import RawClient
from core_in_process import S
from processes import COMMANDS_YAML
from processes import in_a_folder
import pytest

from rt_robot_os.link.protocol import HEADER
from rt_robot_os.link.protocol import Header
from rt_robot_os.link.protocol import header
from rt_robot_os.link.protocol import HEADER_BYTES
from rt_robot_os.link.protocol import PACKET_BYTES_MAXIMUM
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.link.rate_limits import INTERVAL_NS
from rt_robot_os.link.rate_limits import UNITS_PER_INTERVAL
from rt_robot_os.link.server import CLIENTS_MAXIMUM
from rt_robot_os.link.server import HELLO_NS
from rt_robot_os.link.session import ClientSession

pytest.importorskip('geometry_msgs', reason='ROS 2 messages are not installed')


class Client(RawClient):
    """A client that may send anything."""

    def fill(self, packet: bytes) -> int:
        count = 0
        while True:
            try:
                self.socket.send(packet)
            except BlockingIOError:
                return count
            count += 1

    def answer(self) -> dict[str, Any]:
        """Give the last answer that has come."""
        found: dict[str, Any] = {}
        while True:
            try:
                packet = self.socket.recv(PACKET_BYTES_MAXIMUM)
            except (BlockingIOError, ConnectionResetError):
                return found
            if not packet:
                return found
            head = Header(*HEADER.unpack_from(packet))
            if head.kind == PacketKind.REPLY and not head.channel:
                found = json.loads(packet[HEADER_BYTES:])

    def has_ended(self) -> bool:
        while True:
            try:
                if not self.socket.recv(PACKET_BYTES_MAXIMUM):
                    return True
            except BlockingIOError:
                return False
            except ConnectionResetError:
                return True


class World(CoreInProcess[Client]):
    """A core with the topic cmd_vel."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, COMMANDS_YAML)

    def client(self, name: str | None = None) -> Client:
        made = Client(self.path)
        self.clients.append(made)
        if name is not None:
            made.request('hello', name=name)
        self.run()
        return made

    def run(self, duration_ns: int = 50 * MS) -> None:
        super().run(duration_ns)


@pytest.fixture
def world() -> Iterator[World]:
    with in_a_folder(World) as made:
        yield made


def test_a_flood_takes_its_share_and_the_others_are_heard_in_the_same_interval(
        world: World) -> None:
    floods = [world.client(f'flood {n}') for n in range(4)]
    honest = world.client('honest')
    honest.request('advertise', topic='cmd_vel')
    world.run()
    channel = honest.answer()['channel']
    packet = header(PacketKind.DATA, channel) + world.core.bus.topic('cmd_vel').layout.prototype
    beat = header(PacketKind.BEAT)
    for flood in floods:
        assert flood.fill(beat) > 100
    rounds = 50
    taken = late = 0
    for _ in range(rounds):
        honest.socket.send(packet)
        world.run(INTERVAL_NS + MS)
        late += world.core.bus.topic('cmd_vel').head <= _
        taken += sum(flood.fill(beat) for flood in floods)
    assert not late, 'a client that sends little waits for those that flood'
    # As much again may go through while it is not known yet who is greedy.
    assert 10 * rounds < taken < 2 * UNITS_PER_INTERVAL * (rounds + 4)
    assert world.core.kernel.failures_total == 0


def test_what_a_flood_has_sent_is_all_taken_in_the_end(world: World) -> None:
    flood = world.client('flood')
    flood.request('advertise', topic='cmd_vel')
    world.run()
    channel = flood.answer()['channel']
    packet = header(PacketKind.DATA, channel) + world.core.bus.topic('cmd_vel').layout.prototype
    sent = 0
    for _ in range(20):
        sent += flood.fill(packet)
        world.run()
    world.run(2 * S)
    assert sent > 500 and world.core.bus.topic('cmd_vel').head == sent


def test_who_never_says_hello_gives_way(world: World) -> None:
    idle = [world.client() for _ in range(CLIENTS_MAXIMUM + 1)]
    honest = world.client('honest')
    honest.request('reset_statistics')
    world.run()
    assert honest.answer() == {} and not honest.has_ended()
    world.run(HELLO_NS + 100 * MS)
    assert all(client.has_ended() for client in idle)
    assert [client.name for client in world.core.link.statistics()] == ['honest']
    assert any('sent no hello' in text for text in world.reports())


@pytest.mark.parametrize('body', [
    b'{"id": 1, "do": "hello", "name": ' + b'[' * 8000 + b']' * 8000 + b'}',
    b'{"a":' * 2500 + b'1' + b'}' * 2500])
def test_nested_requests_are_refused_unread(world: World, body: bytes) -> None:
    client = world.client()
    client.socket.send(header(PacketKind.REQUEST) + body)
    world.run()
    assert client.has_ended()
    assert 'brackets' in world.reports()[-1]


def test_who_asks_much_waits_for_itself(world: World) -> None:
    greedy, honest = world.client('greedy'), world.client('honest')
    order: list[str] = []

    def noted(session: ClientSession, arguments: dict[str, Any]) -> dict[str, Any]:
        order.append(session.name)
        return {}

    world.core.requests.add('noted', noted)
    for _ in range(60):
        greedy.request('noted')
    honest.request('noted')
    world.run()
    assert order.index('honest') <= 2 and len(order) == 61


def test_a_flood_of_connections_is_summed_up_in_the_log(world: World) -> None:
    before = len(world.reports())
    for _ in range(300):
        client = world.client()
        client.socket.send(b'nonsense')
        world.run(10 * MS)
        client.socket.close()
        world.clients.remove(client)
    world.run(3 * S)
    told = world.reports()[before:]
    assert len(told) < 60
    assert any('more lines about clients' in text for text in told)
    assert world.core.link.refused == 300


@pytest.mark.parametrize(('name', 'shown'), [
    ('\ud800', '\\ud800'), ('a\x1b[31mred', 'a\\x1b[31mred'), ('two\nlines', 'two\\nlines'),
    ('x' * 500, 'x' * 64), ('für', 'für')])
def test_a_name_is_made_safe_where_it_enters(world: World, name: str, shown: str) -> None:
    client = world.client(name)
    assert world.core.link.statistics()[0].name == shown
    client.socket.send(b'nonsense')
    world.run()
    assert f'client {shown} (pid' in world.reports()[-1]
    assert all(c.isprintable() for c in world.reports()[-1])


@pytest.mark.parametrize('request_', [
    {'do': 'change', 'name': 'guard.frame\ud800', 'value': 1},
    {'do': 'change', 'name': 'guard.timeout_s', 'value': '\ud800'},
    {'do': 'change', 'name': 'guard.timeout_s', 'value': ['a', '\udfff']}])
def test_text_that_cannot_be_encoded_is_refused(world: World, request_: dict[str, Any]) -> None:
    client = world.client('asking')
    client.request(**request_)
    world.run()
    answer = client.answer()
    assert 'string' in answer['error']
    answer['error'].encode()


def test_what_modules_and_logs_say_can_be_encoded(
        world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    module = world.core.modules[0]
    monkeypatch.setattr(module, 'statistics', lambda: {
        'bad \ud800': 'text \udfff', 'long': 'x' * 300_000, 'escape': '\x1b]0;owned\x07'})
    module.log.error('a lone %s and \x1b[2J', '\ud83d')
    client = world.client('reader')
    client.request('statistics')
    world.run()
    found: dict[str, Any] = {}
    reports = []
    while True:
        try:
            packet = client.socket.recv(PACKET_BYTES_MAXIMUM)
        except BlockingIOError:
            break
        if packet[0] in (PacketKind.REPLY, PacketKind.REPORT):
            content = json.loads(packet[HEADER_BYTES:])
            reports += [content['text']] if packet[0] == PacketKind.REPORT else []
            if content.get('part') == 'module':
                found = content['values']
    assert found['bad \\ud800'] == 'text \\udfff' and len(found['long']) == 500
    assert found['escape'] == '\\x1b]0;owned\\x07'
    assert 'a lone \\ud83d and \\x1b[2J' in reports
