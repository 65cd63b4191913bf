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

"""The module localization with a SLAM: alone and beside marks, loops, a SLAM that is dead."""

from __future__ import annotations

import math
from typing import Any

from benchmarks.localization.plant import off
from benchmarks.localization.plant import turned
from localization_bench import Bench
from localization_bench import far_robot
from localization_bench import pose_of
import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.reports import formatted
from rt_robot_os.base.reports import Reports
from rt_robot_os.motion.angles import yaw_of
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.poses import composed

pytest.importorskip('nav_msgs', reason='ROS 2 messages are not installed')

LOOP = (0.6, -0.8, 0.1)
ALONE: dict[str, Any] = {'fix_topic': 'slam/pose', 'correction_topic': 'slam/correction',
                         'fix_silent_warn_s': 3.0, 'use_gyro': True}
NAN = math.nan


class Mapped(Bench):
    """A robot without marks, that is where scans say on a map that can be moved."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(far_robot(), **{**ALONE, **settings})
        self.source = self.slam
        self.delay_s = 0.1
        self.reports = Reports()
        self.module.log.connect(self.reports, self.kernel.now_ns)

    def loop(self, movement: Pose, stamp_ns: int = 0, z: float = 0.0, tilt: float = 0.0) -> None:
        """Tell that the map was moved; what is measured from now on is of the new map."""
        message = self.loops.msg.pose.pose
        message.position = movement[0], movement[1], z
        message.orientation = tilt, 0.0, math.sin(movement[2] / 2), math.cos(movement[2] / 2)
        self.loops.publish(stamp_ns)

    @property
    def truth(self) -> Pose:
        return composed(self.map_at, self.robot.pose)


def test_scans_alone_say_where_the_robot_is() -> None:
    with Mapped() as bench:
        bench.drive(10.0)
        assert off(bench.newest(), bench.truth) < 0.03
        found = bench.found
        assert found['warning'] == '' and found['rejected'] < 3 and found['corrected'] == 0


def test_a_loop_moves_the_pose_at_once_and_odometry_never() -> None:
    with Mapped() as bench:
        bench.drive(5.0)
        before, told = bench.found, bench.newest()
        while bench.transform.take() or bench.odom.take():
            pass
        bench.loop(LOOP)
        bench.map_at = LOOP
        odometry = pose_of(bench.odom.msg)
        bench.drive(0.06, marks=False)
        assert off(bench.newest(), bench.truth) < 0.05
        assert turned(bench.newest(), bench.truth) < math.radians(3.0)
        assert off(bench.newest(), told) > 0.5
        while bench.odom.take():
            assert off(pose_of(bench.odom.msg), odometry) < 0.02
            odometry = pose_of(bench.odom.msg)
        while bench.transform.take():
            pass
        t, q = bench.transform.msg.transform.translation, bench.transform.msg.transform.rotation
        again = composed((t.x, t.y, yaw_of(q.x, q.y, q.z, q.w)), odometry)
        assert off(again, pose_of(bench.pose.msg)) < 1e-9
        bench.drive(5.0)
        found = bench.found
        assert off(bench.newest(), bench.truth) < 0.03
        assert (found['corrected'], found['recovered']) == (1, 0)
        assert found['rejected'] - before['rejected'] < 3 and found['warning'] == ''
        assert found['jump_m'] > 0.5 and found['jump_deg'] == pytest.approx(
            math.degrees(0.1), abs=0.01)
        assert any('the map was moved: the pose jumps by ' in str(formatted(line))
                   for line, _ in bench.reports.lines)


@pytest.mark.parametrize(('movement', 'z', 'tilt', 'why'), [
    ((NAN, 0.0, 0.0), 0.0, 0.0, 'not finite'), ((0.0, math.inf, 0.0), 0.0, 0.0, 'not finite'),
    ((0.0, 0.0, NAN), 0.0, 0.0, 'not finite'), ((0.1, 0.0, 0.0), 5.0, 0.0, 'tilt or lift'),
    ((0.1, 0.0, 0.0), 0.0, 0.3, 'tilt or lift'), ((50.0, 0.0, 0.0), 0.0, 0.0, 'correction_max_m'),
    ((0.0, 0.0, 3.0), 0.0, 0.0, 'correction_max_m')])
def test_a_correction_that_cannot_be_is_refused(
        movement: Pose, z: float, tilt: float, why: str) -> None:
    with Mapped() as bench:
        bench.drive(1.0)
        bench.loop(movement, z=z, tilt=tilt)
        bench.drive(0.5)
        found = bench.found
        assert off(bench.newest(), bench.truth) < 0.05
        assert (found['corrected'], found['corrections_refused']) == (0, 1)
        assert why in found['warning']


def test_corrections_of_the_future_the_past_and_the_same_moment() -> None:
    with Mapped() as bench:
        bench.drive(4.0)
        now_ns = bench.kernel.now_ns()
        bench.loop((0.1, 0.0, 0.0), now_ns + 10 ** 9)
        bench.drive(0.02)
        assert bench.found['corrections_refused'] == 1 and 'ahead of now' in bench.warning
        bench.loop((0.1, 0.0, 0.0), now_ns - 3 * 10 ** 9)
        bench.drive(0.02)
        assert bench.found['corrections_late'] == 1 and bench.found['corrected'] == 0
        bench.loop((0.1, 0.0, 0.0), now_ns)
        bench.loop((0.1, 0.0, 0.0), now_ns)
        bench.drive(0.02)
        assert (bench.found['corrected'], bench.found['corrections_again']) == (1, 1)
        assert bench.warning == ''


def test_while_the_slam_is_dead_the_robot_knows_where_it_is_by_its_wheels_and_how_well() -> None:
    with Mapped() as bench:
        bench.drive(5.0)
        sure = bench.found['position_stddev_m']
        count = bench.pose.seq
        bench.drive(10.0, marks=False)
        assert off(bench.newest(), bench.truth) < 0.15
        assert bench.pose.seq - count > 10.0 * 0.95 / 0.02
        found = bench.found
        assert found['position_stddev_m'] > 1.5 * sure
        assert 'no measured pose for 10 s on slam/pose' in found['warning']
        bench.drive(2.0)
        assert bench.warning == '' and bench.found['recovered'] == 0


def test_beside_marks_a_slam_on_another_map_is_told_and_does_not_pull() -> None:
    with Bench(far_robot(), use_gyro=True, second_fix_topic='slam/pose',
               second_fix_correlation_s=2.0) as bench:
        bench.slam_at = (0.3, 0.0, 0.02)
        bench.drive(6.0)
        assert off(bench.newest(), bench.robot.pose) < 0.05
        found = bench.found
        assert found['recovered'] == 0 and found['slam/pose rejected'] > 40
        assert found['stargazer/pose rejected'] < 5
        assert 0.15 < found['disagreement_m'] < 0.45
        assert 'slam/pose has contradicted the estimate for' in found['warning']


def test_beside_marks_a_slam_carries_over_where_there_are_none() -> None:
    with Bench(far_robot(), use_gyro=True,
               second_fix_topic='slam/pose', second_fix_correlation_s=2.0) as bench:
        bench.slam_at = (0.02, 0.0, 0.0)
        bench.drive(5.0)
        bench.drive(20.0, marks=False)
        assert off(bench.newest(), bench.robot.pose) < 0.05
        assert bench.found['recovered'] == 0 and bench.found['slam/pose rejected'] < 8
        assert bench.found['dead_time_s'] == 0.0 and bench.warning == ''


def test_a_map_that_turns_and_a_heading_that_is_measured_exclude_each_other() -> None:
    with pytest.raises(ConfigError, match='correction_topic turns the map'):
        with Mapped(use_imu_heading=True) as bench:
            bench.drive(0.1)
