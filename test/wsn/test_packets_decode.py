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

"""Whatever a network sends becomes one kind of record, and nothing disturbs that."""

from __future__ import annotations

from collections import Counter
import csv
import gzip
import json
from pathlib import Path

from broad import examples
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest

from rt_robot_os.features.wsn.packets import paper
from rt_robot_os.features.wsn.packets.ctp import CtpBeacon
from rt_robot_os.features.wsn.packets.ctp import CtpData
from rt_robot_os.features.wsn.packets.ctp import Neighbour
from rt_robot_os.features.wsn.packets.debug import CollectionDebug
from rt_robot_os.features.wsn.packets.decode import Packet
from rt_robot_os.features.wsn.packets.decode import PacketDecoder
from rt_robot_os.features.wsn.packets.framing import FrameReader
from rt_robot_os.features.wsn.packets.framing import PROTOCOLS
from rt_robot_os.features.wsn.packets.ieee802154 import AckFrame
from rt_robot_os.features.wsn.packets.ieee802154 import read_frame
from rt_robot_os.features.wsn.packets.ieee802154 import T1Frame
from rt_robot_os.features.wsn.packets.ieee802154 import T2Frame
from rt_robot_os.features.wsn.packets.multihop_lqi import LqiBeacon
from rt_robot_os.features.wsn.packets.multihop_lqi import LqiData
from rt_robot_os.features.wsn.packets.multihop_lqi import MicaMultihopMsg
from rt_robot_os.features.wsn.packets.multihop_lqi import MultihopMsg
from rt_robot_os.features.wsn.packets.neighbour_tables import DebugPacket
from rt_robot_os.features.wsn.packets.neighbour_tables import Estimate
from rt_robot_os.features.wsn.packets.neighbour_tables import ReceivedNeighbour
from rt_robot_os.features.wsn.packets.neighbour_tables import RoutePacket
from rt_robot_os.features.wsn.packets.oscilloscope import Oscilloscope
from rt_robot_os.features.wsn.packets.oscilloscope import OscopeMsg
from rt_robot_os.features.wsn.packets.payload_text import parse_payload
from rt_robot_os.features.wsn.packets.serial_am import SerialAm
from rt_robot_os.features.wsn.packets.surge import MicaSurgeMsg
from rt_robot_os.features.wsn.packets.surge import SurgeCmd
from rt_robot_os.features.wsn.packets.surge import SurgeCmdT2
from rt_robot_os.features.wsn.packets.surge import SurgeMsg
from rt_robot_os.features.wsn.packets.tos_msg import MicaMsg
from rt_robot_os.features.wsn.packets.tos_msg import platform_of
from rt_robot_os.features.wsn.packets.tos_msg import TelosMsg

SURGE = bytes.fromhex('14010800ffff7e00117d000005006400620002000000bc0a03002a000000')
ROOT_BEACON = bytes.fromhex('14010833fffffffffa7d000000000700070000007e000000000000000000')


def t1(am_type: int, data: bytes, origin: int = 5, seqno: int = 98) -> bytes:
    """Make a packet behind the header of MultiHopLQI 1.x."""
    return TelosMsg(0x7E, am_type, MultihopMsg(0, origin, 100, seqno, 2, data).pack()).pack()


def t2(am_type: int, payload: bytes) -> bytes:
    """Make a packet of TinyOS 2.x."""
    return SerialAm(0xFFFF, 3, am_type, payload).pack()


def test_the_reading_of_surge_telos() -> None:
    found = PacketDecoder().decode(SURGE)
    assert (found.stack, found.platform, found.am_type, found.group) == (
        'tinyos1', 'telos', 17, 0x7D)
    assert (found.destination, found.source, found.origin, found.origin_seqno) == (0x7E, 0, 5, 98)
    assert (found.hops, found.parent, found.kind, found.name) == (2, 3, 'data', 'surge')
    assert (found.count, found.count_bits) == (42, 32)
    assert found.fields == {'seqno': 100, 'originseqno': 98, 'type': 0, 'reading': 0x0ABC,
                            'seq_no': 42}
    assert (found.cost, found.readings, found.problem) == (-1, {}, '')
    assert TelosMsg.unpack(SURGE).pack() == SURGE


