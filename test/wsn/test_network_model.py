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

"""The model of a network: ways, troubles, bounds, and whatever bytes come."""

from __future__ import annotations

import math
from typing import Any

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest
from rt_robot_os.features.wsn.packets.ctp import CtpBeacon
from rt_robot_os.features.wsn.packets.ctp import CtpData
from rt_robot_os.features.wsn.packets.decode import Packet
from rt_robot_os.features.wsn.packets.decode import PacketDecoder
from rt_robot_os.features.wsn.packets.multihop_lqi import LqiBeacon
from rt_robot_os.features.wsn.packets.multihop_lqi import LqiData
from rt_robot_os.features.wsn.packets.oscilloscope import Oscilloscope
from rt_robot_os.features.wsn.packets.serial_am import SerialAm
from rt_robot_os.features.wsn.routing.link_cost import link_cost
from rt_robot_os.features.wsn.sensor_network.model import NetworkModel
from rt_robot_os.features.wsn.sensor_network.watch import NetworkLimits
from rt_robot_os.features.wsn.sensor_network.watch import NetworkWatch
from rt_robot_os.messages.network_rows import NodeState
from rt_robot_os.messages.network_rows import WIDTH
from rt_robot_os.messages.survey import survey_of

S = 1_000_000_000
DECODER = PacketDecoder('tinyos2')
SURVEY = survey_of(['hall 3 1.5 2.2', 'bed 1 2 0.8'])


def beacon(sender: int, parent: int, cost: int, hops: int = 1) -> Packet:
    """Return a beacon of MultiHopLQI, as a sniffer hears it."""
    return DECODER.decode(SerialAm(0xFFFF, sender, LqiBeacon.AM_TYPE, LqiBeacon(
        sender, 1, 0, parent, cost, hops).pack()).pack())


def data(origin: int, number: int, source: int = 0, destination: int = 0xFFFF, hops: int = 1,
         readings: bytes = bytes(10)) -> Packet:
    """Return a data packet of MultiHopLQI."""
    return DECODER.decode(SerialAm(destination, source, LqiData.AM_TYPE, LqiData(
        origin, 7, number, hops, 0x93, Oscilloscope(0, 800, origin, number, readings).pack()
    ).pack()).pack())


def test_a_sniffed_way_is_that_of_the_frames() -> None:
    model = NetworkModel(SURVEY)
    assert model.update(data(5, 0, source=5, destination=2, hops=3), S)
    assert not model.update(data(5, 0, source=2, destination=1, hops=3), S + 1)
    assert not model.update(data(5, 0, source=1, destination=0, hops=3), S + 2)
    nodes = model.nodes
    assert [nodes[each].parent for each in (5, 2, 1)] == [2, 1, 0]
    assert nodes[5].via == 1 and nodes[5].hops == 3 and nodes[5].received == 1


def test_a_node_without_a_route_has_no_parent_and_no_cost() -> None:
    model = NetworkModel(SURVEY)
    model.update(beacon(2, 0, 420), S)
    assert (model.nodes[2].parent, model.nodes[2].cost, model.nodes[2].hops) == (0, 420, 1)
    model.update(beacon(2, 0xFFFF, 0xFFFE, 0xFF), 2 * S)
    assert (model.nodes[2].parent, model.nodes[2].cost, model.nodes[2].hops) == (-1, -1, -1)


def test_a_circle_of_parents_is_told_with_its_nodes() -> None:
    model = NetworkModel()
    watch = NetworkWatch(model)
    for sender, parent in ((3, 4), (4, 5), (5, 3), (6, 5), (1, 0)):
        model.update(beacon(sender, parent, 800), S)
    watch.evaluate(2 * S)
    trouble, = watch.troubles
    assert trouble.kind == 'loop' and '3 > 4 > 5 > 3' in trouble.text
    assert {number for number, node in model.nodes.items() if node.state == NodeState.DOUBTFUL
            } == {3, 4, 5}
    model.update(beacon(5, 1, 300), 3 * S)
    watch.evaluate(4 * S)
    assert not watch.troubles


def test_parents_that_were_said_at_different_times_are_no_circle() -> None:
    model = NetworkModel()
    watch = NetworkWatch(model)
    model.update(beacon(8, 9, 800), S)
    model.update(data(9, 0), 2 * S)
    model.update(beacon(9, 8, 900), 2 * S)
    model.update(data(8, 0), 3 * S)
    watch.evaluate(4 * S)
    assert not watch.troubles
    # Nothing comes any more, and they still say so.
    model.update(beacon(8, 9, 800), 5 * S)
    model.update(beacon(9, 8, 900), 6 * S)
    watch.evaluate(7 * S)
    assert [each.kind for each in watch.troubles] == ['loop']


