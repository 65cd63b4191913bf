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

"""Does the NMEA driver agree with a parse of our own on four recordings of real receivers."""

from __future__ import annotations

from datetime import datetime
from datetime import timezone
import math

from driver_fakes import data_lines
from gps_streams import APPROXIMATED
from gps_streams import COMPASS
from gps_streams import diagonal
from gps_streams import DIAGONAL_KNOWN
from gps_streams import FIX
from gps_streams import GALILEO
from gps_streams import GLONASS
from gps_streams import GPS
from gps_streams import NO_FIX
from gps_streams import publish
from gps_streams import SBAS
import pytest


def degrees(text: str, letter: str) -> float:
    point = text.index('.')
    value = int(text[:point - 2]) + float(text[point - 2:]) / 60
    return -value if letter in 'SW' else value


def expected_fixes(lines: list[bytes]) -> list[tuple[int, float, float, float]]:
    """Give status, latitude, longitude, altitude of each GGA, by plain string handling."""
    status_of = {'1': FIX, '2': SBAS}
    found = []
    for line in lines:
        fields = line.decode('ascii').strip().split('*')[0].split(',')
        if fields[0][3:] != 'GGA':
            continue
        if fields[6] == '0' or fields[7] == '00':
            found.append((NO_FIX, math.nan, math.nan, math.nan))
            continue
        altitude = float(fields[9]) + float(fields[11]) if fields[11] else math.nan
        found.append((status_of[fields[6]], degrees(fields[2], fields[3]),
                      degrees(fields[4], fields[5]), altitude))
    return found


def expected_times(lines: list[bytes]) -> list[tuple[int, int]]:
    found = []
    for line in lines:
        fields = line.decode('ascii').strip().split('*')[0].split(',')
        if fields[0][3:] != 'RMC' or fields[2] != 'A':
            continue
        clock, date = fields[1], fields[9]
        day = datetime(2000 + int(date[4:]), int(date[2:4]), int(date[:2]), int(clock[:2]),
                       int(clock[2:4]), int(clock[4:6]), tzinfo=timezone.utc)
        fraction = (clock.partition('.')[2] + '0' * 9)[:9]
        found.append((int(day.timestamp()), int(fraction)))
    return found


@pytest.mark.parametrize('name, count, without_fix', [
    ('ublox-neo-m9n-nmea', 61, 0), ('haicom-305N', 73, 6), ('telit-he910', 224, 37),
    ('quectel', 42, 8)])
def test_a_recording_against_a_parse_of_our_own(name: str, count: int, without_fix: int) -> None:
    lines = data_lines(f'gps/{name}.log')
    stream = b''.join(lines)
    chunks = [stream[i:i + 61] for i in range(0, len(stream), 61)]
    fixes, times, statistics = publish(*chunks)
    expected = expected_fixes(lines)
    got = [(f.status.status, f.latitude, f.longitude, f.altitude) for f in fixes.samples]
    assert len(got) == len(expected) == count
    assert sum(status == NO_FIX for status, *_ in got) == without_fix
    for ours, theirs in zip(got, expected):
        assert ours == pytest.approx(theirs, abs=1e-9, nan_ok=True)
    assert [(t.time_ref.sec, t.time_ref.nanosec) for t in times.samples] == expected_times(lines)
    assert statistics.frames == len(lines)
    assert statistics.rejected_bytes == statistics.contradicted_samples == 0


def test_the_ublox_recording_has_known_deviations_after_the_first_epoch() -> None:
    fixes, _, _ = publish(b''.join(data_lines('gps/ublox-neo-m9n-nmea.log')))
    kinds = [f.position_covariance_type for f in fixes.samples]
    assert kinds == [APPROXIMATED] + [DIAGONAL_KNOWN] * 60
    assert diagonal(fixes.samples[1]) == pytest.approx([1.0 ** 2, 0.98 ** 2, 3.1 ** 2])
    assert fixes.samples[0].status.service == 0
    assert fixes.samples[1].status.service == GPS | GLONASS | GALILEO | COMPASS


def test_the_haicom_recording_has_no_position_while_it_repeats_its_last_one() -> None:
    fixes, times, _ = publish(b''.join(data_lines('gps/haicom-305N.log')))
    # The sixth says quality 1, but of no satellite.
    assert all(math.isnan(f.latitude) for f in fixes.samples[:6])
    assert fixes.samples[6].status.status == FIX
    assert len(times.samples) == 68


def test_the_telit_recording_has_no_ellipsoidal_altitude() -> None:
    fixes, _, _ = publish(b''.join(data_lines('gps/telit-he910.log')))
    assert all(math.isnan(f.altitude) for f in fixes.samples)
    assert fixes.samples[-1].status.status == FIX


def test_the_quectel_recording_loses_its_fix_for_eight_epochs() -> None:
    fixes, _, _ = publish(b''.join(data_lines('gps/quectel.log')))
    status = [f.status.status for f in fixes.samples]
    assert status == [FIX] * 18 + [NO_FIX] * 8 + [FIX] * 16
