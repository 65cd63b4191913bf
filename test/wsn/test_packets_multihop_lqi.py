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

"""The messages of MultiHopLQI and of the network with a moving sink, against bytes of motes."""

from __future__ import annotations

import csv
import gzip
from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies
import pytest

from rt_robot_os.features.wsn.packets import multihop_lqi
from rt_robot_os.features.wsn.packets import paper
from rt_robot_os.features.wsn.packets.multihop_lqi import LqiBeacon
from rt_robot_os.features.wsn.packets.multihop_lqi import LqiData
from rt_robot_os.features.wsn.packets.multihop_lqi import MicaMultihopMsg
from rt_robot_os.features.wsn.packets.multihop_lqi import MultihopMsg

U16 = strategies.integers(0, 0xFFFF)
I16 = strategies.integers(-0x8000, 0x7FFF)
U8 = strategies.integers(0, 0xFF)
U32 = strategies.integers(0, 0xFFFFFFFF)
DATA = strategies.binary(max_size=18)
MESSAGES: dict[Any, tuple[Any, ...]] = {
    MultihopMsg: (U16, U16, I16, I16, U16, DATA),
    MicaMultihopMsg: (U16, U16, I16, U8, DATA),
    multihop_lqi.BeaconMsg: (U16, U16, U16, U32),
    LqiBeacon: (U16,) * 6,
    LqiData: (U16, U16, U16, U16, U8, DATA),
    paper.BeaconMsg: (U16,) * 3,
    paper.DataMsg: (U16, U16, U16, U32, U16, U16),
}
SIZES = {MultihopMsg: 10, MicaMultihopMsg: 7, multihop_lqi.BeaconMsg: 10, LqiBeacon: 12,
         LqiData: 9, paper.BeaconMsg: 6, paper.DataMsg: 14}


def test_data_of_surge_behind_the_header() -> None:
    message = MultihopMsg.unpack(bytes.fromhex('0000 0500 6400 6200 0200 0000bc0a03002a000000'))
    assert message[:5] == (0, 5, 100, 98, 2)
    assert message.data.hex() == '0000bc0a03002a000000'
    assert message.pack().hex() == '00000500640062000200' + message.data.hex()


def test_a_beacon_of_the_root() -> None:
    message = MultihopMsg.unpack(bytes.fromhex('0000 0000 0700 0700 0000 7e00 0000 0000 00000000'))
    assert message[:5] == (0, 0, 7, 7, 0)
    beacon = multihop_lqi.BeaconMsg.unpack(message.data)
    assert beacon == (multihop_lqi.UART_ADDRESS, 0, 0, 0)
    assert beacon.AM_TYPE == 250


def test_every_frame_that_firmware_sent(data_dir: Path) -> None:
    seen = {LqiBeacon.AM_TYPE: 0, LqiData.AM_TYPE: 0}
    for name in ('chain4', 'lossy4'):
        with gzip.open(data_dir / f'wsn/mspsim_{name}_multihoplqi.air.csv.gz', 'rt') as file:
            for row in csv.DictReader(file):
                mpdu = bytes.fromhex(row['mpdu_hex_with_length_byte'])
                if len(mpdu) < 14:
                    continue
                am_type, payload = mpdu[11], mpdu[12:-2]
                kind = LqiBeacon if am_type == LqiBeacon.AM_TYPE else LqiData
                message = kind.unpack(payload)
                assert message.pack() == payload
                if kind is LqiBeacon:
                    assert message.origin == int(row['source'])
                    assert message.origin_seqno == 0
                seen[am_type] += 1
    assert seen == {LqiBeacon.AM_TYPE: 76 + 112, LqiData.AM_TYPE: 694 + 1930}


@pytest.mark.parametrize('message', MESSAGES)
def test_what_is_packed_is_read_again(message: Any) -> None:
    @given(strategies.tuples(*MESSAGES[message]))
    def check(fields: tuple[Any, ...]) -> None:
        packed = message(*fields).pack()
        assert message.unpack(packed) == fields
        assert message.unpack(packed).pack() == packed

    check()


@pytest.mark.parametrize('message', MESSAGES)
def test_too_few_bytes_are_named(message: Any) -> None:
    size = SIZES[message]
    name = message.__name__
    for length in range(size):
        with pytest.raises(ValueError, match=f'^too short: {length} bytes, {name} has {size}$'):
            message.unpack(bytes(length))


def test_the_packets_of_the_paper_fit_into_a_message_of_28_bytes() -> None:
    data = paper.DataMsg(0, 72, 3, 5, paper.Kind.PULSE, 3700)
    assert data.pack().hex() == '0000 4800 0300 05000000 0500 740e'.replace(' ', '')
    assert len(MultihopMsg(1, 1, 0, 0, 2, data.pack()).pack()) == 24
