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

"""Does the sink turn the bytes of a base station into packets, each once, whatever comes."""

from __future__ import annotations

from collections import Counter
import json
from pathlib import Path
import random
from typing import Any

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.features.wsn.packets.ctp import CtpBeacon
from rt_robot_os.features.wsn.packets.ctp import CtpData
from rt_robot_os.features.wsn.packets.framing import frame
from rt_robot_os.features.wsn.packets.framing import FrameReader
from rt_robot_os.features.wsn.packets.multihop_lqi import LqiBeacon
from rt_robot_os.features.wsn.packets.multihop_lqi import LqiData
from rt_robot_os.features.wsn.packets.multihop_lqi import MultihopMsg
from rt_robot_os.features.wsn.packets.paper import BeaconMsg
from rt_robot_os.features.wsn.packets.paper import DataMsg
from rt_robot_os.features.wsn.packets.paper import Kind
from rt_robot_os.features.wsn.packets.serial_am import SerialAm
from rt_robot_os.features.wsn.packets.tos_msg import MicaMsg
from rt_robot_os.features.wsn.packets.tos_msg import TelosMsg
from rt_robot_os.features.wsn.sink.driver import Sink
from rt_robot_os.features.wsn.sink.flow_limit import BURST_S
from rt_robot_os.features.wsn.sink.flow_limit import FlowLimit
from rt_robot_os.features.wsn.sink.flow_limit import FLOWS_MAXIMUM
from rt_robot_os.features.wsn.sink.wire import is_tinyos1
from rt_robot_os.features.wsn.sink.wire import is_tinyos2
from rt_robot_os.testing import DriverContract
from rt_robot_os.testing import scripted
from rt_robot_os.testing import settings_of

S = 1_000_000_000
MS = 1_000_000


def on_line(packet: bytes, protocol: int = 0x42) -> bytes:
    return frame(protocol, packet)


def data(origin: int, number: int, kind: Kind = Kind.TEMPERATURE, reading: int = 6000, *,
         source: int = 0, seqno: int = 0, counter: int | None = None, group: int = 0x7D) -> bytes:
    """Make the packet of a reading, as the base of the network hands it on."""
    body = DataMsg(0, reading, 3, number, kind, 3900).pack()
    counter = (number if counter is None else counter) & 0x7FFF
    return TelosMsg(0x7E, 17, MultihopMsg(source, origin, seqno, counter, 2, body).pack(),
                    group).pack()


def beacon(source: int, cost: int, origin: int | None = None, number: int = 0) -> bytes:
    origin = source if origin is None else origin
    body = MultihopMsg(source, origin, number, number, 0, BeaconMsg(9, cost, 1).pack()).pack()
    return TelosMsg(0xFFFF, 250, body).pack()


def packets(publisher: Any) -> list[bytes]:
    return [bytes(sample.data) for sample in publisher.samples]


class TestSink(DriverContract):
    driver = Sink
    # What is the same again is left out, and that has tests of its own.
    changes = {'duplicates_s': 0.0}
    stream = b''.join(on_line(data(1 + n % 3, n, Kind(1 + n % 12))) for n in range(12))
    samples = 12
    pending_limit = 700
    tokens = (b'\x7e', b'\x7d', b'\x7e\x42', b'\x7d\x5e', b'\x7e\x41\x07', frame(0x40, b'\x26'),
              frame(0x41, b'\x09' + data(4, 4)), frame(0x42, b''), frame(0x42, data(4, 4)[:7]),
              frame(0xFF, b'\x43'), frame(0x45, bytes(20)), on_line(data(1, 1, group=3)),
              on_line(beacon(4, 0)), on_line(b'\x05' + bytes(40)))

    def decoder(self) -> Any:
        return FrameReader()

    def frame_size(self, frame: Any) -> int:
        return int(frame.size)

    def test_settings_are_described_by_sentences(self) -> None:
        assert all(each.description.endswith('.') for each in Sink.SETTINGS)

    def test_publications_name_topic_type_and_what_is_fixed(self) -> None:
        device, _ = self.make('nowhere')
        assert [(each.topic, each.message) for each in device.publications()] == [
            (f'wsn/packets/{name}', 'std_msgs/msg/UInt8MultiArray')
            for name in ('alarm', 'vital', 'rest')]


def test_a_packet_is_published_as_it_came_without_its_framing() -> None:
    reading = data(5, 42)
    with scripted(Sink, [on_line(reading)]) as (device, (_, _, rest)):
        assert device.read(1) == 1
        assert packets(rest) == [reading]


