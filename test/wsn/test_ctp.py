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


"""The Collection Tree Protocol on one node: what it decides, sends, drops and counts."""

from __future__ import annotations

from ctp_mote import ME
from ctp_mote import Mote
from fake_node import Sent
from hypothesis import given
from hypothesis import strategies as st
import pytest
from rt_robot_os.features.wsn.packets.ctp import CONGESTED
from rt_robot_os.features.wsn.packets.ctp import CtpBeacon
from rt_robot_os.features.wsn.packets.ctp import CtpData
from rt_robot_os.features.wsn.packets.ctp import NO_PARENT
from rt_robot_os.features.wsn.packets.ctp import PULL
from rt_robot_os.features.wsn.routing.ctp_rules import CtpRules
from rt_robot_os.features.wsn.routing.ctp_rules import TOSSIM
from rt_robot_os.features.wsn.routing.protocol import BINARY_MS_NS
from rt_robot_os.features.wsn.routing.protocol import BROADCAST
from rt_robot_os.features.wsn.routing.protocol import Received


def test_a_root_tells_that_it_is_there() -> None:
    mote = Mote(root=True)
    mote.node.run_binary_ms(128)
    assert mote.told() == [CtpBeacon(0, 0, ME, 0)]
    assert (mote.ctp.parent, mote.ctp.cost, mote.ctp.hops) == (None, 0, 0)


def test_who_has_no_route_asks_for_beacons() -> None:
    mote = Mote()
    mote.node.run_binary_ms(128)
    assert mote.told() == [CtpBeacon(0, PULL, NO_PARENT, 0)]
    assert (mote.ctp.parent, mote.ctp.cost) == (None, 0xFFFF)


def test_the_cheapest_way_is_taken_and_told_soon() -> None:
    mote = Mote()
    mote.beacon(1, 10, 3)
    mote.beacon(2, 20, 3)
    mote.node.run_binary_ms(128)
    assert (mote.ctp.parent, mote.ctp.cost, mote.ctp.hops) == (1, 20, 2)
    mote.told()
    mote.node.run_binary_ms(128)
    told = mote.told()
    assert [(one.parent, one.etx, one.options) for one in told] == [(1, 20, 0)]
    assert ('parent', 1, 20) in mote.node.notes


@pytest.mark.parametrize(('etx', 'parent'), [(15, 1), (14, 2)])
def test_only_a_gain_of_more_than_one_and_a_half_transmissions_is_worth_a_change(
        etx: int, parent: int) -> None:
    mote = Mote()
    mote.beacon(1, 30, 3)
    mote.think()
    mote.beacon(2, etx, 3)
    mote.think()
    assert mote.ctp.parent == parent
    assert mote.ctp.parent_changes == (1 if parent == 1 else 2)


def test_who_goes_over_me_or_has_no_way_is_no_parent() -> None:
    mote = Mote()
    mote.beacon(1, 10, 3, parent=ME)
    mote.beacon(2, 0, 3, parent=NO_PARENT)
    mote.think()
    assert mote.ctp.parent is None


def test_a_link_of_five_transmissions_is_not_used() -> None:
    mote = Mote()
    for sequence in (0, 10):
        mote.ctp.receive(Received(BROADCAST, 1, CtpBeacon.AM_TYPE,
                                  CtpBeacon(sequence, 0, 0, 0).pack(), 100, -80))
    mote.think()
    assert mote.ctp.parent is None


def test_a_packet_is_sent_until_it_is_acknowledged() -> None:
    mote = Mote().with_parent()
    assert mote.ctp.originate(b'hello')
    for _ in range(3):
        assert mote.on_air() == Sent(0, CtpData.AM_TYPE, CtpData(
            0, 0, 10, ME, 0, 0x93, b'hello').pack(), True)
        begun_ns = mote.node.time_ns
        mote.through(acknowledged=False)
        while mote.on_air() is None:
            mote.node.run_until(mote.node.time_ns + 100_000)
        waited_ms = (mote.node.time_ns - begun_ns) / BINARY_MS_NS
        assert 6.9 <= waited_ms <= 13.2
    mote.through()
    mote.node.run_binary_ms(100)
    assert mote.on_air() is None
    assert mote.ctp.counters['resends'] == 3


def test_after_thirty_transmissions_a_packet_is_given_up() -> None:
    mote = Mote().with_parent()
    assert mote.ctp.originate(b'hello')
    count = 0
    while mote.on_air() is not None:
        mote.through(acknowledged=False)
        count += 1
        mote.node.run_binary_ms(14)
    assert count == 30
    assert mote.ctp.counters['given_up'] == 1
    assert mote.ctp.originate(b'again')


