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

"""Fuzzed lines: frames with bytes changed, lost, doubled and made up, from wire to record."""

from __future__ import annotations

import json
import random

from broad import examples
import pytest
from rt_robot_os.features.wsn.packets import paper
from rt_robot_os.features.wsn.packets.ctp import CtpBeacon
from rt_robot_os.features.wsn.packets.ctp import CtpData
from rt_robot_os.features.wsn.packets.ctp import Neighbour
from rt_robot_os.features.wsn.packets.debug import CollectionDebug
from rt_robot_os.features.wsn.packets.decode import PacketDecoder
from rt_robot_os.features.wsn.packets.forwarder import ForwarderClient
from rt_robot_os.features.wsn.packets.forwarding import Forwarder
from rt_robot_os.features.wsn.packets.framing import frame
from rt_robot_os.features.wsn.packets.framing import FrameReader
from rt_robot_os.features.wsn.packets.framing import LONGEST
from rt_robot_os.features.wsn.packets.framing import TINYOS_1
from rt_robot_os.features.wsn.packets.ieee802154 import T2Frame
from rt_robot_os.features.wsn.packets.multihop_lqi import BeaconMsg
from rt_robot_os.features.wsn.packets.multihop_lqi import LqiBeacon
from rt_robot_os.features.wsn.packets.multihop_lqi import LqiData
from rt_robot_os.features.wsn.packets.multihop_lqi import MicaMultihopMsg
from rt_robot_os.features.wsn.packets.multihop_lqi import MultihopMsg
from rt_robot_os.features.wsn.packets.neighbour_tables import DebugPacket
from rt_robot_os.features.wsn.packets.neighbour_tables import Estimate
from rt_robot_os.features.wsn.packets.oscilloscope import Oscilloscope
from rt_robot_os.features.wsn.packets.payload_text import parse_payload
from rt_robot_os.features.wsn.packets.serial_am import SerialAm
from rt_robot_os.features.wsn.packets.serial_link import Link
from rt_robot_os.features.wsn.packets.surge import MicaSurgeMsg
from rt_robot_os.features.wsn.packets.surge import SurgeCmd
from rt_robot_os.features.wsn.packets.surge import SurgeMsg
from rt_robot_os.features.wsn.packets.tos_msg import MicaMsg
from rt_robot_os.features.wsn.packets.tos_msg import TelosMsg

OWN = parse_payload('own 0x42 a:f=temperature b:H=humidity,sht1x_humidity c:3b d:5s e:d')


def _t1(am_type: int, data: bytes) -> bytes:
    return TelosMsg(0x7E, am_type, MultihopMsg(1, 5, -3, -4, 2, data).pack()).pack()


def _t2(am_type: int, data: bytes) -> bytes:
    return SerialAm(0xFFFF, 3, am_type, data).pack()


_SCOPE = Oscilloscope.of(1, 1024, 5, 9, (1, 2, 3, 4, 5)).pack()
#: One of each kind, with the P of its frame.
PACKETS = [
    (0x42, _t1(17, SurgeMsg(0, 5, 2, 9).pack())),
    (0x42, _t1(17, paper.DataMsg(0, 72, 2, 9, 5, 3900).pack())),
    (0x42, _t1(250, BeaconMsg(1, 300, 2).pack())),
    (0x42, _t1(250, paper.BeaconMsg(1, 300, 2).pack())),
    (0x42, _t1(3, DebugPacket((Estimate(1, 2, 3),)).pack())), (0x42, _t1(0x42, bytes(22))),
    (0x42, TelosMsg(5, 18, SurgeCmd(2, 2048).pack()).pack()),
    (0x42, MicaMsg(0x7E, 17, MicaMultihopMsg(
        1, 5, 3, 2, MicaSurgeMsg(0, 1, 2).pack()).pack()).pack()),
    (0x41, b'\x26' + _t1(17, SurgeMsg(0, 5, 2, 9).pack())), (0x40, b'\x26'),
    (0x45, _t2(0x73, LqiBeacon(1, 2, 3, 4, 5, 6).pack())),
    (0x45, _t2(0x74, LqiData(5, 2, 3, 4, 0x93, _SCOPE).pack())),
    (0x45, _t2(0x70, CtpBeacon(1, 0, 2, 30, (Neighbour(4, 250),)).pack())),
    (0x45, _t2(0x71, CtpData(0, 1, 20, 5, 7, 0x93, _SCOPE).pack())),
    (0x45, _t2(0x93, _SCOPE)), (0x45, _t2(0x72, CollectionDebug(0x31, 1, 2, 3, 4).pack())),
    (0x45, _t2(0x42, bytes(22))), (0x45, b'\x02' + T2Frame(1, 2, 0x93, _SCOPE).pack()),
    (0x44, b'\x11' + _t2(0x93, _SCOPE)), (0x43, b'\x11')]


