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


"""The core's side of the link on the virtual clock, with clients that do whatever they like."""

from __future__ import annotations

from collections.abc import Iterator
import json
from pathlib import Path
import socket
import tempfile
from typing import Any

from core_in_process import CoreInProcess
from core_in_process import MS
from core_in_process import PARTS
from core_in_process import RawClient
from core_in_process import S
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from processes import GUARD_YAML
from processes import in_a_folder
import pytest

from rt_robot_os.base.errors import LinkError
from rt_robot_os.core.app import Core
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.link.protocol import encode_json
from rt_robot_os.link.protocol import HEADER
from rt_robot_os.link.protocol import Header
from rt_robot_os.link.protocol import header
from rt_robot_os.link.protocol import HEADER_BYTES
from rt_robot_os.link.protocol import PACKET_BYTES_MAXIMUM
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.link.protocol import REQUEST_BYTES_MAXIMUM
from rt_robot_os.link.protocol import VERSION
from rt_robot_os.link.records import records
from rt_robot_os.link.session import OUTBOX_BYTES_MAXIMUM
from rt_robot_os.settings import load

pytest.importorskip('geometry_msgs', reason='ROS 2 messages are not installed')

YAML = f"""{GUARD_YAML}\
    topics: [cmd_vel, text]
    cmd_vel: {{message: geometry_msgs/msg/Twist, depth: 64}}
    text: {{message: std_msgs/msg/String, depth: 16, tail: 100}}
"""


class Raw(RawClient):
    """A client that may send anything, and sorts what comes."""

    def __init__(self, world: World, name: str = 'raw') -> None:
        super().__init__(world.path)
        self.world = world
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 19)
        self.samples: list[Header] = []
        self.batches: list[int] = []
        self.name = name
        self.ask('hello', name=name)

    def receive(self) -> list[tuple[Header, bytes]]:
        """Give what is there; samples are kept apart."""
        packets = []
        while not self.ended:
            try:
                packet = self.socket.recv(PACKET_BYTES_MAXIMUM)
            except BlockingIOError:
                break
            except ConnectionResetError:
                packet = b''
            if not packet:
                self.ended = True
                break
            head = Header(*HEADER.unpack_from(packet))
            if head.kind == PacketKind.DATA:
                self.samples.append(head)
            elif head.kind == PacketKind.BATCH:
                found = [Header(PacketKind.DATA, head.version, *numbers)
                         for *numbers, _ in records(memoryview(packet))]
                assert len(found) == head.seq > 1
                self.samples += found
                self.batches.append(len(found))
            elif head.kind not in (PacketKind.BEAT, PacketKind.REPORT):
                packets.append((head, packet[HEADER_BYTES:]))
        return packets

    def ask(self, do: str, **arguments: Any) -> dict[str, Any]:
        self.request(do, **arguments)
        self.world.run()
        answers = [json.loads(body) for head, body in self.receive() if head.seq == self.number]
        return answers[-1] if answers else {}


