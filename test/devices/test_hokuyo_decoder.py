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

"""Do decoder and encoder of SCIP 2.0 agree with the specification's examples and each other."""

from __future__ import annotations

import random

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest
from rt_robot_os.devices.hokuyo import wire
from rt_robot_os.devices.hokuyo.wire import checksum
from rt_robot_os.devices.hokuyo.wire import MAX_ANSWER
from rt_robot_os.devices.hokuyo.wire import ScipDecoder

ECHO = wire.scan_command(44, 725)


def test_sums_of_the_specification() -> None:
    assert (checksum(b'00'), checksum(b'99')) == (ord('P'), ord('b'))


def test_three_characters_of_the_specification() -> None:
    # 5432 mm is 1Dh, and 0, in the specification's example: 31h 44h 68h.
    data = wire.scan(ECHO, 0, [5432])
    assert b'1Dh' in data
    frame, = ScipDecoder().feed(data)
    assert frame.distances_mm is not None and frame.distances_mm.tolist() == [5432]


def test_commands() -> None:
    assert wire.command(ECHO) == b'MD0044072500000\n'
    assert wire.answer(b'QT') == b'QT\n00P\n\n'


def test_parameters_of_the_specification() -> None:
    data = (b'PP\n00P\nDMIN:20;4\nDMAX:5600;_\nAMIN:44;7\nAMAX:725;o\nAFRT:384;6\nSCAN:600;e\n\n')
    frame, = ScipDecoder().feed(data)
    assert frame.lines[2:4] == (b'AMIN:44;', b'AMAX:725;')


def test_parameters() -> None:
    data = wire.parameters(first_step=44, last_step=725, steps_per_turn=1024, front_step=384,
                           minimum_mm=20, maximum_mm=5600, rpm=600, model='URG-04LX')
    frame, = ScipDecoder().feed(data)
    assert (frame.command, frame.status) == (b'PP', 0)
    assert frame.lines == (b'MODL:URG-04LX;', b'DMIN:20;', b'DMAX:5600;', b'ARES:1024;',
                           b'AMIN:44;', b'AMAX:725;', b'AFRT:384;', b'SCAN:600;')
    assert frame.size == len(data)


@pytest.mark.parametrize('count', [0, 1, 21, 22, 63, 64, 65, 682, 1081])
def test_scans_of_every_length(count: int) -> None:
    values = [(i * 379) % 262144 for i in range(count)]
    data = wire.scan(ECHO, 0xABCDEF, values)
    decoder = ScipDecoder()
    frame, = decoder.feed(data)
    assert (frame.time_ms, frame.size, frame.end) == (0xABCDEF, len(data), len(data))
    assert frame.distances_mm is not None and frame.distances_mm.tolist() == values
    assert (decoder.rejected_bytes, decoder.pending_bytes) == (0, 0)


def test_a_wrong_sum_anywhere_rejects_the_whole_scan() -> None:
    good = wire.scan(ECHO, 1, range(100, 200))
    noise = random.Random(1)
    for at in range(len(ECHO) + 1, len(good) - 2):
        bad = bytearray(good)
        bad[at] ^= 1 << noise.randrange(6)
        frames = ScipDecoder().feed(bytes(bad) + good)
        # A damaged line end may take the next scan along, never change a distance.
        for frame in frames:
            assert frame.distances_mm is None or frame.distances_mm.tolist() == list(
                range(100, 200)), at


def test_the_second_half_of_a_scan_is_rejected_and_the_next_is_good() -> None:
    data = wire.scan(ECHO, 1, range(1000, 1682))
    for at in range(1, len(data), 97):
        decoder = ScipDecoder()
        assert len(decoder.feed(data[at:] + data)) == 1
        assert decoder.rejected_bytes == len(data) - at


def test_rubbish_before_the_echo_is_passed_over() -> None:
    decoder = ScipDecoder()
    frame, = decoder.feed(b'\xff\x00$GP' + wire.scan(ECHO, 1, [1000]))
    assert frame.echo == ECHO
    assert decoder.rejected_bytes == 5


def test_errors_have_a_status() -> None:
    frames = ScipDecoder().feed(wire.answer(ECHO, 4) + wire.answer(ECHO, 98)
                                + b'QT\n0E' + bytes((checksum(b'0E'),)) + b'\n\n')
    assert [f.status for f in frames] == [4, 98, 0x3045]


def test_what_never_ends_is_not_kept() -> None:
    decoder = ScipDecoder()
    for _ in range(20):
        decoder.feed(b'x' * 1000)
        assert decoder.pending_bytes <= MAX_ANSWER
    assert decoder.rejected_bytes == 20_000 - decoder.pending_bytes


SCANS = st.binary(max_size=60).map(lambda content: ECHO + b'\n99b\n' + content + b'\n\n')


@settings(max_examples=50, deadline=None)
@given(blocks=st.lists(SCANS | st.binary(max_size=40), max_size=8))
def test_no_bytes_raise(blocks: list[bytes]) -> None:
    decoder = ScipDecoder()
    frames = decoder.feed(b''.join(blocks))
    assert sum(map(len, blocks)) == (
        sum(f.size for f in frames) + decoder.rejected_bytes + decoder.pending_bytes)
