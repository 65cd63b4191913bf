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

"""Does the NMEA driver say where the receiver is, how well it knows, and when it does not."""

from __future__ import annotations

from datetime import datetime
from datetime import timezone
import math
from typing import Any

from driver_contract import DriverContract
from driver_fakes import scripted
from gps_streams import APPROXIMATED
from gps_streams import COMPASS
from gps_streams import diagonal
from gps_streams import DIAGONAL_KNOWN
from gps_streams import FIX
from gps_streams import GALILEO
from gps_streams import GBAS
from gps_streams import GLONASS
from gps_streams import GPS
from gps_streams import NO_FIX
from gps_streams import publish
from gps_streams import SBAS
from gps_streams import UNKNOWN
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest
from rt_robot_os.devices.nmea.driver import NmeaGps
from rt_robot_os.devices.nmea.wire import NmeaDecoder
from rt_robot_os.devices.nmea.wire import sentence


PLACE = '4807.038,N,01131.000,E'


def gga(time: str = '123519.00', quality: object = 1, hdop: str = '0.9', *,
        talker: str = 'GP', height: str = '545.4,M,46.9,M', position: str = PLACE,
        satellites: str = '08') -> bytes:
    return sentence(f'{talker}GGA,{time},{position},{quality},{satellites},{hdop},{height},,')


def rmc(time: str = '123519.00', status: str = 'A', date: str = '230394', *, mode: str = '',
        talker: str = 'GP', position: str = PLACE) -> bytes:
    return sentence(f'{talker}RMC,{time},{status},{position},022.4,084.4,{date},003.1,W{mode}')


def gns(time: str = '123519.00', mode: str = 'AANN', *, satellites: str = '14',
        height: str = '545.4,46.9', talker: str = 'GN') -> bytes:
    return sentence(f'{talker}GNS,{time},{PLACE},{mode},{satellites},0.9,{height},,')


def gll(time: str = '123519.00', status: str = 'A', mode: str = ',A') -> bytes:
    return sentence(f'GPGLL,{PLACE},{time},{status}{mode}')


def gst(time: str = '123519.00', deviations: str = '2.0,3.0,4.0') -> bytes:
    return sentence(f'GNGST,{time},1,,,,{deviations}')


def fix_of(*chunks: bytes, **changes: Any) -> Any:
    """Give the last fix."""
    return publish(*chunks, **changes)[0].samples[-1]


class TestNmea(DriverContract):
    driver = NmeaGps
    stream = b''.join((gga('123519.00'), rmc('123519.00'), gst('123519.00'),
                       gga('123520.00'), rmc('123520.00')))
    samples = 4
    tokens = (b'$', b'\r\n', b'*', b'$GPGGA,', gga(), gga(quality='x'), rmc(), rmc(status='V'),
              gst(), sentence('GPGGA'), sentence('GPRMC,nan,A,inf,,,,,,999999'))
    vectors = ((gga(), {'latitude': 48.1173, 'longitude': 11.516667, 'altitude': 592.3}),
               (gga(position='4807.038,S,01131.000,W'),
                {'latitude': -48.1173, 'longitude': -11.516667}))
    # The message says so where there is no fix, or no height.
    unknown = ('latitude', 'longitude', 'altitude')

    def decoder(self) -> Any:
        return NmeaDecoder()

    def frame_size(self, frame: Any) -> int:
        return len(frame.sentence)


# --- position and status ------------------------------------------------------------------------

def test_position_and_ellipsoidal_altitude() -> None:
    fix = fix_of(b'$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n')
    assert (fix.latitude, fix.longitude) == pytest.approx((48.1173, 11.5166667), abs=1e-7)
    assert fix.altitude == pytest.approx(592.3)
    assert fix.status.status == FIX
    assert fix.status.service == GPS


@pytest.mark.parametrize('position, expected', [
    ('4807.038,S,01131.000,W', (-48.1173, -11.516666667)),
    ('0000.000,N,00000.000,E', (0.0, 0.0)),
    ('9000.000,S,18000.000,W', (-90.0, -180.0))])
def test_hemispheres(position: str, expected: tuple[float, float]) -> None:
    fix = fix_of(gga(position=position))
    assert (fix.latitude, fix.longitude) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize('quality, status', [
    (0, NO_FIX), (1, FIX), (2, SBAS), (3, FIX), (4, GBAS), (5, GBAS), (6, NO_FIX), (7, NO_FIX),
    (8, NO_FIX), (9, SBAS), (10, NO_FIX), (-1, NO_FIX), ('', NO_FIX)])
def test_each_quality_has_its_status_and_no_fix_has_no_position(quality: Any, status: int) -> None:
    fix = fix_of(gga(quality=quality))
    assert fix.status.status == status
    for value in (fix.latitude, fix.longitude, fix.altitude):
        assert math.isnan(value) == (status == NO_FIX)
    assert fix.position_covariance_type == (UNKNOWN if status == NO_FIX else APPROXIMATED)
    if status == NO_FIX:
        assert diagonal(fix) == [0, 0, 0]