class World(CoreInProcess[Raw]):
    """A core with the topics cmd_vel and text."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, YAML)

    def client(self, name: str = 'raw') -> Raw:
        self.clients.append(Raw(self, name))
        return self.clients[-1]

    def mirror(self, client: Raw, topic: str = 'cmd_vel') -> dict[str, int]:
        return self.mirror_of(client.name, topic)

    def publish(self, count: int, topic: str = 'cmd_vel') -> None:
        publisher = self.core.bus.publisher(topic)
        for _ in range(count):
            publisher.publish()


@pytest.fixture
def world() -> Iterator[World]:
    with in_a_folder(World) as made:
        yield made


# ---- nonsense --------------------------------------------------------------------------------

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.integers().map(lambda n: n ** 40) | st.floats()
    | st.text(max_size=8) | st.sampled_from(
        ['cmd_vel', 'text', 'drain', 'latest', 'guard', 'link/beat', 'guard.timeout_s',
         'guard.rate_hz', '\ud800']),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner,
                                                                max_size=3), max_leaves=4)
REQUESTS = st.builds(
    lambda known, more: {'id': 1, **known, **more},
    st.fixed_dictionaries({'do': st.sampled_from(
        ['hello', 'mirror', 'unmirror', 'advertise', 'change', 'parameters', 'settings', 'tap',
         'rearm', 'black_box', 'statistics', 'reset_statistics'])}),
    st.dictionaries(st.sampled_from(
        ['id', 'name', 'topic', 'policy', 'max_rate_hz', 'delay_ms', 'initial', 'task', 'reason',
         'value']),
        VALUES, max_size=5))
HEADS = st.builds(
    HEADER.pack, st.integers(0, 13), st.sampled_from([VERSION] * 7 + [0, VERSION + 1, 255]),
    st.integers(0, 4), st.integers(0, (1 << 32) - 1), st.integers(-(1 << 63), (1 << 63) - 1),
    st.integers(0, (1 << 64) - 1))
PACKETS = st.one_of(
    REQUESTS.map(lambda r: header(PacketKind.REQUEST) + json.dumps(r).encode()),
    st.builds(bytes.__add__, HEADS, st.binary(max_size=120)),
    st.builds(bytes.__add__, HEADS, st.just(b'\0\1\0\0' + bytes(48))),
    st.binary(min_size=1, max_size=60))


@examples(max_examples=120)
@given(st.lists(st.lists(PACKETS, max_size=12), min_size=1, max_size=4))
def test_no_packet_does_more_than_end_the_connection(conversations: list[list[bytes]]) -> None:
    with tempfile.TemporaryDirectory(prefix='rtv') as folder:
        world = World(Path(folder))
        try:
            good = world.client('good')
            strangers = [world.client(f'stranger {n}') for n in range(len(conversations))]
            for stranger, packets in zip(strangers, conversations):
                for packet in packets:
                    stranger.send(packet)
                world.run()
                stranger.receive()
            for stranger in strangers:
                stranger.socket.close()
            world.run()
            assert world.core.kernel.failures_total == 0, world.core.kernel.failures[0]
            assert [s.name for s in world.core.link.statistics()] == ['good']
            assert good.ask('reset_statistics') == {}
            for told in world.core.bus.statistics():
                assert not [s.name for s in told.subscribers if s.name.startswith('link:')]
        finally:
            world.close()


def test_a_packet_that_is_too_long_for_the_link_is_refused(world: World) -> None:
    client = world.client()
    client.ask('advertise', topic='cmd_vel')
    # What fits is fine, however much of it is padding.
    client.send(header(PacketKind.BEAT) + bytes(PACKET_BYTES_MAXIMUM - HEADER_BYTES))
    world.run()
    assert not client.receive() and not client.ended
    client.send(header(PacketKind.BEAT) + bytes(PACKET_BYTES_MAXIMUM - HEADER_BYTES + 1))
    world.run()
    client.receive()
    assert client.ended
    assert f'refused: a packet of {PACKET_BYTES_MAXIMUM + 1} bytes' in world.reports()[-1]


def test_more_requests_than_can_wait_end_the_connection(world: World) -> None:
    client = world.client()
    for number in range(70):
        client.send(encode_json(PacketKind.REQUEST, {'id': number, 'do': 'reset_statistics'}))
    world.run()
    client.receive()
    assert client.ended
    assert 'more than 64 requests at once' in world.reports()[-1]


def test_a_request_whose_answer_raises_costs_only_the_connection_of_its_client(
        world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    def defective(name: str, value: Any) -> Any:
        raise ZeroDivisionError('in a module')

    monkeypatch.setattr(world.core.modules[0], 'change', defective)
    asking, other = world.client('asking'), world.client('other')
    other.send(encode_json(PacketKind.REQUEST, {'id': 99, 'do': 'reset_statistics'}))
    assert asking.ask('change', name='guard.timeout_s', value=1.0) == {}
    assert asking.ended
    assert [head.seq for head, _ in other.receive()] == [99]
    assert 'a request raised ZeroDivisionError: in a module' in world.reports()[-1]
    assert world.core.kernel.failures_total == 0


# ---- samples from clients --------------------------------------------------------------------

@pytest.mark.parametrize(('offset_ns', 'kept'), [
    (-5 * S, True), (-1, True), (1 * S, False), (1 << 61, False), (-(1 << 62), False)])
def test_a_stamp_of_a_client_is_never_in_the_future(
        world: World, offset_ns: int, kept: bool) -> None:
    client = world.client()
    channel = client.ask('advertise', topic='cmd_vel')['channel']
    reader = world.core.bus.subscribe('cmd_vel', 'test')
    sent_ns = world.core.kernel.now_ns()
    client.send(header(PacketKind.DATA, channel, stamp_ns=sent_ns + offset_ns)
                + world.core.bus.topic('cmd_vel').layout.prototype)
    world.run()
    assert reader.take()
    if kept:
        assert reader.stamp_ns == sent_ns + offset_ns
    else:
        assert sent_ns <= reader.stamp_ns <= world.core.kernel.now_ns()


def test_a_flood_of_samples_is_taken_in_portions_and_none_is_lost(world: World) -> None:
    client = world.client('flood')
    channel = client.ask('advertise', topic='cmd_vel')['channel']
    packet = header(PacketKind.DATA, channel) + world.core.bus.topic('cmd_vel').layout.prototype
    sent = 0
    for _ in range(20):
        try:
            while True:
                client.socket.send(packet)
                sent += 1
        except BlockingIOError:
            world.run()
    world.run(S)
    assert sent > 1000
    assert world.core.bus.topic('cmd_vel').head == sent
    assert world.core.link.statistics()[0].received == sent


def test_what_a_client_sent_before_it_ended_without_reading_is_taken(world: World) -> None:
    client = world.client('hasty')
    channel = client.ask('advertise', topic='cmd_vel')['channel']
    world.run(S)  # beats that it does not read
    for _ in range(3):
        client.send(header(PacketKind.DATA, channel)
                    + world.core.bus.topic('cmd_vel').layout.prototype)
    client.socket.close()
    world.run()
    assert world.core.bus.topic('cmd_vel').head == 3
    assert any('closed by the client' in text for text in world.reports())


# ---- samples to clients ----------------------------------------------------------------------

@pytest.mark.parametrize('leave', ['unmirror', 'close'])
def test_publications_wake_the_link_only_while_somebody_mirrors(world: World, leave: str) -> None:
    service = world.core.kernel.task('link/service')
    clients = [world.client(f'{n}') for n in range(2)]
    publisher = world.core.bus.publisher('text')

    def wakes() -> int:
        before: list[int] = []

        def publish(slack_ns: int) -> None:
            if not before:  # with nothing else going on
                before.append(service.releases)
                publisher.publish()

        world.core.kernel.on_idle = publish
        world.run()
        world.core.kernel.on_idle = None
        return service.releases - before[0]

    assert not wakes()
    for client in clients:
        client.ask('mirror', topic='text')
    assert wakes()
    for client in clients:
        assert wakes()
        if leave == 'unmirror':
            client.ask('unmirror', topic='text')
        else:
            client.socket.close()
            world.run()
    assert not wakes()


def test_a_client_that_is_gone_leaves_nothing_that_waits(world: World) -> None:
    service = world.core.kernel.task('link/service')
    client = world.client('patient')
    client.ask('mirror', topic='text', delay_ms=100.0)
    world.publish(1, 'text')
    assert world.mirror(client, 'text')['waiting'] == 1
    client.socket.close()
    world.run()
    assert not world.mirror(client, 'text') and not world.core.bus.topic('text').triggers
    before = service.releases
    world.publish(3, 'text')
    world.run(S)
    assert service.releases == before and world.core.kernel.failures_total == 0


@pytest.mark.parametrize('delay_ms', [-1, 100.5, '20', None, True])
def test_a_delay_that_is_none_is_refused(world: World, delay_ms: Any) -> None:
    client = world.client()
    assert 'delay_ms = ' in client.ask('mirror', topic='text', delay_ms=delay_ms)['error']
    assert client.ask('mirror', topic='text', delay_ms=100)['channel'] >= 0
    assert 'delay_ms = ' in client.ask('mirror', topic='text', delay_ms=delay_ms)['error']


def test_samples_that_were_held_back_as_a_run_ended_come_in_the_next(world: World) -> None:
    client = world.client()
    client.ask('mirror', topic='text')
    publisher = world.core.bus.publisher('text')
    left = [3, 2]

    def publish(slack_ns: int) -> None:
        for _ in range(left.pop() if left else 0):
            publisher.publish()

    world.core.kernel.on_idle = publish
    world.run(MS)  # the one before went out, and these have to wait
    world.run(3 * MS)
    world.core.kernel.on_idle = None
    world.run()
    client.receive()
    assert [head.seq for head in client.samples] == [0, 1, 2, 3, 4]


def test_what_was_held_back_goes_out_before_the_goodbye(world: World) -> None:
    client = world.client()
    client.ask('mirror', topic='text')
    world.publish(3, 'text')
    world.core.link.close()
    client.receive()
    assert [head.seq for head in client.samples] == [0, 1, 2]
    assert client.ended


def test_what_a_full_socket_costs_is_counted_and_told_to_the_client(world: World) -> None:
    client = world.client()
    client.ask('mirror', topic='cmd_vel')
    published = 0
    while not (told := world.mirror(client))['full'] or not told['lost']:
        world.publish(100)
        published += 100
        world.run()
        assert published < 100_000
    assert told['published'] == published == sum(told[key] for key in PARTS)
    client.receive()
    world.publish(1)
    world.run()
    client.receive()
    last = client.samples[-1]
    assert last.seq == published
    assert [h.seq for h in client.samples] == sorted({h.seq for h in client.samples})
    for count, head in enumerate(client.samples):
        assert head.seq == count + head.missed, 'each gap is told with the first sample after it'
    assert world.mirror(client)['waiting'] == 0


@examples(max_examples=40)
@given(st.lists(st.one_of(
    st.tuples(st.just('publish'), st.integers(1, 150)), st.tuples(st.just('run'),
                                                                  st.integers(1, 300)),
    st.tuples(st.just('read'), st.just(0)), st.tuples(st.just('latest'), st.sampled_from([0, 20])),
    st.tuples(st.just('drain'), st.sampled_from([0, 20]))), max_size=40), st.booleans())
def test_every_sample_of_a_mirror_is_accounted_for_at_any_time(
        steps: list[tuple[str, int]], initial: bool) -> None:
    with tempfile.TemporaryDirectory(prefix='rtv') as folder:
        world = World(Path(folder))
        try:
            world.publish(3)
            client = world.client()
            client.ask('mirror', topic='cmd_vel', initial=initial)
            published = int(initial)
            for step, number in steps:
                if step == 'publish':
                    world.publish(number)
                    published += number
                elif step == 'run':
                    world.run(number * MS)
                elif step == 'read':
                    client.receive()
                else:
                    client.ask('mirror', topic='cmd_vel', policy=step, max_rate_hz=number)
                told = world.mirror(client)
                assert told['published'] == published
                assert sum(told[key] for key in PARTS) == published
            world.run(S)
            client.receive()
            told = world.mirror(client)
            assert len(client.samples) == told['sent']
            assert [h.seq for h in client.samples] == sorted({h.seq for h in client.samples})
            assert all(h.missed <= told['full'] + told['lost'] for h in client.samples)
        finally:
            world.close()


def test_answers_for_a_client_that_does_not_read_are_bounded_and_counted(world: World) -> None:
    client = world.client('deaf')
    name = 'x' * (REQUEST_BYTES_MAXIMUM - 200)
    sent = 0
    while not (told := world.core.link.statistics()[0]).outbox_dropped:
        for _ in range(20):
            client.send(encode_json(PacketKind.REQUEST, {'id': 5, 'do': 'mirror', 'topic': name}))
        world.run()
        sent += 20
        assert sent < 10_000
    # The error names the topic: each answer is about as long as the request.
    assert OUTBOX_BYTES_MAXIMUM * 0.9 < (sent - told.outbox_dropped) * len(name) < (
        OUTBOX_BYTES_MAXIMUM + (4 << 20)), 'and what the socket itself holds'
    assert not client.ended
    while client.receive():
        world.run()
    assert client.ask('reset_statistics') == {}


# ---- the socket ------------------------------------------------------------------------------

def second_core(world: World) -> Core:
    return Core(load([world.path.parent / 'robot.yaml']), world.path, clock=VirtualClock())


def test_a_second_core_is_refused_also_when_the_first_accepts_nobody(world: World) -> None:
    waiting = []
    for _ in range(40):
        probe = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        probe.setblocking(False)
        waiting.append(probe)
        try:
            probe.connect(str(world.path))
        except BlockingIOError:
            break
    else:
        pytest.fail('the first core had a place for all')
    with pytest.raises(LinkError, match='another core serves it'):
        second_core(world).link.open()
    for probe in waiting:
        probe.close()
    world.run()
    assert world.client('afterwards').ask('reset_statistics') == {}


def test_a_file_that_is_no_socket_is_not_deleted(world: World) -> None:
    world.core.close()
    world.path.write_text('precious')
    with pytest.raises(LinkError, match='not a socket; choose another path'):
        second_core(world).link.open()
    assert world.path.read_text() == 'precious'


def test_the_socket_of_another_program_is_not_deleted(world: World) -> None:
    world.core.close()
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as other:
        other.bind(str(world.path))
        other.listen()
        with pytest.raises(LinkError, match='robot.sock'):
            second_core(world).link.open()
        assert world.path.is_socket()


def test_a_core_that_ends_late_leaves_the_socket_of_its_successor(world: World) -> None:
    world.path.unlink()  # for instance by whoever cleans up temporary files
    successor = second_core(world)
    successor.link.open()
    world.core.close()
    assert world.path.is_socket()
    successor.close()
    assert not world.path.exists()
    successor.close()


def test_a_path_that_is_too_long_or_nowhere_is_named(world: World) -> None:
    for path in (world.path.parent / ('x' * 120), world.path.parent / 'none' / 'robot.sock'):
        core = Core(load([world.path.parent / 'robot.yaml']), path, clock=VirtualClock())
        with pytest.raises(LinkError, match=str(path)):
            core.link.open()


def test_a_client_mirrors_a_topic_that_has_no_room_for_another_module(world: World) -> None:
    topic = world.core.bus.topic('cmd_vel')
    while topic.counted < topic.max_subscribers:
        world.core.bus.subscribe('cmd_vel', f'module {topic.counted}')
    client = world.client()
    answer = client.ask('mirror', topic='cmd_vel', policy='drain')
    assert answer.get('ok') is not False and 'error' not in answer, answer
    world.publish(3)
    world.run()
    client.receive()
    assert len(client.samples) == 3
