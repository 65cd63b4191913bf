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

"""Do decoder and encoder of Xbus messages and MTData2 agree with a recording and each other."""

from __future__ import annotations

import math
import struct
from typing import Any

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest
from rt_robot_os.devices.xsens import mtdata2
from rt_robot_os.devices.xsens import wire
from rt_robot_os.devices.xsens.mtdata2 import MtData2Parser
from rt_robot_os.devices.xsens.wire import MAX_PAYLOAD
from rt_robot_os.devices.xsens.wire import XbusDecoder

# Sent by an MTi-300 (firmware 1.8.2), published as a reference packet.
RECORDED = bytes.fromhex(
    'FA FF 36 8B'
    '10 20 02 A6 55 10 60 04 00 57 47 2E 20 10 10 3F 7F 7D C4 BC 10 10 7D 3B A1 57 70 BD 7E C6 56'
    '40 20 0C BD A2 1A F8 BE 2A 8E 96 41 1D 27 A2 40 10 0C B9 4F C8 00 B9 DA 24 00 3C C9 28 80'
    '40 30 0C 3C 02 C8 9C 3C 35 F6 C8 3C DB 0C 00 80 20 0C BB B1 7D 81 BB 96 32 00 3C 01 E8 41'
    '80 30 10 3F 80 00 00 B6 E3 30 01 B6 C0 40 00 37 26 48 00 C0 20 0C BE 99 9C 24 3F B6 1B 56'
    '3F 16 6A EB 30 10 04 00 01 86 DE E0 20 04 00 40 00 03 8B')


def parse(items: list[tuple[int, bytes]]) -> Any:
    frame, = XbusDecoder().feed(wire.mtdata2(items))
    return MtData2Parser().parse(frame.payload)


def test_a_recorded_message() -> None:
    frame, = XbusDecoder().feed(RECORDED)
    assert (frame.mid, len(frame.payload), frame.end) == (mtdata2.MTDATA2, 139, len(RECORDED))
    sample = MtData2Parser().parse(frame.payload)
    assert sample is not None
    assert (sample.counter, sample.time_fine, sample.status) == (42581, 5719854, 0x00400003)
    assert sample.quaternion == pytest.approx(
        (0.99801278, -0.00879299, 0.00492375, -0.06220087), abs=1e-8)
    assert sample.acceleration == pytest.approx((-0.0791530, -0.1665596, 9.8221760), abs=1e-6)
    assert sample.rate == pytest.approx((-0.00541657, -0.00458360, 0.00792891), abs=1e-8)
    assert sample.field == pytest.approx((-0.3000194, 1.4227092, 0.5875689), abs=1e-6)


def test_commands_are_those_of_the_manual() -> None:
    assert wire.message(wire.GO_TO_CONFIG) == bytes.fromhex('FA FF 30 00 D1')
    assert wire.message(wire.GO_TO_MEASUREMENT) == bytes.fromhex('FA FF 10 00 F1')
    wanted = ((0x1020, 0xFFFF), (0x4020, 100))
    payload = wire.output_configuration(wanted)
    assert payload == bytes.fromhex('10 20 FF FF 40 20 00 64')
    assert wire.read_output_configuration(payload + b'x') == wanted


@pytest.mark.parametrize('size', [0, 1, 254, 255, 256, MAX_PAYLOAD])
def test_long_messages_have_an_extended_length(size: int) -> None:
    data = wire.message(0x36, bytes(range(256)) * 8 if size == MAX_PAYLOAD else bytes(size))
    assert (data[3] == 0xFF) == (size > 254)
    decoder = XbusDecoder()
    frame, = decoder.feed(data + b'\xfa')
    assert (len(frame.payload), frame.size, decoder.pending_bytes) == (size, len(data), 1)


def test_a_length_beyond_the_limit_is_not_waited_for() -> None:
    good = wire.message(0x36, b'abc')
    decoder = XbusDecoder()
    assert len(decoder.feed(b'\xfa\xff\x36\xff\xff\xff' + good)) == 1
    assert decoder.rejected_bytes == 6
    with pytest.raises(ValueError, match='at most 2048'):
        wire.message(0x36, bytes(MAX_PAYLOAD + 1))


