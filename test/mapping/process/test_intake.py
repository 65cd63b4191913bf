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

"""Scans wait for odometry; what is late, missing or impossible is left out and counted."""

from __future__ import annotations

from dataclasses import replace
import math
import time
from typing import Any

from mapping_robot import odometry_message
from mapping_robot import scan_message
import numpy as np
import pytest

from rt_robot_os.features.mapping.scan_intake import LATE_SCANS
from rt_robot_os.features.mapping.scan_intake import ScanIntake
from rt_robot_os.features.mapping.scan_intake import SCANS_MOST
from rt_robot_os.features.mapping.slam.deskew import LaserMount
from rt_robot_os.features.mapping.slam.scan import Scan
from rt_robot_os.motion.mounting import Mounting

MS = 1_000_000
MOUNT = LaserMount.of(Mounting())


def scan_at(stamp_ms: int, **more: Any) -> tuple[int, int, memoryview]:
    scan = Scan(0, np.zeros(3), np.full(180, 2.0), -math.pi, math.tau / 180)
    return stamp_ms * MS, 0, memoryview(scan_message(replace(scan, **more)))


def odom_at(stamp_ms: int, x: float, y: float = 0.0, yaw: float = 0.0
            ) -> tuple[int, int, memoryview]:
    return stamp_ms * MS, 0, memoryview(odometry_message((x, y, yaw)))


@pytest.fixture
def intake() -> ScanIntake:
    return ScanIntake(lambda frame: MOUNT if frame == 'base_link' else None)


def test_a_scan_waits_until_odometry_covers_it(intake: ScanIntake) -> None:
    intake.add_odometry(*odom_at(1000, 0.0))
    intake.add_scan(*scan_at(1010))
    assert intake.next() is None
    intake.add_odometry(*odom_at(1020, 0.1))
    found = intake.next()
    assert found is not None and found.base.tolist() == pytest.approx([0.05, 0.0, 0.0])
    assert intake.next() is None


def test_one_that_odometry_will_never_cover_is_counted(intake: ScanIntake) -> None:
    intake.add_odometry(*odom_at(1000, 0.0))
    intake.add_scan(*scan_at(990))
    assert intake.next() is None
    for stamp in range(1100, 1900, 100):
        intake.add_scan(*scan_at(stamp))
    assert intake.next() is None
    assert intake.statistics()['scans_without_odometry'] == 2
    assert 'without odometry' in intake.warning()


def test_scans_of_before_the_first_odometry_are_no_fault(intake: ScanIntake) -> None:
    # Who joins a robot that runs hears of both from some moment on.
    for stamp in 900, 950, 990:
        intake.add_scan(*scan_at(stamp))
    intake.add_odometry(*odom_at(995, 0.0))
    intake.add_scan(*scan_at(1010))
    intake.add_odometry(*odom_at(1020, 0.1))
    found = intake.next()
    assert found is not None and found.scan.stamp_ns == 1010 * MS
    assert intake.statistics()['scans_too_early'] == 3
    assert not intake.statistics()['scans_without_odometry'] and not intake.warning()


def test_silence_is_told_of_a_core_that_is_there(intake: ScanIntake,
                                                 monkeypatch: pytest.MonkeyPatch) -> None:
    now_ns = time.monotonic_ns()
    monkeypatch.setattr(time, 'monotonic_ns', lambda: now_ns + 10_000 * MS)
    assert not intake.warning(is_connected=False)
    assert intake.warning() == 'no scans for 10 s; no odometry for 10 s'
    intake.connected()
    assert not intake.warning()


def test_who_is_late_goes_on_with_the_newest(intake: ScanIntake) -> None:
    for stamp in range(1000, 1000 + 100 * LATE_SCANS, 100):
        intake.add_scan(*scan_at(stamp))
    for stamp in range(990, 2000, 50):
        intake.add_odometry(*odom_at(stamp, 0.0))
    found = intake.next()
    assert found is not None and found.scan.stamp_ns == (900 + 100 * LATE_SCANS) * MS
    assert intake.counts['scans_skipped'] == LATE_SCANS - 1


