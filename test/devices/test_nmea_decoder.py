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


"""Does the framing of NMEA sentences find what is good and count what is not."""

from __future__ import annotations

from driver_fakes import data_lines
from hypothesis import given
from hypothesis import strategies as st
import pytest
from rt_robot_os.devices.nmea.wire import MAX_SENTENCE
from rt_robot_os.devices.nmea.wire import NmeaDecoder
from rt_robot_os.devices.nmea.wire import sentence

GGA = b'$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n'


def test_a_sentence_of_the_manual() -> None:
    frame, = NmeaDecoder().feed(GGA)
    assert (frame.sentence, frame.address, frame.end) == (GGA, 'GPGGA', len(GGA))


@pytest.mark.parametrize('line', [
    GGA[:-2] + b'\n', GGA.replace(b'*47', b'*47'.lower()), b'$PUBX,00*33\r\n',
    sentence('X').replace(b'*58', b'*58')])
def test_variants_that_receivers_send(line: bytes) -> None:
    decoder = NmeaDecoder()
    assert len(decoder.feed(line)) == 1
    assert decoder.rejected_bytes == 0


@pytest.mark.parametrize('line, bad_sums', [
    (GGA.replace(b'*47', b'*48'), 1), (GGA.replace(b'4807', b'4808'), 1),
    (GGA.replace(b'*47', b''), 0), (GGA.replace(b'*47', b'*4'), 0),
    (GGA.replace(b'*47', b'*4G'), 0),
    (b'$*00\r\n', 0), (b'$\r\n', 0), (b'\r\n', 0), (GGA[1:], 0), (GGA.replace(b'N', b'\x00'), 0),
    (GGA.replace(b'N', b'\xce'), 0), (GGA.replace(b',N', b',N\r'), 0), (b'\n' * 50, 0)])
def test_what_is_no_sentence_is_rejected(line: bytes, bad_sums: int) -> None:
    decoder = NmeaDecoder()
    assert decoder.feed(line) == []
    assert [f.sentence for f in decoder.feed(GGA)] == [GGA]
    assert (decoder.rejected_bytes, decoder.rejected_frames) == (len(line), bad_sums)


def test_a_sentence_that_was_cut_off_does_not_take_the_next_along() -> None:
    decoder = NmeaDecoder()
    assert [f.sentence for f in decoder.feed(GGA[:30] + GGA)] == [GGA]
    assert decoder.rejected_bytes == 30


def test_the_longest_sentence_and_one_more() -> None:
    longest = sentence('G' * (MAX_SENTENCE - 6))
    assert len(longest) == MAX_SENTENCE
    assert len(NmeaDecoder().feed(longest)) == 1
    decoder = NmeaDecoder()
    assert decoder.feed(sentence('G' * (MAX_SENTENCE - 5)) + GGA)[0].sentence == GGA
    assert decoder.rejected_bytes == MAX_SENTENCE + 1


@pytest.mark.parametrize('filler', [b'$', b'a', b'$a', b'\n', b'$GPGGA,'])
def test_memory_stays_bounded_whatever_comes(filler: bytes) -> None:
    decoder = NmeaDecoder()
    for _ in range(20):
        decoder.feed(filler * 1000)
        assert decoder.pending_bytes < MAX_SENTENCE


@given(content=st.text(st.characters(min_codepoint=32, max_codepoint=126, exclude_characters='$*'),
                       min_size=1, max_size=MAX_SENTENCE - 6))
def test_every_sentence_comes_out_as_it_went_in(content: str) -> None:
    frame, = NmeaDecoder().feed(sentence(content))
    assert frame.sentence[1:-5].decode() == content
    assert frame.address == content.split(',')[0]


@pytest.mark.parametrize('name', [
    'haicom-305N', 'quectel', 'telit-he910', 'ublox-neo-m9n-nmea'])
def test_every_line_of_the_recordings_is_a_sentence(name: str) -> None:
    lines = data_lines(f'gps/{name}.log')
    decoder = NmeaDecoder()
    assert [f.sentence for f in decoder.feed(b''.join(lines))] == lines
    assert decoder.rejected_bytes == 0
