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

"""The serial forwarder's protocol, against what TinyOS' own forwarders have said and heard."""

from __future__ import annotations

import json
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st
import pytest

from rt_robot_os.features.wsn.packets.forwarder import forwarder_address
from rt_robot_os.features.wsn.packets.forwarder import ForwarderClient
from rt_robot_os.features.wsn.packets.forwarder import ForwarderEnd
from rt_robot_os.features.wsn.packets.forwarder import MOST_OUTPUT
from rt_robot_os.features.wsn.packets.forwarder import VERSION_PLAIN
from rt_robot_os.features.wsn.packets.forwarding import Forwarder
from rt_robot_os.features.wsn.packets.forwarding import MOST_CLIENTS
from rt_robot_os.features.wsn.packets.framing import frame
from rt_robot_os.features.wsn.packets.framing import FrameReader

NAMES = ('t1_version_space', 't1_version_bang', 't2')


def lines(data_dir: Path, name: str) -> list[tuple[str, bytes]]:
    """Give the lines of a transcript: whose, and what."""
    path = data_dir / 'wsn' / 'serial_forwarder_transcripts.json'
    if not path.exists():
        pytest.skip(f'no transcripts at {path}')
    return [(who, bytes.fromhex(what)) for who, what in json.loads(path.read_text())[name]['log']]


def said(log: list[tuple[str, bytes]], who: str) -> bytes:
    """Give all that one side has said."""
    return b''.join(what for one, what in log if one == who)


@pytest.mark.parametrize('name', NAMES)
@pytest.mark.parametrize('stack', ['known', 'auto'])
def test_the_server_says_what_tinyos_says(name: str, stack: str, data_dir: Path) -> None:
    log = lines(data_dir, name)
    known = 'tinyos2' if name == 't2' else 'tinyos1'
    forwarder = Forwarder(known, platform='telos')
    if stack == 'auto':
        # The first frame of the line tells; with nobody there it is lost, as with the other.
        forwarder = Forwarder(platform='telos')
        forwarder.feed_mote(next(what for who, what in log if who == 'serial mote->host'))
    number = forwarder.connect()
    assert number is not None
    tcp = serial = b''
    for who, what in log:
        if who == 'tcp client->server':
            assert forwarder.feed_client(number, what) == ''
        elif who == 'serial mote->host':
            forwarder.feed_mote(what)
        tcp += forwarder.take_output(number)
        serial += forwarder.poll_mote(0)
        assert tcp == said(log, 'tcp server->client')[:len(tcp)]
        assert serial == said(log, 'serial host->mote')[:len(serial)]
    assert tcp == said(log, 'tcp server->client')
    assert serial == said(log, 'serial host->mote')


@pytest.mark.parametrize('name', NAMES)
@pytest.mark.parametrize('stack', ['known', 'auto'])
@pytest.mark.parametrize('size', [1, 3, 4096])
def test_the_client_says_what_clients_of_tinyos_say(
        name: str, stack: str, size: int, data_dir: Path) -> None:
    log = lines(data_dir, name)
    known = 'tinyos2' if name == 't2' else 'tinyos1'
    version = VERSION_PLAIN if name == 't1_version_space' else 0x21
    client = ForwarderClient(stack if stack == 'auto' else known, version, platform='telos')
    received: list[bytes] = []
    sent = client.take_output()
    for who, what in log:
        if who == 'tcp server->client':
            for at in range(0, len(what), size):
                received += client.feed(what[at:at + size])
        elif who == 'tcp client->server' and client.ready and what[0] == len(what) - 1:
            assert client.send(what[1:])
        sent += client.take_output()
    assert sent == said(log, 'tcp client->server')
    assert (client.stack, client.problem) == (known, '')
    # What the mote has sent is what came.
    reader = FrameReader()
    expected = [each.packet for each in reader.feed(said(log, 'serial mote->host'))
                if each.packet]
    assert received == expected


def join(server: ForwarderEnd, client: ForwarderEnd) -> None:
    """Carry bytes until nobody says any more."""
    while data := server.take_output():
        client.feed(data)
        server.feed(client.take_output())
    server.feed(client.take_output())


