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

"""The mapper: a loop through rooms closes, bad input leaves the map as it is, real logs map."""

from __future__ import annotations

import gzip
import json
import math
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('scipy', reason='scipy is not installed')

from rt_robot_os.features.mapping.cli.command import run  # noqa: E402
from rt_robot_os.features.mapping.slam.mapper import Mapper  # noqa: E402
from rt_robot_os.features.mapping.slam.occupancy import grid_of  # noqa: E402
from rt_robot_os.features.mapping.slam.scan import Scan  # noqa: E402
from rt_robot_os.features.mapping.slam.transforms import between  # noqa: E402
from rt_robot_os.features.mapping.slam.transforms import composed  # noqa: E402
from rt_robot_os.features.mapping.slam.transforms import placed  # noqa: E402
from rt_robot_os.motion.grid_map import GridMap  # noqa: E402
from rt_robot_os.motion.walls import Walls  # noqa: E402

ROOT = Path(__file__).resolve().parents[3]
DATA = Path(os.environ.get('RT_ROBOT_OS_DATA', ROOT.parent / 'shared' / 'data')) / 'slam'
#: Whole logs take a minute together.
BROAD = pytest.mark.skipif(not os.environ.get('RT_ROBOT_OS_BROAD'),
                           reason='long: set RT_ROBOT_OS_BROAD')
#: Through all rooms of the flat, and back.
WAY = ((3.44, 1.0), (3.3, 3.0), (2.45, 3.9), (2.45, 5.2), (3.3, 5.8), (2.45, 5.2), (2.45, 3.9),
       (5.0, 3.6), (6.5, 3.4), (7.5, 3.2), (6.5, 3.4), (5.0, 3.6), (3.44, 1.0))


def true_poses(step_m: float = 0.2) -> Any:
    poses = []
    for a, b in zip(WAY, WAY[1:]):
        count = max(1, round(math.dist(a, b) / step_m))
        yaw = math.atan2(b[1] - a[1], b[0] - a[0])
        poses += [(a[0] + (b[0] - a[0]) * i / count, a[1] + (b[1] - a[1]) * i / count, yaw)
                  for i in range(count)]
    return np.array(poses)


@pytest.fixture(scope='module')
def flat() -> tuple[GridMap, Any, list[Scan]]:
    """Return a flat, where a robot was in it, and what it saw: noisy, with wheels that slip."""
    grid = GridMap.load(ROOT / 'config' / 'maps' / 'flat.yaml')
    walls = Walls.of(grid)
    rng = np.random.default_rng(7)
    poses = true_poses()
    angles = -2.0 + np.arange(180) * (4.0 / 179)
    scans, wheels = [], np.zeros(3)
    for number, pose in enumerate(poses):
        if number:
            step = between(poses[number - 1], pose)
            wheels = composed(wheels, step * (1.05, 1.0, 1.04)
                              + rng.normal(0, (0.01, 0.01, 0.01)))
        ranges = walls.cast(pose[0], pose[1], pose[2] + angles, 20.0)
        scans.append(Scan(number, wheels, ranges + rng.normal(0, 0.01, 180), -2.0, 4.0 / 179))
    return grid, poses, scans


def test_a_flat_is_mapped_to_some_centimetres_and_looks_like_itself(
        flat: tuple[GridMap, Any, list[Scan]]) -> None:
    grid, poses, scans = flat
    mapper = Mapper()
    for scan in scans:
        mapper.add(scan)
    mapper.optimise_all()
    found = composed(np.broadcast_to(poses[0], poses.shape), mapper.trajectory())
    wheels = composed(np.broadcast_to(poses[0], poses.shape),
                      np.array([each.odometry for each in scans]))
    off, off_wheels = between(poses, found), between(poses, wheels)
    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.1
    assert np.hypot(off_wheels[:, 0], off_wheels[:, 1]).max() > 0.3  # of the wheels alone
    assert np.abs(off[:, 2]).max() < math.radians(2.0)
    assert mapper.counts['loops'] and not mapper.counts['lost']
    made = grid_of(mapper.keyframes)
    x, y = made.centres()
    there = placed(poses[0], np.stack((x.ravel(), y.ravel()), -1))
    for mask, what in ((made.cells.ravel() == 100, grid.occupied_mask()),
                       (made.cells.ravel() == 0, ~grid.occupied_mask())):
        row, column, inside = grid.indices(there[mask, 0], there[mask, 1])
        near = [what[np.clip(row + dy, 0, grid.rows - 1),
                     np.clip(column + dx, 0, grid.columns - 1)]
                for dy in (-2, -1, 0, 1, 2) for dx in (-2, -1, 0, 1, 2)]
        assert (np.any(near, axis=0) & inside).mean() > 0.97


