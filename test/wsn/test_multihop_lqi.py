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

"""MultiHopLQI on one node: its beacons, its parent, and what it does with packets."""

from __future__ import annotations

from typing import Any

from fake_node import FakeNode
from fake_node import received
from fake_node import Sent
from hypothesis import given
from hypothesis import strategies
import pytest

from rt_robot_os.features.wsn.packets.multihop_lqi import BeaconMsg
from rt_robot_os.features.wsn.packets.multihop_lqi import LqiBeacon
from rt_robot_os.features.wsn.packets.multihop_lqi import LqiData
from rt_robot_os.features.wsn.packets.multihop_lqi import MultihopMsg
from rt_robot_os.features.wsn.routing.link_cost import link_cost
from rt_robot_os.features.wsn.routing.multihop_lqi import MultiHopLqi1
from rt_robot_os.features.wsn.routing.multihop_lqi import MultiHopLqi2
from rt_robot_os.features.wsn.routing.protocol import BROADCAST
from rt_robot_os.features.wsn.routing.protocol import Received

PERIOD_NS = 32_000_000_000
APPLICATION = bytes(range(10))


def beacon(source: int, cost: int, parent: int = 0, hops: int = 1, lqi: int = 106) -> Received:
    """Make a beacon of TinyOS 2.x."""
    payload = LqiBeacon(source, 1, 0, parent, cost, hops).pack()
    return Received(BROADCAST, source, LqiBeacon.AM_TYPE, payload, lqi, -70)


def beacon1(source: int, cost: int, parent: int = 0, hops: int = 1, lqi: int = 106) -> Received:
    """Make a beacon of TinyOS 1.x, in which the frame does not say who sent it."""
    body = BeaconMsg(parent, cost, hops).pack()
    payload = MultihopMsg(source, source, 1, 1, hops, body).pack()
    return Received(BROADCAST, -1, BeaconMsg.AM_TYPE, payload, lqi, -70)


def data(source: int, to: int, seqno: int, origin: int = 9, origin_seqno: int = 1) -> Received:
    """Make a data packet of TinyOS 2.x."""
    payload = LqiData(origin, seqno, origin_seqno, 3, 0x93, APPLICATION).pack()
    return Received(to, source, LqiData.AM_TYPE, payload, 106, -70)


def data1(source: int, to: int, seqno: int, origin: int = 9, origin_seqno: int = 1) -> Received:
    """Make a data packet of TinyOS 1.x."""
    payload = MultihopMsg(source, origin, seqno, origin_seqno, 3, APPLICATION).pack()
    return Received(to, -1, 17, payload, 106, -70)


def started(kind: Any = MultiHopLqi2, address: int = 5, **options: Any) -> tuple[FakeNode, Any]:
    """Boot a node."""
    node = FakeNode(address)
    router = kind(node, **options)
    router.start()
    return node, router


@pytest.mark.parametrize(('lqi', 'wrapped', 'wide'), [
    (110, 125, 125), (90, 1000, 1000), (70, 3375, 3375), (50, 8000, 8000), (49, 110, 8302),
    (45, 1402, 9594), (40, 3193, 11385), (127, 0, 0), (0, 1552, 34320)])
def test_cost_of_a_link(lqi: int, wrapped: int, wide: int) -> None:
    assert link_cost(lqi) == wrapped
    assert link_cost(lqi, u16_wrap=False) == wide


@pytest.mark.parametrize('lqi', [-1, 256])
def test_an_lqi_is_a_byte(lqi: int) -> None:
    with pytest.raises(ValueError, match=f'^LQI {lqi}: '):
        link_cost(lqi)


