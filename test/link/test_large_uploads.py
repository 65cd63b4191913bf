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

"""Large samples from clients into the core: from good ones, liars, and those that are killed."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
import os
from pathlib import Path
import subprocess
import sys
import tempfile
from typing import Any

from core_in_process import CoreInProcess
from core_in_process import MS
from core_in_process import RawClient
from core_in_process import S
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from processes import in_a_folder
import pytest

from rt_robot_os.errors import LinkError
from rt_robot_os.errors import TopicError
from rt_robot_os.link.client import LinkClient
from rt_robot_os.link.client import LinkSilent
from rt_robot_os.link.client_rooms import ClientRoom
from rt_robot_os.link.client_rooms import ClientRooms
from rt_robot_os.link.client_rooms import SampleTooLong
from rt_robot_os.link.protocol import decode_json
from rt_robot_os.link.protocol import GIVE_BACK
from rt_robot_os.link.protocol import HEADER
from rt_robot_os.link.protocol import Header
from rt_robot_os.link.protocol import header
from rt_robot_os.link.protocol import HEADER_BYTES
from rt_robot_os.link.protocol import Kind
from rt_robot_os.link.protocol import MEMORY
from rt_robot_os.link.protocol import PACKET_BYTES_MAXIMUM
from rt_robot_os.link.protocol import SAMPLE_BYTES_MAXIMUM
from rt_robot_os.link.protocol import SLOT
from rt_robot_os.link.rooms import BYTES_PER_S
from rt_robot_os.link.rooms import ROOM_SLOTS
from rt_robot_os.link.rooms import Uploads
from rt_robot_os.link.rooms import UploadTurns
from rt_robot_os.link.session import ClientStatistics
from rt_robot_os.linux.memory_file import FD_BYTES
from rt_robot_os.linux.memory_file import MemoryFile
from rt_robot_os.linux.memory_file import received_fds
from rt_robot_os.topics import LargePublisher

pytest.importorskip('sensor_msgs', reason='ROS 2 messages are not installed')

TAIL = 400_000
YAML = f"""
robot:
  ros__parameters:
    core: {{cpu: -2, scheduler_priority: 0, lock_memory: false}}
    topics: [map, picture, text]
    map:
      message: nav_msgs/msg/OccupancyGrid
      depth: 4
      tail: {TAIL}
      fixed: {{header.frame_id: map}}
    picture: {{message: sensor_msgs/msg/CompressedImage, depth: 8, tail: {TAIL}}}
    text: {{message: std_msgs/msg/String, depth: 16, tail: 100}}
