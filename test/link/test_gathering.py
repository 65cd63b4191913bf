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

"""Samples that go out together: which do, when, and that none is lost or changed by it."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from pathlib import Path
import socket
import struct
import tempfile
import threading
from types import MappingProxyType
from typing import Any

from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
import pytest

from rt_robot_os.base.errors import LinkError
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.link import LinkClient
from rt_robot_os.link.batch import Batch
from rt_robot_os.link.batch import BATCH_BYTES
from rt_robot_os.link.entry_times import EntryTimes
from rt_robot_os.link.gather import Gather
from rt_robot_os.link.mirror import Mirror
from rt_robot_os.link.mirror import Policy
from rt_robot_os.link.protocol import encode_json
from rt_robot_os.link.protocol import HEADER_BYTES
from rt_robot_os.link.protocol import PACKET_BYTES_MAXIMUM
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.link.protocol import parse_header
from rt_robot_os.link.records import records
from rt_robot_os.link.session import ClientSession
from rt_robot_os.topics import Bus

pytest.importorskip('geometry_msgs', reason='ROS 2 messages are not installed')

MS = 1_000_000
S = 1_000_000_000
GATHER_NS = 5 * MS

Sample = tuple[int, int, int, int, bytes]
SAMPLES = st.lists(st.tuples(
    st.integers(0, 65535), st.integers(0, (1 << 33)), st.integers(-(1 << 63), (1 << 63) - 1),
    st.integers(0, (1 << 64) - 1), st.binary(max_size=300) | st.binary(max_size=3).map(
        lambda some: some * 7000)), max_size=40)


def pair() -> tuple[socket.socket, socket.socket]:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    for end in (ours, theirs):
        end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 20)
        end.setblocking(False)
    return ours, theirs


def packets(connection: socket.socket) -> list[bytes]:
    found = []
    while True:
        try:
            found.append(connection.recv(PACKET_BYTES_MAXIMUM))
        except BlockingIOError:
            return found


def samples(packet: bytes) -> list[Sample]:
    if packet[0] == PacketKind.BATCH:
        return [(*head, bytes(cdr)) for *head, cdr in records(memoryview(packet))]
    head = parse_header(packet)
    assert head.kind == PacketKind.DATA
    return [(head.channel, head.missed, head.stamp_ns, head.seq, packet[HEADER_BYTES:])]


def add(batch: Batch, sample: Sample) -> bool:
    *head, cdr = sample
    room = batch.reserve(len(cdr) + 100)  # a topic's longest is longer than this one
    if room is None:
        return False
    room[:len(cdr)] = cdr
    batch.add(*head, len(cdr))
    return True


@given(SAMPLES)
def test_all_samples_arrive_unchanged_and_in_order(given_samples: list[Sample]) -> None:
    ours, theirs = pair()
    with ours, theirs:
        batch = Batch(ours)
        for sample in given_samples:
            assert add(batch, sample)
        assert batch.send()
        came = packets(theirs)
        assert [s for packet in came for s in samples(packet)] == [
            (channel, missed & 0xFFFFFFFF, stamp_ns, seq, cdr)
            for channel, missed, stamp_ns, seq, cdr in given_samples]
        for packet in came:
            if packet[0] == PacketKind.BATCH:
                assert len(packet) <= BATCH_BYTES
                assert parse_header(packet).seq == len(samples(packet)) > 1
        assert batch.send() and not packets(theirs), 'nothing is sent twice'


@given(SAMPLES.filter(lambda s: len(s) > 1), st.data())
def test_a_packet_of_samples_that_is_not_whole_is_an_error(given_samples: list[Sample],
                                                           data: Any) -> None:
    ours, theirs = pair()
    with ours, theirs:
        batch = Batch(ours)
        for sample in given_samples:
            add(batch, sample)
        batch.send()
        batches = [p for p in packets(theirs) if p[0] == PacketKind.BATCH]
    for packet in batches:
        cut = data.draw(st.integers(HEADER_BYTES + 1, len(packet) - 8))
        whole = samples(packet)
        try:
            found = samples(packet[:cut])
        except LinkError as error:
            assert f'a packet of {cut} bytes' in str(error)
        else:  # cut between two of them
            assert found == whole[:len(found)]
        wrong = bytearray(packet)
        struct.pack_into('<Q', wrong, HEADER_BYTES, data.draw(
            st.integers(len(packet), (1 << 64) - 1) | st.integers(0, HEADER_BYTES - 1)))
        with pytest.raises(LinkError, match='holds a sample of'):
            samples(bytes(wrong))


def test_what_a_full_socket_refuses_is_sent_later_and_nothing_is_lost() -> None:
    ours, theirs = pair()
    with ours, theirs:
        batch = Batch(ours)
        accepted = 0
        while add(batch, (1, 0, 5, accepted, bytes(400))):
            accepted += 1
        assert not batch.send(), 'still full'
        came = packets(theirs)
        assert batch.send(), 'now there is room'
        numbers = [s[3] for p in came + packets(theirs) for s in samples(p)]
        assert numbers == list(range(accepted))


class Carried:
    """Topics that one client gets, under the virtual clock."""

    def __init__(self, gather_ns: int, names: Sequence[str] = ('a',), depth: int = 16,
                 delays_ms: Mapping[str, float] = MappingProxyType({}), max_rate_hz: float = 0.0
                 ) -> None:
        self.kernel = Kernel(VirtualClock())
        self.bus = Bus(self.kernel)
        self.ours, self.theirs = pair()
        self.session = ClientSession(self.ours, self.bus, 1, 0, bytearray(100),
                                     EntryTimes(VirtualClock()))
        self.service = self.kernel.add_task('service', self._serve, priority=2)
        self.gather = Gather(self.kernel, self.service, gather_ns)
        self.served_ns: list[int] = []
        self._came: list[bytes] = []
        for channel, name in enumerate(names):
            self.bus.declare(name, 'geometry_msgs/msg/Vector3', depth=depth)
            self.session.mirrors[name] = Mirror(
                self.bus, name, 'test', self.session.batch, channel, Policy.DRAIN,
                max_rate_hz, False, self.gather)
            self.session.mirrors[name].set_policy(
                Policy.DRAIN, max_rate_hz, delays_ms.get(name, 0.0))

    def _serve(self) -> None:
        now_ns = self.kernel.now_ns()
        self.served_ns.append(now_ns - self.kernel.start_ns)
        self.gather.begin()
        if self.session.send_samples(now_ns):
            self.gather.note_sent(now_ns)
        self._came += packets(self.theirs)

    def publish(self, name: str, times_us: Sequence[int]) -> None:
        """Publish at these times."""
        publisher = self.bus.publisher(name)
        task = self.kernel.add_task(f'publish {name}', publisher.publish, priority=50)
        timers = [self.kernel.timer(task) for _ in times_us]

        def begin() -> None:
            for timer, time_us in zip(timers, times_us):
                timer.start_at(self.kernel.start_ns + time_us * 1000)

        self.kernel.add_task(f'begin {name}', begin, priority=60, rate_hz=1.0)

    def received(self) -> list[list[tuple[int, int]]]:
        """Give (channel, number) of the samples of each packet."""
        return [[(s[0], s[3]) for s in samples(p)] for p in self._came + packets(self.theirs)]

    def close(self) -> None:
        self.session.close()
        self.theirs.close()


@pytest.fixture
def carried() -> Any:
    made: list[Carried] = []

    def make(*arguments: Any, **named: Any) -> Carried:
        made.append(Carried(*arguments, **named))
        return made[-1]

    yield make
    for one in made:
        one.close()


def test_a_sample_after_a_pause_goes_out_at_once(carried: Callable[..., Carried]) -> None:
    world = carried(GATHER_NS)
    world.publish('a', [1000, 11_000, 21_000])
    world.kernel.run(30 * MS)
    assert world.served_ns == [1 * MS, 11 * MS, 21 * MS]
    assert world.received() == [[(0, 0)], [(0, 1)], [(0, 2)]]


def test_what_comes_within_the_interval_goes_out_together_at_its_end(
        carried: Callable[..., Carried]) -> None:
    world = carried(GATHER_NS, ('a', 'b'))
    world.publish('a', [1000, 2000, 3000, 7000])
    world.publish('b', [4000])
    world.kernel.run(30 * MS)
    assert world.served_ns == [1 * MS, 6 * MS, 11 * MS]
    assert world.received() == [[(0, 0)], [(0, 1), (0, 2), (1, 0)], [(0, 3)]]


def test_a_sample_that_comes_when_the_interval_is_nearly_over_goes_out_at_once(
        carried: Callable[..., Carried]) -> None:
    world = carried(8 * MS)
    # A topic whose period is a little shorter than the interval, and a sample that is too early.
    world.publish('a', [1000, 8900, 16_800, 23_700])
    world.kernel.run(50 * MS)
    assert world.served_ns == [1 * MS, 8.9 * MS, 16.8 * MS, 24.8 * MS]
    assert world.received() == [[(0, 0)], [(0, 1)], [(0, 2)], [(0, 3)]]


def test_a_job_that_finds_nothing_holds_nothing_back(carried: Callable[..., Carried]) -> None:
    world = carried(GATHER_NS)
    world.publish('a', [1000, 11_000])
    timer = world.kernel.timer(world.service)
    world.kernel.add_task('ask', lambda: timer.start(10 * MS), priority=60, rate_hz=1.0)
    world.kernel.run(30 * MS)
    assert world.served_ns == [1 * MS, 10 * MS, 11 * MS]


def test_without_an_interval_each_publication_goes_out_at_once(
        carried: Callable[..., Carried]) -> None:
    world = carried(0)
    world.publish('a', [1000, 1100, 1200])
    world.kernel.run(30 * MS)
    assert world.served_ns == [1 * MS, 1.1 * MS, 1.2 * MS]
    assert world.received() == [[(0, 0)], [(0, 1)], [(0, 2)]]


@pytest.mark.parametrize('depth', [1, 2, 16])
def test_a_topic_that_is_faster_than_its_ring_is_deep_loses_nothing(
        carried: Callable[..., Carried], depth: int) -> None:
    world = carried(100 * MS, depth=depth)
    publisher = world.bus.publisher('a')
    world.kernel.add_task('publish', publisher.publish, priority=50, rate_hz=10_000.0)
    world.kernel.run(S)
    world.session.send_samples(0)
    numbers = [number for packet in world.received() for _, number in packet]
    assert numbers == list(range(publisher.published))
    assert len(world.served_ns) <= publisher.published / max(1, depth // 2) + 1


def test_what_may_wait_goes_out_together_when_the_first_has_waited_long_enough(
        carried: Callable[..., Carried]) -> None:
    world = carried(GATHER_NS, ('a', 'b'), delays_ms={'a': 10.0, 'b': 10.0})
    world.publish('a', [1000, 4000, 10_900, 12_000])
    world.publish('b', [3000])
    world.kernel.run(40 * MS)
    assert world.served_ns == [11 * MS, 22 * MS]
    assert world.received() == [[(0, 0), (0, 1), (0, 2), (1, 0)], [(0, 3)]]


def test_what_may_not_wait_takes_along_what_may(carried: Callable[..., Carried]) -> None:
    world = carried(GATHER_NS, ('a', 'b'), delays_ms={'a': 30.0})
    world.publish('a', [1000, 9000])
    world.publish('b', [3000, 5000])
    world.kernel.run(40 * MS)
    # 'b': at once after a pause, then at the end of the interval.
    assert world.served_ns == [3 * MS, 8 * MS, 39 * MS]
    assert world.received() == [[(0, 0), (1, 0)], [(1, 1)], [(0, 1)]]


def test_a_delay_that_is_taken_back_holds_nothing_any_more(carried: Callable[..., Carried]
                                                           ) -> None:
    world = carried(GATHER_NS, delays_ms={'a': 30.0})
    world.publish('a', [1000, 9000])
    world.kernel.add_task(
        'change', lambda: world.session.mirrors['a'].set_policy(Policy.DRAIN, 0.0, 0.0),
        priority=70, rate_hz=200.0, phase_ns=5 * MS)
    world.kernel.run(20 * MS)
    assert world.received() == [[(0, 0), (0, 1)]] and world.served_ns == [9 * MS]


def test_a_limit_of_the_rate_counts_from_publications_and_not_from_when_they_go_out(
        carried: Callable[..., Carried]) -> None:
    world = carried(GATHER_NS, depth=64, delays_ms={'a': 50.0}, max_rate_hz=100.0)
    publisher = world.bus.publisher('a')
    world.kernel.add_task('publish', publisher.publish, priority=50, rate_hz=500.0)
    world.kernel.run(S)
    world.session.send_samples(world.kernel.now_ns())
    numbers = [number for packet in world.received() for _, number in packet]
    assert numbers == list(range(0, publisher.published, 5))
    counted = world.session.mirrors['a'].statistics()
    assert (counted.sent, counted.limited) == (len(numbers), publisher.published - len(numbers))


def test_stamps_of_long_ago_are_no_way_round_a_limit_and_none_is_shut_out(
        carried: Callable[..., Carried]) -> None:
    world = carried(0, depth=64, max_rate_hz=100.0)
    publisher = world.bus.publisher('a')
    odd = iter(range(1, 1000))
    world.kernel.add_task('publish', lambda: publisher.publish(next(odd)), priority=50,
                          rate_hz=500.0)
    world.kernel.run(S)
    sent = world.session.mirrors['a'].statistics().sent
    assert 95 <= sent <= 101


@pytest.mark.parametrize('delay_ms', [0.0, 100.0])
@pytest.mark.parametrize('depth', [1, 2, 16])
def test_a_topic_that_is_faster_than_its_ring_loses_nothing_by_a_delay(
        carried: Callable[..., Carried], depth: int, delay_ms: float) -> None:
    world = carried(5 * MS, depth=depth, delays_ms={'a': delay_ms})
    publisher = world.bus.publisher('a')
    world.kernel.add_task('publish', publisher.publish, priority=50, rate_hz=10_000.0)
    world.kernel.run(S // 4)
    world.session.send_samples(0)
    numbers = [number for packet in world.received() for _, number in packet]
    assert numbers == list(range(publisher.published))


@examples(max_examples=60)
@given(st.lists(st.tuples(st.sampled_from('abc'), st.integers(0, 60_000)), max_size=60,
                unique=True),
       st.sampled_from([0, 1000, 5000, 20_000]), st.sampled_from([100, 3000, 30_000]),
       st.sampled_from([1000, 30_000]))
def test_each_sample_waits_as_long_as_its_own_topic_allows(
        publications: list[tuple[str, int]], gather_us: int, b_us: int, c_us: int) -> None:
    world = Carried(gather_us * 1000, 'abc', depth=256,
                    delays_ms={'b': b_us / 1000, 'c': c_us / 1000})
    limits_us = {'a': gather_us, 'b': b_us, 'c': c_us}
    try:
        for name in 'abc':
            world.publish(name, [time for n, time in publications if n == name])
        world.kernel.run(100 * MS)
        served_us = [ns // 1000 for ns in world.served_ns]
        for name, time_us in publications:
            assert any(time_us <= at <= time_us + limits_us[name] for at in served_us)
        assert sum(map(len, world.received())) == len(publications)
    finally:
        world.close()


@examples(max_examples=60)
@given(st.lists(st.tuples(st.sampled_from('ab'), st.integers(0, 60_000)), max_size=60,
                unique=True),
       st.sampled_from([0, 1000, 5000, 20_000]))
def test_each_sample_is_out_after_the_interval_at_the_latest_and_jobs_keep_apart(
        publications: list[tuple[str, int]], gather_us: int) -> None:
    world = Carried(gather_us * 1000, 'ab', depth=256)
    try:
        for name in 'ab':
            world.publish(name, [time for n, time in publications if n == name])
        world.kernel.run(100 * MS)
        served_us = [ns // 1000 for ns in world.served_ns]
        for _, time_us in publications:
            assert any(time_us <= at <= time_us + gather_us for at in served_us)
        assert all(b - a >= gather_us * 7 // 8 for a, b in zip(served_us, served_us[1:]))
        assert sum(map(len, world.received())) == len(publications)
    finally:
        world.close()


def answer_hello(listener: socket.socket) -> socket.socket:
    connection, _ = listener.accept()
    connection.recv(PACKET_BYTES_MAXIMUM)
    connection.send(encode_json(PacketKind.REPLY, {'topics': []}, seq=1))
    return connection


def test_a_handler_that_raises_loses_its_own_sample_and_no_other() -> None:
    ours, theirs = pair()
    with ours, theirs:
        batch = Batch(ours)
        for number in range(5):
            add(batch, (0, 0, 0, number, b'abcd'))
        batch.send()
        (packet,) = packets(theirs)
    with (tempfile.TemporaryDirectory(prefix='rtg') as folder,
          socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener):
        path = Path(folder) / 'core.sock'
        listener.bind(str(path))
        listener.listen(1)
        connections: list[socket.socket] = []
        core = threading.Thread(target=lambda: connections.append(answer_hello(listener)))
        core.start()
        with LinkClient(path) as client:
            core.join()
            seen: list[int] = []

            def keep(head: Any, cdr: memoryview) -> None:
                seen.append(head.seq)
                if head.seq == 1:
                    raise ValueError('cannot do with that one')

            client.on_data = keep
            connections[0].send(packet)
            with pytest.raises(ValueError, match='cannot do'):
                client.pump(5.0)
            assert seen == [0, 1]
            client.pump(0.0)
            assert seen == [0, 1, 2, 3, 4]
            client.pump(0.0)
            assert seen == [0, 1, 2, 3, 4]
        connections[0].close()
