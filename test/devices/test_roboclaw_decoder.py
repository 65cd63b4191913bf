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

"""Is RoboClaw packet serial written as in the manual, and read whatever happens on the line."""

from __future__ import annotations

from itertools import pairwise

from hypothesis import assume
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest
from rt_robot_os.devices.roboclaw import wire
from rt_robot_os.devices.roboclaw.wire import RoboClawDecoder

ADDRESS = 0x80
DATA = {
    wire.READ_TIMEOUT: b'\x05', wire.VERSION: b'USB Roboclaw 2x15a v4.2.4\n\x00',
    wire.MAIN_BATTERY: b'\x00\x79', wire.CURRENTS: b'\x00\x10\xff\xf0',
    wire.ENCODERS: bytes.fromhex('000004d2 ffffff00'), wire.TEMPERATURE: b'\x01\x2c',
    wire.STATUS: b'\x00\x01\x00\x00'}
# Every kind of request, and its answer.
EXCHANGES = [(wire.ask(ADDRESS, command), wire.answer(ADDRESS, command, data), data)
             for command, data in DATA.items()]
EXCHANGES.append((wire.speeds(ADDRESS, 100, -100), wire.ACKNOWLEDGED, b''))


def fed(request: wire.RoboClawRequest, *chunks: bytes) -> tuple[RoboClawDecoder,
                                                                list[wire.RoboClawReply]]:
    decoder = RoboClawDecoder()
    decoder.expect(request)
    return decoder, [reply for chunk in chunks for reply in decoder.feed(chunk)]


def test_requests_and_answers_are_those_of_the_vectors() -> None:
    assert wire.speeds(0x80, 1000, -1000).data == bytes.fromhex(
        '80 25 00 00 03 e8 ff ff fc 18 82 90')
    assert wire.ask(0x80, wire.ENCODERS).data == b'\x80\x4e'
    _, (reply,) = fed(wire.ask(0x80, wire.ENCODERS),
                      bytes.fromhex('00 00 04 d2 ff ff ff 00 3a 65'))
    assert wire.encoder_counts(reply.data) == (1234, 2**32 - 256)
    _, (reply,) = fed(wire.ask(0x80, wire.MAIN_BATTERY), bytes.fromhex('00 79 d8 44'))
    assert wire.unsigned(reply.data) * wire.BATTERY_V == pytest.approx(12.1)


def test_the_fields_of_the_other_commands() -> None:
    assert wire.speeds(0x81, 1, -2, 3).data[:-2] == bytes.fromhex(
        '81 28 00 00 00 03 00 00 00 01 ff ff ff fe')
    assert wire.duty(0x80, 1, -1).data[:-2] == bytes.fromhex('80 22 00 01 ff ff')
    assert wire.serial_timeout(0x80, 0.5).data[:-2] == bytes.fromhex('80 0e 05')
    assert wire.serial_timeout(0x80, 99.0).data[2] == 255
    # D, P, I and the speed at full duty; a gain of 1 is 65536.
    assert wire.gains(0x80, wire.SET_PID_1, 1.0, 0.5, 0.25, 44000).data[:-2] == bytes.fromhex(
        '80 1c 00 00 40 00 00 01 00 00 00 00 80 00 00 00 ab e0')
    assert wire.currents_a(b'\x00\x64\xff\x9c') == (1.0, -1.0)
    assert wire.version_text(b'USB Roboclaw 2x15a v4.2.4\n\x00') == 'USB Roboclaw 2x15a v4.2.4'


@given(first=st.integers(-2**63, 2**63), second=st.integers(-2**63, 2**63))
def test_a_speed_beyond_32_bits_is_limited_and_never_wraps(first: int, second: int) -> None:
    data = wire.speeds(ADDRESS, first, second).data
    assert wire.crc(data) == 0
    for given_, at in ((first, 2), (second, 6)):
        sent = int.from_bytes(data[at:at + 4], 'big', signed=True)
        assert sent == max(min(given_, 2**31 - 1), -2**31 + 1)


def test_an_acceleration_that_has_no_room_is_limited() -> None:
    assert wire.speeds(0x80, 1, 1, 10**12).data[2:6] == b'\x7f\xff\xff\xff'


