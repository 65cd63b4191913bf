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
"""Does every receiver give one fix an epoch, whichever of its sentences say where it is."""

from __future__ import annotations

from functools import partial
import math
from typing import Any

from driver_fakes import scripted
from gps_streams import APPROXIMATED
from gps_streams import diagonal
from gps_streams import DIAGONAL_KNOWN
from gps_streams import FIX
from gps_streams import GBAS
from gps_streams import GLONASS
from gps_streams import GPS
from gps_streams import NO_FIX
from gps_streams import publish
from gps_streams import SBAS
from gps_streams import UNKNOWN
from hypothesis import given
from hypothesis import strategies as st
import pytest
from rt_robot_os.devices.nmea.driver import NmeaGps
from rt_robot_os.devices.nmea.wire import sentence
from test_nmea import gga
from test_nmea import gll
from test_nmea import gns
from test_nmea import gst
from test_nmea import PLACE
from test_nmea import rmc

S = 1_000_000_000
KINDS = {'gga': gga, 'gns': gns, 'rmc': rmc, 'gll': gll}


def clock(number: int) -> str:
    return f'1235{number:02d}.00'


def statuses(*chunks: bytes) -> list[int]:
    return [f.status.status for f in publish(*chunks)[0].samples]


@pytest.mark.parametrize('kind', KINDS)
def test_a_receiver_that_sends_one_kind_alone_gives_each_of_its_fixes(kind: str) -> None:
    fixes, _, _ = publish(*(KINDS[kind](clock(n)) for n in range(6)))
    assert [f.status.status for f in fixes.samples] == [FIX] * 6
    assert all(f.latitude == pytest.approx(48.1173) for f in fixes.samples)
    known = kind in ('gga', 'gns')
    assert [math.isnan(f.altitude) for f in fixes.samples] == [not known] * 6


@pytest.mark.parametrize('kinds', [
    ('rmc', 'gga'), ('gll', 'rmc', 'gns'), ('gll', 'rmc'), ('gns', 'gga', 'rmc', 'gll'),
    ('gll', 'gns', 'rmc')])
def test_the_best_kind_that_is_sent_gives_the_fix_and_the_others_none(
    kinds: tuple[str, ...],
) -> None:
    # They differ in what they know: GGA and GNS the height, GGA the dilution 1.5.
    order = ('gga', 'gns', 'rmc', 'gll')
    best = min(kinds, key=order.index)
    epochs = [b''.join(gga(clock(n), hdop='1.5') if k == 'gga' else KINDS[k](clock(n))
                       for k in kinds) for n in range(8)]
    fixes, _, _ = publish(*epochs)
    assert len(fixes.samples) == 8
    expected = {'gga': (1.5 * 5) ** 2, 'gns': (0.9 * 5) ** 2, 'rmc': 0.0, 'gll': 0.0}[best]
    assert [diagonal(f)[0] for f in fixes.samples] == pytest.approx([expected] * 8)


def test_what_comes_before_the_first_gga_gives_no_fix_of_its_own() -> None:
    # Opened in the middle of an epoch.
    assert len(statuses(rmc(clock(0)) + gll(clock(0)), gga(clock(1)) + rmc(clock(1)) + gll(
        clock(1)), gga(clock(2)) + rmc(clock(2)))) == 2


def test_a_fix_that_was_held_has_its_own_moment() -> None:
    with scripted(NmeaGps, [rmc(clock(n)) for n in range(3)]) as (device, (fixes, times)):
        for n in range(3):
            device.read((n + 1) * S)
        assert fixes.stamps == times.stamps == [1 * S, 2 * S, 3 * S]


def test_a_single_sentence_gives_its_fix_when_nothing_better_comes() -> None:
    with scripted(NmeaGps, [gll(), b'', b'']) as (device, (fixes, _)):
        device.read(1 * S)
        device.read(2 * S)
        assert fixes.samples == []
        device.read(4 * S)
        assert [f.status.status for f in fixes.samples] == [FIX]
        assert fixes.stamps == [1 * S]


