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

"""The pose of now, from older poses and odometry."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st
import pytest

from rt_robot_os.motion.angles import wrapped
from rt_robot_os.motion.differential import moved
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.pose_prediction import PosePrediction

MS = 1_000_000
POSES = st.tuples(st.floats(-10, 10), st.floats(-10, 10), st.floats(-3, 3))


@given(POSES, POSES, st.floats(-1, 1), st.floats(-2, 2), st.integers(0, 400))
def test_a_late_pose_is_carried_on_to_now(start: Pose, odom: Pose, linear: float, angular: float,
                                          late_ms: int) -> None:
    """However late the pose is, as long as the odometry of its time is still there."""
    prediction = PosePrediction()
    for ms in range(0, 1001, 20):
        prediction.add_odometry(ms * MS, moved(odom, linear * ms / 1000, angular * ms / 1000),
                                (linear, angular))
    then_s = (1000 - late_ms) / 1000
    prediction.add_pose((1000 - late_ms) * MS, moved(start, linear * then_s, angular * then_s))
    found = prediction.at(1050 * MS, 0.1, 0.02)
    wanted = moved(start, linear * 1.15, angular * 1.15)
    assert found[:2] == pytest.approx(wanted[:2], abs=2e-3)
    assert wrapped(found[2] - wanted[2]) == pytest.approx(0.0, abs=2e-3)


def test_a_correction_is_taken_over_at_a_limited_rate() -> None:
    prediction = PosePrediction(correction_m_s=0.1, correction_rad_s=0.3)
    prediction.add_odometry(0, (0.0, 0.0, 0.0), (0.0, 0.0))
    prediction.add_pose(0, (0.0, 0.0, 0.0))
    prediction.add_pose(0, (0.03, 0.04, 0.1))
    poses = [prediction.at(0, 0.0, 0.02) for _ in range(40)]
    steps = [math.hypot(b[0] - a[0], b[1] - a[1]) for a, b in zip(poses, poses[1:])]
    turns = [abs(b[2] - a[2]) for a, b in zip(poses, poses[1:])]
    assert max(steps) == pytest.approx(0.002)
    assert max(turns) == pytest.approx(0.006)
    assert poses[-1] == pytest.approx((0.03, 0.04, 0.1))
    assert prediction.jumps == 0


def test_another_place_is_taken_over_at_once_and_counted() -> None:
    prediction = PosePrediction(jump_m=0.5)
    prediction.add_odometry(0, (0.0, 0.0, 0.0), (0.0, 0.0))
    prediction.add_pose(0, (0.0, 0.0, 0.0))
    prediction.add_pose(0, (3.0, 0.0, 0.0))
    assert prediction.at(0, 0.0, 0.02) == pytest.approx((3.0, 0.0, 0.0))
    assert prediction.jumps == 1


def test_odometry_that_begins_anew_waits_for_a_pose() -> None:
    prediction = PosePrediction()
    prediction.add_pose(0, (1.0, 0.0, 0.0))
    assert not prediction.known
    prediction.add_odometry(0, (50.0, 0.0, 0.0), (0.3, 0.0))
    prediction.add_pose(0, (1.0, 0.0, 0.0))
    prediction.add_odometry(20 * MS, (50.006, 0.0, 0.0), (0.3, 0.0))
    assert prediction.known
    assert prediction.at(20 * MS, 0.0, 0.02) == pytest.approx((1.006, 0.0, 0.0))
    prediction.add_odometry(40 * MS, (0.0, 0.0, 0.0), (0.3, 0.0))
    assert not prediction.known
    assert prediction.resets == 1
    prediction.add_pose(40 * MS, (1.012, 0.0, 0.0))
    assert prediction.at(40 * MS, 0.0, 0.02) == pytest.approx((1.012, 0.0, 0.0))


def test_nothing_is_carried_on_for_ever_when_odometry_stands_still() -> None:
    prediction = PosePrediction()
    prediction.add_odometry(0, (0.0, 0.0, 0.0), (1.0, 0.0))
    prediction.add_odometry(0, (9.0, 0.0, 0.0), (1.0, 0.0))
    prediction.add_pose(0, (0.0, 0.0, 0.0))
    assert prediction.at(3_600_000 * MS, 0.0, 0.02)[0] == pytest.approx(0.5)