@pytest.mark.parametrize('kind', [MultiHopLqi1, MultiHopLqi2])
@pytest.mark.parametrize('period_ns', [PERIOD_NS, 4_000_000_000])
def test_beacons_begin_at_random_and_come_a_tick_late(
        kind: Any, period_ns: int) -> None:
    times = set()
    for seed in range(20):
        node = FakeNode(seed, seed)
        router = kind(node, beacon_period_ns=period_ns)
        router.start()
        first = node.timers[0].due_ns
        assert first is not None
        assert first < period_ns
        times.add(first)
        node.run_until(first)
        assert node.timers[0].due_ns == first + period_ns + 976_562
    assert len(times) > 10


def test_the_first_beacon_of_firmware_comes_when_the_generator_says() -> None:
    # On emulated motes, first beacons were on the air 0.82, 1.57, 16.33 and 17.32 s after the
    # motes' start, in the order 1, 3, 0, 2.
    firsts = []
    for address in range(4):
        node, _ = started(address=address)
        assert node.timers[0].due_ns is not None
        firsts.append(round(node.timers[0].due_ns / 1e9, 2))
    assert firsts == [16.41, 0.83, 17.24, 1.65]


def test_without_a_route_the_beacon_says_so_and_data_go_to_all() -> None:
    node, router = started()
    node.run_until(PERIOD_NS)
    [frame] = node.through()
    assert frame == Sent(BROADCAST, 0x73, LqiBeacon(5, 0, 0, 0xFFFF, 65534, 0xFF).pack(), False)
    assert router.parent is None
    assert router.originate(APPLICATION)
    [frame] = node.through()
    assert frame == Sent(BROADCAST, 0x74, LqiData(5, 1, 0, 255, 0x93, APPLICATION).pack(), True)
    assert node.on_air() == []
    assert router.counters['unrouted'] == 1


def test_data_without_a_route_reach_the_root_but_are_not_forwarded() -> None:
    node, router = started()
    router.receive(beacon(0, 0, hops=0))
    router.receive(data(7, BROADCAST, 1))
    assert node.on_air() == []
    sink, root = started(address=0, root=True)
    root.receive(data(7, BROADCAST, 1))
    root.receive(data(7, BROADCAST, 1))
    assert [packet.application for packet in sink.delivered] == [APPLICATION] * 2


@pytest.mark.parametrize('kind, heard', [(MultiHopLqi1, beacon1), (MultiHopLqi2, beacon)])
def test_another_parent_has_to_be_a_quarter_cheaper(kind: Any, heard: Any) -> None:
    _, router = started(kind)
    router.receive(heard(3, 1000, lqi=90))
    assert (router.parent, router.cost, router.hops) == (3, 2000, 2)
    router.receive(heard(4, 500, lqi=90))
    assert router.parent == 3
    router.receive(heard(4, 499, lqi=90))
    assert (router.parent, router.cost) == (4, 1499)
    # The parent's own beacon counts, however much dearer it has become.
    router.receive(heard(4, 30000, lqi=50, hops=4))
    assert (router.parent, router.cost, router.hops) == (4, 38000, 5)


@pytest.mark.parametrize('kind, heard', [(MultiHopLqi1, beacon1), (MultiHopLqi2, beacon)])
def test_who_goes_over_this_node_is_no_parent(kind: Any, heard: Any) -> None:
    node, router = started(kind)
    router.receive(heard(3, 10, parent=5))
    assert router.parent is None
    router.receive(heard(3, 10, parent=0))
    assert router.parent == 3
    router.receive(heard(3, 10, parent=5))
    assert (router.parent, router.cost, router.hops) == (None, 65534, 255)
    assert router.counters['loops'] == 1
    assert node.notes[-1] == ('no_parent',)


def test_a_hopeless_link_wins_over_two_good_ones_where_16_bits_overflow() -> None:
    for u16_wrap, parent in ((True, 0), (False, 3)):
        _, router = started(u16_wrap=u16_wrap)
        router.receive(beacon(3, 258, lqi=104))
        router.receive(beacon(0, 0, hops=0, lqi=49))
        assert router.parent == parent