def test_the_beacon_of_a_root() -> None:
    found = PacketDecoder().decode(ROOT_BEACON)
    assert (found.kind, found.name, found.destination, found.group) == (
        'beacon', 'multihop_lqi_beacon', 0xFFFF, 0x7D)
    assert (found.source, found.origin, found.origin_seqno) == (0, 0, 7)
    assert (found.parent, found.cost, found.hops, found.problem) == (0x7E, 0, 0, '')
    assert TelosMsg.unpack(ROOT_BEACON).dsn == 0x33


@pytest.mark.parametrize(('kind', 'raw', 'readings'), [
    (1, 6450, {'temperature': 24.9}), (2, 1500, {'humidity': 0.5045}),
    (3, 1000, {'light': 1000 / 4096 * 1.5 / 100e3 * 0.625e9}), (5, 72, {'pulse_per_min': 72.0}),
    (6, 16, {'respiration_per_min': 16.0}), (7, 97, {'spo2_percent': 97.0}),
    (8, 31015, {'body_temperature': 37.0}), (9, 1000, {'acceleration_g': 1.0}),
    (10, 3, {'alarm': 3.0}), (11, 1, {'smoke': 1.0}), (12, 0, {'water': 0.0}), (0, 9, {})])
def test_the_data_packet_of_a_moving_sink(
        kind: int, raw: int, readings: dict[str, float]) -> None:
    found = PacketDecoder().decode(t1(17, paper.DataMsg(0, raw, 3, 77, kind, 3891).pack()))
    assert (found.name, found.kind, found.parent, found.count, found.problem) == (
        'data_msg', 'data', 3, 77, '')
    assert found.readings == pytest.approx({**readings, 'battery': 3891 / 4096 * 3})


def test_the_battery_as_its_own_quantity_and_a_kind_of_a_later_version() -> None:
    battery = PacketDecoder().decode(t1(17, paper.DataMsg(0, 4000, 3, 1, 4, 0).pack()))
    assert battery.readings == pytest.approx({'battery': 4000 / 4096 * 3})
    later = PacketDecoder().decode(t1(17, paper.DataMsg(0, 1, 3, 1, 99, 0).pack()))
    assert (later.problem, later.readings) == ('unknown kind 99', {})


def test_the_beacon_of_a_moving_sink() -> None:
    found = PacketDecoder().decode(t1(250, paper.BeaconMsg(4, 380, 2).pack(), 0, -2))
    assert (found.name, found.parent, found.cost, found.hops) == ('least_cost_beacon', 4, 380, 2)
    assert (found.fields['round'], found.problem) == (0xFFFE, '')


def test_mica_surge_and_commands() -> None:
    payload = MicaMultihopMsg(2, 5, 9, 3, MicaSurgeMsg(0, 0x0ABC, 4).pack()).pack()
    packet = MicaMsg(0x7E, 17, payload, 0x33).pack()
    assert packet.hex() == '7e0011330c' + '02000500090003' + '00bc0a0400'
    found = PacketDecoder().decode(packet)
    assert (found.stack, found.platform, found.group, found.source, found.origin) == (
        'tinyos1', 'mica', 0x33, 2, 5)
    assert (found.hops, found.parent, found.fields['reading']) == (3, 4, 0x0ABC)
    assert MicaMsg.unpack(packet).pack() == packet
    command = PacketDecoder(platform='mica').decode(
        MicaMsg(5, 18, bytes.fromhex('0200080000')).pack())
    assert (command.kind, command.fields) == ('command', {'command': 2, 'value': 2048})


def test_commands_of_both_generations() -> None:
    one = PacketDecoder().decode(TelosMsg(5, 18, SurgeCmd(2, 2048).pack()).pack())
    two = PacketDecoder().decode(t2(18, SurgeCmdT2(2, 2048).pack()))
    for found in (one, two):
        assert (found.kind, found.fields, found.problem) == (
            'command', {'command': 2, 'value': 2048}, '')
    odd = PacketDecoder().decode(t2(18, SurgeCmdT2(7, 1).pack()))
    assert odd.problem == 'unknown command 7 of Surge'