# ---- copies ----------------------------------------------------------------------------------


def test_copies_from_other_hops_are_left_out() -> None:
    copies = [on_line(data(5, 42, source=s, seqno=n)) for n, s in enumerate((5, 3, 3, 0))]
    with scripted(Sink, [b''.join(copies), on_line(data(5, 43))], mode='sniffer') as (
            device, (_, _, rest)):
        device.read(S)
        device.read(2 * S)
        assert packets(rest) == [data(5, 42, source=5), data(5, 43)]
        assert device.statistics().more['duplicates'] == 3


def test_the_base_which_does_not_count_its_own_packets_loses_none() -> None:
    own = [data(0, n, counter=0) for n in range(100)]
    with scripted(Sink, [on_line(each) for each in own]) as (device, (_, _, rest)):
        for n in range(100):
            device.read(n * S)
        assert packets(rest) == own


@pytest.mark.parametrize('step_ns', [S, 10 * MS])
def test_no_new_packet_is_taken_for_a_copy_when_numbers_begin_again(step_ns: int) -> None:
    # 16 bits that wrap, then a restart, each packet followed by a copy of the one before.
    numbers = [*range(65_500, 65_600), *range(300)]
    sent = [data(7, n, reading=n & 0xFFF) for n in numbers]
    lines = [on_line(sent[max(n - 1, 0)]) + on_line(each) for n, each in enumerate(sent)]
    with scripted(Sink, lines) as (device, (_, _, rest)):
        for n in range(len(lines)):
            device.read((n + 1) * step_ns)
        assert packets(rest) == sent
        more = device.statistics().more
        assert more['duplicates'] == len(sent)
        assert more['restarted_nodes'] == 1


def test_two_nodes_with_one_id_both_come_through_and_are_named() -> None:
    sent = [data(5, base + n, reading=n) for n in range(50) for base in (100, 9000)]
    lines = [on_line(each) * 2 for each in sent]
    with scripted(Sink, lines) as (device, (_, _, rest)):
        for n in range(len(lines)):
            device.read((n + 1) * 100 * MS)
        assert packets(rest) == sent
        statistics = device.statistics()
        assert statistics.more['duplicates'] == len(sent)
        assert 'two nodes probably have the id 5' in statistics.more['warning']


def test_two_nodes_with_one_id_that_count_alike_are_named() -> None:
    lines = [on_line(data(5, n, reading=1)) + on_line(data(5, n, reading=2)) for n in range(9)]
    with scripted(Sink, lines) as (device, (_, _, rest)):
        for n in range(len(lines)):
            device.read((n + 1) * S)
        assert len(rest.samples) == 18
        assert 'two nodes probably have the id 5' in device.statistics().more['warning']


def test_a_node_that_begins_anew_and_says_the_same_is_heard_after_one_packet() -> None:
    first = [on_line(data(7, n)) for n in range(20)]
    with scripted(Sink, first + first) as (device, (_, _, rest)):
        for n in range(40):
            device.read((n + 1) * 800 * MS)
        assert len(rest.samples) == 39
        assert device.statistics().more['restarted_nodes'] == 1


def test_what_a_relay_held_back_is_still_a_copy() -> None:
    first = [on_line(data(7, n)) for n in range(12)]
    with scripted(Sink, [*first, *first]) as (device, (_, _, rest)):
        for n in range(12):
            device.read((n + 1) * 800 * MS)
        for n in range(12):  # ten seconds later, one after the other
            device.read((20_000 + 20 * n) * MS)
        assert len(rest.samples) == 12


@settings(max_examples=60, deadline=None)
@given(chance=st.randoms(use_true_random=False), count=st.integers(1, 60),
       start=st.integers(0, 2**32 - 100))
def test_reordered_and_copied_packets_come_once_each(
        chance: random.Random, count: int, start: int) -> None:
    sent = [data(origin, (start + n) & 0xFFFFFFFF) for n in range(count) for origin in (1, 2)]
    arriving = sorted((n + chance.uniform(0, 8), each) for n, each in enumerate(sent)
                      for _ in range(chance.randint(1, 3)))
    with scripted(Sink, [on_line(each) for _, each in arriving], queue=4096) as (
            device, (_, _, rest)):
        for at, _ in arriving:
            device.read(round(at * 100 * MS) + S)
        assert sorted(packets(rest)) == sorted(sent)