def test_a_node_that_claims_to_be_the_sink_changes_no_way() -> None:
    model = NetworkModel(SURVEY)
    watch = NetworkWatch(model)
    model.update(beacon(2, 0, 420), S)
    model.update(beacon(2, 2, 0, 0), 2 * S)
    watch.evaluate(3 * S)
    assert 'bed (node 2) claims to be the sink' in watch.warning()
    assert model.nodes[2].state == NodeState.DOUBTFUL
    assert (model.nodes[2].parent, model.nodes[2].cost) == (0, 420)
    for second in range(4, 80):
        model.update(beacon(2, 0, 420), second * S)
    watch.evaluate(80 * S)
    assert model.nodes[2].state == NodeState.GOOD


def test_strangers_have_a_bounded_place_and_slips_make_room() -> None:
    model = NetworkModel(SURVEY, max_nodes=4)
    for place in range(3):
        for number in (10, 11, 12):
            model.update(data(number, place), (3 * place + number) * S)
    for number in range(100, 120):
        model.update(data(number, 0), (100 + number) * S)
    assert set(model.nodes) == {1, 2, 10, 11, 12, 119}
    assert model.counters.nodes_forgotten == 19
    model.update(data(119, 1), 300 * S)
    model.update(data(120, 0), 301 * S)
    assert 120 not in model.nodes and model.counters.nodes_refused == 1
    watch = NetworkWatch(model)
    watch.evaluate(302 * S)
    assert 'increase max_nodes, 4' in watch.warning()


def test_a_foreign_group_is_counted_and_nothing_else() -> None:
    model = NetworkModel(SURVEY, group=0x22)
    model.update(data(9, 0), S)
    watch = NetworkWatch(model)
    watch.evaluate(2 * S)
    assert model.counters.foreign_groups == 1 and 9 not in model.nodes
    assert 'every packet is of another group than 34: set group' in watch.warning()


def test_problems_and_unknown_types_are_named_and_bounded() -> None:
    model, decoder = NetworkModel(), PacketDecoder()
    for size in range(20):
        model.update(decoder.decode(bytes(size)), S)
    for am_type in range(256):
        model.update(decoder.decode(SerialAm(0, 3, am_type, b'').pack()), S)
    named = model.problems.named()
    assert any('bytes are not a packet of TinyOS' in text for text in named)
    assert any('LqiBeacon' in text for text in named) and len(named) <= 8
    assert 0 < len(model.unknown_types.counts) <= 32 and -1 not in model.unknown_types.counts
    assert model.unknown_types.text().startswith('0x00:3 0x01:1')


def test_ctp_tells_parents_and_costs_in_its_beacons() -> None:
    model = NetworkModel()
    model.update(DECODER.decode(SerialAm(0xFFFF, 3, CtpBeacon.AM_TYPE, CtpBeacon(
        1, 0, 2, 23).pack()).pack()), S)
    model.update(DECODER.decode(SerialAm(2, 3, CtpData.AM_TYPE, CtpData(
        0, 0, 23, 3, 250, 0x93, Oscilloscope(0, 800, 3, 506, bytes(10)).pack()).pack()).pack()), S)
    assert (model.nodes[3].parent, model.nodes[3].cost) == (2, 23)
    assert model.nodes[3].account is not None and model.nodes[3].account.bits == 8


def test_a_weak_node_is_told_with_what_it_loses() -> None:
    model, limits = NetworkModel(SURVEY), NetworkLimits(delivery=0.8)
    watch = NetworkWatch(model, limits)
    for number in range(200):
        if number % 3 == 0 or number < 20:
            model.update(data(1, number), number * S)
        watch.evaluate(number * S)
    assert 'hall (node 1) loses 67 % of its packets' in watch.warning()
    assert model.nodes[1].state == NodeState.WEAK


def test_a_reboot_is_told_for_a_minute() -> None:
    model = NetworkModel(SURVEY)
    watch = NetworkWatch(model)
    told = []
    for second in range(200):
        model.update(data(1, second if second < 100 else second - 100), second * S)
        watch.evaluate(second * S)
        told.append('hall (node 1) rebooted (1 times so far)' in watch.warning())
    assert told.index(True) == 100 and sum(told) == 61