def test_a_bad_sum_is_counted_and_the_message_inside_is_found() -> None:
    good = wire.message(0x36, b'abc')
    bad = bytearray(wire.message(0x36, b'xy' + good))
    bad[-1] ^= 1
    decoder = XbusDecoder()
    assert [f.payload for f in decoder.feed(bytes(bad))] == [b'abc']
    assert (decoder.rejected_frames, decoder.rejected_bytes) == (1, len(bad) - len(good))


@pytest.mark.parametrize('precision', [0, 1, 2, 3])
def test_every_number_format(precision: int) -> None:
    values = (1.5, -0.25, 9.81)
    sample = parse([(mtdata2.ACCELERATION | precision, wire.reals(values, precision))])
    assert sample.acceleration == pytest.approx(values, abs=1e-6)


def test_16_32_sends_the_fraction_first() -> None:
    # -1.5 is -2 + 0.5.
    assert wire.reals((-1.5,), 2) == struct.pack('>Ih', 1 << 31, -2)


@pytest.mark.parametrize('frame', [mtdata2.NED, mtdata2.NWU])
def test_other_frames_of_reference_become_east_north_up(frame: int) -> None:
    # The device's x axis points north, its z axis up.
    north_ahead = {mtdata2.NED: (0.0, 1.0, 0.0, 0.0), mtdata2.NWU: (1.0, 0.0, 0.0, 0.0)}[frame]
    sample = parse([(mtdata2.QUATERNION | frame, wire.reals(north_ahead))])
    w, x, y, z = sample.quaternion
    ahead = (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y))
    up = (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y))
    assert ahead == pytest.approx((0.0, 1.0, 0.0), abs=1e-12)
    assert up == pytest.approx((0.0, 0.0, 1.0), abs=1e-12)


def test_angles_become_a_quaternion() -> None:
    sample = parse([(mtdata2.EULER, wire.reals((0.0, 0.0, 90.0)))])
    assert sample.quaternion == pytest.approx((math.sqrt(0.5), 0, 0, math.sqrt(0.5)))


def test_items_that_are_not_known_are_passed_over() -> None:
    sample = parse([(0x5040, bytes(8)), (mtdata2.RATE_OF_TURN, wire.reals((1, 2, 3))),
                    (mtdata2.ACCELERATION, bytes(5)), (0x0810, wire.reals((25.5,)))])
    assert (sample.rate, sample.acceleration, sample.temperature_c) == ((1, 2, 3), None, 25.5)


def test_messages_of_equal_length_and_different_items_are_told_apart() -> None:
    parser = MtData2Parser()
    for _ in range(2):
        for kind in (mtdata2.ACCELERATION, mtdata2.RATE_OF_TURN):
            sample = parser.parse(
                wire.mtdata2([(kind, wire.reals((1, 2, 3)))])[4:-1])
            assert sample is not None
            assert (sample.acceleration is None) == (kind == mtdata2.RATE_OF_TURN)


def test_items_that_do_not_add_up_are_counted() -> None:
    parser = MtData2Parser()
    for payload in (b'', b'\x10', b'\x10\x20\x02\x00', bytes.fromhex('401005 0000')):
        assert parser.parse(payload) is None
    assert parser.malformed == 4


def test_layouts_kept_are_bounded() -> None:
    parser = MtData2Parser()
    for size in range(100):
        assert parser.parse(struct.pack('>HB', 0x5040, size) + bytes(size)) is not None
    assert len(parser._layouts) <= 8


@settings(max_examples=100, deadline=None)
@given(payloads=st.lists(st.binary(max_size=80) | st.lists(st.tuples(
    st.sampled_from([0x1020, 0x1060, 0x2010, 0x2015, 0x2036, 0x203B, 0x4020, 0x8022, 0xC021,
                     0xE020, 0x0813]), st.binary(max_size=32)), max_size=4).map(
                         lambda items: wire.mtdata2(items)[4:-1]), max_size=10))
def test_no_payload_raises(payloads: list[bytes]) -> None:
    parser = MtData2Parser()
    for payload in payloads:
        parser.parse(payload)