@given(exchange=st.sampled_from(EXCHANGES), cuts=st.lists(st.integers(0, 40), max_size=6))
def test_an_answer_is_read_however_it_is_cut(
        exchange: tuple[wire.RoboClawRequest, bytes, bytes], cuts: list[int]) -> None:
    request, answer, data = exchange
    places = sorted({0, len(answer), *(min(cut, len(answer)) for cut in cuts)})
    decoder, replies = fed(request, *(answer[a:b] for a, b in pairwise(places)))
    assert [(r.request, r.data, r.size) for r in replies] == [(request, data, len(answer))]
    assert (decoder.frames, decoder.rejected_bytes, decoder.pending_bytes) == (1, 0, 0)


@given(exchange=st.sampled_from(EXCHANGES), at=st.integers(0, 40), flip=st.integers(1, 255))
def test_an_answer_with_a_wrong_byte_is_none(
        exchange: tuple[wire.RoboClawRequest, bytes, bytes], at: int, flip: int) -> None:
    request, answer, _ = exchange
    at %= len(answer)
    damaged = answer[:at] + bytes((answer[at] ^ flip,)) + answer[at + 1:]
    decoder, replies = fed(request, damaged)
    assert replies == []
    assert decoder.failed or decoder.pending_bytes
    assert decoder.rejected_bytes + decoder.pending_bytes == len(damaged)


@given(exchange=st.sampled_from(EXCHANGES), at=st.integers(0, 40))
def test_a_lost_byte_is_no_answer(exchange: tuple[wire.RoboClawRequest, bytes, bytes],
                                  at: int) -> None:
    request, answer, data = exchange
    at %= len(answer)
    short = answer[:at] + answer[at + 1:]
    decoder, replies = fed(request, short)
    # Of a text a character may be missing only if the CRC happens to agree.
    assert replies == []
    # The next request starts afresh.
    decoder.expect(request)
    assert [r.data for r in decoder.feed(answer)] == [data]


@settings(max_examples=60)
@given(asked=st.sampled_from(EXCHANGES), got=st.sampled_from(EXCHANGES))
def test_an_answer_to_something_else_is_none(
        asked: tuple[wire.RoboClawRequest, bytes, bytes],
        got: tuple[wire.RoboClawRequest, bytes, bytes]) -> None:
    assume(asked[0].command != got[0].command and asked[0].asks)
    decoder, replies = fed(asked[0], got[1])
    assert replies == []


def test_an_answer_of_another_unit_is_none() -> None:
    data = DATA[wire.ENCODERS]
    decoder, replies = fed(wire.ask(0x80, wire.ENCODERS),
                           wire.answer(0x81, wire.ENCODERS, data))
    assert replies == []
    assert (decoder.failed, decoder.rejected_frames, decoder.rejected_bytes) == (True, 1, 10)


@given(chunks=st.lists(st.one_of(
    st.binary(max_size=60), st.sampled_from([e[1] for e in EXCHANGES]),
    st.sampled_from([e[0] for e in EXCHANGES])), max_size=12))
def test_any_bytes_are_accounted_for(chunks: list[bytes | wire.RoboClawRequest]) -> None:
    decoder = RoboClawDecoder()
    fed_bytes = framed = 0
    for chunk in chunks:
        if isinstance(chunk, wire.RoboClawRequest):
            decoder.expect(chunk)
            continue
        fed_bytes += len(chunk)
        for reply in decoder.feed(chunk):
            framed += reply.size
            assert 0 < reply.end <= len(chunk)
        assert decoder.pending_bytes <= 50
        assert fed_bytes == framed + decoder.rejected_bytes + decoder.pending_bytes


def test_nothing_is_used_that_nobody_asked_for() -> None:
    decoder = RoboClawDecoder()
    assert decoder.feed(b''.join(e[1] for e in EXCHANGES)) == []
    assert decoder.pending_bytes == 0


def test_the_status_of_older_firmware_is_shorter() -> None:
    request = wire.ask(ADDRESS, wire.STATUS)
    old = wire.answer(ADDRESS, wire.STATUS, b'\x08\x05')
    decoder, replies = fed(request, old)
    assert replies == []
    assert decoder.learn()
    decoder.expect(request)
    reply, = decoder.feed(old)
    # Main battery low, emergency stop, overcurrent of M1: as new firmware has them.
    assert wire.status_bits(reply.data) == 0x80000 | 0x1 | 0x10000
    assert wire.status_bits(b'\x00\x08\x00\x01') == 0x80001
    decoder, _ = fed(request, wire.answer(ADDRESS, wire.STATUS, bytes(4))[:4])
    assert not decoder.learn()