def test_the_memory_is_bounded() -> None:
    lines = [b''.join(on_line(data(n % 6000, 1 + n // 6000)) for n in range(base, base + 100))
             for base in range(0, 12_000, 100)]
    with scripted(Sink, lines, queue=4096) as (device, _):
        for n in range(len(lines)):
            device.read((n + 1) * S)
        more = device.statistics().more
        assert more['streams'] <= 4096
        assert more['forgotten_streams'] > 0


# ---- floods ----------------------------------------------------------------------------------


def test_a_node_that_floods_in_the_name_of_another_displaces_no_alarm() -> None:
    """A hundred forged alarms a second, of which the queue of the class holds 64 at most."""
    forged = [on_line(data(5, 5000 + n, Kind.ALARM, reading=n, source=9)) for n in range(1000)]
    own = [data(5, n, Kind.ALARM, source=3) for n in range(10)]
    other = [data(6, n, Kind.SMOKE, source=9) for n in range(10)]
    lines = [b''.join([on_line(own[n]), on_line(other[n]), *forged[100 * n:100 * n + 100]])
             for n in range(10)]
    with scripted(Sink, lines, queue=64, packets_per_job=64) as (device, (alarm, _, _)):
        for n in range(10):
            device.read((n + 1) * S)
        found = packets(alarm)
        assert [each for each in found if each in own] == own
        assert [each for each in found if each in other] == other
        forged_found = len(found) - len(own) - len(other)
        assert forged_found == 40 + 9 * 20  # twice the rate at once, then the rate
        statistics = device.statistics()
        assert statistics.more['over_rate'] == 1000 - forged_found == statistics.lost_samples
        assert ('packets above node_rate_hz were dropped, the last from node 5, '
                'delivered by node 9'
                in statistics.more['warning'])


def test_the_rate_of_a_node_is_not_bounded_in_the_last_class_or_by_0() -> None:
    lines = [b''.join(on_line(data(5, n)) for n in range(100))]
    with scripted(Sink, lines) as (device, (_, _, rest)):
        for n in range(9):
            device.read(S + n * MS)
        assert len(rest.samples) == 100
    lines = [b''.join(on_line(data(5, n, Kind.ALARM)) for n in range(100))]
    with scripted(Sink, lines, node_rate_hz=0.0) as (device, (alarm, _, _)):
        for n in range(9):
            device.read(S + n * MS)
        assert len(alarm.samples) == 100


@given(rate_hz=st.floats(0.01, 1000.0),
       gaps_ns=st.lists(st.integers(0, 10 * S), min_size=1, max_size=200))
def test_a_flow_never_exceeds_its_rate_and_always_passes_after_a_silence(
        rate_hz: float, gaps_ns: list[int]) -> None:
    limit = FlowLimit(rate_hz)
    now_ns, accepted = 0, []
    for gap_ns in gaps_ns:
        now_ns += gap_ns
        passed = limit.accepts(5, 3, now_ns)
        longest_ns = max(BURST_S, 1 / rate_hz) * S
        assert passed or gap_ns < longest_ns
        accepted += [now_ns] * passed
    span_s = (accepted[-1] - accepted[0]) / S
    assert len(accepted) <= rate_hz * (span_s + BURST_S) * 1.001 + 1
    assert limit.refused == len(gaps_ns) - len(accepted)


def test_the_memory_of_the_rates_is_bounded() -> None:
    limit = FlowLimit(1.0)
    for n in range(3 * FLOWS_MAXIMUM):
        assert limit.accepts(n, 0, n)
    assert limit.flows == FLOWS_MAXIMUM


# ---- TinyOS 2 --------------------------------------------------------------------------------


def of_2(am_type: int, body: bytes, group: int = 0x22, source: int = 0) -> bytes:
    return SerialAm(0xFFFF, source, am_type, body, group).pack()


@pytest.mark.parametrize('make', [
    lambda hop: (0x74, LqiData(5, hop, 17, 2, 0xEE, b'reading').pack()),
    lambda hop: (0x71, CtpData(0, hop, 40 - hop, 5, 17, 0xEE, b'reading').pack())])
def test_copies_under_tinyos_2_are_left_out(make: Any) -> None:
    lines = b''.join(on_line(of_2(*make(hop), source=9 - hop), 0x45) for hop in range(3))
    with scripted(Sink, [lines], stack='tinyos2', mode='sniffer') as (device, (_, _, rest)):
        device.read(S)
        assert len(rest.samples) == 1
        assert device.statistics().more['duplicates'] == 2


def test_a_root_that_begins_anew_is_noticed() -> None:
    debug = [of_2(0x75, bytes(7) + n.to_bytes(2, 'big'), 0) for n in (500, 501, 502, 0, 1, 2)]
    with scripted(Sink, [on_line(each, 0x45) for each in debug], stack='tinyos2') as (device, _):
        for n in range(6):
            device.read(n * S)
        assert device.statistics().more['sink_resets'] == 1


# ---- payloads of one's own -------------------------------------------------------------------


@pytest.mark.parametrize('stack, text, make', [
    ('tinyos1', 'soil 0x42 moisture:H', lambda n, hop: TelosMsg(0x7E, 0x42, MultihopMsg(
        hop, 5, hop, n, 1, b'ab').pack()).pack()),
    ('tinyos1', 'soil 0x42 plain version:B origin:H seqno:H x:H', lambda n, hop: TelosMsg(
        0x7E, 0x42, bytes((0, 5, 0, n, 0, 9, 9))).pack()),
    ('tinyos2', 'soil 0x42 version:B origin:H seqno:H x:H', lambda n, hop: SerialAm(
        0xFFFF, 0, 0x42, bytes((0, 0, 5, 0, n, 9, 9))).pack())])
def test_copies_of_payloads_of_ones_own_are_left_out(stack: str, text: str, make: Any) -> None:
    sent = [make(n, hop) for n in range(5) for hop in (1, 2)]
    protocol = 0x42 if stack == 'tinyos1' else 0x45
    with scripted(Sink, [b''.join(on_line(each, protocol) for each in sent)], stack=stack,
                  payloads=[text], rules=['alarm if origin 5 and type 0x42']) as (
                      device, (alarm, _, _)):
        device.read(S)
        assert len(alarm.samples) == 5
        assert device.statistics().more['unknown_types'] == 0


# ---- what is wrong ---------------------------------------------------------------------------


def test_what_is_wrong_with_packets_is_counted_and_none_of_it_published() -> None:
    wrong = [data(5, 1, group=0x11), data(5, 1)[:6], data(5, 1) + b'x', data(5, 1)[:-1],
             TelosMsg(0x7E, 17, b'short').pack()]
    with scripted(Sink, [b''.join(map(on_line, wrong))]) as (device, publishers):
        assert device.read(S) == 0
        statistics = device.statistics()
        assert statistics.frames == statistics.ignored_frames == 5
        more = statistics.more
        assert (more['foreign_groups'], more['truncated_headers'], more['lying_lengths']) == (
            1, 2, 2)
        assert '1 packets of other groups, the last of 17' in more['warning']


def test_what_is_over_for_a_minute_is_counted_and_warned_of_no_more() -> None:
    lines = [on_line(data(5, 1, group=0x11)), on_line(data(5, 1)), on_line(data(5, 2))]
    with scripted(Sink, lines) as (device, _):
        device.read(S)
        device.read(60 * S)
        assert 'of other groups' in device.statistics().more['warning']
        device.read(62 * S)
        more = device.statistics().more
        assert 'warning' not in more
        assert more['foreign_groups'] == 1


def test_packets_of_unknown_types_are_counted_by_type_and_published() -> None:
    strange = [TelosMsg(0x7E, am_type, b'12').pack() for am_type in (99, 99, 200)]
    with scripted(Sink, [b''.join(map(on_line, strange))]) as (device, (_, _, rest)):
        assert device.read(S) == 3
        more = device.statistics().more
        assert (more['unknown_types'], more['unknown_by_type']) == (3, '0x63: 2, 0xc8: 1')


@pytest.mark.parametrize('stack, line', [
    ('tinyos1', on_line(beacon(4, 0)) + on_line(beacon(0, 0)) + on_line(beacon(3, 200))),
    ('tinyos2', on_line(of_2(0x73, LqiBeacon(4, 1, 0, 4, 0, 0).pack()), 0x45)),
    ('tinyos2', on_line(of_2(0x70, CtpBeacon(1, 0, 4, 0).pack(), source=4), 0x45))])
def test_a_node_that_claims_to_be_at_no_cost_is_named(stack: str, line: bytes) -> None:
    with scripted(Sink, [line], mode='sniffer', stack=stack) as (device, _):
        device.read(S)
        more = device.statistics().more
        assert more['cost_0_claims'] == 1
        assert 'node 4 advertises a cost of 0 to the sink' in more['warning']


def test_beacons_that_nodes_pass_on_are_no_copies() -> None:
    lines = b''.join(on_line(beacon(node, 200 + node, origin=0, number=7)) for node in range(1, 4))
    with scripted(Sink, [lines], mode='sniffer') as (device, (_, _, rest)):
        assert device.read(S) == 3


def test_the_other_generation_of_tinyos_is_told() -> None:
    with scripted(Sink, [on_line(of_2(0x93, bytes(18)), 0x45) * 3]) as (device, _):
        device.read(S)
        with pytest.raises(DeviceError, match='dut: .* set stack: tinyos2'):
            device.write(S)


@pytest.mark.parametrize('platform, packet, told', [
    ('telos', MicaMsg(0x7E, 17, bytes(12)).pack(), 'set platform: mica'),
    ('mica', data(5, 1), 'set platform: telos'),
    ('telos', data(5, 1, group=4), 'they are of group 4: set groups: [4]')])
def test_why_nothing_is_published_is_told(platform: str, packet: bytes, told: str) -> None:
    with scripted(Sink, [on_line(packet)], platform=platform) as (device, _):
        device.read(S)
        assert told in device.unused()


def test_the_bytes_of_a_base_station_are_recognised() -> None:
    one, two = on_line(data(1, 1)), on_line(of_2(0x93, bytes(18)), 0x45)
    assert (is_tinyos1(b'xx' + one * 2), is_tinyos2(one * 2)) == (True, False)
    assert (is_tinyos1(two * 3), is_tinyos2(two * 3)) == (False, True)
    assert not is_tinyos1(random.Random(1).randbytes(512))


@pytest.mark.parametrize('changes, said', [
    ({'classes': []}, 'sink.classes = .*: 0 classes: name 1 to 8'),
    ({'classes': ['a', 'a']}, 'a class is given twice'),
    ({'classes': ['A b']}, "'A b' is not a valid name of a class"),
    ({'rules': ['alarm']}, "rules: 'alarm': must look like"),
    ({'rules': ['fire if kind smoke']}, "there is no class 'fire': use one of alarm, vital, rest"),
    ({'rules': ['alarm if colour red']}, "'colour' is not a fact of a rule: use type"),
    ({'rules': ['alarm if kind fire']}, "kind 'fire': must be a number .* or one of none, temp"),
    ({'rules': ['alarm if origin 70000']}, "origin '70000': must be within 0-65535"),
    ({'rules': ['alarm if origin 7-3']}, "origin '7-3': must be within 0-65535, the smaller"),
    ({'rules': ['alarm if kind']}, 'kind needs values'),
    ({'rules': ['alarm if kind 1 and kind 2']}, 'kind is given twice'),
    ({'payloads': ['soil']}, 'sink.payloads: '),
    ({'depth': 8}, 'packets_per_job = 16: must be at most depth, 8'),
    ({'port': 'udpp://x:1'}, 'sf://')])
def test_wrong_settings_are_told(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        Sink('sink', settings_of(Sink, **{'port': 'x', **changes}))


# ---- what real motes sent --------------------------------------------------------------------


@pytest.mark.parametrize('name', [
    'chain4_multihoplqi', 'chain4_ctp', 'lossy4_multihoplqi', 'lossy4_ctp'])
def test_of_what_a_real_sink_sent_each_packet_comes_once(name: str, data_dir: Path) -> None:
    told = json.loads((data_dir / 'wsn' / 'mspsim_summary.json').read_text())[name]
    stream = (data_dir / 'wsn' / f'mspsim_{name}.serial.bin').read_bytes()
    chunks = [stream[at:at + 97] for at in range(0, len(stream), 97)]
    with scripted(Sink, chunks, stack='tinyos2') as (device, (_, _, rest)):
        for n in range(len(chunks) + 9):
            device.read((n + 1) * 100 * MS)
        statistics = device.statistics()
        found = Counter((each[12] << 8 | each[13]) for each in packets(rest) if each[7] == 0x93)
    assert {str(node): found[node] for node in (1, 2, 3)} == told['delivered']
    assert statistics.more['duplicates'] == told['duplicates_on_serial']
    assert (statistics.rejected_bytes, statistics.more['unknown_types']) == (0, 0)