def test_scans_that_say_nothing_follow_odometry_and_leave_the_map(
        flat: tuple[GridMap, Any, list[Scan]]) -> None:
    _, _, scans = flat
    mapper = Mapper()
    for scan in scans[:20]:
        last = mapper.add(scan).pose
    blind = Scan(20, composed(scans[19].odometry, np.array((0.1, 0.0, 0.0))),
                 np.full(180, np.inf), -2.0, 4.0 / 179)
    assert mapper.add(blind).pose == pytest.approx(composed(last, np.array((0.1, 0.0, 0.0))))
    assert mapper.counts['lost'] == mapper.counts['empty'] == 1
    with pytest.raises(ValueError, match='odometry says'):
        mapper.add(Scan(21, np.array((math.nan, 0.0, 0.0)), scans[0].ranges, -2.0, 0.1))
    assert mapper.counts['scans'] == 21


def beginning(name: str, folder: Path, scans: int) -> tuple[Path, Path]:
    """Write the first scans of a log, with their relations."""
    if not DATA.is_dir():
        pytest.skip(f'no logs of scans at {DATA}')
    log, relations = folder / f'{name}.csv', folder / f'{name}.relations.csv'
    with gzip.open(DATA / f'{name}.csv.gz', 'rt') as file:
        log.write_text(''.join(line for line, _ in zip(file, range(scans + 1))))
    head, *lines = (DATA / f'{name}.relations.csv').read_text().splitlines(keepends=True)
    relations.write_text(head + ''.join(
        line for line in lines if max(map(int, line.split(',')[:2])) < scans))
    return log, relations


@pytest.mark.parametrize('name, scans', [
    ('edmonton', 75),
    *(pytest.param(name, 10_000, marks=BROAD) for name in ('edmonton', 'csail', 'intel'))])
def test_a_real_log_is_mapped_reported_drawn_and_compared(
        tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, scans: int) -> None:
    pytest.importorskip('matplotlib', reason='matplotlib is not installed')
    report, chart = tmp_path / 'report.json', tmp_path / 'map.png'
    log, relations = (str(each) for each in beginning(name, tmp_path, scans))
    assert run(['--bag', log, '--report', str(report), '--map', str(tmp_path / 'made.yaml'),
                '--picture', str(chart), '--relations', relations]) == 0
    errors = json.loads(report.read_text())['errors']
    assert errors['mean_m'] < 0.08 and errors['mean_rad'] < 0.02
    assert errors['largest_m'] < 0.6
    assert errors['loops_mean_m'] < 0.12 or errors['loops'] < 5  # one is no mean
    assert GridMap.load(tmp_path / 'made.yaml').occupied_mask().sum() > 1000
    assert chart.read_bytes().startswith(b'\x89PNG')
    said = capsys.readouterr().out
    assert run(['--compare', str(report), '--relations', relations]) == 0
    assert capsys.readouterr().out.strip() == said.splitlines()[-1]


def test_a_carmen_log_is_read_with_what_the_wheels_said(tmp_path: Path) -> None:
    log = tmp_path / 'log.clf'
    log.write_text('# message formats\nODOM 1 2 0.5 0 0 0 1.5 host 1.5\n'
                   'FLASER 3 1 2 3 9 9 0.1 9 9 0.1 1.6 host 1.6\nFLASER 3 1 2\nNEFF 7\n')
    from rt_robot_os.features.mapping.slam.logs import read_log
    found = read_log(log)
    assert found.bad_lines == 1 and len(found.scans) == 1
    assert found.scans[0].odometry.tolist() == [1, 2, 0.5]
    assert found.scans[0].stamp_ns == 1_600_000_000
    assert found.reference is not None and found.reference.tolist() == [[9, 9, 0.1]]


@pytest.mark.parametrize('arguments, says', [
    (['--bag', 'nowhere'], 'nowhere: No such file'),
    (['--bag', 'empty'], 'no scan in it'),
    (['--bag', 'empty', '--relations', 'empty'], 'the first line must be i,j,dx,dy,dyaw'),
    (['--compare', 'empty'], '--compare needs --relations'),
    (['--compare', 'empty', '--relations', 'empty'], 'no report of mapping'),
    (['--bag', 'cut.gz'], 'cut.gz: '),
])
def test_files_that_cannot_be_used_are_named(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
        arguments: list[str], says: str) -> None:
    monkeypatch.chdir(tmp_path)
    Path('empty').touch()
    Path('cut.gz').write_bytes(b'\x1f\x8b\x08\0\0')
    assert run(arguments) == 2
    assert says in capsys.readouterr().err
