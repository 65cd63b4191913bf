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

"""Do decoder and encoder of UBX agree with another implementation, and bear NMEA in between."""

from __future__ import annotations

from datetime import datetime
from datetime import timezone

import pytest
from rt_robot_os.devices.nmea import wire as nmea
from rt_robot_os.devices.ublox import wire
from rt_robot_os.devices.ublox.wire import nav_pvt
from rt_robot_os.devices.ublox.wire import UbxDecoder

# Made with pyubx2 1.4.0 from the values in the test below.
FROM_PYUBX2 = bytes.fromhex(
    'b56201075c0050880612ea070b15091e0f0719000000c01dfeff034100111db906f8c05b4d1f523d010007'
    '870000d20400002909000024faffffc4090000d4feffff630b00004fdeb700d2000000305705007b000000'
    '0000000000000000000000004f9b')
NOON = datetime(2026, 1, 1, 12, tzinfo=timezone.utc)
SENTENCE = nmea.sentence('GPGSV,1,1,00')


def test_a_message_of_another_implementation() -> None:
    frame, = UbxDecoder().feed(FROM_PYUBX2)
    assert (frame.kind, frame.identifier, frame.size, frame.end) == (wire.NAV, wire.PVT, 100, 100)
    pvt = nav_pvt(frame.payload)
    assert pvt is not None
    assert pvt.tow_ms == 302418000
    assert (pvt.year, pvt.month, pvt.day, pvt.hour, pvt.minute, pvt.second) == (
        2026, 11, 21, 9, 30, 15)
    assert (pvt.valid, pvt.time_accuracy_ns, pvt.nano) == (7, 25, -123456)
    assert (pvt.fix_type, pvt.satellites, pvt.pdop, pvt.flags3) == (3, 17, 123, 0)
    assert (pvt.longitude, pvt.latitude) == (-133777123, 525163456)
    assert (pvt.height_mm, pvt.sea_height_mm) == (81234, 34567)
    assert (pvt.horizontal_accuracy_mm, pvt.vertical_accuracy_mm) == (1234, 2345)
    assert (pvt.north_mm_s, pvt.east_mm_s, pvt.down_mm_s) == (-1500, 2500, -300)
    assert (pvt.ground_speed_mm_s, pvt.heading, pvt.speed_accuracy_mm_s, pvt.heading_accuracy) == (
        2915, 12050000 - 1, 210, 350000)
    assert (pvt.has_fix, pvt.has_date, pvt.is_differential, pvt.carrier) == (True, True, False, 1)


def test_commands_agree_with_another_implementation() -> None:
    assert wire.set_rate(5.0) == bytes.fromhex('b56206080600c80001000000dd68')
    assert wire.acknowledge(6, 8, done=False) == bytes.fromhex('b562050002000608153a')
    assert wire.enable(7)[2:9] == bytes.fromhex('0601 0300 010701')


def test_the_encoder_says_what_the_decoder_reads() -> None:
    data = wire.make_nav_pvt(NOON, -33.8567844, 151.2152967, 60.5, velocity_m_s=(1.0, -2.0, 0.5),
                             separation_m=22.0)
    frame, = UbxDecoder().feed(data)
    pvt = nav_pvt(frame.payload)
    assert pvt is not None
    assert (pvt.latitude, pvt.longitude) == (-338567844, 1512152967)
    assert (pvt.height_mm, pvt.sea_height_mm) == (60500, 38500)
    assert (pvt.east_mm_s, pvt.north_mm_s, pvt.down_mm_s) == (1000, -2000, -500)


def test_messages_of_the_seventh_generation_are_shorter() -> None:
    long, = UbxDecoder().feed(FROM_PYUBX2)
    short, = UbxDecoder().feed(wire.message(wire.NAV, wire.PVT, long.payload[:84]))
    assert nav_pvt(short.payload) == nav_pvt(long.payload)
    assert nav_pvt(long.payload[:83]) is None


def test_sentences_in_between_are_frames_and_no_rubbish() -> None:
    decoder = UbxDecoder()
    frames = decoder.feed(SENTENCE + FROM_PYUBX2 + SENTENCE + SENTENCE + FROM_PYUBX2)
    assert [f.kind for f in frames] == [wire.NMEA, wire.NAV, wire.NMEA, wire.NMEA, wire.NAV]
    assert [f.end for f in frames] == sorted(f.end for f in frames)
    assert (decoder.rejected_bytes, decoder.frames) == (0, 5)


def test_a_sentence_that_a_message_cuts_off_is_rejected() -> None:
    decoder = UbxDecoder()
    frames = decoder.feed(SENTENCE[:9] + FROM_PYUBX2 + SENTENCE[9:] + SENTENCE)
    assert [f.kind for f in frames] == [wire.NAV, wire.NMEA]
    assert decoder.rejected_bytes == len(SENTENCE)


@pytest.mark.parametrize('at', [4, 5, 20, 98, 99])
def test_a_damaged_message_is_counted_and_the_next_is_found_at_once(at: int) -> None:
    bad = bytearray(FROM_PYUBX2)
    bad[at] ^= 0x40
    decoder = UbxDecoder()
    assert len(decoder.feed(bytes(bad) + FROM_PYUBX2)) == 1
    assert decoder.rejected_bytes == 100


def test_a_message_without_payload_is_one() -> None:
    frame, = UbxDecoder().feed(wire.message(0x0A, 0x04))
    assert (frame.kind, frame.payload, frame.size) == (0x0A, b'', 8)


def test_a_length_beyond_the_limit_is_not_waited_for() -> None:
    decoder = UbxDecoder()
    assert decoder.feed(wire.SYNC + bytes((0x01, 0x35, 0xFF, 0xFF)) + bytes(50)) == []
    assert decoder.pending_bytes == 0


def test_the_checksum_is_that_of_the_standard() -> None:
    a = b = 0
    content = (bytes(range(256)) * 11)[:wire.MAX_PAYLOAD + 4]
    for at, byte in enumerate(content):
        assert at % 97 or wire.fletcher(content[:at]) == bytes((a, b))
        a = (a + byte) & 0xFF
        b = (b + a) & 0xFF
    assert wire.fletcher(content) == bytes((a, b))


@pytest.mark.parametrize('kind', [0x03, 0x0C])
def test_messages_for_the_makers_own_use_are_messages(kind: int) -> None:
    decoder = UbxDecoder()
    frame, = decoder.feed(wire.message(kind, 0x10, bytes(20)) + SENTENCE[:-3])
    assert (frame.kind, decoder.rejected_bytes) == (kind, 0)