@pytest.mark.parametrize('position', [
    ',N,01131.000,E', '4807.038,,01131.000,E', '4807.038,N,,', 'nan,N,inf,E', ',,,',
    '9107.038,N,01131.000,E', '4807.038,N,18131.000,E', '4807.038,X,01131.000,E', '48,N,11,E'])
def test_a_fix_without_a_sensible_position_is_none(position: str) -> None:
    fix = fix_of(gga(position=position))
    assert fix.status.status == NO_FIX
    assert math.isnan(fix.latitude)


@pytest.mark.parametrize('height', [
    '545.4,M,,', '545.4,M,,M', ',M,46.9,M', ',,,', 'nan,M,46.9,M', '545.4,M,inf,M',
    '545.4,F,46.9,M'])
def test_an_altitude_that_is_not_known_above_the_ellipsoid_is_nan(height: str) -> None:
    fix = fix_of(gga(height=height))
    assert math.isnan(fix.altitude)
    assert fix.status.status == FIX
    assert fix.latitude == pytest.approx(48.1173)


# --- covariance ---------------------------------------------------------------------------------

def test_gst_of_the_same_epoch_is_used_east_first() -> None:
    fix = fix_of(gst('123519.00', '2.0,3.0,4.0') + gga('123519.00'))
    assert fix.position_covariance_type == DIAGONAL_KNOWN
    assert diagonal(fix) == [9, 4, 16]


def test_gst_of_the_previous_epoch_is_used_and_no_older_one() -> None:
    fixes, _, _ = publish(gga('1.00'.zfill(9)) + gst('000001.00') + gga('000002.00')
                          + gga('000003.00'))
    assert [f.position_covariance_type for f in fixes.samples] == [
        APPROXIMATED, DIAGONAL_KNOWN, APPROXIMATED]


@pytest.mark.parametrize('deviations', [',3.0,4.0', '2.0,,4.0', 'nan,3.0,4.0', '0.0,0.0,0.0', ''])
def test_gst_without_the_horizontal_deviations_is_not_used(deviations: str) -> None:
    fix = fix_of(gst(deviations=deviations) + gga())
    assert fix.position_covariance_type == APPROXIMATED


def test_gst_without_the_vertical_one_takes_twice_the_horizontal() -> None:
    assert diagonal(fix_of(gst(deviations='2.0,3.0,') + gga())) == [9, 4, 36]


def test_dilution_times_range_error_otherwise() -> None:
    assert diagonal(fix_of(gga(hdop='1.5'), uere_m=4.0)) == [36, 36, 144]


def test_vertical_dilution_of_gsa_is_used_for_five_epochs() -> None:
    gsa = sentence('GPGSA,A,3,05,12,30,,,,,,,,,,2.5,1.5,2.0')
    fixes, _, _ = publish(gsa + gga(hdop='1.5') * 8, uere_m=1.0)
    assert [diagonal(f)[2] for f in fixes.samples] == [4] * 6 + [9] * 2


def test_vertical_dilution_of_zero_is_none() -> None:
    gsa = sentence('GPGSA,A,2,05,12,30,,,,,,,,,,17.0,17.0,0.0')
    assert diagonal(fix_of(gsa + gga(hdop='1.0'), uere_m=1.0)) == [1, 1, 4]


@pytest.mark.parametrize('hdop', ['', '0.0', '99.99', 'nan', '-1'])
def test_without_a_dilution_the_covariance_is_unknown(hdop: str) -> None:
    fix = fix_of(gga(hdop=hdop))
    assert fix.status.status == FIX
    assert fix.position_covariance_type == UNKNOWN
    assert diagonal(fix) == [0, 0, 0]


# --- services -----------------------------------------------------------------------------------

@pytest.mark.parametrize('talker, service', [
    ('GP', GPS), ('GL', GLONASS), ('GA', GALILEO), ('GB', COMPASS), ('BD', COMPASS), ('GN', 0)])
def test_services_by_talker(talker: str, service: int) -> None:
    assert fix_of(gga(talker=talker)).status.service == service


@pytest.mark.parametrize('used, system, service', [
    ('29,20', ',1', GPS), ('82,73', ',2', GLONASS), ('03,05', ',3', GALILEO),
    ('32,28', ',4', COMPASS), ('', ',3', 0), ('29', '', GPS), ('82', '', GLONASS),
    ('301', '', GALILEO), ('401', '', COMPASS), ('', '', 0)])
def test_services_of_gsa_with_and_without_system_number(
    used: str, system: str, service: int,
) -> None:
    satellites = ','.join((used.split(',') + [''] * 12)[:12])
    gsa = sentence(f'GNGSA,A,3,{satellites},0.99,0.54,0.83{system}')
    assert fix_of(gsa + gga(talker='GN')).status.service == service


