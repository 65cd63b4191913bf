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

"""The serial side of a sink's mote: what it sends, what it takes, and what finds no room."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import pytest

from rt_robot_os.features.wsn.packets.framing import frame
from rt_robot_os.features.wsn.packets.framing import FrameReader
from rt_robot_os.features.wsn.packets.framing import TINYOS_1
from rt_robot_os.features.wsn.packets.framing import TINYOS_2
from rt_robot_os.features.wsn.packets.serial_am import SerialAm
from rt_robot_os.features.wsn.packets.surge import SurgeCmd
from rt_robot_os.features.wsn.packets.tos_msg import TelosMsg
from rt_robot_os.features.wsn.simulator.base_station import BaseStation
from rt_robot_os.features.wsn.simulator.base_station import Outgoing
from rt_robot_os.features.wsn.simulator.base_station import QUEUE
from rt_robot_os.features.wsn.simulator.base_station import STATIONS

# A reading of SurgeTelos as its header says it, with a last hop that is not the root.
SURGE = bytes.fromhex('0700 0500 6400 6200 0200 0000 bc0a 0300 2a000000')
COMMAND = SurgeCmd(2, 2048).pack()


class Bench:
    """A base station between a host and a radio that may be busy."""

    def __init__(self, name: str, baud: int = 0) -> None:
        self.out: list[tuple[int, bytes]] = []
        self.air: list[Outgoing] = []
        self.radio_is_busy = False
        self.station = BaseStation(STATIONS[name], lambda data, at_ns: self.out.append(
            (at_ns, data)), self._send, baud)

    def _send(self, packet: Outgoing) -> bool:
        if not self.radio_is_busy:
            self.air.append(packet)
        return not self.radio_is_busy

    @property
    def line(self) -> str:
        return b''.join(data for _, data in self.out).hex()


def test_a_root_of_tinyos_1_hands_on_data_as_its_last_hop() -> None:
    bench = Bench('surge')
    bench.station.delivered(17, SURGE, SURGE[10:], 0)
    reading, = FrameReader().feed(bench.out[0][1])
    told = TelosMsg.unpack(reading.packet)
    assert (told.destination, told.am_type, told.group) == (0x7E, 17, 0x7D)
    assert told.payload == b'\0\0' + SURGE[2:]
    assert bench.line == (
        '7e4214010800ffff7d5e00117d5d000005006400620002000000bc0a03002a00000018e97e')


def test_a_root_of_tinyos_2_speaks_as_the_real_one_did() -> None:
    bench = Bench('multihop_oscilloscope_lqi')
    station = bench.station
    station.noted('parent', (0, 0, 0), 0)
    station.noted('beacon_heard', (1, 0, 0xFFFE), 0)
    station.noted('data_heard', (0, 1, 0xFFFF), 0)
    station.noted('boot', (1,), 0)
    station.delivered(0x74, b'header', bytes(18), 0)
    found = [f'45{each.packet.hex()}' for each in FrameReader().feed(bytes.fromhex(bench.line))]
    assert found == [
        '4500ffff0000090075310000000000000001', '4500ffff000009007534000100fffe000002',
        '4500ffff00000900752100000001ffff0003', '4500ffff0000120093' + 18 * '00']


@pytest.mark.parametrize(('name', 'expected'), [
    ('tosbase', TelosMsg(5, 250, b'abcd', dsn=9, fcf=0x0821).pack()),
    ('base_station', SerialAm(5, 3, 250, b'abcd', 0x22).pack())])
def test_a_sniffer_hands_on_what_it_hears_and_nothing_else(name: str, expected: bytes) -> None:
    bench = Bench(name)
    bench.station.delivered(17, SURGE, b'', 0)
    bench.station.heard(5, 3, 250, b'abcd', 9, True, 0)
    assert [each.packet for each in FrameReader().feed(bytes.fromhex(bench.line))] == [expected]


def test_frames_leave_at_the_speed_of_the_line_and_a_burst_loses_some() -> None:
    bench = Bench('surge', baud=57600)
    for _ in range(QUEUE + 3):
        bench.station.delivered(17, SURGE, b'', 1000)
    size = len(bench.out[0][1])
    byte_ns = 10 * 1_000_000_000 // 57600
    assert [at_ns for at_ns, _ in bench.out] == [
        1000 + number * size * byte_ns for number in range(QUEUE)]
    assert (bench.station.sent, bench.station.line_full) == (QUEUE, 3)
    bench.station.delivered(17, SURGE, b'', 1000 + size * byte_ns)
    assert (bench.station.sent, bench.station.line_full) == (QUEUE + 1, 3)


@pytest.mark.parametrize(('name', 'packet', 'am_type'), [
    ('surge', TelosMsg(5, 18, COMMAND).pack(), 18),
    ('tosbase', TelosMsg(5, 99, b'xy').pack(), 99),
    ('multihop_oscilloscope', SerialAm(5, 0, 18, COMMAND).pack(), 18),
    ('base_station', SerialAm(5, 0, 99, b'xy').pack(), 99)])
def test_a_packet_is_acknowledged_when_there_is_room_for_it(
        name: str, packet: bytes, am_type: int) -> None:
    protocols = STATIONS[name].protocols
    bench = Bench(name)
    bench.station.take(frame(protocols.acked, b'\x26' + packet), 0)
    assert bench.line == frame(protocols.ack, b'\x26').hex()
    assert [(each.destination, each.am_type) for each in bench.air] == [(5, am_type)]
    bench.station.take(frame(protocols.plain, packet), 0)
    assert len(bench.out) == 1 and len(bench.air) == 2
    bench.radio_is_busy = True
    for token in range(QUEUE + 1):
        bench.station.take(frame(protocols.acked, bytes((token,)) + packet), 0)
    assert len(bench.out) == 1 + QUEUE and bench.station.radio_full == 1
    bench.radio_is_busy = False
    bench.station.radio_ready()
    assert len(bench.air) == 2 + QUEUE


@pytest.mark.parametrize('packet', [
    TelosMsg(5, 99, b'xy').pack(), TelosMsg(5, 18, COMMAND, group=0x22).pack(), b'nonsense', b''])
def test_a_root_takes_no_packet_but_commands_of_its_group(packet: bytes) -> None:
    bench = Bench('surge')
    bench.station.take(frame(TINYOS_1.acked, b'\x01' + packet), 0)
    assert (bench.out, bench.air, bench.station.refused) == ([], [], 1)


def test_a_mote_of_tinyos_1_tells_what_it_does_not_understand() -> None:
    bench = Bench('surge')
    bench.station.take(frame(TINYOS_2.acked, b'\x01abcd'), 0)
    assert bench.line == frame(0xFF, bytes((TINYOS_2.acked,))).hex()
    bench.station.take(frame(TINYOS_1.ack, b'\x01'), 0)
    assert len(bench.out) == 1 and bench.station.refused == 1


@given(st.sampled_from(sorted(STATIONS)), st.lists(st.one_of(
    st.binary(max_size=60), st.builds(frame, st.sampled_from([0x41, 0x42, 0x44, 0x45]),
                                      st.binary(max_size=60))), max_size=8))
def test_any_bytes_of_the_host_are_borne(name: str, pieces: list[bytes]) -> None:
    bench = Bench(name)
    for data in pieces:
        bench.station.take(data, 0)
    assert len(bench.air) == bench.station.taken
    told = FrameReader().feed(bytes.fromhex(bench.line))
    assert {each.protocol for each in told} <= {bench.station.station.protocols.ack, 0xFF}


def test_after_a_reset_nothing_waits() -> None:
    bench = Bench('surge')
    bench.radio_is_busy = True
    whole = frame(TINYOS_1.plain, TelosMsg(5, 18, COMMAND).pack())
    bench.station.take(whole + whole[:9], 0)
    bench.station.reset()
    bench.radio_is_busy = False
    bench.station.take(whole[9:], 0)
    assert bench.air == []
