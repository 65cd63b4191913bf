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


"""The Collection Tree Protocol's packets, against what real motes sent over the air."""

from __future__ import annotations

import csv
import gzip
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st
import pytest
from rt_robot_os.features.wsn.packets.ctp import CtpBeacon
from rt_robot_os.features.wsn.packets.ctp import CtpData
from rt_robot_os.features.wsn.packets.ctp import Neighbour
from rt_robot_os.features.wsn.packets.ctp import NO_PARENT
from rt_robot_os.features.wsn.packets.ctp import PULL

BYTE = st.integers(0, 0xFF)
WORD = st.integers(0, 0xFFFF)
BEACON = st.builds(
    CtpBeacon, BYTE, BYTE, WORD, WORD,
    st.lists(st.builds(Neighbour, WORD, BYTE), max_size=15).map(tuple),
    st.integers(0, 15).map(lambda bits: bits << 4))


@pytest.mark.parametrize('name', ['chain4', 'lossy4'])
def test_every_frame_of_real_motes_packs_as_it_came(data_dir: Path, name: str) -> None:
    counts = {CtpBeacon.AM_TYPE: 0, CtpData.AM_TYPE: 0}
    path = data_dir / 'wsn' / f'mspsim_{name}_ctp.air.csv.gz'
    with gzip.open(path, 'rt') as lines:
        for row in csv.DictReader(lines):
            mpdu = bytes.fromhex(row['mpdu_hex_with_length_byte'])
            if mpdu[0] == 5:
                continue
            kind: type[CtpBeacon | CtpData] = (
                CtpBeacon if mpdu[11] == CtpBeacon.AM_TYPE else CtpData)
            payload = mpdu[12:-2]
            assert kind.unpack(payload).pack() == payload
            counts[kind.AM_TYPE] += 1
    assert list(counts.values()) == {'chain4': [61, 541], 'lossy4': [77, 1368]}[name]


def test_a_beacon_has_its_fields_where_the_motes_have_them() -> None:
    got = CtpBeacon.unpack(bytes.fromhex('02 05 80 ffff 0014 0002a6 00017d'))
    assert got == CtpBeacon(sequence=5, options=PULL, parent=NO_PARENT, etx=20,
                            neighbours=(Neighbour(2, 166), Neighbour(1, 125)))


def test_data_have_their_fields_where_the_motes_have_them() -> None:
    got = CtpData.unpack(bytes.fromhex('00 01 000a 0003 09 93 0000'))
    assert got == CtpData(options=0, hops=1, etx=10, origin=3, origin_sequence=9,
                          collect_id=0x93, application=bytes(2))


@given(BEACON)
def test_a_beacon_comes_back(beacon: CtpBeacon) -> None:
    assert CtpBeacon.unpack(beacon.pack()) == beacon


@given(st.builds(CtpData, BYTE, BYTE, WORD, WORD, BYTE, BYTE, st.binary(max_size=20)))
def test_data_come_back(data: CtpData) -> None:
    assert CtpData.unpack(data.pack()) == data


@given(st.binary(max_size=60))
def test_whatever_bytes_come_raise_only_value_error(data: bytes) -> None:
    kinds: tuple[type[CtpBeacon | CtpData], ...] = (CtpBeacon, CtpData)
    for kind in kinds:
        try:
            packet = kind.unpack(data)
        except ValueError:
            continue
        assert packet.pack() == data


@pytest.mark.parametrize(('packet', 'words'), [
    (CtpBeacon(256, 0, 0, 0), 'does not fit'),
    (CtpBeacon(0, 0, 0, 0, (Neighbour(1, 2),) * 16), '16 neighbours'),
    (CtpBeacon(0, 0, 0, 0, (), 1), 'flags 0x01'),
    (CtpData(0, 0, 70_000, 0, 0, 0), 'does not fit'),
])
def test_what_has_no_room_says_so(packet: CtpBeacon | CtpData, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        packet.pack()


def test_a_beacon_that_lies_about_its_length_says_so() -> None:
    with pytest.raises(ValueError, match='8 bytes, CtpBeacon with 1 neighbours has 10'):
        CtpBeacon.unpack(bytes([1, 0, 0, 0, 0, 0, 0, 0]))
    with pytest.raises(ValueError, match='too short: 3 bytes, CtpData has 8'):
        CtpData.unpack(bytes(3))