def test_two_talkers_give_one_fix_an_epoch() -> None:
    fixes, _, _ = publish(*(gga(clock(n)) + gga(clock(n), talker='GL') for n in range(5)))
    assert len(fixes.samples) == 5
    assert fixes.samples[-1].status.service == GPS | GLONASS


def test_the_talker_with_a_fix_is_taken_where_the_first_has_none() -> None:
    epochs = [gga(clock(n), quality=int(n < 2)) + gga(clock(n), talker='GL') for n in range(6)]
    assert statuses(*epochs) == [FIX, FIX, NO_FIX, FIX, FIX, FIX, FIX]


def test_two_talkers_of_rmc_tell_the_time_once() -> None:
    _, times, _ = publish(*(rmc(clock(n)) + rmc(clock(n), talker='GN') for n in range(4)))
    assert len(times.samples) == 4


def test_a_clock_that_stands_still_is_no_reason_to_say_nothing() -> None:
    assert statuses(*[gga('', 0)] * 3) == [NO_FIX] * 3
    assert statuses(*[gga('000000.00', 0)] * 3) == [NO_FIX] * 3
    empty = sentence('GPRMC,,V,,,,,,,,,,N')
    assert statuses(*[empty] * 3) == [NO_FIX] * 3


def test_a_better_kind_takes_over_and_gives_no_second_fix_of_its_epoch() -> None:
    chunks = [rmc(clock(n)) for n in range(3)]
    chunks += [rmc(clock(n)) + gga(clock(n)) for n in range(3, 6)]
    fixes, _, _ = publish(*chunks)
    assert len(fixes.samples) == 6
    assert [math.isnan(f.altitude) for f in fixes.samples] == [True] * 5 + [False]


def test_a_receiver_that_stops_sending_gga_goes_on_with_what_is_left() -> None:
    chunks = [gga(clock(n)) + rmc(clock(n)) for n in range(3)]
    chunks += [rmc(clock(n)) for n in range(3, 20)]
    fixes, _, _ = publish(*chunks)
    assert len(fixes.samples) == 20
    assert [math.isnan(f.altitude) for f in fixes.samples] == [False] * 3 + [True] * 17


def test_gga_every_fifth_epoch_gives_the_fix_of_that_epoch_and_rmc_the_others() -> None:
    chunks = [(gga(clock(n)) if n % 5 == 0 else b'') + rmc(clock(n)) for n in range(25)]
    fixes, _, _ = publish(*chunks)
    assert [math.isnan(f.altitude) for f in fixes.samples] == [n % 5 != 0 for n in range(25)]


def test_one_gga_a_minute_delays_no_fix_of_a_receiver_that_sends_gns() -> None:
    chunks = [(gga(f'12{n // 60:02d}{n % 60:02d}.00') if n % 60 == 30 else b'')
              + gns(f'12{n // 60:02d}{n % 60:02d}.00') for n in range(180)]
    with scripted(NmeaGps, chunks) as (device, (fixes, _)):
        for n in range(180):
            device.read((n + 1) * S)
            # The first is held until it is clear that nothing better comes.
            assert len(fixes.samples) == (n + 1 if n else 0)


@pytest.mark.parametrize('between', [1, 3, 30])
def test_another_talker_takes_over_without_a_gap(between: int) -> None:
    """Of GN, then GP alone, then GN again: each epoch gives its fix when its sentence comes."""
    talkers = ['GN'] * 20 + ['GP'] * between + ['GN'] * 20
    chunks = [gga(clock(n % 60), talker=talker) for n, talker in enumerate(talkers)]
    with scripted(NmeaGps, chunks) as (device, (fixes, _)):
        for n in range(len(talkers)):
            device.read((n + 1) * S)
            assert len(fixes.samples) == n + 1
    assert fixes.stamps == [(n + 1) * S for n in range(len(talkers))]


