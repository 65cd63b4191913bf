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

"""Do decoder and encoder of the BNO055's UART protocol agree with the format."""

from __future__ import annotations

import math
import random

import pytest
from rt_robot_os.devices.bno055 import wire
from rt_robot_os.devices.bno055.wire import Bno055Decoder


def test_requests_are_those_of_the_data_sheet() -> None:
    assert wire.read_request(0x00, 1) == bytes.fromhex('AA 01 00 01')
    assert wire.read_request(wire.BLOCK_FIRST, wire.BLOCK_SIZE) == bytes.fromhex('AA 01 08 2E')
    assert wire.write_request(0x3D, b'\x0c') == bytes.fromhex('AA 00 3D 01 0C')


def test_the_block_has_every_value_at_its_register() -> None:
    block = wire.block((1, 2, -3), (1e-6, 2e-6, -3e-6), (4, 5, -6), (0.5, -0.5, 0.5, 0.5),
                       (0, 0, 9.8), temperature_c=-7, calibration=0xE4)
    registers = dict(enumerate(block, 0x08))

    def number(register: int) -> int:
        return int.from_bytes((registers[register], registers[register + 1]), 'little',
                              signed=True)

    assert len(block) == wire.BLOCK.size == wire.BLOCK_SIZE
    assert [number(r) for r in (0x08, 0x0A, 0x0C)] == [100, 200, -300]
    assert [number(r) for r in (0x0E, 0x10, 0x12)] == [16, 32, -48]
    assert [number(r) for r in (0x14, 0x16, 0x18)] == [64, 80, -96]
    assert [number(r) for r in (0x20, 0x22, 0x24, 0x26)] == [8192, -8192, 8192, 8192]
    assert [number(r) for r in (0x28, 0x2A, 0x2C)] == [100, 200, -1280]
    assert number(0x32) == 980
    assert (registers[0x34], registers[0x35]) == (0xF9, 0xE4)


def test_answers() -> None:
    block = wire.block((0, 0, 9.8), (0, 0, 0), (0, 0, 0), (1, 0, 0, 0))
    decoder = Bno055Decoder()
    frames = decoder.feed(wire.data_answer(b'\xa0') + wire.status_answer(1)
                          + wire.data_answer(block) + wire.status_answer(7))
    assert [(f.status, f.data) for f in frames] == [(0, b'\xa0'), (1, b''), (0, block), (7, b'')]
    assert decoder.rejected_bytes == 0


@pytest.mark.parametrize('quaternion, good', [
    ((0, 0, 0, 0), True), ((0.6, 0, 0.8, 0), True), ((0.6, 0, 0, 0), False),
    ((1, 1, 0, 0), False)])
def test_only_a_block_with_a_rotation_is_one(quaternion: tuple[float, ...], good: bool) -> None:
    block = wire.block((0, 0, 9.8), (0, 0, 0), (0, 0, 0), quaternion)
    decoder = Bno055Decoder()
    assert bool(decoder.feed(wire.data_answer(block))) == good
    assert decoder.rejected_frames == (not good)


def test_lengths_and_statuses_that_do_not_exist_are_passed_over() -> None:
    decoder = Bno055Decoder()
    assert decoder.feed(bytes.fromhex('BB 00 BB 2D EE 00 EE 0B BB FF')) == []
    assert len(decoder.feed(wire.status_answer(1))) == 1
    assert decoder.rejected_bytes == 10


def test_garbage_is_hardly_ever_a_block() -> None:
    decoder = Bno055Decoder()
    frames = decoder.feed(random.Random(3).randbytes(200_000))
    assert not [f for f in frames if len(f.data) == wire.BLOCK_SIZE]


def test_what_is_beyond_the_range_is_limited() -> None:
    block = wire.block((1e9, -1e9, 0), (0, 0, 0), (0, 0, 0), (1, 0, 0, 0))
    assert wire.BLOCK.unpack(block)[:3] == (32767, -32768, 0)
    assert math.hypot(*wire.BLOCK.unpack(block)[12:16]) == 1 << 14
