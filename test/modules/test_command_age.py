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

"""Orders that waited somewhere start no movement; what stops the robot is never too old."""

from __future__ import annotations

from pathlib import Path

from agent_rig import AgentRig
from planned_rooms import Planned
import pytest
from rt_robot_os.features.navigation.twist_guard import TwistGuard
from rt_robot_os.modules.command_age import COMMAND_AGE
from rt_robot_os.modules.command_age import stale_reason
from rt_robot_os.testing.module_bench import ModuleBench
from steered import Bench

pytest.importorskip('nav_msgs', reason='ROS 2 messages are not installed')

MS = 1_000_000
S = 1_000_000_000


def test_an_order_is_refused_from_its_age_on_and_the_reason_says_the_remedy() -> None:
    settings = {COMMAND_AGE.name: 5.0}
    assert not stale_reason(5 * S, 10 * S, settings)
    assert not stale_reason(11 * S, 10 * S, settings), 'a time in the future counts as now'
    why = stale_reason(4 * S, 10 * S, settings)
    assert '6.0 s old' in why and 'give it again' in why


@pytest.mark.parametrize(('age_s', 'drives'), [(4.0, True), (6.0, False)])
def test_a_goal_that_waited_is_not_driven_to(age_s: float, drives: bool) -> None:
    with Bench() as bench:
        def give() -> None:
            bench.goal.msg.pose.position = 1.0, 0.0, 0.0
            bench.goal.msg.pose.orientation = 0.0, 0.0, 0.0, 1.0
            bench.goal.publish(bench.kernel.now_ns() - round(age_s * S))
        bench.at(7.0, give)
        bench.run(8.0)
        assert bool(bench.all_commands) == drives
        assert bench.module.statistics()['goals_refused'] == (not drives)
        assert drives or 'order_age_max_s' in bench.state


def test_a_plan_is_as_young_as_its_planner_says_it_is() -> None:
    with Bench() as bench:
        def give() -> None:
            bench.plan.msg.data = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0]
            bench.plan.publish(bench.kernel.now_ns() - 6 * S)
        bench.at(7.0, give)
        bench.run(8.0)
        assert bench.all_commands, 'it waited for the planner, which has looked at the goal'


def test_the_planner_refuses_a_goal_that_waited(tmp_path: Path) -> None:
    robot = Planned(tmp_path)

    def give() -> None:
        pose = robot.goal_out.msg.pose
        pose.position.x, pose.position.y, pose.orientation.w = 5.0, 1.25, 1.0
        robot.goal_out.publish(robot.bench.kernel.now_ns() - 6 * S)
    robot.bench.at(7.0, give)
    robot.bench.run(9.0)
    assert not robot.plans and robot.told()[-1].startswith('refused: it was 6.')


def test_a_cancellation_that_is_dated_too_early_ends_the_goal_all_the_same(tmp_path: Path) -> None:
    robot = Planned(tmp_path, cancel_topic='trajectory_cancel')

    def give_up() -> None:
        robot.cancel_out.msg.data = True
        # The clock of its sender was set back.
        robot.cancel_out.publish(robot.bench.kernel.now_ns() - 5 * S // 2)
    robot.go(5.0, 1.25, 1.0)
    robot.bench.at(3.0, give_up)
    robot.bench.run(4.0)
    assert robot.told()[-1] == 'stopped: cancelled'


def test_the_agent_refuses_old_commands_but_those_that_stop_it() -> None:
    rig = AgentRig()
    command = rig.texts['agent/command']

    def say(text: str, age_s: float) -> None:
        command.msg.data = text
        command.publish(rig.kernel.now_ns() - round(age_s * S))
    rig.at(8.0, lambda: say('go 1', 1.0))  # there is no such alarm: refused by the agent
    rig.at(8.5, lambda: say('return', 6.0))
    rig.at(9.0, lambda: say('abort', 6.0))
    rig.at(9.5, lambda: say('stay', 6.0))
    rig.run(10.0)
    assert rig.agent.statistics()['words_refused'] == 2


def test_a_guard_passes_nothing_on_that_was_commanded_before_a_gap() -> None:
    bench = ModuleBench()
    command = bench.topic('cmd_vel', 'geometry_msgs/msg/Twist')
    guard = bench.add(TwistGuard, 'guard', rate_hz=50.0, timeout_s=10.0)
    safe = bench.watch('cmd_vel_safe')

    def drive() -> None:
        command.msg.linear.x = 0.5
        command.publish()
    bench.at(0.1, drive)
    bench.run(0.2)
    assert safe.latest() and safe.msg.linear.x == 0.5
    bench.kernel.clock.spend(1500 * MS)
    bench.run(0.05)
    assert safe.latest() and safe.msg.linear.x == 0.0
    assert guard.statistics()['gaps'] == 1
    drive()
    bench.run(0.05)
    assert safe.latest() and safe.msg.linear.x == 0.5