@pytest.mark.parametrize('kind, heard', [(MultiHopLqi1, beacon1), (MultiHopLqi2, beacon)])
def test_a_parent_is_lost_after_eight_silent_periods(kind: Any, heard: Any) -> None:
    node, router = started(kind)
    timer = node.timers[0]
    router.receive(heard(0, 0, hops=0))
    for _ in range(8):
        timer.fire()
        node.through()
        assert router.parent == 0
    timer.fire()
    assert router.parent is None
    assert router.counters['silent_parents'] == 1
    router.receive(heard(0, 0, hops=0))
    assert router.parent == 0
    for _ in range(8):
        timer.fire()
    assert router.parent == 0


@pytest.mark.parametrize('kind', [MultiHopLqi1, MultiHopLqi2])
def test_a_root_never_loses_its_place(kind: Any) -> None:
    node, router = started(kind, address=0, root=True)
    for _ in range(20):
        node.timers[0].fire()
        [frame] = node.through()
    router.receive((beacon1 if kind is MultiHopLqi1 else beacon)(3, 0, lqi=110))
    assert (router.parent, router.cost, router.hops) == (None, 0, 0)
    if kind is MultiHopLqi1:
        assert BeaconMsg.unpack(MultihopMsg.unpack(frame.payload).data) == (0x7E, 0, 0, 0)
    else:
        assert LqiBeacon.unpack(frame.payload) == (0, 19, 0, 0, 0, 0)


def test_a_packet_is_sent_six_times_and_then_given_up() -> None:
    node, router = started()
    router.receive(beacon(3, 100))
    assert router.originate(APPLICATION)
    assert not router.originate(APPLICATION)
    first = node.on_air()
    for _ in range(6):
        assert node.through() == first
    assert node.on_air() == []
    assert (router.counters['resends'], router.counters['given_up']) == (5, 1)
    # A resend goes to the parent of that moment.
    router.originate(APPLICATION)
    router.receive(beacon(4, 0))
    assert [frame.destination for frame in node.through() + node.through(True)] == [3, 4]
    assert node.on_air() == []


def test_own_packets_and_forwarded_ones_share_the_count_of_frames() -> None:
    node, router = started()
    router.receive(beacon(3, 100))
    router.originate(APPLICATION)
    router.receive(data(7, 5, 40))
    node.timers[0].fire()
    assert [frame.am_type for frame in node.on_air()] == [0x73, 0x74, 0x74]
    sent = node.through(True)
    assert LqiBeacon.unpack(sent[0].payload).seqno == 2
    assert [LqiData.unpack(frame.payload)[:3] for frame in sent[1:]] == [(5, 0, 0), (9, 1, 1)]


def test_two_packets_wait_and_a_third_is_dropped() -> None:
    node, router = started()
    router.receive(beacon(3, 100))
    for number in range(3):
        router.receive(data(7, 5, number, origin_seqno=number))
    assert router.counters['queue_full'] == 1
    numbers = []
    while node.on_air():
        numbers += [LqiData.unpack(frame.payload).origin_seqno for frame in node.through(True)]
    assert numbers == [0, 1]


def test_copies_are_dropped_and_a_packet_that_comes_back_ends_the_route() -> None:
    node, router = started()
    router.receive(beacon(3, 100))
    router.receive(data(7, 5, 40))
    node.through(True)
    router.receive(data(7, 5, 40))
    assert router.counters['duplicates'] == 1
    assert (node.on_air(), router.parent) == ([], 3)
    router.receive(data(8, 5, 77))
    assert router.counters['loops'] == 1
    assert (node.on_air(), router.parent) == ([], None)
    # Only four are remembered.
    router.receive(beacon(3, 100))
    for number in range(4):
        router.receive(data(7, 5, 50 + number, origin_seqno=50 + number))
        node.through(True)
    router.receive(data(7, 5, 40))
    assert len(node.on_air()) == 1