def test_two_lasers_are_noticed_by_who_is_late_and_sees_one_of_them_alone(intake: ScanIntake
                                                                          ) -> None:
    for number in range(2 * LATE_SCANS + 16):
        stamp = 1000 + 50 * number
        intake.add_scan(*scan_at(stamp, ranges=np.full(180, 2.0 + number % 2)))
        intake.add_odometry(*odom_at(stamp, 0.0))
        intake.add_odometry(*odom_at(stamp + 40, 0.0))
    found = intake.next()
    assert found is not None and found.are_two and found.left_out


def test_a_machine_that_skips_scans_says_so(intake: ScanIntake,
                                            monkeypatch: pytest.MonkeyPatch) -> None:
    began_ns = time.monotonic_ns()
    assert intake.warning() == ''
    for stamp in range(1000, 1000 + 100 * LATE_SCANS, 100):
        intake.add_scan(*scan_at(stamp))
    for stamp in range(990, 2000, 50):
        intake.add_odometry(*odom_at(stamp, 0.0))
    intake.next()
    # Not of the first ones, while libraries are loaded.
    assert intake.warning(is_connected=False) == ''
    monkeypatch.setattr(time, 'monotonic_ns', lambda: began_ns + 6000 * MS)
    intake.connected()
    share = (LATE_SCANS - 1) / LATE_SCANS
    assert f'overloaded: {share:.0%} of the scans were skipped' in intake.warning()
    assert intake.blocking_problem == ''


def test_no_more_are_skipped_than_came(intake: ScanIntake, monkeypatch: pytest.MonkeyPatch
                                       ) -> None:
    began_ns = time.monotonic_ns()
    for stamp in range(1000, 2000, 100):
        intake.add_scan(*scan_at(stamp))
    assert intake.warning() == ''
    for stamp in range(990, 2000, 50):
        intake.add_odometry(*odom_at(stamp, 0.0))
    intake.next()
    monkeypatch.setattr(time, 'monotonic_ns', lambda: began_ns + 6000 * MS)
    assert intake.warning() == 'no scans for 6 s; no odometry for 6 s'
    intake.add_odometry(*odom_at(2040, 0.0))
    intake.add_scan(*scan_at(2000))
    assert 'overloaded: 100% of the scans were skipped' in intake.warning()


def test_what_waits_is_bounded(intake: ScanIntake) -> None:
    for stamp in range(SCANS_MOST + 5):
        intake.add_scan(*scan_at(1000 + stamp))
    assert intake.statistics()['scans_waiting'] == SCANS_MOST
    assert intake.counts['scans_overflowed'] == 5


def test_odometry_that_jumps_or_begins_anew_goes_on_from_where_it_was(intake: ScanIntake) -> None:
    intake.add_odometry(*odom_at(1000, 5.0, 1.0, 1.0))
    intake.add_odometry(*odom_at(1020, 50.0, 1.0, 1.0))
    assert intake.track.last == pytest.approx((5.0, 1.0, 1.0))
    intake.core_restarted()
    intake.add_odometry(*odom_at(1040, 0.0, 0.0, 0.0))
    intake.add_odometry(*odom_at(1060, 0.1, 0.0, 0.0))
    assert intake.track.last == pytest.approx(
        (5.0 + 0.1 * math.cos(1.0), 1.0 + 0.1 * math.sin(1.0), 1.0))
    assert intake.counts['odometry_jumps'] == intake.counts['odometry_restarts'] == 1
    assert intake.raw_odometry(np.array(intake.track.last)).tolist() == pytest.approx([0.1, 0.0,
                                                                                       0.0])


