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
from typing import Final

from rt_robot_os.motion.angles import wrapped
from rt_robot_os.sim.world import World
from rt_robot_os.tools.rehearse.stage import Stage
from rt_robot_os.tools.rehearse.stage import STEP_NS
from rt_robot_os.units import NS_PER_S

_SPEED_M_S: Final = 0.4
_TURN_RAD_S: Final = 0.8
_STEP_S: Final = STEP_NS / NS_PER_S
_POSE_EVERY: Final = 2
_STATE_EVERY: Final = 20
# A planner waits so long for a way, as the real one does by default.
_PATIENCE_S: Final = 30.0
# Commands older than that move nothing.
_COMMAND_NS: Final = NS_PER_S // 2


class Body:
    """
    Plays localisation, planner, trajectory, multiplexer, guard and wheels.

    It turns to a goal, goes there in a straight line (walls are not its matter: the real modules
    have their own tests) and says what the real modules would.

    :param world: whose robot is moved.
    :ivar blocked: something stands in the way.
    :ivar lost: nobody knows where it is.
    :ivar battery_v: of its battery.
    :ivar estop: somebody holds the e-stop.
    :ivar refuses: no place near the goal is free.
    :ivar moved_m: the way that it went.
    :ivar first_motion_ns: when it began to move, after :meth:`note_motion`.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        self.blocked = self.lost = self.estop = self.refuses = False
        self.battery_v = 25.2
        self.moved_m = 0.0
        self.first_motion_ns = 0
        self._forget()

    def _forget(self) -> None:
        self._goal: tuple[float, float, float] | None = None
        self._waited_s = 0.0
        self._state, self._planner = 'idle', ''
        self._turn_rad_s, self._turn_until_ns = 0.0, 0
        self._steps = 0

    def note_motion(self) -> None:
        """Forget when it first moved."""
        self.first_motion_ns = 0

    def enter(self, stage: Stage) -> None:
        """Find the topics; it has forgotten its goal, as a core does that was killed."""
        self._forget()
        self._pose = stage.publisher('pose')
        self._trajectory_out = stage.publisher('trajectory/state')
        self._planner_out = stage.publisher('planner/state')
        self._battery = stage.publisher('battery')
        self._stop_reason = stage.publisher('stop_reason')
        self._estop_out = stage.publisher('estop')
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
        if self._steps % _STATE_EVERY == 0:
            self._tell(self._state, now_ns, again=True)
            if self._battery is not None:
                self._battery.msg.voltage = self.battery_v
                self._battery.msg.percentage = max(0.0, min(1.0, (self.battery_v - 21.0) / 4.2))
                self._battery.publish(now_ns)

    def _take(self, now_ns: int) -> None:
        while self._goals is not None and self._goals.take():
            pose = self._goals.msg.pose
            yaw = 2.0 * math.atan2(pose.orientation.z, pose.orientation.w)
            self._goal = (pose.position.x, pose.position.y, yaw)
            self._waited_s = 0.0
            if self.refuses:
                self._goal = None
                self._plan('refused: where the robot could stand is not free', now_ns)
            else:
                distance = math.dist(self._goal[:2], self.world.base.pose[:2])
                self._plan('planning', now_ns)
                self._plan(f'planned: {distance:.2f} m', now_ns)
        while self._cancels is not None and self._cancels.take():
            if self._cancels.msg.data and self._goal is not None:
                self._stop('stopped: cancelled', now_ns)
        while self._commands is not None and self._commands.take():
            self._turn_rad_s = self._commands.msg.angular.z
            self._turn_until_ns = now_ns + _COMMAND_NS

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
        if self._goal is None:
            if self._turn_rad_s and now_ns < self._turn_until_ns:
                self._turn(self._turn_rad_s * _STEP_S, now_ns)
            return
        if self.lost:
            self._stop('stopped: pose is 0.6 s old', now_ns)
        elif self.blocked:
            self._wait(now_ns)
        else:
            self._waited_s = 0.0
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
            self._turn(math.copysign(most, error), now_ns)
        elif distance > 0.01:
            self._tell('driving', now_ns)
            step = min(distance, _SPEED_M_S * _STEP_S)
            self._put(x + step * math.cos(wanted), y + step * math.sin(wanted), wanted, now_ns)
            self.moved_m += step
        else:
            self._goal = None
            self._put(x, y, goal[2], now_ns)
            self._tell('done', now_ns)
            self._plan('done', now_ns)

    # ---- saying ------------------------------------------------------------------------------

    def _turn(self, angle: float, now_ns: int) -> None:
        x, y, yaw = self.world.base.pose
        self._put(x, y, wrapped(yaw + angle), now_ns)

    def _put(self, x: float, y: float, yaw: float, now_ns: int) -> None:
        self.first_motion_ns = self.first_motion_ns or now_ns
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
        if self._planner_out is not None and state != self._planner:
            self._planner_out.msg.data = state
            self._planner_out.publish(now_ns)
        self._planner = state
