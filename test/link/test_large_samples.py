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

"""Samples that are too long for a packet: through memory files, with clients good and bad."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
import json
import os
from pathlib import Path
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
import numpy as np
from processes import in_a_folder
import pytest

from rt_robot_os.base.errors import LinkError
from rt_robot_os.link import LinkClient
from rt_robot_os.link.client_memories import ClientMemories
from rt_robot_os.link.client_memories import give_back
from rt_robot_os.link.large import SLOTS
from rt_robot_os.link.protocol import GIVE_BACK
from rt_robot_os.link.protocol import HEADER
from rt_robot_os.link.protocol import Header
from rt_robot_os.link.protocol import header
from rt_robot_os.link.protocol import HEADER_BYTES
from rt_robot_os.link.protocol import MEMORY
from rt_robot_os.link.protocol import PACKET_BYTES_MAXIMUM
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.link.protocol import SLOT
from rt_robot_os.linux.memory_file import FD_BYTES
from rt_robot_os.linux.memory_file import Loans
from rt_robot_os.linux.memory_file import MemoryFile
from rt_robot_os.linux.memory_file import received_fds

pytest.importorskip('sensor_msgs', reason='ROS 2 messages are not installed')

SIZE = 150_000
YAML = """
robot:
  ros__parameters:
    core: {cpu: -2, scheduler_priority: 0, lock_memory: false}
    topics: [picture, jpeg]
    picture:
      {message: sensor_msgs/msg/Image, depth: 4, fixed: {encoding: mono8, data: 150000}}
    jpeg: {message: sensor_msgs/msg/CompressedImage, depth: 8, tail: 100000}
"""


class Reader(RawClient):
    """A client that keeps the slots until it is told to give them back."""

    def __init__(self, world: World, name: str) -> None:
        super().__init__(world.path)
        self.world = world
        self.name = name
        self.memories = ClientMemories()
        self.packets: list[bytes] = []
        self.seen: list[tuple[int, int]] = []
        self.answers: list[dict[str, Any]] = []
        self.ask('hello', name=name)

    def ask(self, do: str, **arguments: Any) -> dict[str, Any]:
        self.request(do, **arguments)
        self.world.run()
        self.receive()
        return self.answers[-1] if self.answers else {}

    def receive(self) -> None:
        while not self.ended:
            buffer = bytearray(PACKET_BYTES_MAXIMUM)
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
            if ancillary and packet[0] == PacketKind.LIVENESS:
                for fd in received_fds(ancillary):
                    os.close(fd)
            elif ancillary:
                self.memories.take(memoryview(packet), received_fds(ancillary))
            elif packet[0] == PacketKind.SLOT:
                self.note(packet)
            elif packet[0] == PacketKind.REPLY:
                self.answers.append(json.loads(packet[HEADER_BYTES:]))

    def note(self, packet: bytes) -> None:
        sample = self.memories.sample(packet)
        assert sample is not None
        head = Header(*HEADER.unpack_from(packet))
        self.packets.append(packet)
        values = {int(sample[-1]), int(sample[-70_000])}
        assert len(values) == 1, 'two samples are mixed'
        self.seen.append((head.seq, values.pop()))

    def close(self) -> None:
        super().close()
        self.memories.close()

    def give(self, count: int) -> None:
        for packet in self.packets[:count]:
            self.send(give_back(packet))
        del self.packets[:count]


class World(CoreInProcess[Reader]):
    """A core with two topics of large samples."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, YAML)
        self.publisher = self.core.bus.publisher('picture')
        self.published = 0

    def client(self, name: str = 'reader') -> Reader:
        self.clients.append(Reader(self, name))
        return self.clients[-1]

    def publish(self, count: int) -> None:
        for _ in range(count):
            self.publisher.fill(bytes([self.published % 251]) * SIZE)
            self.publisher.publish()
            self.published += 1

    def told(self, name: str = 'reader') -> dict[str, int]:
        for each in self.core.link.statistics():
            if each.name == name:
                return dict(each.as_json()['mirrors'][0])
        return {}


