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

"""A laser that reports its reach where it has no echo is recognised, and a wall is not."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('scipy', reason='scipy is not installed')

from rt_robot_os.features.mapping.cli.command import run  # noqa: E402
from rt_robot_os.features.mapping.slam.logs import read_log  # noqa: E402
from rt_robot_os.features.mapping.slam.max_range import echo_ranges  # noqa: E402
from rt_robot_os.features.mapping.slam.max_range import reported_max_range  # noqa: E402
from rt_robot_os.features.mapping.slam.scan import Scan  # noqa: E402
from rt_robot_os.motion.grid_map import GridMap  # noqa: E402
from rt_robot_os.motion.walls import Walls  # noqa: E402

CELL_M, BEAMS, REACH_M = 0.05, 181, 6.0
ANGLES = np.arange(BEAMS) * math.pi / 180 - math.pi / 2
DATA = Path(os.environ.get(
    'RT_ROBOT_OS_DATA', Path(__file__).parents[4] / 'shared' / 'data')) / 'slam'


def hall() -> Walls:
    """Return a hall of 14 x 8 m with two pillars."""
    cells = np.full((200, 320), 100, np.int8)
    cells[20:180, 20:300] = 0
    cells[60:70, 100:110] = cells[120:135, 200:210] = 100
    return Walls.of(GridMap(cells, CELL_M))


def drive(sees_m: float, poses: Any) -> list[Scan]:
    """Return scans with 1 cm of noise; no echo is NaN."""
    walls, rng = hall(), np.random.default_rng(2)
    scans = []
    for number, (x, y, yaw) in enumerate(poses):
        ranges = walls.cast(x, y, yaw + ANGLES, sees_m)
        ranges = np.where(ranges < sees_m - 0.1, ranges + rng.normal(0.0, 0.01, BEAMS), np.nan)
        scans.append(Scan(number * 10 ** 9, np.array((x, y, yaw)), ranges, ANGLES[0],
                          math.pi / 180))
    return scans


#: Along the hall, and across it at its end.
WAY = [*((x, 4.0, 0.1) for x in np.arange(2.0, 11.0, 0.3)),
       *((11.0, y, 1.6) for y in np.arange(4.0, 7.5, 0.3))]


def reported(scans: list[Scan], reach_m: float, spread_m: float = 0.0) -> list[Scan]:
    """Return the scans of a laser that reports its reach where it has no echo."""
    rng = np.random.default_rng(3)
    return [Scan(each.stamp_ns, each.odometry, np.where(
        np.isnan(each.ranges), reach_m + spread_m * rng.random(BEAMS), each.ranges),
        each.angle_min, each.angle_increment) for each in scans]


def written(path: Path, scans: list[Scan]) -> Path:
    lines = [f'# t, odometry x y yaw, reference x y yaw, then {BEAMS} ranges in m, first beam at '
             '-90.0 deg, step 1.0000 deg']
    for number, scan in enumerate(scans):
        pose = [f'{each:.5f}' for each in scan.odometry]
        lines.append(','.join([str(number), *pose, *pose,
                               *(f'{each:.3f}' for each in scan.ranges)]))
    path.write_text('\n'.join(lines))
    return path


@pytest.mark.parametrize('spread_m', [0.0, 0.012])
def test_a_reported_reach_is_recognised_though_single_ranges_are_longer(spread_m: float) -> None:
    scans = reported(drive(REACH_M, WAY), REACH_M + 0.183, spread_m)
    assert reported_max_range(scans) == pytest.approx(REACH_M + 0.18, abs=0.031)
    scans[3].ranges[7] = 12.0
    found = reported_max_range(scans)
    assert found is not None and REACH_M < found <= REACH_M + 0.183


def test_walls_are_no_reach() -> None:
    # The whole hall is seen, or no echo is said as it should be.
    assert reported_max_range(drive(30.0, WAY)) is None
    assert reported_max_range(drive(REACH_M, WAY)) is None
    # A robot that stands, or turns, sees the far wall at one distance all the time.
    for turn in (0.0, 0.1):
        standing = drive(30.0, [(13.0 - REACH_M, 4.0, 0.01 * number * turn)
                                for number in range(40)])
        far = [Scan(each.stamp_ns, each.odometry, np.where(
            np.abs(each.ranges - 8.0) < 0.02, each.ranges, np.nan), each.angle_min,
            each.angle_increment) for each in standing]
        assert reported_max_range(far) is None
    # A reach beyond what mapping uses is left out anyway.
    assert reported_max_range(reported(drive(REACH_M, WAY), 81.91)) is None


@pytest.mark.skipif(not DATA.is_dir(), reason='the shared logs are absent')
@pytest.mark.parametrize('name', ['intel', 'csail', 'edmonton'])
def test_real_logs_have_none_below_20_m_and_their_true_one_beyond(name: str) -> None:
    scans = read_log(DATA / f'{name}.csv.gz').scans
    assert [reported_max_range(scans, most_m)
            for most_m in (5.0, 8.0, 12.0, 20.0, 40.0)] == [None] * 5
    assert reported_max_range(scans, 200.0) == pytest.approx(
        {'intel': 81.83, 'csail': 81.91, 'edmonton': 51.14}[name], abs=0.02)


def test_mapping_leaves_it_out_says_so_once_and_an_option_overrides_it(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    clean = drive(REACH_M, WAY)
    reports = []
    for name, scans, options in (
            ('clean', clean, []), ('reach', reported(clean, REACH_M), []),
            ('given', reported(clean, REACH_M), ['--range-max', '20'])):
        report = tmp_path / f'{name}.json'
        assert run(['--bag', str(written(tmp_path / f'{name}.csv', scans)), '--report',
                    str(report), *options]) == 0
        said = capsys.readouterr().out
        reports.append(json.loads(report.read_text()))
        assert said.count('reports its maximum range') == (name == 'reach')
    true, reach, given = reports
    assert reach['reach_m'] == REACH_M and true['reach_m'] is given['reach_m'] is None
    assert sum('6.00 m' in each and '--range-max' in each for each in reach['problems']) == 1
    # The map is that of a laser that says nan; with the option these ranges are walls.
    assert reach['poses'] == true['poses'] != given['poses']


def test_a_laser_scan_says_what_its_reach_is() -> None:
    ranges = np.array((0.0, 0.04, 1.0, 11.9, 12.0, 12.1, np.inf, np.nan, -np.inf), np.float32)
    seen = echo_ranges(ranges, 0.05, 12.0)
    assert np.isnan(seen[[0, 1, 7, 8]]).all() and np.isposinf(seen[[4, 5, 6]]).all()
    assert seen[[2, 3]] == pytest.approx((1.0, 11.9))
    # A driver that does not state it.
    for least_m, most_m in ((0.0, 0.0), (0.05, math.nan)):
        assert np.isfinite(echo_ranges(ranges, least_m, most_m)[[2, 3, 4, 5]]).all()