# --- contradictions -----------------------------------------------------------------------------

def test_a_warning_of_rmc_before_gga_takes_the_fix_away() -> None:
    fixes, times, statistics = publish(rmc(status='V') + gga())
    assert [f.status.status for f in fixes.samples] == [NO_FIX]
    assert statistics.contradicted_samples == 1
    assert times.samples == []


def test_a_warning_about_another_time_does_not() -> None:
    assert fix_of(rmc('123518.00', 'V') + gga('123519.00')).status.status == FIX


def test_a_receiver_that_contradicts_itself_afterwards_is_waited_for_from_then_on() -> None:
    epochs = [(gga(f'12350{i}.00'), rmc(f'12350{i}.00', 'V' if i < 3 else 'A')) for i in range(5)]
    chunks = [part for epoch in epochs for part in epoch]
    with scripted(NmeaGps, chunks) as (device, (fixes, times)):
        published = []
        for now in range(10):
            device.read(now + 1)
            published.append([f.status.status for f in fixes.samples])
        assert published[0] == published[1] == [FIX]
        assert published[2] == [FIX]
        assert published[3] == [FIX, NO_FIX]
        assert published[-1] == [FIX, NO_FIX, NO_FIX, FIX, FIX]
        assert device.statistics().contradicted_samples == 3
        # They carry the time at which GGA came.
        assert fixes.stamps == [1, 3, 5, 7, 9]
        assert len(times.samples) == 2


def test_a_fix_that_waits_is_published_when_no_rmc_comes() -> None:
    chunks = [gga('1.00'.zfill(9)), rmc('000001.00', 'V'), gga('000002.00'), b'', b'']
    with scripted(NmeaGps, chunks) as (device, (fixes, _)):
        for now in (0, 0, 0, 400_000_000):
            device.read(now)
        assert len(fixes.samples) == 1
        device.read(600_000_000)
        assert [f.status.status for f in fixes.samples] == [FIX, FIX]


def test_without_contradiction_a_fix_is_published_with_its_gga() -> None:
    with scripted(NmeaGps, [gga(), rmc()]) as (device, (fixes, _)):
        assert device.read(1) == 1
        assert len(fixes.samples) == 1


# --- time ---------------------------------------------------------------------------------------

def test_time_reference() -> None:
    _, times, _ = publish(rmc('123519.25'))
    stamp = datetime(1994, 3, 23, 12, 35, 19, tzinfo=timezone.utc).timestamp()
    assert (times.samples[0].time_ref.sec, times.samples[0].time_ref.nanosec) == (
        stamp, 250_000_000)
    assert times.publication.fixed == {'header.frame_id': 'gps_link', 'source': 'gps'}


@pytest.mark.parametrize('line', [
    rmc(status='V'), rmc(time=''), rmc(date=''), rmc(date='310294'), rmc(time='235960.00'),
    rmc(date='010169'), rmc(date='190168'), sentence('GPRMC,,V,,,,,,,,,,N'), sentence('GPRMC')])
def test_no_time_reference_without_a_valid_time(line: bytes) -> None:
    assert publish(line)[1].samples == []


def test_no_time_topic_publishes_no_time() -> None:
    with scripted(NmeaGps, [rmc() + gga()], time_topic='') as (device, publishers):
        assert len(publishers) == 1
        assert device.read(1) == 1


def test_other_sentences_are_ignored_and_counted() -> None:
    lines = [sentence('GPVTG,,T,,M,,N,,K,N'), sentence('PUBX,00'), sentence('PAGGA,1'),
             sentence('GPXXX'), sentence('G'), sentence('GPGGA,,,,,,x')]
    fixes, _, statistics = publish(b''.join(lines))
    assert fixes.samples == []
    assert statistics.ignored_frames == statistics.frames == len(lines)


@settings(max_examples=150, deadline=None)
@given(kind=st.sampled_from(['GGA', 'RMC', 'GSA', 'GST']),
       fields=st.lists(st.sampled_from([
           '', '0', '1', '-1', '4807.038', '1e400', 'nan', '-inf', 'A', 'V', 'N', 'E', 'M', '１',
           '123519.00', '230394', '999999999999999999999', '08', 'x', '.', '-', '_1_'])
           | st.text(st.characters(min_codepoint=32, max_codepoint=126,
                                   exclude_characters='$*,'), max_size=12), max_size=24))
def test_no_content_of_a_sentence_raises_anything(kind: str, fields: list[str]) -> None:
    content = ','.join([f'GN{kind}', *fields])
    if not content.isascii() or len(content) > 190:
        content = content.encode('ascii', 'replace').decode()[:190]
    fixes, _, statistics = publish(sentence(content) + gga())
    assert statistics.frames == 2
    last = fixes.samples[-1]
    assert last.status.status in (NO_FIX, FIX)
    assert all(math.isfinite(v) for v in last.position_covariance)