@pytest.fixture
def world() -> Iterator[World]:
    with in_a_folder(World) as made:
        yield made


def test_a_large_sample_arrives_in_place_and_in_order(world: World) -> None:
    client = world.client()
    assert 'channel' in client.ask('mirror', topic='picture')
    for _ in range(10):
        world.publish(1)
        world.run()
        client.receive()
        client.give(1)
    assert client.seen == [(n, n) for n in range(10)]
    told = world.told()
    assert (told['sent'], told['full'], told['lost']) == (10, 0, 0)


def test_a_large_sample_does_not_wait_for_others(world: World) -> None:
    client = world.client()
    client.ask('mirror', topic='picture', delay_ms=100.0)
    left = [1]

    def publish(slack_ns: int) -> None:
        if left:
            world.publish(left.pop())

    world.core.kernel.on_idle = publish
    world.run(5 * MS)
    world.core.kernel.on_idle = None
    client.receive()
    assert client.seen == [(0, 0)] and world.told()['delay_ms'] == 0


def test_a_client_that_gives_nothing_back_loses_samples_and_others_do_not(world: World) -> None:
    stalled, good = world.client('stalled'), world.client('good')
    for client in (stalled, good):
        client.ask('mirror', topic='picture')
    for _ in range(20):
        world.publish(1)
        world.run()
        for client in (stalled, good):
            client.receive()
        good.give(1)
    assert [n for n, _ in stalled.seen] == list(range(SLOTS))
    assert world.told('stalled')['full'] == 20 - SLOTS
    assert world.told('good')['sent'] == 20
    stalled.give(SLOTS)  # it wakes up: it goes on, and learns what it lost
    world.publish(1)
    world.run()
    stalled.receive()
    assert stalled.seen[-1] == (20, 20)
    assert Header(*HEADER.unpack_from(stalled.packets[-1])).missed == 20 - SLOTS


def test_a_patient_client_gets_what_waited_in_the_topic(world: World) -> None:
    client = world.client()
    client.ask('mirror', topic='picture', patient=True)
    for _ in range(SLOTS + 3):
        world.publish(1)
        world.run()
    client.receive()
    assert [n for n, _ in client.seen] == list(range(SLOTS))
    client.give(SLOTS)
    world.run()
    client.receive()
    assert client.seen == [(n, n) for n in range(SLOTS + 3)]
    assert (world.told()['full'], world.told()['lost']) == (0, 0)


@pytest.mark.parametrize('answers, said', [
    ([(1, 3)], 'returns slot 3 of 1, which it does not hold'),
    ([(1, 0), (1, 0)], 'returns slot 0 of 1, which it does not hold'),
    ([(1, SLOTS)], f'returns slot {SLOTS} of 1'),
    ([(1, 0xFFFFFFFF)], 'returns slot 4294967295'),
    ([(2, 0)], 'memory 2, which it never got'),
    ([(0, 0)], 'memory 0, which it never got'),
])
def test_a_client_that_breaks_the_rules_is_parted_with(
        world: World, answers: list[tuple[int, int]], said: str) -> None:
    client = world.client()
    client.ask('mirror', topic='picture')
    world.publish(1)
    world.run()
    for number, slot in answers:
        client.send(header(PacketKind.GIVE_BACK) + GIVE_BACK.pack(number, slot))
    world.run()
    client.receive()
    assert client.ended
    assert said in world.reports()[-1]
    assert world.core.kernel.failures_total == 0


def test_what_is_given_back_after_the_end_of_the_mirror_is_fine(world: World) -> None:
    client = world.client()
    client.ask('mirror', topic='picture')
    world.publish(2)
    world.run()
    client.receive()
    client.ask('unmirror', topic='picture')
    late = [*client.packets]
    client.ask('mirror', topic='picture')
    for packet in late:
        client.send(give_back(packet))
    world.publish(1)
    world.run()
    client.receive()
    assert not client.ended
    assert client.seen[-1] == (2, 2)