def damaged(data: bytes, chance: random.Random, most: int = 4) -> bytes:
    """Change, leave out, double and make up some bytes."""
    changed = bytearray(data)
    for _ in range(chance.randrange(most)):
        at = chance.randrange(len(changed) + 1)
        what = chance.randrange(5)
        if what == 0 and at < len(changed):
            changed[at] = chance.randrange(256)
        elif what == 1:
            del changed[at:at + chance.randrange(1, 9)]
        elif what == 2:
            changed[at:at] = changed[at:at + chance.randrange(1, 9)]
        elif what == 3:
            changed[at:at] = chance.randbytes(chance.randrange(1, 9))
        elif what == 4 and at < len(changed):
            changed[at] = chance.choice(b'\x7e\x7d\x00\xff')
    return bytes(changed)


def test_packets_that_lie_are_decoded_without_a_fault() -> None:
    chance = random.Random(14)
    decoder = PacketDecoder(payloads=[OWN], group=0x7D)
    for _ in range(count := examples(1000)):
        protocol, packet = chance.choice(PACKETS)
        changed = damaged(packet, chance)
        reader = FrameReader()
        if len(changed) > LONGEST - 3:
            continue
        found, = reader.feed(frame(protocol, changed)) or [None]
        if found is None:
            assert len(changed) < 1
            continue
        one = decoder.decode_frame(found)
        assert not (one.readings and one.problem)
        json.dumps([one.origin, one.count, one.problem, *one.readings.values()])
        decoder.decode_air(changed, checked=False)
        decoder.decode(changed)
    assert decoder.packets > count and 0 < decoder.problems < decoder.packets
    assert len(decoder.unknown_types) <= 256


def test_a_fuzzed_line_accounts_for_every_byte() -> None:
    chance = random.Random(41)
    reader, decoder, link = FrameReader(), PacketDecoder(), Link(TINYOS_1)
    fed = framed = 0
    for _ in range(examples(1500)):
        wire = frame(*chance.choice(PACKETS))
        data = wire if chance.random() < 0.5 else damaged(wire, chance)
        for found in reader.feed(data):
            framed += found.size
            decoder.decode_frame(found)
        link.feed(data)
        link.poll(fed)
        fed += len(data)
        assert framed + reader.rejected_bytes + reader.pending_bytes == fed
        assert reader.pending_bytes <= 2 * LONGEST + 1
    assert reader.frames == link.reader.frames > 0 < reader.rejected_frames


@pytest.mark.parametrize('greeting', [b'T\x20', b'T\x21\x02\0\0\0', b'U\x20'])
def test_fuzzed_connections_disturb_neither_side(greeting: bytes) -> None:
    chance = random.Random(7)
    for _ in range(examples(3000) // 30):
        client, server = ForwarderClient(), Forwarder(chance.choice(['tinyos1', 'tinyos2']))
        number = server.connect()
        assert number is not None
        for _ in range(10):
            packet = chance.choice(PACKETS)[1]
            data = damaged(greeting + bytes((len(packet),)) + packet, chance)
            client.feed(data)
            server.feed_client(number, data)
            server.feed_mote(damaged(frame(*chance.choice(PACKETS)), chance))
            server.poll_mote(0)
            assert client.pending_bytes <= 256 and server.link.waiting <= 64
