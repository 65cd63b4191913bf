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

"""Loops that overlap shortly: what is visible of them, corridors, what is reported of the rest."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('scipy', reason='scipy is not installed')

from rt_robot_os.features.mapping.cli.command import run  # noqa: E402
from rt_robot_os.features.mapping.slam.keyframes import Keyframe  # noqa: E402
from rt_robot_os.features.mapping.slam.mapper import mapped  # noqa: E402
from rt_robot_os.features.mapping.slam.mapper import Mapper  # noqa: E402
from rt_robot_os.features.mapping.slam.overlap import overlap_of  # noqa: E402
from rt_robot_os.features.mapping.slam.scan import Scan  # noqa: E402
from rt_robot_os.features.mapping.slam.scan import surface_of  # noqa: E402
from rt_robot_os.features.mapping.slam.transforms import between  # noqa: E402
from rt_robot_os.features.mapping.slam.transforms import composed  # noqa: E402
from rt_robot_os.motion.grid_map import GridMap  # noqa: E402
from rt_robot_os.motion.walls import Walls  # noqa: E402

CELL_M = 0.05
BEAMS, REACH_M = 181, 8.0


def box(cells: Any, x: float, y: float, wide: float, high: float, value: int) -> None:
    cells[round(y / CELL_M):round((y + high) / CELL_M),
          round(x / CELL_M):round((x + wide) / CELL_M)] = value


def ring(apart: float = 0.0) -> Walls:
    """
    Return a corridor 2 m wide round a block of 11 x 9 m, with a few doors.

    :param apart: the end of the way leads into another corridor, so far from the first one.
    """
    cells = np.full((400, 400), 100, np.int8)
    box(cells, 1.0, 1.0, 15.0, 13.0, 0)
    box(cells, 3.0, 3.0, 11.0, 9.0, 100)
    for x, y in ((5.0, 11.7), (4.4, 2.9), (9.0, 1.0)):
        box(cells, x, y, 0.9, 0.3, 0)
    box(cells, 14.0, 6.0, 0.4, 0.8, 100)
    if apart:
        box(cells, 1.0, 12.0, 13.0, 2.0, 100)
        box(cells, 3.0, 12.0, 9.0, 2.0, 0)  # where it began, closed on both sides
        box(cells, 3.0, 12.0 + apart, 13.0, 2.0, 0)  # where it ends
        box(cells, 14.0, 12.0, 2.0, 2.0 + apart, 0)
        box(cells, 1.0, 12.0, 3.0, 2.0, 0)
    return Walls.of(GridMap(cells, CELL_M))


def drive(walls: Walls, corners: list[tuple[float, float]], bias_rad: float) -> tuple[Any, Any]:
    """Return scans along a way and where they were taken; odometry turns as it goes on."""
    poses: list[Any] = []
    for (x, y), (to_x, to_y) in zip(corners, corners[1:]):
        way, yaw = math.hypot(to_x - x, to_y - y), math.atan2(to_y - y, to_x - x)
        if poses:
            turn = float(between(poses[-1], np.array((0.0, 0.0, yaw)))[2])
            poses += [composed(np.array((x, y, poses[-1][2])), np.array((0.0, 0.0, part * turn)))
                      for part in (0.25, 0.5, 0.75)]
        poses += [np.array((x + far * math.cos(yaw), y + far * math.sin(yaw), yaw))
                  for far in np.arange(0.0, way, 0.4)]
    truth, rng = np.array(poses), np.random.default_rng(1)
    angles = np.arange(BEAMS) * math.pi / 180 - math.pi / 2
    scans, wheels = [], np.zeros(3)
    for number, pose in enumerate(truth):
        if number:
            step = between(truth[number - 1], pose)
            step[2] += bias_rad * math.hypot(step[0], step[1])
            wheels = composed(wheels, step)
        ranges = walls.cast(pose[0], pose[1], pose[2] + angles, REACH_M) + rng.normal(
            0.0, 0.01, BEAMS)
        scans.append(Scan(number * 10 ** 9, wheels, np.where(ranges < REACH_M - 0.1, ranges,
                                                             np.nan), angles[0], math.pi / 180))
    return scans, truth


AROUND = [(8.0, 13.0), (2.0, 13.0), (2.0, 2.0), (15.0, 2.0), (15.0, 13.0)]


def test_what_the_place_did_not_look_at_does_not_count_and_what_it_looked_at_does() -> None:
    walls = ring()
    angles = np.arange(BEAMS) * math.pi / 180 - math.pi / 2

    def seen(x: float, y: float, yaw: float) -> Any:
        ranges = walls.cast(x, y, yaw + angles, REACH_M)
        return surface_of(Scan(0, np.zeros(3), np.where(ranges < REACH_M - 0.1, ranges, np.nan),
                               angles[0], math.pi / 180), 20.0)

    there = np.array((8.0, 13.0, math.pi))
    place = [Keyframe(0, there, np.zeros(3), seen(*there), 0.0)]
    whole = overlap_of(place, seen(*there), there)
    assert whole.visible == 1.0 and whole.contradicted == 0.0
    # Half a turn later it looks at what is behind the place, but for the walls at its sides.
    behind = np.array((8.0, 13.0, 0.0))
    assert overlap_of(place, seen(*behind), behind).visible < 0.1
    # 3 m ahead and turned to it, it looks at what the place looked at, and no more.
    ahead = np.array((5.0, 13.0, 0.0))
    short = overlap_of(place, seen(*ahead), ahead)
    assert 0.2 < short.visible < 0.8 and short.contradicted < 0.02
    # At another place the scan sees through walls that are known.
    elsewhere = overlap_of(place, seen(*ahead), np.array((5.0, 14.0, 0.5)))
    assert elsewhere.contradicted > 0.1


def test_a_corridor_closes_across_though_nothing_says_how_far_along_it_the_robot_is() -> None:
    scans, truth = drive(ring(), [*AROUND, (11.0, 13.0)], 0.012)
    mapper = mapped(scans)
    off = between(between(truth[0], truth[-1]), between(*mapper.trajectory()[[0, -1]]))
    assert mapper.counts['loops'] and not mapper.counts['refused']
    assert abs(off[1]) < 0.15 and abs(off[2]) < 0.03


def test_a_corridor_that_looks_alike_beside_the_first_one_is_not_closed() -> None:
    scans, truth = drive(ring(3.0), [*AROUND[:-1], (15.0, 16.0), (9.0, 16.0)], 0.004)
    mapper = mapped(scans)
    off = between(between(truth[0], truth[-1]), between(*mapper.trajectory()[[0, -1]]))
    assert not mapper.counts['loops']
    assert abs(off[1]) < 1.2  # and not 3 m


def test_near_misses_are_counted_and_reported(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scans, _ = drive(ring(), [*AROUND, (12.6, 13.0)], 0.012)
    log, report = tmp_path / 'ring.csv', tmp_path / 'report.json'
    lines = [f'# t, odometry x y yaw, reference x y yaw, then {BEAMS} ranges in m, first beam at '
             '-90.0 deg, step 1.0000 deg']
    for number, scan in enumerate(scans):
        pose = [f'{each:.5f}' for each in scan.odometry]
        lines.append(','.join([str(number), *pose, *pose, *(
            f'{each:.3f}' if math.isfinite(each) else '8.0' for each in scan.ranges)]))
    log.write_text('\n'.join(lines))
    assert run(['--bag', str(log), '--report', str(report), '--range-max', '7.9']) == 0
    found = json.loads(report.read_text())
    assert f'{found["near_misses"]} near misses)' in capsys.readouterr().out
    assert found['near_misses'] == len(found['near']) > 0
    assert not any('--range-max' in each for each in found['problems'])
    assert all(each['why'] and 0.5 <= each['of_visible'] <= 1.0 for each in found['near'])


def test_a_mapper_begins_with_no_near_miss() -> None:
    mapper = Mapper()
    assert mapper.counts['near_misses'] == 0 and mapper.near_misses == []
