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

"""The period that a module computes with."""

from __future__ import annotations

import pytest

pytest.importorskip('nav_msgs.msg', reason='the ROS 2 messages are not installed')

from rt_robot_os.features.navigation.trajectory import Trajectory  # noqa: E402
from rt_robot_os.modules import Module  # noqa: E402, I100
from rt_robot_os.testing.module_bench import ModuleBench  # noqa: E402

MS = 1_000_000


class Idle(Module):
    """Do nothing."""

    def step(self) -> None:
        """Do nothing."""


def test_the_period_follows_a_change_of_the_rate() -> None:
    with ModuleBench() as bench:
        module = bench.add(Idle, rate_hz=50.0)
        assert module.period_ns == 20 * MS
        module.change('rate_hz', 100.0)
        assert module.period_ns == 10 * MS
        assert bench.add(Idle, 'woken').period_ns == 0


def test_a_replayed_trajectory_has_the_period_of_the_recorded_one() -> None:
    with ModuleBench() as bench:
        for name, message, fixed in (
                ('pose', 'PoseWithCovarianceStamped', {'header.frame_id': 'map'}),
                ('goal_pose', 'PoseStamped', {'header.frame_id': 'map'})):
            bench.topic(name, f'geometry_msgs/msg/{message}', fixed)
        bench.topic('odom', 'nav_msgs/msg/Odometry', {
            'header.frame_id': 'odom', 'child_frame_id': 'base_link'})
        module = bench.add(Trajectory, rate_hz=50.0)
        assert module.task is not None
        module.task.period_ns = 0  # what was recorded releases it
        bench.run(0.1)  # and it is prepared all the same
        assert module.period_ns == 20 * MS
