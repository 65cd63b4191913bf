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


"""Do decoder and encoder of WitMotion frames agree with the format and with each other."""

from __future__ import annotations

import math
import struct

from hypothesis import given
from hypothesis import strategies as st
import pytest
from rt_robot_os.devices.witmotion import wire
from rt_robot_os.devices.witmotion.wire import WitMotionDecoder

GRAVITY = 9.80665


def hexbytes(text: str) -> bytes:
    return bytes.fromhex(text)


def test_one_g_at_25_degrees() -> None:
    frame, = WitMotionDecoder().feed(hexbytes('55 51 00 00 00 00 00 08 c4 09 7b'))
    assert frame.kind == wire.ACCELERATION
    assert [v / 32768 * 16 for v in frame.values[:3]] == [0, 0, 1]
    assert frame.values[3] / 100 == 25.0
    assert frame.end == 11


def test_angles() -> None:
    frame, = WitMotionDecoder().feed(hexbytes('55 53 00 20 00 f0 00 40 00 00 f8'))
    assert frame.kind == wire.ANGLE
    assert [v / 32768 * 180 for v in frame.values[:3]] == [45, -22.5, 90]


def test_the_encoder_makes_the_same_vectors() -> None:
    assert wire.acceleration_frame(0, 0, GRAVITY) == hexbytes('55 51 00 00 00 00 00 08 c4 09 7b')
    assert wire.angle_frame(math.radians(45), math.radians(-22.5), math.radians(90), 0) == (
        hexbytes('55 53 00 20 00 f0 00 40 00 00 f8'))


def test_the_commands_are_those_of_the_manual() -> None:
    assert wire.UNLOCK == hexbytes('ff aa 69 88 b5')
    outputs = wire.output_mask((0x51, 0x52, 0x53, 0x54, 0x59))
    assert wire.command(wire.REGISTER_OUTPUTS, outputs) == hexbytes('ff aa 02 1e 02')
    assert wire.command(wire.REGISTER_RATE, wire.RATES_HZ[100]) == hexbytes('ff aa 03 09 00')
    assert wire.RATES_HZ[200] == 0xB


def test_a_bad_sum_is_counted_and_the_next_frame_is_found() -> None:
    good = wire.frame(wire.TIME, 1, 2, 3, 4)
    bad = bytearray(good)
    bad[10] ^= 1
    decoder = WitMotionDecoder()
    frames = decoder.feed(bytes(bad) + good)
    assert [f.values for f in frames] == [(1, 2, 3, 4)]
    assert (decoder.rejected_frames, decoder.rejected_bytes, decoder.frames) == (1, 11, 1)
    assert frames[0].skipped == 11


def test_a_header_inside_of_a_damaged_frame_does_not_hide_the_next_frame() -> None:
    header = struct.unpack('<h', b'\x55\x51')[0]
    inner = bytearray(wire.frame(wire.ANGLE, header, header, header, header))
    inner[10] ^= 0xFF
    good = wire.frame(wire.ACCELERATION, header, 0, 0, 0)
    decoder = WitMotionDecoder()
    assert [f.kind for f in decoder.feed(bytes(inner) + good + good)] == [wire.ACCELERATION] * 2
    assert decoder.rejected_bytes == 11


def test_unknown_ids_are_not_frames() -> None:
    decoder = WitMotionDecoder()
    for kind in (0x4F, 0x5B, 0x01, 0xFF):
        content = bytes((0x55, kind)) + bytes(8)
        assert decoder.feed(content + bytes((sum(content) & 0xFF,))) == []
    assert decoder.rejected_bytes + decoder.pending_bytes == 44
    assert decoder.rejected_frames == 0


def test_reset_rejects_what_is_pending() -> None:
    frame = wire.frame(wire.TIME, 0, 0, 0, 0)
    decoder = WitMotionDecoder()
    assert decoder.feed(frame[:6]) == []
    decoder.reset()
    assert (decoder.pending_bytes, decoder.rejected_bytes) == (0, 6)
    assert len(decoder.feed(frame)) == 1


@given(values=st.tuples(*4 * (st.integers(-32768, 32767),)),
       kind=st.integers(wire.TIME, wire.LAST), noise=st.binary(max_size=8))
def test_every_frame_comes_out_as_it_went_in(
    values: tuple[int, int, int, int], kind: int, noise: bytes,
) -> None:
    noise = noise.replace(b'\x55', b'\x00')
    decoder = WitMotionDecoder()
    frames = decoder.feed(noise + wire.frame(kind, *values))
    assert [(f.kind, f.values, f.skipped) for f in frames] == [(kind, values, len(noise))]


def test_values_beyond_the_range_are_limited_to_it() -> None:
    frame, = WitMotionDecoder().feed(wire.acceleration_frame(1e9, -1e9, 0.0))
    assert frame.values[:3] == (32767, -32768, 0)


@pytest.mark.parametrize('size', [1, 10, 100_000])
def test_memory_stays_bounded_whatever_comes(size: int) -> None:
    decoder = WitMotionDecoder()
    for filler in (b'\x55', b'\x00', b'\x55\x51'):
        decoder.feed(filler * size)
        assert decoder.pending_bytes <= 10
