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

"""Are the sentences of a StarGazer read right, in all three forms, and damaged ones dropped."""

from __future__ import annotations

import json

from driver_fakes import DATA
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest
from rt_robot_os.devices.stargazer import wire
from rt_robot_os.devices.stargazer.wire import CeilingMark
from rt_robot_os.devices.stargazer.wire import is_stargazer
from rt_robot_os.devices.stargazer.wire import StarGazerDecoder

NUMBERS = st.integers(0, 999_999)
LENGTHS = st.integers(-99_999, 99_999).map(lambda each: each / 100)
MARKS = st.builds(CeilingMark, NUMBERS, st.integers(-18_000, 18_000).map(lambda each: each / 100),
                  LENGTHS, LENGTHS, st.integers(1, 65_000).map(lambda each: each / 100))


@pytest.mark.parametrize('text, mode, marks', [
    ('~^I+150.23|-33.12|+12.00|64`', 'I', [CeilingMark(64, 150.23, -33.12, 12.0, None)]),
    ('~^F+150.23|-33.12|+12.00|64`', 'F', [CeilingMark(64, 150.23, -33.12, 12.0, None)]),
    ('~^Z+150.23|-33.12|+12.00|64`', 'Z', [CeilingMark(64, 150.23, -33.12, 12.0, None)]),
    ('~^I24706|-96.61|-48.13|-21.35|221.64`', 'I',
     [CeilingMark(24706, -96.61, -48.13, -21.35, 221.64)]),
    ('~^F48|+1|2|-3|-182.39`', 'F', [CeilingMark(48, 1.0, 2.0, -3.0, 182.39)]),
    ('~^124706|-96.61|-48.13|-21.35|221.64`', 'I',
     [CeilingMark(24706, -96.61, -48.13, -21.35, 221.64)]),
    ('~^148|-175.91|+98.74|+7.10|182.39`', 'I', [CeilingMark(48, -175.91, 98.74, 7.1, 182.39)]),
    ('~^224706|-96.28|-48.90|-21.13|220.50|24594|-94.27|+101.58|-17.80|230.71`', 'I',
     [CeilingMark(24706, -96.28, -48.9, -21.13, 220.5),
      CeilingMark(24594, -94.27, 101.58, -17.8, 230.71)])])
def test_sentences_of_vendor_and_drivers(text: str, mode: str, marks: list[CeilingMark]) -> None:
    frame, = StarGazerDecoder().feed(text.encode())
    assert (frame.mode, list(frame.marks), frame.size) == (mode, marks, len(text))


def test_every_sentence_of_the_collection() -> None:
    path = DATA / 'stargazer' / 'strings.json'
    if not path.exists():
        pytest.skip('the recorded data is not here')
    for each in json.loads(path.read_text()):
        frame, = StarGazerDecoder().feed(each['text'].encode())
        assert [list(mark) for mark in frame.marks] == each['landmarks'], each['text']
        assert frame.is_dead_zone == (each['format'] == 'notice')


@pytest.mark.parametrize('text', ['~*DeadZone`', '~*Dead zone`', '~*deadzone`'])
def test_dead_zones(text: str) -> None:
    frame, = StarGazerDecoder().feed(text.encode())
    assert frame.is_dead_zone and not frame.marks


@pytest.mark.parametrize('text', [
    '~^`', '~^I`', '~^0`', '~^X+1|2|3|4`', '~^I+1|2|3`', '~^I1|2|3|4|5|6`', '~^11|2|3|4`',
    '~^21|2|3|4|5`', '~^11|2|3|4|5|6`', '~^I+181.00|0|0|4`', '~^Inan|0|0|4`', '~^I+1|1e9|0|4`',
    '~^I+1.2.3|1|0|4`', '~^I+1|1_0|0|4`', '~^I+1|123456|0|4`', '~^I+1|0|0|-4`', '~^I |0|0|4`',
    '~^11|+-2|3|4|5`', '~^1|2|3|4|5`'])
def test_a_measurement_that_cannot_be_is_none(text: str) -> None:
    decoder = StarGazerDecoder()
    assert decoder.feed(text.encode() + b'~*X`')[0].content == 'X'
    assert (decoder.rejected_frames, decoder.rejected_bytes) == (1, len(text))


def test_a_beginning_in_the_middle_begins_anew() -> None:
    decoder = StarGazerDecoder()
    frames = decoder.feed(b'~^124706|-96.61|-48~^148|-175.91|+98.74|+7.10|182.39`')
    assert [frame.marks[0].number for frame in frames] == [48]
    assert decoder.rejected_bytes == 19


def test_a_sentence_without_an_end_is_dropped() -> None:
    decoder = StarGazerDecoder()
    assert decoder.feed(b'~^1' + b'0' * 400) == []
    assert decoder.pending_bytes == 0
    assert len(decoder.feed(b'~*DeadZone`')) == 1


@settings(max_examples=100, deadline=None)
@given(marks=st.lists(MARKS, min_size=1, max_size=5), cut=st.integers(0, 400))
def test_what_is_written_is_read(marks: list[CeilingMark], cut: int) -> None:
    first = marks[0]
    stream = (wire.multi(marks) + wire.single(first, 'F')
              + wire.old(first._replace(z_cm=None), 'Z'))
    decoder = StarGazerDecoder()
    frames = decoder.feed(stream[:cut]) + decoder.feed(stream[cut:])
    assert [list(frame.marks) for frame in frames] == [
        marks, [first], [first._replace(z_cm=None)]]
    assert decoder.rejected_bytes == 0


@settings(max_examples=100, deadline=None)
@given(text=st.text('~`^*!IFZ0123456789|+-. ', max_size=80))
def test_any_text_is_read_or_rejected(text: str) -> None:
    decoder = StarGazerDecoder()
    framed = 0
    for frame in decoder.feed(text.encode()):
        framed += frame.size
        assert all(abs(mark.angle_deg) <= 180 for mark in frame.marks)
    assert len(text) == framed + decoder.rejected_bytes + decoder.pending_bytes


def test_it_is_recognised_from_the_middle() -> None:
    stream = wire.multi([CeilingMark(48, 1.0, 2.0, 3.0, 200.0)]) * 4
    assert is_stargazer(stream[11:])
    assert is_stargazer(b'one`~*DeadZone`~*DeadZone`')
    assert not is_stargazer(b'~~~```^^|||' * 30)