def test_a_late_sentence_of_the_epoch_before_gives_no_fix() -> None:
    chunks = [gga(clock(n)) + rmc(clock(max(n - 1, 0))) for n in range(10)]
    fixes, _, _ = publish(*chunks)
    assert len(fixes.samples) == 10
    assert not any(math.isnan(f.altitude) for f in fixes.samples)


SENTENCES = {'gga': gga, 'gns': gns, 'rmc': rmc, 'gll': gll,
             'GN gga': partial(gga, talker='GN'), 'GN rmc': partial(rmc, talker='GN')}


@given(st.lists(st.lists(st.sampled_from(sorted(SENTENCES)), min_size=1, max_size=6, unique=True),
                min_size=3, max_size=40))
def test_each_epoch_gives_one_fix_whatever_the_receiver_sends(epochs: list[list[str]]) -> None:
    # The first epochs show which sentences there are; in the last ones nothing is held.
    ends = [['gga'], ['gga']]
    course = [*ends, *epochs, *ends]
    fixes, _, _ = publish(*(b''.join(SENTENCES[name](clock(n)) for name in each)
                            for n, each in enumerate(course)))
    assert [f.status.status for f in fixes.samples] == [FIX] * len(course)


# --- the receiver's own "no fix" ----------------------------------------------------------------

@pytest.mark.parametrize('quality', [1, 2, 4])
def test_a_position_of_no_satellite_is_no_fix(quality: int) -> None:
    assert statuses(gga(quality=quality, satellites='00')) == [NO_FIX]
    assert statuses(gga(quality=quality, satellites='0')) == [NO_FIX]
    assert statuses(gga(quality=quality, satellites='')) != [NO_FIX]
    assert set(statuses(*[gns(satellites='00')] * 2)) == {NO_FIX}


GSA = 'GNGSA,A,3,{},,,,,,,,,,1.9,1.0,1.6'


def test_a_count_of_0_satellites_is_not_believed_where_gsa_and_rmc_deny_it() -> None:
    """As furuno receivers count with corrections of SBAS."""
    epochs = [gga(clock(n), quality=2, satellites='00') + sentence(GSA.format('05,12,30'))
              + rmc(clock(n)) for n in range(6)]
    assert statuses(*epochs) == [NO_FIX] + [SBAS] * 5
    # Of too few satellites, or where RMC warns, there is none.
    few = [each.replace(sentence(GSA.format('05,12,30')), sentence(GSA.format('05,12,')))
           for each in epochs]
    assert statuses(*few) == [NO_FIX] * 6
    warned = [gga(clock(n), quality=2, satellites='00') + sentence(GSA.format('05,12,30'))
              + rmc(clock(n), status='V') for n in range(6)]
    assert statuses(*warned) == [NO_FIX] * 6


@pytest.mark.parametrize('mode, status', [
    ('', FIX), (',', FIX), (',A', FIX), (',D', SBAS), (',P', FIX), (',R', GBAS), (',F', GBAS),
    (',E', NO_FIX), (',M', NO_FIX), (',S', NO_FIX), (',N', NO_FIX), (',A,V', FIX),
    (',E,V', NO_FIX)])
def test_the_mode_of_rmc_and_gll_is_a_quality(mode: str, status: int) -> None:
    assert statuses(*[rmc(mode=mode)] * 2) == [status] * 2
    assert statuses(*[gll(mode=mode)] * 2) == [status] * 2
    assert statuses(*[rmc(status='V', mode=mode)] * 2) == [NO_FIX] * 2


@pytest.mark.parametrize('mode, status', [
    ('A', FIX), ('NA', FIX), ('NNNN', NO_FIX), ('', NO_FIX), ('DA', SBAS), ('RFAA', GBAS),
    ('NF', GBAS), ('EE', NO_FIX), ('x', NO_FIX)])