def test_failures_turn_a_node_to_another_parent_within_a_packet() -> None:
    mote = Mote().with_parent()
    mote.beacon(1, 10, 3)
    assert mote.ctp.originate(b'hello')
    destinations = []
    while mote.on_air() is not None:
        frame = mote.on_air()
        assert frame is not None
        destinations.append(frame.destination)
        mote.through(acknowledged=frame.destination == 1)
        mote.node.run_binary_ms(14)
    assert destinations[-1] == 1
    # From the fifth on each counts for a tenth of the average: 10 14 18 23 28 34 40 > 20 + 15.
    assert destinations == [0] * 10 + [1]


def test_a_wait_that_runs_down_meanwhile_prepares_the_frame_again() -> None:
    # CtpForwardingEngineP's sendTask sets the next hop of the message before AMQueueImplP refuses
    # it, and sendDone credits the message's destination.
    mote = Mote()
    mote.beacon(1, 30, 3)
    mote.think()
    mote.node.run_binary_ms(8192 - 3)
    assert mote.ctp.originate(b'one')
    mote.through()
    assert mote.ctp.originate(b'two')
    frame = mote.on_air()
    assert frame is not None and frame.destination == 1
    mote.beacon(0, 0, 3)
    mote.node.run_binary_ms(4)
    assert mote.ctp.parent == 0
    mote.node.run_binary_ms(14)
    frame = mote.on_air()
    assert frame is not None and frame.destination == 0


def test_an_application_has_one_packet_under_way() -> None:
    mote = Mote().with_parent()
    assert mote.ctp.originate(b'one')
    assert not mote.ctp.originate(b'two')
    assert mote.ctp.counters['own_busy'] == 1
    mote.through()
    assert mote.ctp.originate(b'three')
    assert [mote.through().origin_sequence] == [1]


def test_without_a_route_packets_wait_until_there_is_one() -> None:
    mote = Mote()
    assert mote.ctp.originate(b'hello')
    assert mote.on_air() is None
    assert mote.ctp.counters['no_route'] == 1
    mote.beacon(0, 0, 3)
    mote.node.run_binary_ms(8192)
    assert mote.on_air() is not None


def test_a_packet_of_another_is_passed_on_one_hop_older() -> None:
    mote = Mote().with_parent()
    mote.data(7, hops=2)
    assert mote.through() == CtpData(0, 3, 10, 9, 7, 0x93, b'hello')


def test_the_queue_holds_twelve_packets_of_others_and_one_of_its_own() -> None:
    mote = Mote().with_parent()
    for number in range(14):
        mote.data(number)
    assert mote.ctp.originate(b'hello')
    assert mote.ctp.counters['queue_full'] == 2
    sent = []
    while mote.on_air() is not None:
        sent.append(mote.through().origin_sequence)
        mote.node.run_binary_ms(14)
    assert sent == [*range(12), 0]


def test_a_repeated_packet_is_dropped_while_it_is_remembered() -> None:
    mote = Mote().with_parent()
    mote.data(0)
    mote.data(0)
    assert mote.ctp.counters['duplicates'] == 1
    mote.through()
    mote.data(0)
    assert mote.ctp.counters['duplicates'] == 2
    for number in range(1, 5):
        mote.data(number)
        mote.node.run_binary_ms(14)
        mote.through()
    mote.data(0)
    mote.node.run_binary_ms(14)
    assert mote.on_air() is not None
    # The same packet with another count of hops has gone in a circle, and is not dropped.
    mote.data(4, hops=3)
    assert mote.ctp.counters['duplicates'] == 2


@pytest.mark.parametrize(('rules', 'count'), [(TOSSIM, 1), (CtpRules(), 2)])
def test_a_root_hands_over_what_it_has_not_handed_over_before(rules: CtpRules,
                                                              count: int) -> None:
    mote = Mote(root=True, rules=rules)
    mote.data(7)
    mote.data(7)
    assert [(one.origin, one.application, one.payload[1]) for one in mote.node.delivered] == [
        (9, b'hello', 1)] * count
    assert mote.ctp.originate(b'mine')
    assert mote.node.delivered[-1][2:] == (ME, b'mine')


def test_a_packet_from_someone_nearer_to_the_sink_tells_of_a_loop() -> None:
    mote = Mote().with_parent()
    mote.node.run_binary_ms(100_000)
    mote.told()
    mote.data(7, etx=10)
    assert mote.ctp.counters['loops'] == 1
    assert mote.node.notes[-1] == ('loop', 9, 7)
    assert mote.on_air() is None
    mote.node.run_binary_ms(128)
    assert len(mote.told()) == 1
    assert mote.on_air() is not None