"""


def grid(cells: int, value: int, frame: bytes = b'map\0') -> bytes:
    """Make the CDR of an OccupancyGrid of one row, all its cells of one value."""
    head = bytes([0, 1, 0, 0]) + bytes(8) + (4).to_bytes(4, 'little') + frame
    head += bytes(12) + cells.to_bytes(4, 'little') + (1).to_bytes(4, 'little') + bytes(4)
    head += bytes(-(len(head) - 4) % 8) + bytes(56)
    return head + cells.to_bytes(4, 'little') + bytes([value]) * cells


class Client(RawClient):
    """A client with the rooms of a real one, which sends what a test tells it to."""

    def __init__(self, world: World, name: str) -> None:
        super().__init__(world.path)
        self.world = world
        self.rooms = ClientRooms()
        self.answers: list[dict[str, Any]] = []
        self.fds: list[int] = []
        self.refused = 0
        self.ask('hello', name=name)

    def ask(self, do: str, **arguments: Any) -> dict[str, Any]:
        self.request(do, **arguments)
        self.world.run()
        self.receive()
        return self.answers[-1]

    def receive(self) -> None:
        buffer = bytearray(PACKET_BYTES_MAXIMUM)
        while not self.ended:
            try:
                length, ancillary, _, _ = self.socket.recvmsg_into([buffer], FD_BYTES)
            except BlockingIOError:
                return
            except ConnectionResetError:
                length, ancillary = 0, []
            if not length:
                self.ended = True
                return
            packet = bytes(buffer[:length])
            if packet[0] == Kind.ROOM:
                self.rooms.take(memoryview(packet), received_fds(ancillary))
            elif packet[0] == Kind.GIVE_BACK:
                self.rooms.returned(Header(*HEADER.unpack_from(packet)).channel, packet)
            elif packet[0] == Kind.REPLY:
                self.answers.append(decode_json(packet))
            for fd in received_fds(ancillary) if packet[0] == Kind.LIFE else ():
                os.close(fd)

    def room(self, topic: str) -> ClientRoom:
        room = self.rooms.by_channel.get(self.ask('advertise', topic=topic)['channel'])
        assert room is not None
        return room

    def publish(self, room: ClientRoom, cdr: bytes, stamp_ns: int = 0) -> bool:
        def send(packet: bytes) -> None:
            self.socket.send(packet)

        return room.publish(cdr, stamp_ns, send)

    def close(self) -> None:
        super().close()
        self.rooms.close()


class World(CoreInProcess[Client]):
    """A core with topics of large samples, and a reader of each of them."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, YAML)
        self.reader = self.core.bus.subscribe('map', 'test')
        self.seen: list[tuple[int, int]] = []

    def client(self, name: str = 'writer') -> Client:
        self.clients.append(Client(self, name))
        return self.clients[-1]

    def told(self, name: str = 'writer') -> ClientStatistics:
        return next(each for each in self.core.link.statistics() if each.name == name)

    def run(self, duration_ns: int = 20 * MS) -> None:
        super().run(duration_ns)
        if hasattr(self, 'seen'):
            self.read()

    def read(self) -> None:
        while self.reader.take():
            data = bytes(self.reader.msg.data)[:self.reader.msg.info.width]
            assert len(set(data)) <= 1, 'two samples are mixed'
            self.seen.append((len(data), data[0] if data else -1))


@pytest.fixture
def world() -> Iterator[World]:
    with in_a_folder(World) as made:
        yield made


HEAD_BYTES = len(grid(0, 0))


@pytest.mark.parametrize('length', [
    HEAD_BYTES, SAMPLE_BYTES_MAXIMUM - 1, SAMPLE_BYTES_MAXIMUM, SAMPLE_BYTES_MAXIMUM + 1,
    PACKET_BYTES_MAXIMUM - HEADER_BYTES, PACKET_BYTES_MAXIMUM + 1, HEAD_BYTES + TAIL])
def test_a_sample_of_any_length_arrives(world: World, length: int) -> None:
    client = world.client()
    room = client.room('map')
    cells = length - HEAD_BYTES
    assert client.publish(room, grid(cells, 7), stamp_ns=99 * S)
    world.run()
    assert world.seen == [(cells, 7 if cells else -1)]
    assert world.reader.stamp_ns == 99 * S
    told = world.told()
    assert (told.received, told.large) == (1, length > SAMPLE_BYTES_MAXIMUM)


def test_what_does_not_fit_the_topic_is_refused_and_counted(world: World) -> None:
    client = world.client()
    room = client.room('map')
    with pytest.raises(SampleTooLong, match='declare the topic with a longer tail'):
        client.publish(room, grid(TAIL + 100, 1))
    for wrong in (grid(TAIL + 1, 1), grid(100_000, 1, b'odo\0'), b'\x07' * 100_000):
        assert client.publish(room, wrong)
        world.run()
        client.receive()
    assert client.publish(room, grid(100_000, 3))
    world.run()
    assert world.seen == [(100_000, 3)] and not client.ended
    told = world.told()
    assert (told.received, told.refused, told.large_waiting) == (1, 3, 0)


def test_a_short_sample_does_not_overtake_a_long_one(world: World) -> None:
    client = world.client()
    room = client.room('map')
    assert client.publish(room, grid(200_000, 1))
    assert client.publish(room, grid(10, 2))
    assert not client.publish(room, grid(10, 3))  # both slots are on their way
    world.run()
    client.receive()
    assert client.publish(room, grid(10, 4))
    world.run()
    assert world.seen == [(200_000, 1), (10, 2), (10, 4)]


