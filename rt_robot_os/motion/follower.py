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
From a goal or a path to velocities, step by step: turn, drive, turn, and report the result.

It has no topics and no clock: a module, a test, a thread or a timer calls it once a period.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence
from enum import Enum
import math
from typing import Final

from rt_robot_os.motion.angles import wrapped
from rt_robot_os.motion.controllers.base import Controller
from rt_robot_os.motion.controllers.base import Velocity
from rt_robot_os.motion.controllers.turning import turning_rate
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.follower_tuning import FollowerTuning
from rt_robot_os.motion.reference import PathReference
from rt_robot_os.motion.reference_path import checked
from rt_robot_os.motion.reference_path import is_pose
from rt_robot_os.motion.reference_path import Path
from rt_robot_os.motion.reference_path import PathError
from rt_robot_os.motion.reference_path import SAME_M
from rt_robot_os.motion.reference_path import straight
from rt_robot_os.motion.spline import legs
from rt_robot_os.motion.velocity_limits import VelocityLimits
from rt_robot_os.motion.velocity_limits import within_reach
from rt_robot_os.motion.velocity_limits import within_speeds

# How far along its path a robot may be that drove on while the path was planned.
_JOIN_WITHIN_M: Final = 2.0
# A robot that points farther aside while it drives stops and turns.
_ASTRAY_RAD: Final = 1.2
_TURNED_RAD: Final = 0.035
# How long the rest of the path is driven after the end of the time law, and how long the robot
# rests before its pose is checked.
_CREEP_S: Final = 2.0
_REST_S: Final = 0.3
# A robot that moves less is blocked, not slow.
_MOVED_M: Final = 0.02
_MOVED_RAD: Final = 0.05
# A commanded velocity that the robot does not reach is not increased beyond this time.
_BEHIND_S: Final = 0.5
_AT_REST_M_S: Final = 0.02
# Planners repeat the same goal with each plan.
_SAME_GOAL_M: Final = 0.1
_STANDSTILL: Final = (0.0, 0.0)


class Phase(Enum):
    """The phases of a follower."""

    REST = 'rest'
    BRAKE = 'brake'
    TURN = 'turn'
    DRIVE = 'drive'
    SETTLE = 'settle'