def test_tables_of_neighbours_and_the_oscilloscope_of_tinyos_1() -> None:
    table = DebugPacket((Estimate(3, 2, 200), Estimate(4, 1, 90)))
    assert DebugPacket.unpack(table.pack()) == table
    found = PacketDecoder().decode(t1(3, table.pack()))
    assert (found.kind, found.fields['estimates'][1]) == (
        'debug', {'node': 4, 'hopcount': 1, 'quality': 90})
    cut = PacketDecoder().decode(t1(3, table.pack()[:-1]))
    assert cut.problem == 'too short: 9 bytes, DebugPacket with 2 neighbours has 10'
    scope = PacketDecoder().decode(
        TelosMsg(0x7E, 10, OscopeMsg(7, 30, 1, bytes.fromhex('01000200')).pack()).pack())
    assert (scope.origin, scope.fields['readings']) == (7, [1, 2])


def test_mica_tells_of_its_neighbours() -> None:
    body = RoutePacket(2, 1200, 2, bytes.fromhex('0300c8 0400ff')).pack()
    assert RoutePacket.unpack(body).neighbours() == (
        ReceivedNeighbour(3, 200), ReceivedNeighbour(4, 255))
    decoder = PacketDecoder('tinyos1', platform='mica')
    packet = MicaMsg(0xFFFF, 250, MicaMultihopMsg(5, 5, 9, 1, body).pack())
    beacon = decoder.decode(packet.pack())
    assert (beacon.kind, beacon.origin, beacon.parent, beacon.cost, beacon.hops) == (
        'beacon', 5, 2, 1200, 1)
    assert beacon.fields['neighbours'][0] == {'address': 3, 'quality': 200}
    cut = decoder.decode(packet._replace(payload=packet.payload[:-1]).pack())
    assert cut.problem == 'too short: 5 bytes for 2 neighbours'
    # Mica's table has room for five.
    table = DebugPacket((Estimate(3, 2, 200),)).pack(is_mica=True) + bytes(16)
    found = decoder.decode(MicaMsg(0, 3, MicaMultihopMsg(1, 5, 9, 1, table).pack()).pack())
    assert found.fields['estimates'] == [{'node': 3, 'hopcount': 2, 'quality': 200}]


def test_beacons_and_data_of_tinyos_2() -> None:
    beacon = PacketDecoder().decode(t2(0x73, LqiBeacon(3, 9, 0, 1, 330, 2).pack()))
    assert (beacon.kind, beacon.origin, beacon.parent, beacon.cost, beacon.hops) == (
        'beacon', 3, 1, 330, 2)
    ctp = PacketDecoder().decode(t2(0x70, CtpBeacon(8, 0, 1, 23, (Neighbour(4, 250),)).pack()))
    assert (ctp.origin, ctp.parent, ctp.cost, ctp.fields['neighbours']) == (
        3, 1, 23, [{'address': 4, 'quality': 250}])
    readings = Oscilloscope.of(1, 1024, 6, 55, (1, 2, 3, 4, 5))
    assert readings.readings == (1, 2, 3, 4, 5)
    lqi = PacketDecoder().decode(t2(0x74, LqiData(6, 70, 54, 3, 0x93, readings.pack()).pack()))
    assert (lqi.source, lqi.origin, lqi.origin_seqno, lqi.count, lqi.count_bits, lqi.hops) == (
        3, 6, 54, 54, 16, 3)
    assert (lqi.name, lqi.fields['readings'], lqi.fields['count']) == (
        'oscilloscope', [1, 2, 3, 4, 5], 55)
    data = PacketDecoder().decode(
        t2(0x71, CtpData(0, 1, 20, 6, 200, 0x93, readings.pack()).pack()))
    assert (data.origin, data.origin_seqno, data.count_bits, data.hops, data.cost) == (
        6, 200, 8, 2, -1)
    alone = PacketDecoder().decode(t2(0x93, readings.pack()))
    # Nodes take over a higher count that they hear: what it leaves out is not lost.
    assert (alone.origin, alone.origin_seqno, alone.count_bits) == (6, 55, 0)


