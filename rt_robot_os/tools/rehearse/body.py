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

"""The robot's body on the stage: it goes where goals say, unless something is wrong with it."""

from __future__ import annotations

import math
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.motion.angles import wrapped
from rt_robot_os.sim.world import World
from rt_robot_os.tools.rehearse.stage import Stage
from rt_robot_os.tools.rehearse.stage import STEP_NS

_SPEED_M_S: Final = 0.4
_TURN_RAD_S: Final = 0.8
_STEP_S: Final = STEP_NS / NS_PER_S
_POSE_EVERY: Final = 2
_STATE_EVERY: Final = 20
# A planner waits so long for a way, as the real one does by default.
_PATIENCE_S: Final = 30.0
# Commands older than that move nothing.
_COMMAND_NS: Final = NS_PER_S // 2
# Whoever has the robot has had it for so long before an order of the agent is one too many.
_HEARD_NS: Final = 3 * STEP_NS
# So near to where it began it is charged, as sensor_msgs/BatteryState says it.
_HOME_M: Final = 0.3
_CHARGING, _DISCHARGING = 1, 2
_FULL_V, _FLAT_V = 25.2, 21.2
# How an operator drives.
_TELEOP_RAD_S: Final = 0.3
_SAME_M: Final = 1e-6


class Body:
    """
    Plays localisation, planner, trajectory, multiplexer, guard and wheels.

    It turns to a goal, goes there in a straight line (walls are not its matter: the real modules
    have their own tests) and says what the real modules would.

    :param world: whose robot is moved.
    :ivar blocked: something stands in the way.
    :ivar lost: nobody knows where it is.
    :ivar flat: its battery is nearly empty.
    :ivar estop: somebody holds the e-stop.
    :ivar refuses: no place near the goal is free.
    :ivar silent: the planner says nothing.
    :ivar stuck: its wheels turn, and it stays where it is.
    :ivar driven: an operator steers.
    :ivar home: where it began; it is charged there.
    :ivar errand: where an operator has sent it; None without.
    :ivar disobeyed: what the agent ordered while somebody else had the robot.
    :ivar moved_m: the way that it went.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        self.blocked = self.lost = self.estop = self.refuses = False
        self.flat = self.silent = self.stuck = self.driven = False
        self.disobeyed: list[str] = []
        self.moved_m = 0.0
        self.home = world.base.pose[:2]
        self._forget()

    def _forget(self) -> None:
        self._goal: tuple[float, float, float] | None = None
        self.errand: tuple[float, float] | None = None
        self._waited_s = 0.0
        self._state, self._planner = 'idle', ''
        self._turn_rad_s, self._turn_until_ns = 0.0, 0
        self._steps = 0
        self._taken_ns: int | None = None
        self._steers = ''

    def enter(self, stage: Stage) -> None:
        """Find the topics; it has forgotten its goal, as a core does that was killed."""
        self._forget()
        self._pose = stage.publisher('pose')
        self._trajectory_out = stage.publisher('trajectory/state')
        self._planner_out = stage.publisher('planner/state')
        self._battery = stage.publisher('battery')
        self._stop_reason = stage.publisher('stop_reason')
        self._estop_out = stage.publisher('estop')
        self._steering = stage.publisher('steering')
        self._goals = stage.reader('goal_pose')
        self._cancels = stage.reader('trajectory_cancel')
        self._commands = stage.reader('cmd_vel_agent')
        self._held = False

    # ---- acting ------------------------------------------------------------------------------

    def act(self, now_ns: int) -> None:
        """Take what was ordered, move, and say so."""
        self.world.advance(now_ns)
        self._steps += 1
        self._take(now_ns)
        self._hold(now_ns)
        self._move(now_ns)
        if self._steps % _POSE_EVERY == 0 and not self.lost and self._pose is not None:
            x, y, yaw = self.world.base.pose
            pose = self._pose.msg.pose.pose
            pose.position = x, y, 0.0
            pose.orientation = 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)
            self._pose.publish(now_ns)
        self._tell_who_steers(now_ns)
        if self._steps % _STATE_EVERY == 0:
            self._tell(self._state, now_ns, again=True)
            if self._battery is not None:
                self._tell_battery(self._battery.msg)
                self._battery.publish(now_ns)

    def _tell_battery(self, message: Any) -> None:
        message.voltage = volts = _FLAT_V if self.flat else _FULL_V
        message.percentage = max(0.0, min(1.0, (volts - 21.0) / 4.2))
        is_home = math.dist(self.world.base.pose[:2], self.home) < _HOME_M
        message.power_supply_status = _CHARGING if is_home else _DISCHARGING

    def _tell_who_steers(self, now_ns: int) -> None:
        """Say it as the multiplexer does."""
        steers = ('nobody: e-stop, asked for on estop' if self._held else
                  'teleop' if self.driven else
                  'agent' if self._turn_rad_s and now_ns < self._turn_until_ns else
                  'trajectory' if self._goal is not None else 'nobody')
        if steers != self._steers and self._steering is not None:
            self._steering.msg.data = steers
            self._steering.publish(now_ns)
        self._steers = steers

    def _order(self, what: str, now_ns: int) -> None:
        """Note an order of the agent that it should not have given."""
        if not (self.estop or self.driven):
            self._taken_ns = None
        elif self._taken_ns is None:
            self._taken_ns = now_ns
        elif what and now_ns - self._taken_ns > _HEARD_NS:
            who = 'e-stop' if self.estop else 'operator'
            self.disobeyed.append(f'{what} at {now_ns / NS_PER_S:.2f} s: the {who} had the robot')

    def _take(self, now_ns: int) -> None:
        self._order('', now_ns)
        while self._goals is not None and self._goals.take():
            self._take_goal(self._goals.msg.pose, now_ns)
        while self._cancels is not None and self._cancels.take():
            if self._cancels.msg.data and self._goal is not None:
                if self._is_errand(self._goal):
                    self.disobeyed.append(f'cancelled at {now_ns / NS_PER_S:.2f} s what an '
                                          'operator had sent the robot for')
                self._stop('stopped: cancelled', now_ns)
        while self._commands is not None and self._commands.take():
            self._turn_rad_s = self._commands.msg.angular.z
            self._turn_until_ns = now_ns + _COMMAND_NS
            self._order('a turn' if self._turn_rad_s else '', now_ns)

    def _take_goal(self, pose: Any, now_ns: int) -> None:
        yaw = 2.0 * math.atan2(pose.orientation.z, pose.orientation.w)
        self._goal = goal = pose.position.x, pose.position.y, yaw
        self._waited_s = 0.0
        if not self._is_errand(goal):
            self.errand = None
            self._order('a goal', now_ns)
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
        """Tell of the e-stop when it changes."""
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
                self._tell('driving', now_ns)
            elif not self.silent:
                self._go(self._goal, now_ns)

    def _wait(self, now_ns: int) -> None:
        self._waited_s += _STEP_S
        self._tell('stopped: blocked: laser sees something in the way', now_ns)
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
            self._tell('turning', now_ns)
            self._turn(math.copysign(most, error))
        elif distance > 0.01:
            self._tell('driving', now_ns)
            step = min(distance, _SPEED_M_S * _STEP_S)
            self._put(x + step * math.cos(wanted), y + step * math.sin(wanted), wanted)
            self.moved_m += step
        else:
            self._goal = None
            self._put(x, y, goal[2])
            self._tell('done', now_ns)
            self._plan('done', now_ns)

    # ---- saying ------------------------------------------------------------------------------

    def _turn(self, angle: float) -> None:
        x, y, yaw = self.world.base.pose
        self._put(x, y, wrapped(yaw + angle))

    def _put(self, x: float, y: float, yaw: float) -> None:
        self.world.base.teleport(x, y, yaw)

    def _stop(self, why: str, now_ns: int) -> None:
        self._goal = None
        self._tell(why, now_ns)
        self._plan(why, now_ns)

    def _tell(self, state: str, now_ns: int, again: bool = False) -> None:
        if self._trajectory_out is not None and (again or state != self._state):
            self._trajectory_out.msg.data = state
            self._trajectory_out.publish(now_ns)
        self._state = state

    def _plan(self, state: str, now_ns: int) -> None:
        if self._planner_out is not None and state != self._planner and not self.silent:
            self._planner_out.msg.data = state
            self._planner_out.publish(now_ns)
        self._planner = state