class Follower:
    """
    Follow goals and paths with a tracking law.

    :param controller: the law.
    :ivar state: ``idle``, ``turning``, ``driving``, ``done`` or ``stopped: WHY``.
    :ivar progress: from 0 to 1, never back.
    :ivar error: how far the reference is ahead of the robot and to the left in m, and its heading
        to the left in rad; a turn in place has only the last.
    :ivar command: the last linear and angular velocity.
    :ivar reference: the one that is followed; None without.
    """

    def __init__(self, controller: Controller, limits: VelocityLimits = VelocityLimits(),
                 tuning: FollowerTuning = FollowerTuning()) -> None:
        self.controller = controller
        self.limits = limits
        self.tuning = tuning
        self.state = 'idle'
        self.progress = 0.0
        self.error = (0.0, 0.0, 0.0)
        self.command: Velocity = _STANDSTILL
        self.reference: PathReference | None = None
        self.phase = Phase.REST
        self._then: Callable[[Pose], None] | None = None
        self._poses: list[Pose] = []
        self._goal: Pose = (0.0, 0.0, 0.0)
        self._legs: list[Path] = []
        self._start_m = self._driven_m = self._whole_m = 0.0
        self._heading = 0.0
        self._time_s = self._stuck_s = 0.0
        self._stuck_at: Pose = (math.inf, 0.0, 0.0)
        self._attempts = 0

    # ---- requests ----------------------------------------------------------------------------

    def go(self, poses: Sequence[Pose], pose: Pose, velocity: Velocity = _STANDSTILL) -> None:
        """
        Follow a path, or drive straight to a goal, instead of the present one.

        A driving robot changes over without a stop when the new path begins ahead of it. Not for
        the hot path: a thousand poses take some milliseconds.

        :param poses: in m and rad; a single one is a goal. The heading of the last one counts.
        :param pose: of the robot.
        :param velocity: of the robot, which another source may have steered.
        :raises PathError: it cannot be followed; the text says why. The robot brakes.
        """
        try:
            if not is_pose(pose):
                raise PathError('pose of the robot is no place')
            self._poses = checked(poses)
            goal, self._goal = self._goal, self._poses[-1]
            self._attempts = self.tuning.attempts
            if not self.driving or math.hypot(
                    goal[0] - self._goal[0], goal[1] - self._goal[1]) > _SAME_GOAL_M:
                self.progress = 0.0
            if self.phase is Phase.REST:
                self._stuck_s, self.command = 0.0, velocity
            if abs(self.command[0]) < _AT_REST_M_S:
                self._begin(pose)  # a turn in place continues to another heading without a stop
            else:
                self._lay(pose)
                if abs(self._aside(pose)) <= self.tuning.turn_above_rad and self._legs:
                    self._drive(max(0.0, self.command[0]))
                else:
                    self._brake('driving', self._begin)
        except PathError as error:
            self.stop(str(error))
            raise

    def stop(self, why: str) -> None:
        """Brake and rest with a reason, until the next goal. At rest it returns no command."""
        if self.phase is Phase.REST:
            self.state = f'stopped: {why}'
        else:
            self._brake(f'stopped: {why}', None)

    def abandon(self, why: str = '') -> None:
        """
        Rest immediately, without a command: the caller has stopped the robot already.

        :param why: empty leaves the state unchanged.
        """
        if why:
            self.state = f'stopped: {why}'
        self.command = _STANDSTILL
        self._then = None
        self._rest()

    @property
    def driving(self) -> bool:
        """Return whether the robot is driving; not when it rests, or brakes to rest."""
        return self.phase is not Phase.REST and not (
            self.phase is Phase.BRAKE and self._then is None)

    # ---- one step ----------------------------------------------------------------------------

    def step(self, pose: Pose, period_s: float, velocity: Velocity | None = None
             ) -> Velocity | None:
        """
        Return the velocity for the period that begins now; safe in the real-time loop.

        :param pose: where the robot is when the command takes effect.
        :param velocity: as measured; None when that is not known.
        :return: None when there is nothing to do: another source may steer.
        """
        if self.phase is Phase.REST:
            return None
        wanted = _STANDSTILL
        self._time_s += period_s
        if not is_pose(pose):
            self.stop('pose is no place')
        if self.phase is Phase.DRIVE:
            wanted = self._driving(pose, period_s, velocity)
        if self.phase is Phase.TURN:
            wanted = self._turning(pose, period_s)
        if self.phase is Phase.SETTLE:
            if self._time_s >= max(_REST_S, period_s):
                self._settled(pose)
        if self.phase is Phase.BRAKE:
            wanted = _STANDSTILL
        self._limit(wanted, velocity, period_s)
        if self.phase is Phase.BRAKE and self.command == _STANDSTILL:
            self._braked(pose, velocity)
        return self.command

    def _limit(self, wanted: Velocity, velocity: Velocity | None, period_s: float) -> None:
        """Move the command towards the wanted velocity as far as the limits allow."""
        linear, angular = self.command
        if velocity is not None:
            most = abs(velocity[0]) + self.limits.acceleration_m_s2 * max(_BEHIND_S, 2 * period_s)
            linear = max(-most, min(most, linear))
        self.command = within_reach(*within_speeds(*wanted, self.limits), (linear, angular),
                                    self.limits, period_s)

    # ---- phases ------------------------------------------------------------------------------

    def _driving(self, pose: Pose, period_s: float, velocity: Velocity | None) -> Velocity:
        reference = self.reference
        assert reference is not None
        finished = reference.finished  # before the step: the rest is driven first
        linear, angular = self.controller.step(pose, reference, period_s, velocity)
        self.error = self.controller.error
        left, turned = reference.locate(pose)
        done_m = reference.nearest_m
        self.progress = max(self.progress, min(1.0, (
            self._driven_m + done_m - self._start_m) / max(self._whole_m, SAME_M)))
        if abs(left) > self.tuning.off_path_max_m:
            self.stop(f'off the path by {abs(left):.2f} m, at most '
                      f'{self.tuning.off_path_max_m:g}')
        elif abs(wrapped(turned)) > _ASTRAY_RAD:
            self._brake('driving', self._again)
        elif self._stuck(pose, period_s):
            self.stop(f'blocked: no progress for {self.tuning.blocked_after_s:g} s')
        elif self._at_end(reference, pose, finished):
            self._arrived()
        elif self.controller.TIMED and not finished:
            linear = max(0.0, linear)
        return linear, angular

    def _at_end(self, reference: PathReference, pose: Pose, finished: bool) -> bool:
        path = reference.path
        heading = path.heading[-1]
        ahead = (math.cos(heading) * (path.x[-1] - pose[0])
                 + math.sin(heading) * (path.y[-1] - pose[1]))
        near = self.tuning.goal_tolerance_m / 4
        if not self.controller.TIMED:
            return reference.nearest_m >= path.length_m - self.tuning.goal_tolerance_m and (
                ahead <= near)
        if not finished:
            self._time_s = 0.0
            return False
        return abs(ahead) <= near or self._time_s > _CREEP_S

    def _turning(self, pose: Pose, period_s: float) -> Velocity:
        angle = wrapped(self._heading - pose[2])
        self.error = (0.0, 0.0, angle)
        last = not self._legs
        enough = min(self.tuning.goal_tolerance_rad, math.pi) if last else _TURNED_RAD
        if abs(angle) <= enough:
            if last:
                self._enter(Phase.SETTLE)
            elif self.command == _STANDSTILL:
                self._drive(0.0)
            return _STANDSTILL
        if self._stuck(pose, period_s):
            self.stop(f'blocked: no progress for {self.tuning.blocked_after_s:g} s of turning')
            return _STANDSTILL
        return 0.0, turning_rate(angle, self.limits, period_s)

    def _settled(self, pose: Pose) -> None:
        """Check whether the robot is at the goal."""
        tuning, goal = self.tuning, self._goal
        distance = math.hypot(goal[0] - pose[0], goal[1] - pose[1])
        turn = abs(wrapped(goal[2] - pose[2]))
        # It was within the tolerance when it stopped; noise must not restart it.
        near, aligned = (distance <= 1.5 * tuning.goal_tolerance_m,
                         turn <= 1.5 * tuning.goal_tolerance_rad)
        if near and aligned:
            self.state, self.progress = 'done', 1.0
            self._rest()
        elif self._attempts == 0:
            self.stop(f'missed the goal by {distance:.3f} m and {math.degrees(turn):.1f} deg')
        else:
            self._attempts -= 1
            self._poses = [goal]
            self._try(self._begin, pose)

    # ---- transitions -------------------------------------------------------------------------

    def _begin(self, pose: Pose) -> None:
        """Start from a standstill, with a turn when the path begins aside."""
        self._lay(pose)
        aside = self._aside(pose)
        if not self._legs:
            self._turn_to(self._goal[2])
        elif abs(aside) > self.tuning.turn_above_rad:
            self._turn_to(pose[2] - aside)
        else:
            self._drive(max(0.0, self.command[0]))

    def _lay(self, pose: Pose) -> None:
        """Make the legs, and locate the robot on them."""
        self._driven_m = self.progress * self._whole_m
        self._start_m = 0.0
        if len(self._poses) == 1:
            distance = math.hypot(self._goal[0] - pose[0], self._goal[1] - pose[1])
            if distance > self.tuning.goal_distance_max_m:
                raise PathError(f'goal is {distance:g} m away, at most '
                                f'{self.tuning.goal_distance_max_m:g}')
            near = distance <= max(SAME_M, self.tuning.goal_tolerance_m)
            self._legs = [] if near else [straight(pose[:2], self._goal[:2])]
            self._whole_m = self._driven_m + distance
            return
        found = legs(self._poses, self.tuning.corner_rad, self.tuning.path_shape)
        least, before_m, best = math.inf, 0.0, 0
        for i, leg in enumerate(found):
            if before_m > _JOIN_WITHIN_M:
                break
            along = leg.joined(pose[0], pose[1], _JOIN_WITHIN_M - before_m)
            x, y = leg.at(along)[:2]
            distance = math.hypot(x - pose[0], y - pose[1])
            if distance < least - SAME_M:
                least, best, self._start_m = distance, i, along
            before_m += leg.length_m
        if found and least > self.tuning.off_path_max_m:
            raise PathError(f'off the path: it begins {least:.2f} m from the robot, at most '
                            f'{self.tuning.off_path_max_m:g}')
        self._legs = found[best:]
        self._whole_m = (self._driven_m - self._start_m
                         + sum(leg.length_m for leg in self._legs))

    def _aside(self, pose: Pose) -> float:
        """Return how far the robot points to the left of the start of the path."""
        heading = self._legs[0].at(self._start_m)[2] if self._legs else self._goal[2]
        return wrapped(pose[2] - heading)

    def _turn_to(self, heading_rad: float) -> None:
        self.state = 'turning'
        self._heading = heading_rad
        self._enter(Phase.TURN)

    def _drive(self, speed_m_s: float) -> None:
        self.state = 'driving'
        self.reference = PathReference(self._legs[0], self.limits, self._start_m, speed_m_s)
        self.controller.restart()
        self._enter(Phase.DRIVE)

    def _arrived(self) -> None:
        """Continue with the next leg, or with the heading of the goal."""
        leg = self._legs.pop(0)
        self._driven_m += leg.length_m - self._start_m
        self._start_m = 0.0
        self.reference = None
        self._turn_to(self._legs[0].heading[0] if self._legs else self._goal[2])

    def _again(self, pose: Pose) -> None:
        """Resume the leg that the robot left."""
        if self.reference is not None:
            self._driven_m += self.reference.nearest_m - self._start_m
            self._start_m = self.reference.nearest_m
        self._turn_to(pose[2] - self._aside(pose))

    def _brake(self, state: str, then: Callable[[Pose], None] | None) -> None:
        self.state = state
        self._then = then
        self._enter(Phase.BRAKE)

    def _braked(self, pose: Pose, velocity: Velocity | None) -> None:
        """Do the next action once the robot stands."""
        if self._then is None:
            self._rest()
        elif velocity is None or abs(velocity[0]) < _AT_REST_M_S or self._time_s > _CREEP_S:
            then, self._then = self._then, None
            self._try(then, pose)

    def _try(self, then: Callable[[Pose], None], pose: Pose) -> None:
        """Start an action; the robot may have moved meanwhile."""
        try:
            then(pose)
        except PathError as error:
            self.stop(str(error))

    def _rest(self) -> None:
        self.reference = None
        self._legs = []
        self.error = (0.0, 0.0, 0.0)
        self._enter(Phase.REST)

    def _enter(self, phase: Phase) -> None:
        self.phase = phase
        self._time_s = 0.0

    def _stuck(self, pose: Pose, period_s: float) -> bool:
        """Return whether the robot has hardly moved, regardless of new paths."""
        x, y, yaw = self._stuck_at
        if (math.hypot(pose[0] - x, pose[1] - y) > _MOVED_M
                or abs(wrapped(pose[2] - yaw)) > _MOVED_RAD):
            self._stuck_at, self._stuck_s = pose, 0.0
        else:
            self._stuck_s += period_s
        return self._stuck_s > self.tuning.blocked_after_s