def test_clients_have_their_turns_at_a_bounded_rate(world: World) -> None:
    names = 'one', 'two', 'three'
    clients = {name: world.client(name) for name in names}
    rooms = {name: client.room('map') for name, client in clients.items()}
    sent = dict.fromkeys(names, 0)

    def flood(slack_ns: int) -> None:
        for name, client in clients.items():
            client.receive()
            while client.publish(rooms[name], grid(TAIL, 5)):
                sent[name] += 1
        world.read()

    world.core.kernel.on_idle = flood
    world.run(S // 4)
    world.core.kernel.on_idle = None
    taken = [world.told(name).large for name in names]
    assert max(taken) - min(taken) <= 1
    total = sum(taken) * TAIL
    assert BYTES_PER_S / 4 * 0.5 < total < BYTES_PER_S / 4 * 1.3  # and what it may do at once
    assert world.told('one').large_waiting <= ROOM_SLOTS


@pytest.mark.parametrize('packets, said', [
    ([(1, 0, 9), (1, 0, 9)], 'fills slot 0 of 1, which it has handed over'),
    ([(1, ROOM_SLOTS, 9)], f'fills slot {ROOM_SLOTS} of memory 1, which it never got'),
    ([(2, 0, 9)], 'slot 0 of memory 2, which it never got'),
    ([(1, 0, 1 << 40)], f'{1 << 40} bytes in a slot of'),
])
def test_a_client_that_lies_is_parted_with(world: World, packets: list[tuple[int, int, int]],
                                           said: str) -> None:
    client, good = world.client(), world.client('good')
    client.room('map')
    channel = client.answers[-1]['channel']
    room = good.room('map')
    for packet in packets:
        client.send(header(Kind.SLOT, channel) + SLOT.pack(*packet))
    assert good.publish(room, grid(100_000, 9))
    world.run()
    client.receive()
    assert client.ended and said in '\n'.join(world.reports())
    assert world.seen == [(100_000, 9)]
    assert world.core.kernel.failures_total == 0


def test_packets_without_a_room_are_parted_with(world: World) -> None:
    for number, packet in enumerate((
            header(Kind.SLOT, 2) + SLOT.pack(1, 0, 5), header(Kind.SLOT, 999) + SLOT.pack(1, 0, 5),
            header(Kind.SLOT, 0), header(Kind.ROOM, 0) + MEMORY.pack(1, 2, 4096))):
        client = world.client(f'{number}')
        client.send(packet)
        world.run()
        client.receive()
        assert client.ended, packet
    assert world.core.kernel.failures_total == 0


def test_a_short_packet_that_overtakes_is_parted_with(world: World) -> None:
    client = world.client()
    room = client.room('map')
    assert client.publish(room, grid(100_000, 1))
    client.send(header(Kind.DATA, client.answers[-1]['channel']) + grid(3, 2))
    world.run()
    client.receive()
    assert client.ended and 'would overtake a large one' in '\n'.join(world.reports())


def test_what_was_handed_over_before_the_client_left_is_published(world: World) -> None:
    client = world.client()
    room = client.room('map')
    assert client.publish(room, grid(100_000, 1)) and client.publish(room, grid(90_000, 2))
    client.close()
    world.run()
    assert world.seen == [(100_000, 1), (90_000, 2)]


def test_nothing_is_left_of_clients_that_left(world: World) -> None:
    def held() -> tuple[int, int]:
        return (Path('/proc/self/maps').read_text().count('memfd:rt_robot_os'),
                len(os.listdir('/proc/self/fd')))

    before = held()
    for number in range(3):
        client = world.client(f'{number}')
        room = client.room('map')
        client.room('map')  # again: it is the same
        client.publish(room, grid(100_000, 1))
        client.close()
        world.run()
    assert held() == before


def test_the_memory_of_a_client_is_bounded(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('rt_robot_os.link.session.CLIENT_MEMORY_MAXIMUM', 1_000_000)
    client = world.client()
    client.room('map')
    assert 'are taken by this client' in client.ask('advertise', topic='picture')['error']
    assert 'are taken by this client' in client.ask('mirror', topic='picture')['error']
    assert not client.ended


def test_a_copy_that_changes_under_the_core_is_judged_as_it_is(world: World) -> None:
    publisher = world.core.bus.publisher('map')
    assert isinstance(publisher, LargePublisher)
    shared = bytearray(grid(100_000, 1))
    check = publisher.topic.layout.check

    class Layout:
        """The other side writes when the core looks."""

        max_size = publisher.topic.layout.max_size

        def check(self, data: memoryview) -> str | None:
            shared[0:4] = b'\xff' * 4
            shared[88:92] = b'\xff' * 4
            return check(data)

        def __getattr__(self, name: str) -> Any:
            return getattr(layout, name)

    layout = publisher.topic.layout
    publisher.topic.layout = Layout()  # type: ignore[assignment]
    publisher.publish_shared(memoryview(shared))
    with pytest.raises(TopicError, match='of no known encoding'):
        publisher.publish_shared(memoryview(shared))
    publisher.topic.layout = layout
    world.run()
    assert world.seen == [(100_000, 1)]


STEPS = st.lists(st.tuples(
    st.sampled_from(['short', 'long', 'longest', 'wrong', 'run', 'receive', 'leave']),
    st.integers(0, 1)), max_size=20)


@examples(max_examples=25, deadline=None)
@given(STEPS)
def test_every_sample_is_published_in_order_whatever_clients_do(
        steps: list[tuple[str, int]]) -> None:
    lengths = {'short': 50, 'long': SAMPLE_BYTES_MAXIMUM, 'longest': TAIL}
    with tempfile.TemporaryDirectory(prefix='rtv') as folder:
        world = World(Path(folder))
        try:
            def join(which: int) -> tuple[Client, ClientRoom]:
                client = world.client(f'{which}')
                return client, client.room('map')

            both = [join(0), join(1)]
            accepted: list[list[tuple[int, int]]] = [[], []]
            for number, (step, which) in enumerate(steps):
                client, room = both[which]
                value = 2 * (number % 60) + which
                if step == 'run':
                    world.run()
                elif step == 'receive':
                    client.receive()
                elif step == 'leave':
                    client.close()
                    world.run(100 * MS)
                    both[which] = join(which)
                elif step == 'wrong':
                    client.publish(room, b'\x07' * SAMPLE_BYTES_MAXIMUM * 2)
                elif client.publish(room, grid(lengths[step], value)):
                    accepted[which].append((lengths[step], value))
            world.run(S)
            assert world.core.kernel.failures_total == 0, world.core.kernel.failures[0]
            for which in (0, 1):
                assert [each for each in world.seen if each[1] % 2 == which] == accepted[which]
        finally:
            world.close()


def test_turns_go_to_whoever_waited_longest() -> None:
    class Waiting:
        def __init__(self, name: str, count: int) -> None:
            self.name, self.count = name, count
            self.uploads = Uploads()
            self.uploads.waiting.extend([None] * count)  # type: ignore[list-item]

        def upload(self) -> int:
            self.uploads.waiting.pop()
            order.append(self.name)
            return 10

    order: list[str] = []
    turns, clients = UploadTurns(), [Waiting('a', 3), Waiting('b', 1), Waiting('c', 2)]
    now_ns = S
    while turns.take(clients, now_ns := now_ns + S):
        pass
    assert order == ['a', 'b', 'c', 'a', 'c', 'a']


# ---- the client -------------------------------------------------------------------------------

@pytest.mark.parametrize('body', [
    b'', GIVE_BACK.pack(3, 0), GIVE_BACK.pack(4, 1), GIVE_BACK.pack(3, 9)])
def test_a_core_that_gives_back_nonsense_is_refused_by_the_client(body: bytes) -> None:
    rooms = ClientRooms()
    memory = MemoryFile.create('test', 2, 5000)
    rooms.take(memoryview(header(Kind.ROOM, 7) + MEMORY.pack(3, 2, 5000)), [os.dup(memory.fd)])
    with pytest.raises(LinkError, match='the core gives back'):
        rooms.returned(7, header(Kind.GIVE_BACK, 7) + body)
    with pytest.raises(LinkError, match='which has no room'):
        rooms.returned(8, header(Kind.GIVE_BACK, 8) + GIVE_BACK.pack(3, 0))
    rooms.close()
    memory.close()
    room = rooms.by_channel.get(7)
    assert room is not None
    with pytest.raises(LinkError, match='is closed'):
        room.publish(b'', 0, print)


def test_a_packet_that_finds_no_room_in_the_socket_keeps_no_slot() -> None:
    rooms = ClientRooms()
    memory = MemoryFile.create('test', 2, 100_000)
    rooms.take(memoryview(header(Kind.ROOM, 7) + MEMORY.pack(3, 2, 100_000)),
               [os.dup(memory.fd)])
    room = rooms.by_channel.get(7)
    assert room is not None
    sent: list[bytes] = []

    def full(packet: bytes) -> None:
        raise LinkSilent('full')

    for _ in range(5):
        with pytest.raises(LinkSilent):
            room.publish(bytes(70_000), 0, full)
    assert [room.publish(bytes(70_000), 0, sent.append) for _ in range(3)] == [True, True, False]
    rooms.close()
    memory.close()


def test_a_real_client_publishes_what_is_long_by_itself(
        core: Any, until: Callable[..., Any]) -> None:
    client: LinkClient = core.client('source')
    reader: LinkClient = core.client('viewer')
    channel, text = client.advertise('picture'), client.advertise('text')
    seen: list[int] = []
    reader.on_data = lambda head, cdr: seen.append(cdr[-1])
    reader.mirror('picture')
    with pytest.raises(SampleTooLong):
        client.publish(channel, bytes(200_000))
    with pytest.raises(SampleTooLong):
        client.publish(text, bytes(200_000))
    head = bytes([0, 1, 0, 0]) + bytes(8) + (1).to_bytes(4, 'little') + bytes(4)
    head += (5).to_bytes(4, 'little') + b'jpeg\0' + bytes(3)
    for number in range(8):
        body = bytes([number]) * 100_000

        def publish() -> bool:  # nobody pumps this client but its publishing
            try:
                client.publish(channel, head + len(body).to_bytes(4, 'little') + body)
                return True
            except LinkSilent:
                return False

        until(publish, 'a slot')
        until(lambda: reader.pump(0.1) is not None and len(seen) > number, 'the sample')
    assert seen == list(range(8))
    mine = next(each for each in reader.statistics().clients if each['name'] == 'source')
    assert (mine['received'], mine['large'], mine['refused']) == (8, 8, 0)


KILLED = """
import sys
from pathlib import Path
from rt_robot_os.link.client import LinkClient, LinkSilent
client = LinkClient(Path(sys.argv[1]), 'killed')
channel = client.advertise('picture')
head = (bytes([0, 1, 0, 0]) + bytes(8) + bytes([1, 0, 0, 0]) + bytes(4) + bytes([5, 0, 0, 0])
        + b'jpeg\\0' + bytes(3) + (100_000).to_bytes(4, 'little'))
number = 0
while True:
    number += 1
    try:
        client.publish(channel, head + bytes([number % 251]) * 100_000)
    except LinkSilent:
        client.pump(0.01)
    if number == 20:
        print('many', flush=True)
"""


def test_a_client_that_is_killed_in_the_middle_harms_nobody(
        core: Any, until: Callable[..., Any]) -> None:
    reader: LinkClient = core.client('viewer')
    broken: list[int] = []
    seen: list[int] = []

    def take(head: Header, cdr: memoryview) -> None:
        seen.append(head.seq)
        if len(cdr) != 100_036 or len(set(bytes(cdr[36:]))) != 1:
            broken.append(head.seq)

    reader.on_data = take
    reader.mirror('picture', patient=True)
    victim = subprocess.Popen([sys.executable, '-c', KILLED, str(core.path)],
                              stdout=subprocess.PIPE)
    try:
        assert victim.stdout is not None and victim.stdout.readline()
    finally:
        victim.kill()
        victim.communicate()

    def gone() -> bool:
        reader.pump(0.05)
        return all(each['name'] != 'killed' for each in reader.statistics().clients)

    until(gone, 'the end of the client')
    assert seen and not broken
    maps = Path(f'/proc/{core.process.pid}/maps').read_text()
    assert maps.count('memfd:rt_robot_os picture') == 1  # of the viewer's mirror