def test_debug_messages_tell_of_the_routing() -> None:
    parent = PacketDecoder().decode(bytes.fromhex('00ffff00000900723100010004d9000002'))
    assert (parent.kind, parent.name, parent.parent, parent.cost, parent.hops) == (
        'debug', 'new_parent', 1, 0x04D9, 0)
    taken = PacketDecoder().decode(bytes.fromhex('00ffff00000900752100000001ffff0003'))
    assert (taken.name, taken.fields) == ('received', {
        'event': 0x21, 'seqno': 3, 'message': 0, 'origin': 1, 'other': 0xFFFF})
    loop = PacketDecoder().decode(t2(0x72, CollectionDebug(0x18, 1, 2, 3, 4).pack()))
    strange = PacketDecoder().decode(t2(0x72, CollectionDebug(0x99, 1, 2, 3, 4).pack()))
    assert (loop.name, strange.name) == ('loop', 'event_0x99')


# --- recordings of real firmware -----------------------------------------------------------------


def summary(data_dir: Path) -> dict[str, dict[str, dict[str, int]]]:
    """Give what the recorded runs have delivered, or skip."""
    path = data_dir / 'wsn' / 'mspsim_summary.json'
    if not path.exists():
        pytest.skip(f'no recording at {path}')
    found: dict[str, dict[str, dict[str, int]]] = json.loads(path.read_text())
    return found


@pytest.mark.parametrize('name', [
    'chain4_multihoplqi', 'chain4_ctp', 'lossy4_multihoplqi', 'lossy4_ctp'])
def test_a_recorded_line_says_what_was_delivered(name: str, data_dir: Path) -> None:
    expected = summary(data_dir)[name]
    decoder = PacketDecoder()
    stream = (data_dir / 'wsn' / f'mspsim_{name}.serial.bin').read_bytes()
    packets = [decoder.decode(each.packet, PROTOCOLS[each.protocol].name)
               for each in FrameReader().feed(stream)]
    assert decoder.counters() == {'packets': len(packets), 'problems': 0, 'unreadable': 0,
                                  'foreign_groups': 0, 'unknown_types': 0}
    # A root that measures itself hands that over as well, without the radio.
    data = Counter((each.origin, each.origin_seqno) for each in packets
                   if each.kind == 'data' and each.origin)
    assert Counter(str(origin) for origin, _ in data) == expected['delivered']
    assert data.total() - len(data) == expected['duplicates_on_serial']
    assert {each.kind for each in packets} == {'data', 'debug'}


@pytest.mark.parametrize('name', [
    'chain4_multihoplqi', 'chain4_ctp', 'lossy4_multihoplqi', 'lossy4_ctp'])
def test_recorded_air_is_read_and_written_byte_for_byte(name: str, data_dir: Path) -> None:
    expected = summary(data_dir)[name]
    decoder = PacketDecoder()
    kinds: Counter[str] = Counter()
    with gzip.open(data_dir / 'wsn' / f'mspsim_{name}.air.csv.gz', 'rt') as lines:
        for row in csv.DictReader(lines):
            data = bytes.fromhex(row['mpdu_hex_with_length_byte'])
            assert read_frame(data).pack() == data
            found = decoder.decode_air(data)
            kinds[found.kind] += 1
            assert found.kind == 'ack' or found.source == int(row['source'])
    assert decoder.problems == 0
    assert kinds == {'data': expected['data_transmissions'], 'beacon': expected['beacons'],
                     'ack': expected['acks']}


# --- the air -------------------------------------------------------------------------------------


