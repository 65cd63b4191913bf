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

"""What is wrong with scans and odometry is told, and what is right is not."""

from __future__ import annotations

from dataclasses import replace
import math

import numpy as np
import pytest

pytest.importorskip('scipy', reason='SciPy is not installed')

from rt_robot_os.features.mapping.slam.checks import ScanChecks  # noqa: E402
from rt_robot_os.features.mapping.slam.scan import Scan  # noqa: E402
from rt_robot_os.features.mapping.slam.transforms import Floats  # noqa: E402

PERIOD_NS = 100_000_000
ANGLES = np.linspace(-2.0, 2.0, 400)


def seen(pose: Floats, seed: int = 0, turned: float = 1.0) -> Floats:
    """Return what a laser sees of a room with a bay."""
    x, y, yaw = pose
    bearings = yaw + turned * ANGLES
    along, across = np.cos(bearings), np.sin(bearings)
    with np.errstate(divide='ignore'):
        wall_x = np.where(along > 0, 4.0 - x, 2.0 + x) / np.abs(along)
        wall_y = np.where(across > 0, 1.5 - y, 3.0 + y) / np.abs(across)
        bay = np.where((across > 0) & (along < 0), (2.5 - y) / np.abs(across), wall_y)
    noise = np.random.default_rng(seed).normal(0.0, 0.01, len(ANGLES))
    return np.minimum(wall_x, bay) + noise


def driven(odometry: list[Floats], laser: list[Floats], turned: float = 1.0,
           checks: ScanChecks | None = None, before: int = 0) -> ScanChecks:
    """Drive after some scans; odometry and the laser may disagree."""
    checks = checks or ScanChecks(20.0)
    begun = before * PERIOD_NS
    for number, (base, at) in enumerate(zip(odometry, laser)):
        checks.check(Scan(begun + number * PERIOD_NS, base, seen(at, number, turned), -2.0,
                          ANGLES[1] - ANGLES[0]), base)
    return checks


STANDS = [np.zeros(3)] * 30
TURNS = [np.array((0.0, 0.0, 0.06 * step)) for step in range(30)]
GOES = [np.array((0.03 * step, 0.0, 0.0)) for step in range(30)]
SLOWLY = [np.array((0.02 * step, -0.02 * step, 0.0)) for step in range(90)]


@pytest.mark.parametrize('way', [STANDS, TURNS, GOES])
def test_what_agrees_is_not_told(way: list[Floats]) -> None:
    checks = driven(way, way)
    assert checks.warnings(30 * PERIOD_NS) == () and not checks.rejection_reason


@pytest.mark.parametrize('odometry, laser, turned, told', [
    (TURNS, TURNS, -1.0, 'upside down'), (TURNS, STANDS, 1.0, 'stand still while odometry turns'),
    (STANDS, TURNS, 1.0, 'while odometry stands still'),
    (3 * STANDS, SLOWLY, 1.0, 'while odometry stands still')])
def test_what_contradicts_is_told_and_over_when_it_is(
        odometry: list[Floats], laser: list[Floats], turned: float, told: str) -> None:
    checks = driven(odometry, laser, turned)
    assert told in checks.rejection_reason
    checks = driven([*TURNS, *STANDS], [*TURNS, *STANDS], 1.0, checks,
                    len(odometry))
    assert not checks.rejection_reason


def test_who_walks_by_is_not_the_robot() -> None:
    checks = ScanChecks(20.0)
    for number in range(30):
        ranges = seen(np.zeros(3), number)
        ranges[(10 * number) % 300:(10 * number) % 300 + 90] = 0.6
        checks.check(Scan(number * PERIOD_NS, np.zeros(3), ranges, -2.0, 0.01), np.zeros(3))
    assert not checks.rejection_reason


@pytest.mark.parametrize('value', [math.inf, math.nan, 0.0, 100.0])
def test_a_laser_that_sees_nothing_is_told(value: float) -> None:
    checks = ScanChecks(20.0)
    for number in range(6):
        checks.check(Scan(number * PERIOD_NS, np.zeros(3), np.full(400, value), -2.0, 0.01),
                     np.zeros(3))
    assert 'sees nothing' in checks.rejection_reason