def test_the_modes_of_gns_count_for_all_systems(mode: str, status: int) -> None:
    assert statuses(*[gns(mode=mode)] * 2) == [status] * 2


@pytest.mark.parametrize('mode', 'EMSN')
def test_a_gga_whose_rmc_is_dead_reckoning_is_no_fix(mode: str) -> None:
    fixes, times, statistics = publish(rmc(mode=',' + mode) + gga())
    assert [f.status.status for f in fixes.samples] == [NO_FIX]
    assert statistics.contradicted_samples == 1
    # The time is good: the receiver does not warn.
    assert len(times.samples) == 1


def test_a_letter_that_nobody_knows_takes_no_fix_away() -> None:
    assert statuses(rmc(mode=',Q') + gga()) == [FIX]


# --- what RMC and GLL do not say -----------------------------------------------------------------

def covariance_of(*chunks: bytes) -> Any:
    return publish(*chunks)[0].samples[-1]


def test_the_dilution_of_gsa_counts_where_the_sentence_has_none() -> None:
    gsa = sentence('GPGSA,A,3,05,12,30,,,,,,,,,,2.5,1.5,2.0')
    fix = covariance_of(*[gsa + rmc(clock(n)) for n in range(3)])
    assert fix.position_covariance_type == APPROXIMATED
    assert diagonal(fix) == pytest.approx([7.5 ** 2, 7.5 ** 2, 10.0 ** 2])


def test_gst_counts_for_every_kind() -> None:
    fix = covariance_of(*[rmc(clock(n)) + gst(clock(n)) for n in range(3)])
    assert fix.position_covariance_type == DIAGONAL_KNOWN
    assert covariance_of(*[rmc(clock(n)) for n in range(3)]).position_covariance_type == UNKNOWN


def test_lines_that_end_in_two_carriage_returns() -> None:
    line = gga().replace(b'\r\n', b'\r\r\n')
    fixes, _, statistics = publish(line * 3)
    assert len(fixes.samples) == 3
    assert statistics.rejected_bytes == 0


@pytest.mark.parametrize('text', [
    'nan', 'inf', '-inf', '1_0', '1e1', '0x1', ' 1', '1 ', '1' * 13, '+', '.', '1.2.3'])
def test_what_is_no_plain_number_is_none(text: str) -> None:
    fix = covariance_of(gga(hdop=text))
    assert (fix.status.status, fix.position_covariance_type) == (FIX, UNKNOWN)
    assert math.isnan(covariance_of(gga(height=f'{text},M,46.9,M')).altitude)
    for position in (f'{text},N,01131.000,E', f'4807.038,N,{text},E'):
        assert covariance_of(gga(position=position)).status.status == NO_FIX


@pytest.mark.parametrize('position, expected', [
    (PLACE, 48.1173), ('4760.000,N,01131.000,E', 48.0), ('807.038,N,01131.000,E', 8.1173)])
def test_angles_as_receivers_write_them(position: str, expected: float) -> None:
    assert covariance_of(gga(position=position)).latitude == pytest.approx(expected)


@pytest.mark.parametrize('position', [
    '4860.001,N,01131.000,E', '9000.001,N,01131.000,E', '4807.038,n,01131.000,E',
    '4807.038,NS,01131.000,E', '-4807.038,N,01131.000,E'])
def test_angles_that_are_none(position: str) -> None:
    assert covariance_of(gga(position=position)).status.status == NO_FIX


def test_a_device_of_other_sentences_is_told_which_they_are() -> None:
    vectornav = sentence('VNYMR,+100.9,-000.3,+003.5,+1.0,+0.1,+1.9,+00.1,-00.7,-09.8,+0,+0,+0')
    with scripted(NmeaGps, [vectornav + sentence('GPGSV,1,1,00')]) as (device, _):
        device.read(1)
        assert 'it sends GPGSV, VNYMR but none of GGA, GNS, RMC and GLL' in device.unused()
