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

"""The motion of the robot in scenarios: it drives to its goals unless a fault is injected."""

from __future__ import annotations

import math
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.motion.angles import wrapped
from rt_robot_os.sim.world import World
from rt_robot_os.tools.rehearse.fixture import CoreFixture
from rt_robot_os.tools.rehearse.fixture import STEP_NS

_SPEED_M_S: Final = 0.4
_TURN_RAD_S: Final = 0.8
_STEP_S: Final = STEP_NS / NS_PER_S
_POSE_EVERY: Final = 2
_STATE_EVERY: Final = 20
# Time that the planner waits for a free path, the default of the real one.
_PATIENCE_S: Final = 30.0
# Age at which a velocity command expires.
_COMMAND_NS: Final = NS_PER_S // 2
# Orders of the agent later than this after an override are violations.
_REACTION_NS: Final = 3 * STEP_NS
# Near its start it is charged; the states are those of sensor_msgs/BatteryState.
_HOME_M: Final = 0.3
_CHARGING, _DISCHARGING = 1, 2
_FULL_V, _FLAT_V = 25.2, 21.2
# Velocity at which an operator turns the robot.
_TELEOP_RAD_S: Final = 0.3
_SAME_M: Final = 1e-6


class SimulatedRobot:
    """
    Simulates localization, planner, trajectory, multiplexer, guard and wheels.

    It turns to a goal, drives there in a straight line (walls are ignored: the real modules have
    their own tests) and publishes the same messages as the real modules.

    :param world: the world with the robot.
    :ivar blocked: there is an obstacle on the path.
    :ivar lost: its position is unknown.
    :ivar battery_low: its battery is nearly empty.
    :ivar estop: the e-stop is active.
    :ivar refuses: no place near the goal is free.
    :ivar silent: the planner publishes nothing.
    :ivar stuck: its wheels turn, but it does not move.
    :ivar driven: an operator steers.
    :ivar home: its start position, where it is charged.
    :ivar errand: goal of an operator; None without one.
    :ivar violations: orders of the agent during an e-stop or a control by an operator.
    :ivar moved_m: travelled distance.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        self.blocked = self.lost = self.estop = self.refuses = False
        self.battery_low = self.silent = self.stuck = self.driven = False
        self.violations: list[str] = []
        self.moved_m = 0.0
        self.home = world.base.pose[:2]
        self._reset()

    def _reset(self) -> None:
        self._goal: tuple[float, float, float] | None = None
        self.errand: tuple[float, float] | None = None
        self._waited_s = 0.0
        self._state, self._planner = 'idle', ''
        self._turn_rad_s, self._turn_until_ns = 0.0, 0
        self._steps = 0
        self._overridden_ns: int | None = None
        self._steered_by = ''

    def attach(self, fixture: CoreFixture) -> None:
        """Find the topics; the goal is lost, as after a crash of the core."""
        self._reset()
        self._pose = fixture.publisher('pose')
        self._trajectory_out = fixture.publisher('trajectory/state')
        self._planner_out = fixture.publisher('planner/state')
        self._battery = fixture.publisher('battery')
        self._stop_reason = fixture.publisher('stop_reason')
        self._estop_out = fixture.publisher('estop')
        self._steering = fixture.publisher('steering')
        self._goals = fixture.reader('goal_pose')
        self._cancels = fixture.reader('trajectory_cancel')
        self._commands = fixture.reader('cmd_vel_agent')
        self._held = False

    # ---- moving ------------------------------------------------------------------------------

    def step(self, now_ns: int) -> None:
        """Receive orders, move, and publish the state."""
        self.world.advance(now_ns)
        self._steps += 1
        self._receive(now_ns)
        self._hold(now_ns)
        self._move(now_ns)
        if self._steps % _POSE_EVERY == 0 and not self.lost and self._pose is not None:
            x, y, yaw = self.world.base.pose
            pose = self._pose.msg.pose.pose
            pose.position = x, y, 0.0
            pose.orientation = 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)
            self._pose.publish(now_ns)
        self._publish_steering(now_ns)
        if self._steps % _STATE_EVERY == 0:
            self._publish_state(self._state, now_ns, again=True)
            if self._battery is not None:
                self._fill_battery(self._battery.msg)
                self._battery.publish(now_ns)

    def _fill_battery(self, message: Any) -> None:
        message.voltage = volts = _FLAT_V if self.battery_low else _FULL_V
        message.percentage = max(0.0, min(1.0, (volts - 21.0) / 4.2))
        is_home = math.dist(self.world.base.pose[:2], self.home) < _HOME_M
        message.power_supply_status = _CHARGING if is_home else _DISCHARGING

    def _publish_steering(self, now_ns: int) -> None:
        """Publish the source of the velocity, as the multiplexer does."""
        steers = ('nobody: e-stop, asked for on estop' if self._held else
                  'teleop' if self.driven else
                  'agent' if self._turn_rad_s and now_ns < self._turn_until_ns else
                  'trajectory' if self._goal is not None else 'nobody')
        if steers != self._steered_by and self._steering is not None:
            self._steering.msg.data = steers
            self._steering.publish(now_ns)
        self._steered_by = steers

    def _check_order(self, what: str, now_ns: int) -> None:
        """Record an order of the agent that it should not have given."""
        if not (self.estop or self.driven):
            self._overridden_ns = None
        elif self._overridden_ns is None:
            self._overridden_ns = now_ns
        elif what and now_ns - self._overridden_ns > _REACTION_NS:
            who = 'e-stop' if self.estop else 'operator'
            self.violations.append(f'{what} at {now_ns / NS_PER_S:.2f} s: the {who} had the robot')

    def _receive(self, now_ns: int) -> None:
        self._check_order('', now_ns)
        while self._goals is not None and self._goals.take():
            self._receive_goal(self._goals.msg.pose, now_ns)
        while self._cancels is not None and self._cancels.take():
            if self._cancels.msg.data and self._goal is not None:
                if self._is_errand(self._goal):
                    self.violations.append(f'cancelled at {now_ns / NS_PER_S:.2f} s what an '
                                           'operator had sent the robot for')
                self._stop('stopped: cancelled', now_ns)
        while self._commands is not None and self._commands.take():
            self._turn_rad_s = self._commands.msg.angular.z
            self._turn_until_ns = now_ns + _COMMAND_NS
            self._check_order('a turn' if self._turn_rad_s else '', now_ns)

    def _receive_goal(self, pose: Any, now_ns: int) -> None:
        yaw = 2.0 * math.atan2(pose.orientation.z, pose.orientation.w)
        self._goal = goal = pose.position.x, pose.position.y, yaw
        self._waited_s = 0.0
        if not self._is_errand(goal):
            self.errand = None
            self._check_order('a goal', now_ns)
        self._plan('planning', now_ns)
        if self.refuses:
            self._goal = None
            self._plan('refused: where the robot could stand is not free', now_ns)
        else:
            distance = math.dist(goal[:2], self.world.base.pose[:2])
            self._plan(f'planned: {distance:.2f} m', now_ns)

    def _is_errand(self, goal: tuple[float, float, float]) -> bool:
        return self.errand is not None and math.dist(goal[:2], self.errand) < _SAME_M

    def _hold(self, now_ns: int) -> None:
        """Publish the e-stop when it changes."""
        if self.estop != self._held:
            self._held = self.estop
            if self._estop_out is not None:
                self._estop_out.msg.data = self.estop
                self._estop_out.publish(now_ns)
            if self.estop and self._goal is not None:
                self._stop('stopped: e-stop', now_ns)

    def _move(self, now_ns: int) -> None:
        if self._held:
            return
        if self.driven:
            self._turn(_TELEOP_RAD_S * _STEP_S)
            return
        if self._goal is None:
            if self._turn_rad_s and now_ns < self._turn_until_ns:
                self._turn(self._turn_rad_s * _STEP_S)
            return
        if self.lost:
            self._stop('stopped: pose is 0.6 s old', now_ns)
        elif self.blocked:
            self._wait(now_ns)
        else:
            self._waited_s = 0.0
            if self.stuck:
                self._publish_state('driving', now_ns)
            elif not self.silent:
                self._go(self._goal, now_ns)

    def _wait(self, now_ns: int) -> None:
        self._waited_s += _STEP_S
        self._publish_state('stopped: blocked: laser sees something in the way', now_ns)
        if self._waited_s > _PATIENCE_S:
            self._goal = None
            self._plan('refused: no way to the goal is wide enough beside what stands there now',
                       now_ns)
        else:
            self._plan('waiting: no way to the goal is wide enough beside what stands there now',
                       now_ns)

    def _go(self, goal: tuple[float, float, float], now_ns: int) -> None:
        x, y, yaw = self.world.base.pose
        distance = math.hypot(goal[0] - x, goal[1] - y)
        wanted = math.atan2(goal[1] - y, goal[0] - x) if distance > 0.01 else goal[2]
        error = wrapped(wanted - yaw)
        most = _TURN_RAD_S * _STEP_S
        if abs(error) > most:
            self._publish_state('turning', now_ns)
            self._turn(math.copysign(most, error))
        elif distance > 0.01:
            self._publish_state('driving', now_ns)
            step = min(distance, _SPEED_M_S * _STEP_S)
            self._put(x + step * math.cos(wanted), y + step * math.sin(wanted), wanted)
            self.moved_m += step
        else:
            self._goal = None
            self._put(x, y, goal[2])
            self._publish_state('done', now_ns)
            self._plan('done', now_ns)

    # ---- publishing --------------------------------------------------------------------------

    def _turn(self, angle: float) -> None:
        x, y, yaw = self.world.base.pose
        self._put(x, y, wrapped(yaw + angle))

    def _put(self, x: float, y: float, yaw: float) -> None:
        self.world.base.teleport(x, y, yaw)

    def _stop(self, why: str, now_ns: int) -> None:
        self._goal = None
        self._publish_state(why, now_ns)
        self._plan(why, now_ns)

    def _publish_state(self, state: str, now_ns: int, again: bool = False) -> None:
        if self._trajectory_out is not None and (again or state != self._state):
            self._trajectory_out.msg.data = state
            self._trajectory_out.publish(now_ns)
        self._state = state

    def _plan(self, state: str, now_ns: int) -> None:
        if self._planner_out is not None and state != self._planner and not self.silent:
            self._planner_out.msg.data = state
            self._planner_out.publish(now_ns)
        self._planner = state