def test_frames_of_both_generations_on_the_air() -> None:
    assert AckFrame(1).pack().hex() == '0502000131a4'
    one = T1Frame(0, 17, TelosMsg.unpack(SURGE).payload, dsn=9)
    # 31 bytes with the check sequence: 1.184 ms with preamble and length.
    assert one.pack()[:11].hex() == '1f010809ffff0000117d00' and len(one.pack()) == 32
    found = PacketDecoder().decode_air(one.pack())
    assert (found.stack, found.name, found.origin, found.problem) == ('tinyos1', 'surge', 5, '')
    two = T2Frame(0xFFFF, 3, 0x73, LqiBeacon(3, 0, 0, 0xFFFF, 0xFFFE, 0xFF).pack())
    assert two.pack().hex() == '194188002200ffff03003f73000300000000fffffffe00ffd889'[:48] + (
        two.pack()[-2:].hex())
    raw = PacketDecoder().decode(b'\x02' + two.pack())
    assert (raw.source, raw.kind, raw.problem) == (3, 'beacon', '')
    with pytest.raises(ValueError, match='128 bytes: at most 127 on the air'):
        T2Frame(0, 0, 0, bytes(115)).pack()


@pytest.mark.parametrize(('frame', 'problem'), [
    ('', 'too short: 0 bytes, a frame has 6'),
    ('0602000131a4', 'its length byte is 6, but 5 bytes follow'),
    ('0503000131a4', 'is neither of data nor of an acknowledgement'),
    ('0e41cc010000000000000000000000',
     'frame control field 0xcc41 has an address format other than'),
    ('0d' '418801' '2200' '0000' '0000' '41' '42' '0000', "network byte is 0x41, TinyOS' is 0x3f"),
    ('0541880131a4', 'too short: 6 bytes, a frame with data has 14'),
    ('0502000131a5', 'its frame check sequence is wrong')])
def test_damaged_frames_from_the_air_are_named(frame: str, problem: str) -> None:
    decoder = PacketDecoder()
    assert problem in decoder.decode_air(bytes.fromhex(frame)).problem
    assert decoder.counters()['problems'] == 1


# --- what is wrong -------------------------------------------------------------------------------


@pytest.mark.parametrize(('packet', 'stack', 'problem'), [
    (SURGE[:9], 'tinyos1', 'too short: 9 bytes, the header has 10'),
    (SURGE[:-1], 'tinyos1', 'its length byte is 20, but the payload has 19 bytes'),
    (SURGE + b'\0', 'tinyos1', 'its length byte is 20, but the payload has 21 bytes'),
    (t1(17, b'abc'), 'tinyos1', 'too short: 3 bytes, SurgeMsg has 10'),
    (TelosMsg(0, 17, b'abc').pack(), 'tinyos1', 'too short: 3 bytes, MultihopMsg has 10'),
    (t1(250, bytes(8)), 'tinyos1', 'truncated: 8 bytes after the header, a beacon has 6 or 10'),
    (t1(17, bytes(12)), 'tinyos1', 'truncated: 12 bytes after the header, SurgeMsg has 10 and'),
    (t1(17, SurgeMsg(9, 0, 0, 0).pack()), 'tinyos1', 'unknown message type 9 of Surge'),
    (t2(0x73, bytes(11)), 'tinyos2', 'too short: 11 bytes, LqiBeacon has 12'),
    (t2(0x74, bytes(8)), 'tinyos2', 'too short: 8 bytes, LqiData has 9'),
    (t2(0x93, bytes(9)), 'tinyos2', 'its last reading is truncated'),
    (b'', 'tinyos2', 'too short: 0 bytes, the header has 8'),
    (b'\x07' + bytes(9), 'tinyos2', 'its dispatch byte is 0x07'),
    (b'\x02\x05', 'tinyos2', 'too short: 1 bytes'),
    (b'nothing of the kind', 'auto', '19 bytes are not a packet of TinyOS')])
def test_what_is_wrong_is_named_and_counted(packet: bytes, stack: str, problem: str) -> None:
    decoder = PacketDecoder(stack)
    found = decoder.decode(packet)
    assert found.problem.startswith(problem)
    assert found.readings == {}
    assert (decoder.packets, decoder.problems) == (1, 1)