def test_tinyos_1_sends_one_message_at_a_time_and_loses_the_others() -> None:
    node, router = started(MultiHopLqi1)
    router.receive(beacon1(3, 100))
    assert router.originate(APPLICATION)
    assert not router.originate(APPLICATION)
    router.receive(data1(7, 5, 40))
    node.timers[0].fire()
    assert len(node.on_air()) == 1
    assert router.counters['stack_busy'] == 3
    node.through(True)
    node.timers[0].fire()
    [frame] = node.through()
    # Who sends a frame counts on, also for what was lost.
    assert MultihopMsg.unpack(frame.payload)[:5] == (5, 5, 4, 4, 2)


def test_tinyos_1_forwards_under_its_own_name() -> None:
    node, router = started(MultiHopLqi1)
    router.receive(beacon1(3, 100))
    router.receive(data1(7, 5, 40))
    [frame] = node.through(True)
    assert frame == Sent(3, 17, MultihopMsg(5, 9, 0, 1, 3, APPLICATION).pack(), True)
    router.receive(data1(7, BROADCAST, 41, origin_seqno=2))
    assert node.on_air() == []


def test_the_root_of_tinyos_1_is_busy_while_its_serial_line_is() -> None:
    node, router = started(MultiHopLqi1, address=0, root=True)
    router.receive(data1(7, 0, 40))
    router.receive(data1(8, 0, 41, origin=8))
    assert [packet.origin for packet in node.delivered] == [9]
    assert MultihopMsg.unpack(node.delivered[0].payload)[:3] == (0, 9, 40)
    node.run_until(node.time_ns + 6_200_000)
    router.receive(data1(8, 0, 42, origin=8, origin_seqno=2))
    assert [packet.origin for packet in node.delivered] == [9, 8]
    router.originate(APPLICATION)
    assert router.counters['stack_busy'] == 2


def test_the_root_of_tinyos_1_gives_up_its_serial_line_for_a_copy_over_another_way() -> None:
    node, router = started(MultiHopLqi1, address=0, root=True, serial_baud=0)
    router.receive(data1(7, 0, 40))
    router.receive(data1(8, 0, 41))
    router.receive(data1(8, 0, 42, origin_seqno=2))
    assert len(node.delivered) == 1
    assert [frame.destination for frame in node.on_air()] == [BROADCAST]


@pytest.mark.parametrize('kind', [MultiHopLqi1, MultiHopLqi2])
def test_a_node_that_boots_again_knows_nothing(kind: Any) -> None:
    heard, packet = (beacon1, data1) if kind is MultiHopLqi1 else (beacon, data)
    node, router = started(kind)
    router.receive(heard(3, 100))
    router.receive(packet(7, 5, 1))
    node.through()
    router.stop()
    assert all(timer.due_ns is None for timer in node.timers)
    node.through()
    assert node.on_air() == []
    router.start()
    assert router.parent is None
    router.receive(heard(3, 100))
    assert router.originate(APPLICATION)
    assert len(node.on_air()) == 1


@pytest.mark.parametrize('kind', [MultiHopLqi1, MultiHopLqi2])
@given(strategies.lists(strategies.tuples(
    strategies.sampled_from([5, 0, BROADCAST]), strategies.integers(-1, 0xFFFF),
    strategies.sampled_from([17, 250, 0x73, 0x74, 3]), strategies.binary(max_size=30),
    strategies.integers(0, 255)), max_size=20), strategies.booleans())
def test_bytes_of_whatever_kind_raise_nothing(
        kind: Any, frames: list[tuple[int, int, int, bytes, int]], root: bool) -> None:
    node, router = started(kind, root=root)
    for to, source, am_type, payload, lqi in frames:
        router.receive(Received(to, source, am_type, payload, lqi, -80))
        node.through()
    node.timers[0].fire()
    for frame in node.through():
        router.receive(received(frame, 5))


def test_a_period_of_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match='^beacon_period_ns 0: must be 1 or more$'):
        MultiHopLqi2(FakeNode(1), beacon_period_ns=0)