def test_one_that_hangs_is_told_when_the_robot_moves() -> None:
    checks = ScanChecks(20.0)
    for number in range(40):
        base = np.array((0.02 * max(0, number - 15), 0.0, 0.0))
        checks.check(Scan(number * PERIOD_NS, base, seen(np.zeros(3)), -2.0, 0.01), base)
        assert bool(checks.rejection_reason) == (number >= 15 + 6 + 9)
    assert 'repeats the same scan' in checks.rejection_reason


@pytest.mark.parametrize('value', [math.inf, math.nan, 0.0])
def test_a_cover_that_is_taken_off_does_not_look_like_a_robot_that_was_carried(value: float
                                                                               ) -> None:
    checks = driven(STANDS, STANDS)
    for number in range(30, 60):
        checks.check(Scan(number * PERIOD_NS, np.zeros(3), np.full(400, value), -2.0,
                          ANGLES[1] - ANGLES[0]), np.zeros(3))
    for number in range(60, 90):
        checks.check(Scan(number * PERIOD_NS, np.zeros(3), seen(np.zeros(3), number), -2.0,
                          ANGLES[1] - ANGLES[0]), np.zeros(3))
        assert not checks.rejection_reason
    assert checks.counts['wheels_stand'] == 0


def test_one_that_hung_while_the_robot_turned_is_right_again_at_its_next_scan() -> None:
    checks = ScanChecks(20.0)
    turned = [np.array((0.0, 0.0, 0.06 * min(number, 40))) for number in range(60)]
    for number, base in enumerate(turned):
        hangs = number < 40
        checks.check(Scan(number * PERIOD_NS, base,
                          seen(np.zeros(3) if hangs else base, 0 if hangs else number), -2.0,
                          ANGLES[1] - ANGLES[0]), base)
        assert not checks.rejection_reason or ('repeats the same scan' in checks.rejection_reason
                                               and hangs)
    assert checks.counts['frozen'] == 1 and checks.counts['laser_stands'] == 0


def test_scans_of_changing_length_and_a_rate_that_drops_are_told() -> None:
    checks = driven(STANDS, STANDS)
    scan = Scan(31 * PERIOD_NS, np.zeros(3), np.ones(200), -2.0, 0.02)
    checks.check(scan, np.zeros(3))
    assert 'scans of 200 beams after scans of 400' in checks.warnings(31 * PERIOD_NS)[0]
    for number in range(30):
        checks.check(replace(scan, stamp_ns=(40 + 5 * number) * PERIOD_NS,
                             ranges=seen(np.zeros(3), number)), np.zeros(3))
    assert checks.warnings(300 * PERIOD_NS) == (
        'scans arrive 2.0 times a second, before 10.0 times',)


def test_two_lasers_are_told_alone_and_are_no_rate_to_measure_one_by() -> None:
    checks = driven(STANDS, STANDS)
    for number in range(60):
        ranges = seen(np.array((0.0, 0.0, math.pi * (number % 2))), number)
        checks.check(Scan(30 * PERIOD_NS + number * PERIOD_NS // 2, np.zeros(3), ranges, -2.0,
                          ANGLES[1] - ANGLES[0]), np.zeros(3), are_two=True)
        assert len(checks.warnings(60 * PERIOD_NS)) == 1
        assert 'two lasers' in checks.rejection_reason
    for number in range(60):
        checks.check(Scan((60 + number) * PERIOD_NS, np.zeros(3), seen(np.zeros(3), number), -2.0,
                          ANGLES[1] - ANGLES[0]), np.zeros(3))
        assert checks.warnings((60 + number) * PERIOD_NS) == ()
    assert checks.counts['two_lasers'] == 1


def test_silence_is_no_rate() -> None:
    checks = driven(STANDS, STANDS)
    for stamp in range(30 + 200, 30 + 240):  # unplugged for 20 s
        checks.check(Scan(stamp * PERIOD_NS, np.zeros(3), seen(np.zeros(3), stamp), -2.0,
                          ANGLES[1] - ANGLES[0]), np.zeros(3))
        assert checks.warnings(stamp * PERIOD_NS) == ()


def test_scans_that_were_left_out_came_all_the_same() -> None:
    checks = ScanChecks(20.0)
    for number in range(60):
        left_out = 4 * (number > 25)
        stamp_ns = (number + 4 * max(0, number - 25)) * PERIOD_NS
        checks.check(Scan(stamp_ns, np.zeros(3), seen(np.zeros(3), number), -2.0, 0.01),
                     np.zeros(3), left_out)
    assert checks.warnings(stamp_ns) == ()
