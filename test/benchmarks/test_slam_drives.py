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

"""The simulated drives: the same each time, true to their map, with wheels that are not."""

from __future__ import annotations

import math
from typing import Any

from benchmarks.slam.drives import Drive
from benchmarks.slam.drives import drive
from benchmarks.slam.drives import flat_drive
from benchmarks.slam.drives import ring_map
import numpy as np
import pytest

from rt_robot_os.features.mapping.slam.transforms import between
from rt_robot_os.features.mapping.slam.transforms import composed

SHORT = ((3.44, 1.0), (4.4, 1.1), (4.4, 2.2))


def on_walls(made: Drive) -> float:
    """Return the share of all echoes that end within 5 cm of something that is on the map."""
    good = count = 0
    for scan, pose in zip(made.scans, made.truth):
        angles = pose[2] + scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
        if scan.beam_poses is not None:
            where = composed(np.broadcast_to(pose, scan.beam_poses.shape), scan.beam_poses)
            angles = angles + scan.beam_poses[:, 2]
        else:
            where = np.broadcast_to(pose, (len(angles), 3))
        there = np.isfinite(scan.ranges)
        x = where[there, 0] + scan.ranges[there] * np.cos(angles[there])
        y = where[there, 1] + scan.ranges[there] * np.sin(angles[there])
        near = [made.grid.values(x + dx, y + dy) == 100
                for dx in (-0.05, 0.0, 0.05) for dy in (-0.05, 0.0, 0.05)]
        good += int(np.any(near, axis=0).sum())
        count += int(there.sum())
    return good / count


def test_a_drive_is_the_same_each_time_and_another_with_another_seed() -> None:
    first, again, other = (flat_drive(seed, SHORT) for seed in (1, 1, 2))
    assert all(np.array_equal(a.ranges, b.ranges) and np.array_equal(a.odometry, b.odometry)
               for a, b in zip(first.scans, again.scans, strict=True))
    assert not np.array_equal(first.scans[0].ranges, other.scans[0].ranges)
    assert np.diff([each.stamp_ns for each in first.scans]) == pytest.approx(100_000_000)
    assert first.in_its_map()[0] == pytest.approx((0.0, 0.0, 0.0))


def test_scans_lie_on_the_walls_of_the_true_map_and_wheels_are_off() -> None:
    made = flat_drive(1, SHORT)
    assert on_walls(made) > 0.99
    off = between(made.in_its_map()[-1], between(made.scans[0].odometry, made.scans[-1].odometry))
    assert 0.02 < np.hypot(off[0], off[1]) < 0.5
    true_wheels = flat_drive(1, SHORT, slip=0.0, wheel=0.0)
    off = between(made.in_its_map()[-1], between(true_wheels.scans[0].odometry,
                                                 true_wheels.scans[-1].odometry))
    assert np.abs(off).max() < 0.005


def test_a_skewed_scan_lies_on_the_walls_only_when_it_is_deskewed() -> None:
    straight: dict[str, Any] = {'slip': 0.0, 'wheel': 0.0, 'speed_m_s': 0.8, 'is_skewed': True}
    way = ((2.0, 2.0), (5.0, 2.0), (4.5, 2.1), (5.0, 2.2))
    assert on_walls(drive(ring_map(), way, **straight)) > 0.99
    assert on_walls(drive(ring_map(), way, is_deskewed=False, **straight)) < 0.97


def test_glass_gives_no_echo_and_people_stand_before_walls() -> None:
    plain, glass = flat_drive(1, SHORT), flat_drive(1, SHORT, glass=0.2)
    missing = np.mean([np.isinf(each.ranges).mean() for each in glass.scans])
    assert 0.05 < missing < 0.4
    assert not any(np.isinf(each.ranges).any() for each in plain.scans)
    crossing = (((5.0, 1.0), (4.8, 3.0)),)
    peopled = drive(plain.grid, SHORT, 1, crossing)
    nearer = sum(int((b.ranges < a.ranges - 0.3).sum())
                 for a, b in zip(plain.scans, peopled.scans, strict=True))
    assert nearer > 500


def test_a_laser_that_sees_less_than_a_turn_looks_ahead() -> None:
    made = flat_drive(1, SHORT, beams=270, field_rad=math.radians(270))
    assert len(made.scans[0].ranges) == 270
    assert made.scans[0].angle_min == pytest.approx(math.radians(-135))
    assert made.scans[0].angle_min + 269 * made.scans[0].angle_increment == pytest.approx(
        math.radians(135))
    assert on_walls(made) > 0.99
