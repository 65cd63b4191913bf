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

"""Beams count from where the laser was when they were measured, however it is mounted."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip('scipy', reason='SciPy is not installed')

from rt_robot_os.features.mapping.slam.deskew import beam_seconds  # noqa: E402
from rt_robot_os.features.mapping.slam.deskew import LaserMount  # noqa: E402
from rt_robot_os.features.mapping.slam.deskew import scan_of  # noqa: E402
from rt_robot_os.features.mapping.slam.deskew import Sweep  # noqa: E402
from rt_robot_os.features.mapping.slam.odometry_track import OdometryTrack  # noqa: E402
from rt_robot_os.features.mapping.slam.scan import surface_of  # noqa: E402
from rt_robot_os.features.mapping.slam.transforms import composed  # noqa: E402
from rt_robot_os.features.mapping.slam.transforms import placed  # noqa: E402
from rt_robot_os.motion.mounting import Mounting  # noqa: E402

NS = 1_000_000_000
START_NS = 10 ** 18  # a machine that has run for thirty years
ANGLES = np.linspace(-2.0, 2.0, 200)
BEAM_S = 0.1 / 200


def moving(turn_rad_s: float, speed_m_s: float) -> OdometryTrack:
    track = OdometryTrack()
    for step in range(-5, 20):
        time_s = step * 0.02
        yaw = turn_rad_s * time_s
        track.add(START_NS + round(time_s * NS), (
            speed_m_s / turn_rad_s * math.sin(yaw), speed_m_s / turn_rad_s * (1 - math.cos(yaw)),
            yaw))
    return track


@pytest.mark.parametrize('roll', [0.0, math.pi])
@pytest.mark.parametrize('beam_s', [BEAM_S, -BEAM_S])
def test_a_wall_is_straight_though_the_robot_turned(roll: float, beam_s: float) -> None:
    mount = LaserMount.of(Mounting((0.2, 0.1, 0.3), (roll, 0.0, 0.4)))
    track = moving(1.5, 0.5)
    stamps = START_NS + np.rint(np.arange(200) * beam_s * NS).astype(np.int64)
    lasers = composed(track.at(stamps), np.broadcast_to(mount.pose, (200, 3)))
    bearings = lasers[:, 2] + (-ANGLES if roll else ANGLES)
    with np.errstate(divide='ignore'):
        ranges = (3.0 - lasers[:, 0]) / np.cos(bearings)  # of a wall at x = 3
    ranges[(np.cos(bearings) < 0.3)] = np.inf
    scan = scan_of(Sweep(START_NS, ranges, -2.0, ANGLES[1] - ANGLES[0], beam_s), track, mount)
    points = placed(scan.odometry, surface_of(scan, 20.0).points)
    assert len(points) > 50
    assert np.abs(points[:, 0] - 3.0).max() < 1e-3
    assert mount.base(scan.odometry).tolist() == pytest.approx(
        track.at(np.array([START_NS]))[0].tolist(), abs=1e-9)


def test_one_that_stands_needs_no_compensation() -> None:
    track = OdometryTrack()
    for step in range(10):
        track.add(START_NS + step * NS // 50, (1.0, 2.0, 3.0))
    scan = scan_of(Sweep(START_NS, np.ones(100), 0.0, 0.01, 0.001), track, LaserMount(np.zeros(3)))
    assert scan.beam_poses is None and scan.odometry.tolist() == [1.0, 2.0, 3.0]


def test_drivers_say_the_time_of_a_beam_in_two_ways() -> None:
    assert beam_seconds(0.001, 0.1, 0.01, 100) == 0.001
    assert beam_seconds(0.0, 0.1, math.tau / 400, 100) == pytest.approx(0.1 / 400)
    assert beam_seconds(1.0, 0.0, 0.01, 100) == 0.0  # a scan that took 100 s
    assert beam_seconds(math.nan, 0.1, 0.01, 100) == 0.0


def test_a_pose_is_as_unsure_as_the_lever_to_the_laser_makes_it() -> None:
    mount = LaserMount(np.array((1.0, 0.0, 0.0)))
    found = mount.covariance_of_base(np.array((0.0, 0.0, math.pi / 2)), np.diag((0.0, 0.0, 0.01)))
    assert found.round(6).tolist() == [[0.01, 0.0, 0.01], [0.0, 0.0, 0.0], [0.01, 0.0, 0.01]]


def test_a_track_tells_gaps_and_forgets_what_is_old() -> None:
    track = OdometryTrack()
    for step in range(6000):
        track.add(step * NS // 50, (0.0, 0.0, 0.0))
    assert len(track) < 3000 and not track.covers(0, track.last_ns)
    assert track.covers(track.last_ns - NS, track.last_ns)
    track.add(track.last_ns + NS, (0.0, 0.0, 0.0))
    assert not track.covers(track.last_ns - NS // 2, track.last_ns)
    assert not track.add(track.last_ns, (0.0, 0.0, 0.0))
