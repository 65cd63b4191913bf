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

"""The base of the tutorial: its configuration is right, and its square ends where it began."""

from __future__ import annotations

from importlib import util
import math
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('nav_msgs.msg', reason='the ROS 2 messages are not installed')

from rt_robot_os.motion.differential import moved  # noqa: E402, I100
from rt_robot_os.settings import load  # noqa: E402
from rt_robot_os.testing.module_bench import ModuleBench  # noqa: E402

BASE = Path(__file__).resolve().parents[2] / 'examples' / 'robot_base'


def square_class() -> Any:
    spec = util.spec_from_file_location('square', BASE / 'square.py')
    assert spec is not None and spec.loader is not None
    module = util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Square


def test_the_configuration_is_right(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(BASE))
    robot = load([BASE / 'base.yaml'], simulate=True)
    assert [(each.name, each.port) for each in robot.devices] == [('board', 'sim')]
    board, odometry = robot.devices[0].settings, robot.modules[0].settings
    for key in ('wheel_radius_m', 'wheel_separation_m'):
        assert board[key] == odometry[key], 'both have to be changed'
    priorities = [each.priority for each in (robot.devices[0], robot.modules[1], robot.modules[2])]
    assert priorities == sorted(priorities, reverse=True), 'board, mux, square'


@pytest.mark.parametrize('to_the_right', [False, True])
def test_a_square_ends_where_it_began_and_goes_the_other_way_on_demand(to_the_right: bool) -> None:
    with ModuleBench() as bench:
        begin = bench.topic('square/begin', 'std_msgs/msg/Bool')
        odom = bench.topic('odom', 'nav_msgs/msg/Odometry',
                           {'header.frame_id': 'odom', 'child_frame_id': 'base_link'})
        bench.add(square_class(), rate_hz=50.0, to_the_right=to_the_right)
        command = bench.watch('cmd_vel_agent')
        pose, velocity, ways = (0.0, 0.0, 0.0), (0.0, 0.0), []

        def drive() -> None:
            nonlocal pose, velocity
            while command.take():
                velocity = command.msg.linear.x, command.msg.angular.z
            pose = moved(pose, velocity[0] * 0.02, velocity[1] * 0.02)
            ways.append(pose)
            at = odom.msg.pose.pose
            at.position.x, at.position.y = pose[:2]
            at.orientation.z, at.orientation.w = math.sin(pose[2] / 2), math.cos(pose[2] / 2)
            odom.publish()

        bench.kernel.add_task('wheels', drive, priority=60, rate_hz=50.0)
        begin.msg.data = True
        bench.at(1.0, begin.publish)
        bench.run(60.0)
    assert velocity == (0.0, 0.0)
    assert pose[:2] == pytest.approx((0.0, 0.0), abs=0.03)
    assert math.remainder(pose[2], math.tau) == pytest.approx(0.0, abs=0.03)
    reach = min(y for _, y, _ in ways) if to_the_right else max(y for _, y, _ in ways)
    assert reach == pytest.approx(-1.0 if to_the_right else 1.0, abs=0.05)