def test_after_silence_odometry_may_say_anything(intake: ScanIntake) -> None:
    for stamp in (1000, 1050):
        intake.add_odometry(*odom_at(stamp, 2.5))
    intake.add_scan(*scan_at(1020))
    found = intake.next()
    assert found is not None and not found.is_cut
    for stamp in (4000, 4050, 4200):  # its driver was started again: no faster than a robot may be
        intake.add_odometry(*odom_at(stamp, 0.0))
    cut = []
    for stamp in (4010, 4110):
        intake.add_scan(*scan_at(stamp))
        found = intake.next()
        assert found is not None
        cut.append(found.is_cut)
    assert cut == [True, False] and intake.counts['odometry_gaps'] == 1
    assert 'odometry paused' in intake.warning()
    for stamp, missed in ((7000, 140), (7050, 140)):  # this machine was late: it was not silent
        intake.add_odometry(stamp * MS, missed, odom_at(stamp, 0.1)[2])
    intake.add_scan(*scan_at(7010))
    found = intake.next()
    assert found is not None and not found.is_cut


@pytest.mark.parametrize('scan, told', [
    (scan_message(Scan(0, np.zeros(3), np.ones(180), -1.0, 0.01), b'rear\0'),
     "no transform for frame 'rear'"),
    (scan_message(Scan(0, np.zeros(3), np.ones(180), math.nan, 0.01)),
     'not from a rotating laser'),
    (scan_message(Scan(0, np.zeros(3), np.ones(180), 0.0, 0.0)), 'not from a rotating laser'),
    (scan_message(Scan(0, np.zeros(3), np.ones(0), 0.0, 0.1)), 'not from a rotating laser'),
    (b'\0\1\0\0', 'bytes'), (b'', 'encapsulation')])
def test_a_scan_that_is_none_is_told(intake: ScanIntake, scan: bytes, told: str) -> None:
    intake.add_scan(1000 * MS, 0, memoryview(scan))
    assert told in intake.warning() and intake.counts['malformed'] == 1
    intake.add_scan(*scan_at(1100))
    assert not intake.problem


def test_time_that_goes_back_is_left_out_and_told(intake: ScanIntake) -> None:
    intake.add_odometry(*odom_at(1000, 1.0))
    intake.add_odometry(*odom_at(990, 9.0))
    assert intake.track.last[0] == 1.0
    intake.add_scan(*scan_at(1000))
    intake.add_scan(*scan_at(900))
    assert intake.counts['scans_backwards'] == intake.counts['odometry_backwards'] == 1
    assert 'went back' in intake.warning()


@pytest.mark.parametrize('scans_by_ms, told', [
    (-5000, 'scans are 5.0 s behind those of odometry'), (3000, 'ahead of'), (-200, ''), (30, '')])
def test_two_clocks_are_told_apart(intake: ScanIntake, scans_by_ms: int, told: str) -> None:
    for stamp in range(10_000, 12_000, 100):
        intake.add_odometry(*odom_at(stamp, 0.0))
        intake.add_scan(*scan_at(stamp + scans_by_ms))
    warning = intake.warning()
    assert told in warning and ('clocks' in warning) == bool(told)


def test_scans_that_came_late_once_are_no_matter_of_clocks(intake: ScanIntake) -> None:
    for stamp in range(10_000, 12_000, 100):
        intake.add_odometry(*odom_at(stamp, 0.0))
    for stamp in range(10_000, 12_000, 100):  # all that waited at once
        intake.add_scan(*scan_at(stamp))
    assert 'clocks' not in intake.warning()


def test_ranges_out_of_reach_measure_nothing(intake: ScanIntake) -> None:
    ranges = np.array([0.01, 1.0, 30.0, np.inf, np.nan, -1.0, *[2.0] * 174])
    intake.add_odometry(*odom_at(1000, 0.0))
    intake.add_scan(*scan_at(1000, ranges=ranges))
    found = intake.next()
    assert found is not None
    seen = found.scan.ranges[:6]
    assert np.isnan(seen[[0, 4, 5]]).all() and np.isinf(seen[[2, 3]]).all() and seen[1] == 1.0


def test_missed_samples_are_counted_once(intake: ScanIntake) -> None:
    for stamp, missed in ((1000, 0), (1020, 3), (1040, 3), (1060, 5)):
        intake.add_odometry(stamp * MS, missed, odom_at(stamp, 0.0)[2])
    assert intake.counts['odometry_missed'] == 5