@pytest.mark.parametrize('stack', ['tinyos1', 'tinyos2'])
def test_client_and_server_understand_each_other(stack: str) -> None:
    server, client = ForwarderEnd(stack, platform='telos'), ForwarderClient(platform='mica')
    join(server, client)
    assert (server.ready, client.ready, client.stack) == (True, True, stack)
    assert client.send(b'to the mote') and server.feed(client.take_output()) == [b'to the mote']
    assert server.send(bytes(255)) and client.feed(server.take_output()) == [bytes(255)]
    assert (client.packets, client.sent, server.peer_platform) == (
        1, 1, 1 if stack == 'tinyos1' else 0)


@pytest.mark.parametrize(('greeting', 'stack', 'problem'), [
    (b'SSH-2.0', 'auto', 'not a serial forwarder: it started with 53 53; check host and port'),
    (b'T\x1f', 'auto', 'not a serial forwarder: it started with 54 1f'),
    (b'U ', 'tinyos1', 'uses tinyos2, not tinyos1: change the stack, or the port')])
def test_a_server_of_another_kind_is_named(greeting: bytes, stack: str, problem: str) -> None:
    client = ForwarderClient(stack)
    assert client.feed(greeting) == client.feed(b'\x03abc') == []
    assert problem in client.problem
    assert client.rejected_bytes == len(greeting) + 4
    assert not client.send(b'lost') and client.dropped == 1


def test_a_newer_server_is_spoken_to_in_our_version() -> None:
    client = ForwarderClient()
    client.feed(b'T\x30')
    assert client.take_output() == b'T\x21\0\0\0\0'
    assert client.feed(b'\2\0\0\0\3abc') == [b'abc']


@given(st.lists(st.binary(max_size=300), max_size=5))
def test_no_bytes_disturb_a_connection(chunks: list[bytes]) -> None:
    for end in (ForwarderClient(), ForwarderEnd('tinyos1'), ForwarderEnd('tinyos2')):
        for chunk in chunks:
            end.feed(chunk)
        assert end.pending_bytes <= 256


def ready(forwarder: Forwarder, greeting: bytes = b'U ') -> int:
    """Connect a client, and let it greet."""
    number = forwarder.connect()
    assert number is not None
    forwarder.feed_client(number, greeting)
    forwarder.take_output(number)
    return number


def test_every_client_gets_what_the_mote_sends() -> None:
    forwarder = Forwarder('tinyos2')
    clients = [ready(forwarder) for _ in range(3)]
    forwarder.disconnect(clients.pop(1))
    forwarder.feed_mote(frame(0x45, b'one') + frame(0x42, b'of another generation'))
    assert [forwarder.take_output(each) for each in clients] == [b'\3one'] * 2
    assert (forwarder.from_mote, forwarder.foreign) == (1, 1)


def test_a_client_that_does_not_read_loses_packets_and_holds_up_nobody() -> None:
    forwarder = Forwarder('tinyos2')
    lazy, diligent = ready(forwarder), ready(forwarder)
    packet = frame(0x45, bytes(199))
    got = 0
    for _ in range(2 * MOST_OUTPUT // 200):
        forwarder.feed_mote(packet)
        got += len(forwarder.take_output(diligent))
    assert got == forwarder.from_mote * 200
    assert len(forwarder.take_output(lazy)) <= MOST_OUTPUT
    forwarder.disconnect(lazy)
    assert forwarder.clients_dropped > 300


def test_there_are_only_so_many_clients() -> None:
    forwarder = Forwarder('tinyos1')
    assert None not in [forwarder.connect() for _ in range(MOST_CLIENTS)]
    assert forwarder.connect() is None
    assert forwarder.refused_clients == 1


@pytest.mark.parametrize(('text', 'expected'), [
    ('sf://localhost:9002', ('localhost', 9002)), ('sf://10.0.0.7', ('10.0.0.7', 9001)),
    ('sf://[::1]:9100', ('::1', 9100)), ('sf://sink/', ('sink', 9001))])
def test_an_address_is_read(text: str, expected: tuple[str, int]) -> None:
    assert forwarder_address(text) == expected
    assert forwarder_address('sf://sink', 'tinyos2') == ('sink', 9002)


@pytest.mark.parametrize('text', [
    'sf://', 'sf://:9001', 'sf://host:0', 'sf://host:99999', 'sf://host:x', 'tcp://host:1',
    'sf://host:1/path', 'sf://me@host:1', 'sf://[::1'])
def test_a_wrong_address_says_what_is_right(text: str) -> None:
    with pytest.raises(ValueError, match='must look like sf://host:port'):
        forwarder_address(text)
