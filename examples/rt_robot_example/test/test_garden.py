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

"""Tests of the payload of a garden node, without a node and without a port."""

from __future__ import annotations

import pytest
from rt_robot_example.garden import SOIL
from rt_robot_os.features.wsn.packets.decode import PacketDecoder
from rt_robot_os.features.wsn.packets.serial_am import SerialAm

# From "hex" of `wsn sniff --json`.
RECEIVED = bytes.fromhex('00ffff00070a00420007000100e719320eb6')


def test_a_received_packet_is_decoded() -> None:
    found = PacketDecoder(payloads=[SOIL]).decode(RECEIVED)
    assert (found.name, found.origin, found.origin_seqno, found.problem) == ('soil', 7, 1, '')
    assert found.readings == pytest.approx(
        {'soil_moisture_percent': 23.1, 'temperature': 24.9, 'battery': 2.759}, abs=0.001)


def test_an_encoded_packet_is_decoded() -> None:
    values = {'origin': 7, 'seqno': 2, 'moisture': 1000, 'air': 6450, 'supply': 3766}
    packet = SerialAm(0xFFFF, 7, SOIL.am_type, SOIL.pack(values, big_endian=True)).pack()
    assert PacketDecoder(payloads=[SOIL]).decode(packet).fields == values


def test_a_truncated_packet_has_no_readings() -> None:
    found = PacketDecoder(payloads=[SOIL]).decode(RECEIVED[:-2], stack='tinyos2')
    assert found.readings == {}
    assert found.problem == 'its length byte is 10, but the payload has 8 bytes'
