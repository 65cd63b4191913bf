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

"""Large samples from clients into the core: from good ones, and from liars."""

from __future__ import annotations

from collections.abc import Iterator
import os
from pathlib import Path
import tempfile

from core_in_process import MS
from core_in_process import S
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from large_clients import Client
from large_clients import grid
from large_clients import TAIL
from large_clients import World
from processes import in_a_folder
import pytest
from rt_robot_os.base.errors import TopicError
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.link.client_uploads import ClientUploadBuffer
from rt_robot_os.link.client_uploads import SampleTooLong
from rt_robot_os.link.entry_times import EntryTimes
from rt_robot_os.link.protocol import header
from rt_robot_os.link.protocol import HEADER_BYTES
from rt_robot_os.link.protocol import MEMORY
from rt_robot_os.link.protocol import PACKET_BYTES_MAXIMUM
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.link.protocol import SAMPLE_BYTES_MAXIMUM
from rt_robot_os.link.protocol import SLOT
from rt_robot_os.link.uploads import BYTES_PER_S
from rt_robot_os.link.uploads import UPLOAD_SLOTS
from rt_robot_os.link.uploads import Uploads
from rt_robot_os.link.uploads import UploadScheduler
from rt_robot_os.topics import LargePublisher
from rt_robot_os.topics import Layout

pytest.importorskip('sensor_msgs', reason='ROS 2 messages are not installed')


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
    assert world.told('one').large_waiting <= UPLOAD_SLOTS


@pytest.mark.parametrize('packets, said', [
    ([(1, 0, 9), (1, 0, 9)], 'fills slot 0 of 1, which the core holds'),
    ([(1, UPLOAD_SLOTS, 9)], f'fills slot {UPLOAD_SLOTS} of memory 1, which it never got'),
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
        client.send(header(PacketKind.SLOT, channel) + SLOT.pack(*packet))
    assert good.publish(room, grid(100_000, 9))
    world.run()
    client.receive()
    assert client.ended and said in '\n'.join(world.reports())
    assert world.seen == [(100_000, 9)]
    assert world.core.kernel.failures_total == 0


def test_packets_without_a_room_are_parted_with(world: World) -> None:
    for number, packet in enumerate((
            header(PacketKind.SLOT, 2) + SLOT.pack(1, 0, 5),
            header(PacketKind.SLOT, 999) + SLOT.pack(1, 0, 5),
            header(PacketKind.SLOT, 0), header(PacketKind.UPLOAD, 0) + MEMORY.pack(1, 2, 4096))):
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
    client.send(header(PacketKind.DATA, client.answers[-1]['channel']) + grid(3, 2))
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
    assert 'are used by this client' in client.ask('advertise', topic='picture')['error']
    assert 'are used by this client' in client.ask('mirror', topic='picture')['error']
    assert not client.ended


def test_a_copy_that_changes_under_the_core_is_judged_as_it_is(
        world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    publisher = world.core.bus.publisher('map')
    assert isinstance(publisher, LargePublisher)
    shared = bytearray(grid(100_000, 1))
    check = Layout.check

    def check_while_the_other_side_writes(layout: Layout, data: memoryview) -> str | None:
        shared[0:4] = b'\xff' * 4
        shared[88:92] = b'\xff' * 4
        return check(layout, data)

    monkeypatch.setattr(Layout, 'check', check_while_the_other_side_writes)
    publisher.publish_shared(memoryview(shared))
    with pytest.raises(TopicError, match='of no known encoding'):
        publisher.publish_shared(memoryview(shared))
    monkeypatch.undo()
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
            def join(which: int) -> tuple[Client, ClientUploadBuffer]:
                client = world.client(f'{which}')
                return client, client.room('map')

            both = [join(0), join(1)]
            accepted: list[list[tuple[int, int]]] = [[], []]
            waiting = 0
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
                    waiting += 1
                    if waiting == world.reader.topic.depth:  # the reader looks after each run
                        world.run()
                        waiting = 0
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
            self.uploads = Uploads(EntryTimes(VirtualClock()))
            self.uploads.waiting.extend([None] * count)  # type: ignore[list-item]

        def publish_upload(self) -> int:
            self.uploads.waiting.pop()
            order.append(self.name)
            return 10

    order: list[str] = []
    turns, clients = UploadScheduler(), [Waiting('a', 3), Waiting('b', 1), Waiting('c', 2)]
    now_ns = S
    while turns.publish_next(clients, now_ns := now_ns + S):
        pass
    assert order == ['a', 'b', 'c', 'a', 'c', 'a']