@pytest.mark.parametrize('text', ['sleep 1', 'sleep hall', 'sleep all', 'sleep 0xFFFF'])
def test_commands_to_sleep_are_understood(text: str) -> None:
    model = NetworkModel(SURVEY)
    for bad in ('', 'sleep', 'rate 1 x', 'rate 1', 'dance 1'):
        model.command(bad)
    model.command(text)
    assert model.nodes[1].asleep
    model.command('wake all')
    assert not model.nodes[1].asleep


def test_a_slower_rate_on_command_is_no_silence() -> None:
    model = NetworkModel(SURVEY)
    watch = NetworkWatch(model)
    for second in range(20):
        model.update(data(1, second), second * S)
    model.command('rate 1 30000')
    watch.evaluate(60 * S)
    assert model.nodes[1].state == NodeState.GOOD


def test_a_sink_that_drives_by_finds_a_node_that_nobody_surveyed() -> None:
    model = NetworkModel(SURVEY)
    watch, true = NetworkWatch(model), (6.0, 3.0)
    for step in range(60):
        x, y = (0.2 * step, 1.0) if step < 30 else (6.0 + 0.1 * (step - 30), 0.2 * (step - 25))
        model.sink_at(x, y)
        distance = math.dist((x, y), true)
        lqi = round(min(108.0, max(70.0, 112.0 - 14.0 * math.log10(max(distance, 0.3)))))
        model.update(beacon(9, 0, link_cost(lqi)), step * S)
        watch.evaluate(step * S)
    place = model.nodes[9].place
    assert place is not None
    assert math.dist(place[:2], true) < min(3.0, 3 * place.stddev_m)
    assert model.rows(60 * S)[3].stddev_m == place.stddev_m


def packets() -> st.SearchStrategy[bytes]:
    """Return bytes of any kind: random ones, cut ones, those whose length lies."""
    number = st.integers(0, 0xFFFF)
    whole: Any = st.one_of(
        st.builds(lambda a, b, c, d, e: SerialAm(0xFFFF, a, LqiBeacon.AM_TYPE, LqiBeacon(
            a, b, 0, c, d, e).pack()).pack(), number, number, number, number, number),
        st.builds(lambda a, b, c, d: SerialAm(c, d, CtpData.AM_TYPE, CtpData(
            0, b & 0xFF, 10, a, b & 0xFF, 0x93, bytes(8)).pack(), b >> 8).pack(),
            number, number, number, number),
        st.builds(lambda a, b: SerialAm(0xFFFF, 0, 0x72, bytes([a & 0xFF]) + b).pack(),
                  st.sampled_from((0x10, 0x18, 0x21, 0x31, 0x34)), st.binary(
                      min_size=8, max_size=8)))
    return st.one_of(
        st.binary(max_size=60), whole, st.builds(lambda each, cut: each[:cut], whole,
                                                 st.integers(0, 40)),
        st.builds(lambda each, at, value: each[:at] + bytes([value]) + each[at + 1:], whole,
                  st.integers(0, 30), st.integers(0, 255)))


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(packets(), st.integers(0, 100 * S)), max_size=60))
def test_whatever_comes_nothing_raises_and_all_is_counted(
        stream: list[tuple[bytes, int]]) -> None:
    model, decoder, now_ns = NetworkModel(SURVEY, max_nodes=8), PacketDecoder(), 0
    watch = NetworkWatch(model)
    model.sink_at(1.0, 2.0)
    for packet, passed_ns in stream:
        now_ns += passed_ns
        model.update(decoder.decode(packet), now_ns)
        watch.evaluate(now_ns)
        assert all(len(row) == WIDTH for row in model.rows(now_ns))
    counters = model.counters
    assert counters.packets == len(stream) == (
        counters.data + counters.beacons + counters.debug + counters.commands + counters.unknown)
    assert len(model.nodes) <= len(SURVEY) + 8
    assert all(node.lost >= 0 for node in model.nodes.values())
    assert isinstance(watch.warning(), str)


def test_a_node_that_somebody_wears_has_its_name_and_the_place_of_who_hears_it() -> None:
    model = NetworkModel(survey_of(['hall 3 1.5 2', 'bed 9 8 1', 'wrist 1 2 0.8 id 7 on anna']))
    watch = NetworkWatch(model)
    for second in range(100):
        model.update(data(7, second, source=7, destination=1 if second < 50 else 2), second * S)
        watch.evaluate(second * S)
        if second == 40:
            assert model.nodes[7].place == pytest.approx((3.0, 1.5, 10.0), abs=3.0)
    wrist = model.nodes[7]
    assert wrist.name == 'wrist' and wrist.place == pytest.approx((9.0, 8.0, 10.0), abs=3.0)
    assert wrist.row(100 * S).stddev_m > 5.0
