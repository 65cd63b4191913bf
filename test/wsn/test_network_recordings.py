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

"""The model of a network against recordings of real motes: what came, was lost and repeated."""

from __future__ import annotations

from collections import Counter
import csv
import gzip
import json
from pathlib import Path

import pytest
from rt_robot_os.features.wsn.packets.decode import PacketDecoder
from rt_robot_os.features.wsn.packets.framing import FrameReader
from rt_robot_os.features.wsn.sensor_network.model import NetworkModel

NAMES = [f'{topology}_{protocol}' for topology in ('chain4', 'lossy4')
         for protocol in ('multihoplqi', 'ctp')]


def table(path: Path) -> list[dict[str, str]]:
    """Read a packed table."""
    with gzip.open(path, 'rt') as file:
        return list(csv.DictReader(file))


def heard_by_the_sink(wsn: Path, name: str) -> NetworkModel:
    """Feed a model with what the sink's mote sent over its serial line."""
    model, decoder = NetworkModel(), PacketDecoder('tinyos2')
    for row in table(wsn / f'mspsim_{name}.frames.csv.gz'):
        frame = bytes.fromhex(row['frame_hex_unescaped_with_crc'])
        model.update(decoder.decode(frame[1:-2]), int(row['t_us']) * 1000)
    return model


@pytest.mark.parametrize('name', NAMES)
def test_deliveries_losses_and_duplicates_are_those_of_the_motes(data_dir: Path, name: str
                                                                 ) -> None:
    wsn = data_dir / 'wsn'
    truth = json.loads((wsn / 'mspsim_summary.json').read_text())[name]
    model = heard_by_the_sink(wsn, name)
    for origin, generated in truth['generated'].items():
        node = model.nodes[int(origin)]
        assert node.received == truth['delivered'][origin]
        assert node.lost == generated - truth['delivered'][origin]
    assert sum(node.duplicates for node in model.nodes.values()) == truth['duplicates_on_serial']
    assert not any(node.exact and (node.exact.reboots or node.exact.twins)
                   for node in model.nodes.values())


@pytest.mark.parametrize('name', NAMES)
def test_the_bytes_of_the_line_give_the_same_as_its_frames(data_dir: Path, name: str) -> None:
    wsn = data_dir / 'wsn'
    model, decoder, reader = NetworkModel(), PacketDecoder('tinyos2'), FrameReader()
    data = (wsn / f'mspsim_{name}.serial.bin').read_bytes()
    rows = iter(table(wsn / f'mspsim_{name}.frames.csv.gz'))
    for frame in reader.feed(data):
        model.update(decoder.decode(frame.packet), int(next(rows)['t_us']) * 1000)
    expected = heard_by_the_sink(wsn, name)
    assert {number: node.summary() for number, node in model.nodes.items()} == {
        number: node.summary() for number, node in expected.nodes.items()}


@pytest.mark.parametrize('name', NAMES)
def test_parents_and_costs_are_those_that_the_roots_debug_frames_tell(data_dir: Path, name: str
                                                                      ) -> None:
    wsn = data_dir / 'wsn'
    costs, last_hops = {}, {}
    for row in table(wsn / f'mspsim_{name}.frames.csv.gz'):
        frame = bytes.fromhex(row['frame_hex_unescaped_with_crc'])
        am_type, payload = frame[8], frame[9:-2]
        if am_type in (0x72, 0x75) and payload[0] == 0x34:
            costs[int.from_bytes(payload[1:3], 'big')] = int.from_bytes(payload[4:6], 'big')
        elif am_type == 0x72 and payload[0] == 0x21:
            last_hops[int.from_bytes(payload[3:5], 'big')] = int.from_bytes(payload[5:7], 'big')
    model = heard_by_the_sink(wsn, name)
    for number, cost in costs.items():
        assert model.nodes[number].cost == (cost if cost < 0xFFFE else -1)
    for number, last in last_hops.items():
        assert model.nodes[number].via == last
        assert (model.nodes[number].parent == 0) == (last == number)


@pytest.mark.parametrize('name', NAMES)
def test_a_sniffer_sees_the_parent_of_every_node(data_dir: Path, name: str) -> None:
    model, decoder = NetworkModel(), PacketDecoder('tinyos2')
    sent: dict[int, Counter[int]] = {}
    for row in table(data_dir / 'wsn' / f'mspsim_{name}.air.csv.gz'):
        data = bytes.fromhex(row['mpdu_hex_with_length_byte'])
        packet = decoder.decode_air(data, checked=False)
        model.update(packet, int(row['t_us']) * 1000)
        if packet.kind == 'data' and packet.destination != 0xFFFF:
            sent.setdefault(packet.source, Counter())[packet.destination] += 1
            if packet.source:
                assert model.nodes[packet.source].parent == packet.destination
    assert set(model.nodes) == set(sent) - {0} == {1, 2, 3}
    assert sum(node.lost for node in model.nodes.values()) <= 2
