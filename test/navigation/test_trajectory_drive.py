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

"""
How well the robot drives with the whole chain: odometry, localisation, trajectory, wheels.

The world has slip that changes all the time, encoders have steps, and a StarGazer sees the pose
with noise of 1 cm and 1 degree, 80 ms late.
"""

from __future__ import annotations

import math

from driven_world import Chain
import pytest

from rt_robot_os.motion.angles import wrapped
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.reference_path import Path
from rt_robot_os.motion.spline import legs

pytest.importorskip('nav_msgs', reason='ROS 2 messages are not installed')

UP = math.pi / 2
GOAL: Pose = (3.44, 2.30, UP)


def rms(values: list[float]) -> float:
    return math.sqrt(sum(v * v for v in values) / len(values))


def eight(radius_m: float = 1.5, count: int = 200) -> list[Pose]:
    angles = [math.tau * i / count for i in range(count + 1)]
    return [(radius_m * math.sin(a), radius_m * math.sin(a) * math.cos(a),
             math.atan2(math.cos(2 * a), math.cos(a))) for a in angles]


def papers_run(seed: int, slip: float = 0.0) -> Chain:
    """From (344, 100) to (344, 230) cm, 120 to 90 degrees, a step every 300 ms."""
    with Chain((3.44, 1.0, math.radians(120)), 1 / 0.3, slip, seed,
               goal_tolerance_rad=0.01) as chain:
        chain.at(4.0, lambda: chain.drive_to(*GOAL))
        chain.run(22.0)
    assert chain.told[-1] == 'done'
    return chain


@pytest.mark.parametrize('slip', [0.0, 0.05])
@pytest.mark.parametrize('seed', [3, 14, 15])
def test_the_papers_run(slip: float, seed: int) -> None:
    chain = papers_run(seed, slip)
    assert chain.distance_m == pytest.approx(1.30, abs=0.02 if slip else 0.01)
    assert rms([x - 3.44 for _, (x, y, _) in chain.track if y > 1.3]) < 0.015
    assert abs(wrapped(chain.base.pose[2] - UP)) < math.radians(1)


def test_the_papers_run_takes_the_same_time_whatever_the_noise_within_a_period() -> None:
    counts = [len(papers_run(seed).commands) for seed in (1, 2, 3)]
    assert max(counts) - min(counts) <= 1


def away(chain: Chain, path: Path, after_s: float) -> list[float]:
    found, near = [], 0.0
    for time_s, (x, y, _) in chain.track:
        if time_s > after_s:
            near = path.nearest(x, y, near)
            px, py = path.at(near)[:2]
            found.append(math.hypot(px - x, py - y))
    return found


@pytest.mark.parametrize('seed', [9])
def test_the_eight_at_50_hz_is_not_behind_regulated_pure_pursuit(seed: int) -> None:
    path, = legs(eight(), 0.8)
    found = {}
    for law in ('kanayama', 'regulated_pure_pursuit'):
        with Chain((0.0, 0.0, math.pi / 4), 50.0, 0.0, seed, law=law,
                   angular_max_rad_s=1.5) as chain:
            chain.at(3.0, lambda: chain.follow(eight()))
            chain.run(43.0)
        assert chain.told[-1] == 'done'
        found[law] = away(chain, path, 3.0)
    assert rms(found['kanayama']) < 0.02
    assert max(found['kanayama']) < 0.05
    assert rms(found['kanayama']) < rms(found['regulated_pure_pursuit'])