def test_a_request_for_beacons_is_answered_at_once() -> None:
    mote = Mote().with_parent()
    mote.node.run_binary_ms(1_000_000)
    mote.told()
    mote.beacon(3, 0, parent=NO_PARENT, options=PULL)
    mote.node.run_binary_ms(128)
    assert len(mote.told()) == 1
    mote.node.run_binary_ms(1_000_000)
    mote.told()
    pull = CtpData(PULL, 0, 100, 9, 0, 0x93).pack()
    mote.ctp.snoop(Received(1, 9, CtpData.AM_TYPE, pull, 100, -80))
    mote.node.run_binary_ms(128)
    assert len(mote.told()) == 1


def test_the_longest_interval_between_beacons_is_a_rule() -> None:
    mote = Mote(rules=CtpRules(longest_interval_ms=256)).with_parent()
    beacons = 0
    for _ in range(1000):
        mote.node.run_binary_ms(256)
        beacons += len(mote.told())
    assert 950 <= beacons <= 1050


def test_a_lost_parent_is_lost_with_its_place_in_the_table() -> None:
    mote = Mote().with_parent()
    # Beacons after a long silence: the link is judged anew, and its place no longer kept.
    mote._sequences[0] = 100
    mote.beacon(0, 30)
    for address in range(10, 19):
        mote.beacon(address, 80, 3)
    mote.think()
    mote.beacon(30, 5, lqi=107)
    assert mote.ctp.counters['no_route'] == 0
    assert mote.node.notes[-2:][0] == ('no_route',)


def test_the_white_bit_needs_a_radio_that_can_tell() -> None:
    for rules, changes in ((CtpRules(), True), (TOSSIM, False)):
        mote = Mote(rules=rules)
        for address in range(10, 20):
            mote.beacon(address, 80, 3 if address < 19 else 1)
        mote.think()
        mote.beacon(30, 5, lqi=107)
        mote.beacon(30, 5, 4, lqi=107)
        mote.think()
        assert (mote.ctp.parent == 30) is changes


def test_with_congestion_told_children_wait() -> None:
    mote = Mote(rules=CtpRules(congestion=True)).with_parent()
    mote.beacon(0, 0, options=CONGESTED)
    assert mote.ctp.originate(b'hello')
    assert mote.on_air() is None
    assert mote.ctp.counters['parent_congested'] == 1
    data = CtpData(0, 0, 10, 0, 0, 0x93).pack()
    mote.ctp.snoop(Received(1, 0, CtpData.AM_TYPE, data, 100, -80))
    assert mote.on_air() is not None


def test_a_long_queue_is_told() -> None:
    for congestion, options in ((True, CONGESTED), (False, 0)):
        mote = Mote(rules=CtpRules(congestion=congestion)).with_parent()
        for number in range(8):
            mote.data(number)
        mote.ctp._routing.trigger_immediate_update()
        mote.node.run_binary_ms(128)
        assert [one.options for one in mote.told()] == [options]


def test_a_boot_begins_anew() -> None:
    mote = Mote().with_parent()
    assert mote.ctp.originate(b'hello')
    mote.ctp.stop()
    mote.node.run_binary_ms(100_000)
    mote.node.senders[1].done(True)
    mote.ctp.start()
    assert mote.ctp.parent is None
    mote.node.run_binary_ms(128)
    assert mote.told() == [CtpBeacon(0, PULL, NO_PARENT, 0)]
    assert mote.ctp.originate(b'hello')


@given(st.lists(st.tuples(
    st.sampled_from([CtpBeacon.AM_TYPE, CtpData.AM_TYPE, 0x72, 0]),
    st.integers(-1, 0xFFFF), st.sampled_from([ME, BROADCAST, 1]), st.binary(max_size=40)),
    max_size=40))
def test_whatever_bytes_come_raise_nothing(frames: list[tuple[int, int, int, bytes]]) -> None:
    for root in (False, True):
        mote = Mote(root=root)
        for am_type, source, destination, payload in frames:
            frame = Received(destination, source, am_type, payload, 100, -80)
            if destination == 1:
                mote.ctp.snoop(frame)
            else:
                mote.ctp.receive(frame)
            mote.node.run_binary_ms(100)
            mote.node.through()
        assert (mote.ctp.parent is None) or 0 <= mote.ctp.parent < BROADCAST