def test_the_memory_of_a_client_is_bounded(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('rt_robot_os.link.session.CLIENT_MEMORY_MAXIMUM', 700_000)
    client = world.client()
    assert 'channel' in client.ask('mirror', topic='picture')
    assert '700000 are used by this client' in client.ask('mirror', topic='jpeg')['error']
    client.ask('unmirror', topic='picture')
    assert 'channel' in client.ask('mirror', topic='jpeg')
    assert not client.ended


def test_nothing_is_left_of_clients_that_left(world: World) -> None:
    def mapped() -> int:
        return Path('/proc/self/maps').read_text().count('memfd:rt_robot_os')

    before = mapped()
    descriptors = len(os.listdir('/proc/self/fd'))
    for number in range(3):
        client = world.client(f'{number}')
        client.ask('mirror', topic='picture')
        world.publish(1)
        world.run()
        client.receive()
        client.socket.close()
        client.memories.close()
        world.run()
    assert mapped() == before
    assert len(os.listdir('/proc/self/fd')) == descriptors


STEPS = st.lists(st.one_of(
    st.tuples(st.just('publish'), st.integers(1, 6)), st.tuples(st.just('run'), st.just(20)),
    st.tuples(st.just('receive'), st.just(0)), st.tuples(st.just('give'), st.integers(1, 5)),
    st.tuples(st.just('latest'), st.sampled_from([0, 20])),
    st.tuples(st.just('drain'), st.sampled_from([0, 20])),
    st.tuples(st.just('wrong'), st.integers(0, 5)), st.tuples(st.just('again'), st.just(0)),
), max_size=25)


@examples(max_examples=40, deadline=None)
@given(STEPS, st.booleans())
def test_every_large_sample_is_accounted_for_whatever_the_client_does(
        steps: list[tuple[str, int]], initial: bool) -> None:
    with tempfile.TemporaryDirectory(prefix='rtv') as folder:
        world = World(Path(folder))
        try:
            world.publish(2)
            good, client = world.client('good'), world.client()
            good.ask('mirror', topic='picture')
            client.ask('mirror', topic='picture', initial=initial)
            published, given = int(initial), [b'']
            for step, number in steps:
                if step == 'publish':
                    world.publish(number)
                    published += number
                elif step == 'run':
                    world.run(number * MS)
                elif step == 'receive':
                    client.receive()
                elif step == 'give':
                    given = [give_back(p) for p in client.packets[:1]] or given
                    client.give(number)
                elif step == 'again':
                    client.send(given[0] or header(PacketKind.BEAT))
                elif step == 'wrong':
                    client.send(header(PacketKind.GIVE_BACK) + GIVE_BACK.pack(1, number))
                else:
                    client.ask('mirror', topic='picture', policy=step, max_rate_hz=number)
                told = world.told()
                if told:
                    assert told['published'] == published
                    assert sum(told[key] for key in PARTS) == published
            world.run(S)
            assert world.core.kernel.failures_total == 0, world.core.kernel.failures[0]
            client.receive()
            # The bytes of a client that keeps the rules are never touched under it.
            good.receive()
            assert all(seq % 251 == value for seq, value in good.seen)
            assert world.told('good')['sent'] == len(good.seen)
        finally:
            world.close()


@given(st.lists(st.tuples(st.sampled_from(['take', 'lend', 'back', 'return']),
                          st.integers(-2, 6)), max_size=60))
def test_a_slot_is_never_lent_twice(steps: list[tuple[str, int]]) -> None:
    loans, filling, out = Loans(4), set[int](), set[int]()
    for step, slot in steps:
        if step == 'take':
            taken = loans.acquire()
            assert (taken < 0) == (len(filling | out) == 4)
            if taken >= 0:
                assert taken not in filling | out
                filling.add(taken)
        elif step == 'return':
            assert loans.returned(slot) == (slot in out)
            out.discard(slot)
        elif slot in filling:
            filling.remove(slot)
            if step == 'lend':
                loans.lend(slot)
                out.add(slot)
            else:
                loans.put_back(slot)
        assert loans.out == len(out)


# ---- the client -------------------------------------------------------------------------------

@given(st.integers(0, 5), st.integers(0, 9), st.integers(0, 1 << 40))
def test_a_core_that_names_nonsense_is_refused_by_the_client(
        number: int, slot: int, length: int) -> None:
    memories = ClientMemories()
    memory = MemoryFile.create('test', 4, 5000)
    memories.take(memoryview(header(PacketKind.MEMORY, 7) + MEMORY.pack(3, 4, 5000)),
                  [os.dup(memory.fd)])
    packet = header(PacketKind.SLOT, 7) + SLOT.pack(number, slot, length)
    if number != 3:
        assert memories.sample(packet) is None
    elif slot < 4 and length <= 5000:
        sample = memories.sample(packet)
        assert sample is not None and len(sample) == length
        del sample
    else:
        with pytest.raises(LinkError, match='the core names slot'):
            memories.sample(packet)
    memories.close()
    memory.close()


@pytest.mark.parametrize('count, size', [(4, 4097), (3, 5000), (0, 5000), (1 << 31, 1 << 40)])
def test_a_memory_of_another_size_is_refused(count: int, size: int) -> None:
    memory = MemoryFile.create('test', 4, 4096)
    with pytest.raises(LinkError, match='unusable memory'):
        ClientMemories().take(memoryview(header(PacketKind.MEMORY) + MEMORY.pack(1, count, size)),
                              [os.dup(memory.fd)])
    memory.close()


def test_a_file_that_could_shrink_is_refused() -> None:
    fd = os.memfd_create('test', os.MFD_ALLOW_SEALING)
    os.ftruncate(fd, 4 * 4096)
    with pytest.raises(OSError, match='not sealed'):
        MemoryFile.received(fd, 4, 4096)
    with pytest.raises(OSError):
        os.fstat(fd)


def test_a_real_client_gets_large_samples_as_it_gets_small_ones(
        core: Any, until: Callable[..., Any]) -> None:
    publisher, client = core.client('source'), core.client('viewer')
    channel = publisher.advertise('picture')
    seen: list[tuple[int, int, int]] = []

    def on_data(head: Header, cdr: memoryview) -> None:
        assert head.kind == PacketKind.DATA and client.topics['picture'].channel == head.channel
        cdr[8:12] = b'\xff' * 4  # as the ROS node does with the stamp
        seen.append((head.seq, len(cdr), cdr[-1]))

    client.on_data = on_data
    client.mirror('picture')
    head = bytes([0, 1, 0, 0]) + bytes(8) + (1).to_bytes(4, 'little') + bytes(4)
    head += (5).to_bytes(4, 'little') + b'jpeg\0' + bytes(3)
    for number in range(12):
        body = np.full(90_000, number, np.uint8).tobytes()
        publisher.publish(channel, head + len(body).to_bytes(4, 'little') + body)
        until(lambda: client.pump(0.1) is not None and len(seen) > number, 'the sample')
    assert [s[0] for s in seen] == list(range(12))
    assert [s[2] for s in seen] == list(range(12))
    assert {s[1] for s in seen} == {len(head) + 4 + 90_000}
    mirror = next(c for c in publisher.statistics().clients if c['mirrors'])['mirrors'][0]
    assert (mirror['sent'], mirror['full'], mirror['lost']) == (12, 0, 0)


def test_a_handler_that_raises_keeps_no_slot(core: Any, until: Callable[..., Any]) -> None:
    client: LinkClient = core.client()
    seen: list[int] = []

    def on_data(head: Header, cdr: memoryview) -> None:
        seen.append(head.seq)
        raise ZeroDivisionError

    client.on_data = on_data
    client.mirror('picture')
    source = core.client('source')
    channel = source.advertise('picture')
    sample = bytes([0, 1, 0, 0]) + bytes(8) + bytes([1, 0, 0, 0]) + bytes(4) + (
        5).to_bytes(4, 'little') + b'jpeg\0' + bytes(3) + bytes(4)

    def pumped(number: int) -> bool:
        try:
            client.pump(0.1)
        except ZeroDivisionError:
            pass
        return len(seen) > number

    for number in range(2 * SLOTS):
        source.publish(channel, sample)
        until(lambda: pumped(number), 'the sample')
    assert seen == list(range(2 * SLOTS))
