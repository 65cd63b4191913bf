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
"""Does our parser of sentences agree with another one, where that one is installed."""

from __future__ import annotations

from datetime import date
from datetime import time
from typing import Any

from driver_fakes import data_lines
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest
from rt_robot_os.devices.nmea.sentences import GsaSentence
from rt_robot_os.devices.nmea.sentences import GstSentence
from rt_robot_os.devices.nmea.sentences import parse
from rt_robot_os.devices.nmea.sentences import PositionSentence
from rt_robot_os.devices.nmea.wire import sentence

pynmeagps = pytest.importorskip('pynmeagps', reason='the other parser is not installed')

KINDS = ('GGA', 'GNS', 'RMC', 'GLL', 'GSA', 'GST')


def absent(value: Any) -> Any:
    """Give what the other parser says, '' being nothing."""
    return None if value == '' else value


def clock(value: Any) -> int | None:
    if not isinstance(value, time):
        return None
    return ((value.hour * 60 + value.minute) * 60 + value.second) * 10**9 + (
        value.microsecond * 1000)


def near(ours: float | None, theirs: Any) -> bool:
    theirs = absent(theirs)
    return (ours is None) == (theirs is None) and (
        ours is None or ours == pytest.approx(theirs, abs=1e-8))


def check_position(ours: PositionSentence, other: Any) -> None:
    assert ours.time_ns == clock(other.time)
    if absent(other.lat) is None or absent(other.lon) is None:
        assert ours.position_deg is None
    else:
        assert ours.position_deg == pytest.approx((other.lat, other.lon), abs=1e-8)
    if ours.kind in ('GGA', 'GNS'):
        assert ours.satellites == absent(other.numSV)
        assert near(ours.hdop, other.HDOP)
        assert near(ours.height_m, other.alt)
        assert near(ours.separation_m, other.sep)
    if ours.kind == 'GGA':
        assert ours.quality == other.quality
    if ours.kind in ('RMC', 'GLL'):
        assert ours.warns == (other.status != 'A')
    if ours.kind == 'RMC':
        assert ours.day == (other.date if isinstance(other.date, date) else None)


def check(line: bytes) -> bool:
    """Compare one line; False when it is none that we read."""
    ours = parse(line[1:line.index(b'*')].decode())
    if ours is None:
        return False
    other = pynmeagps.NMEAReader.parse(line)
    if isinstance(ours, PositionSentence):
        check_position(ours, other)
    elif isinstance(ours, GstSentence):
        assert ours.time_ns == clock(other.time)
        assert near(ours.north_m, other.stdLat)
        assert near(ours.east_m, other.stdLong)
        assert near(ours.up_m, other.stdAlt)
    else:
        assert isinstance(ours, GsaSentence)
        used = [getattr(other, f'svid_{i:02d}') for i in range(1, 13)]
        assert list(ours.satellites) == [n for n in used if n != '']
        assert near(ours.hdop, other.HDOP)
        assert near(ours.vdop, other.VDOP)
    return True


@pytest.mark.parametrize('name, count', [
    ('ublox-neo-m9n-nmea', 61 * 4 + 244), ('haicom-305N', 173), ('telit-he910', 896),
    ('quectel', 126)])
def test_every_sentence_of_the_recordings(name: str, count: int) -> None:
    assert sum(map(check, data_lines(f'gps/{name}.log'))) == count


def numbers(most: float, digits: int) -> Any:
    return st.floats(0, most).map(lambda v: f'{v:.{digits}f}') | st.just('')


CLOCKS = st.times().map(lambda t: f'{t:%H%M%S}.{t.microsecond // 10000:02d}') | st.just('')
DATES = st.dates(date(1980, 1, 6), date(2067, 12, 31)).map(lambda d: f'{d:%d%m%y}')
PLACES = st.tuples(
    st.integers(0, 89), st.integers(0, 599999), st.sampled_from('NS'), st.integers(0, 179),
    st.integers(0, 599999), st.sampled_from('EW')).map(
        lambda p: f'{p[0]:02d}{p[1] / 10000:07.4f},{p[2]},{p[3]:03d}{p[4] / 10000:07.4f},{p[5]}')
SENTENCES = st.one_of(
    st.tuples(st.just('GPGGA'), CLOCKS, PLACES, st.integers(0, 8).map(str),
              st.integers(0, 12).map(lambda n: f'{n:02d}'), numbers(50, 1), numbers(9000, 1),
              st.just('M'), numbers(100, 1), st.just('M,,')),
    st.tuples(st.just('GNGNS'), CLOCKS, PLACES, st.sampled_from(['AN', 'NN', 'DD']),
              st.integers(0, 40).map(lambda n: f'{n:02d}'), numbers(50, 1), numbers(9000, 1),
              numbers(100, 1), st.just(',')),
    st.tuples(st.just('GPRMC'), CLOCKS, st.sampled_from('AV'), PLACES, numbers(100, 2),
              numbers(359, 1), DATES, st.just(',,A')),
    st.tuples(st.just('GPGLL'), PLACES, CLOCKS, st.sampled_from('AV'), st.just('A')),
    st.tuples(st.just('GNGST'), CLOCKS, numbers(50, 1), st.just(',,'), numbers(50, 2),
              numbers(50, 2), numbers(50, 2)))


@settings(max_examples=300, deadline=None)
@given(parts=SENTENCES)
def test_sentences_of_any_values(parts: tuple[str, ...]) -> None:
    assert check(sentence(','.join(parts)))