def test_an_unknown_type_is_no_problem_and_counted_by_type() -> None:
    decoder = PacketDecoder()
    found = decoder.decode(t2(0x55, b'abc'))
    decoder.decode(t2(0x55, b''))
    decoder.decode(TelosMsg(0, 0x21, b'').pack())
    assert (found.kind, found.name, found.problem, found.payload) == ('unknown', '', '', b'abc')
    assert decoder.unknown_types == {0x55: 2, 0x21: 1}
    assert (decoder.problems, decoder.counters()['unknown_types']) == (0, 3)


def test_foreign_groups_are_counted_and_give_no_readings() -> None:
    decoder = PacketDecoder(group=0x7D)
    data = MultihopMsg(0, 5, 1, 1, 1, paper.DataMsg(0, 72, 0, 1, 5, 4000).pack()).pack()
    ours, theirs = (decoder.decode(TelosMsg(0x7E, 17, data, group).pack())
                    for group in (0x7D, 0x22))
    assert (ours.problem, ours.readings['pulse_per_min']) == ('', 72.0)
    assert (theirs.problem, theirs.readings, theirs.origin) == (
        'group 0x22 instead of 0x7d', {}, 5)
    assert decoder.foreign_groups == 1


def test_the_platform_is_known_by_the_length() -> None:
    assert platform_of(SURGE) == 'telos'
    mica = MicaMsg(0x7E, 17, bytes(12)).pack()
    assert platform_of(mica) == 'mica' and platform_of(b'\x01') == platform_of(b'') == ''
    decoder = PacketDecoder('tinyos1')
    assert decoder.decode(mica).platform == 'mica'
    # One that fits neither is as those before it.
    assert decoder.decode(mica[:-1]).problem == (
        'its length byte is 12, but the payload has 11 bytes')
    assert decoder.decode(SURGE).platform == 'telos'
    with pytest.raises(ValueError, match="stack 'zigbee' must be one of auto, tinyos1, tinyos2"):
        PacketDecoder('zigbee')


# Headers that say what follows, whatever that is.
TYPES = st.sampled_from([3, 10, 17, 18, 250, 0x42, 0x70, 0x71, 0x72, 0x73, 0x74, 0x75, 0x93])
PAYLOADS = st.binary(max_size=40)
COLLECTED = st.builds(lambda app: LqiData(1, 2, 3, 4, 0x93, app).pack(), PAYLOADS)
PACKETS = st.one_of(
    st.binary(max_size=64),
    st.builds(lambda am, data: TelosMsg(0x7E, am, data).pack(), TYPES, PAYLOADS),
    st.builds(lambda am, data: t1(am, data), TYPES, PAYLOADS),
    st.builds(lambda am, data: MicaMsg(0x7E, am, data).pack(), TYPES, PAYLOADS),
    st.builds(t2, TYPES, PAYLOADS | COLLECTED))
OWN = parse_payload('soil 0x42 wet:H=soil_percent,0.1 air:f=temperature many:3b name:4s pad:x '
                    'damp:H=humidity,sht1x_humidity')


def check(found: Packet) -> None:
    """Check what holds for every packet."""
    assert not (found.problem and found.readings)
    assert all(value == value and abs(value) < 1e39 for value in found.readings.values())
    assert found.kind in ('data', 'beacon', 'debug', 'command', 'unknown', 'ack')
    json.dumps(dict(found.fields))


@settings(max_examples=examples(150))
@given(PACKETS, st.sampled_from(['', 'tinyos1', 'tinyos2']), st.integers(-3, 3),
       st.sampled_from(['auto', 'telos', 'mica']))
def test_nothing_raises(packet: bytes, stack: str, cut: int, platform: str) -> None:
    decoder = PacketDecoder(payloads=[OWN], platform=platform, group=0x7D)
    changed = packet[:cut] if cut < 0 else packet + bytes(cut)
    for each in (packet, changed):
        check(decoder.decode(each, stack))
        check(decoder.decode_air(each))
    assert decoder.packets == 4
