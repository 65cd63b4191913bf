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

"""What the agent does with the robot: turn to a person, drive there, drive home, stop."""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.agent.drive import GoalFollower
from rt_robot_os.features.agent.inputs import AgentInputs
from rt_robot_os.features.agent.inputs import AgentOrder
from rt_robot_os.features.agent.inputs import Goal
from rt_robot_os.features.agent.inputs import LimitSpeed
from rt_robot_os.features.agent.inputs import Location
from rt_robot_os.features.agent.inputs import Spin
from rt_robot_os.features.agent.standoff import StandoffPlanner
from rt_robot_os.features.agent.tuning import AgentTuning
from rt_robot_os.features.agent.turn import Turn
from rt_robot_os.motion.differential import Pose

# An older pose is not used for turning.
_POSE_NS: Final = NS_PER_S
# Distance within which a pose is reached already.
_HOME_M: Final = 0.3
# A standing robot turns again when it is off by this many tolerances.
_LOOKS_AWAY: Final = 4.0
# A person who has moved less has not changed place.
_STEP_M: Final = 0.2


class RobotInterface:
    """
    Turns and drives; safe in the real-time loop.

    :param emit: receives each order.
    :param period_ns: of the grid on which :meth:`tick` is called.
    :ivar drive: the goal that it follows.
    :ivar is_aligned: it faces the location.
    :ivar is_free: neither e-stop nor operator holds the robot.
    """

    def __init__(self, tuning: AgentTuning, standoff: StandoffPlanner, inputs: AgentInputs,
                 emit: Callable[[AgentOrder], None], period_ns: int) -> None:
        self.inputs = inputs
        self.is_aligned = False
        self.is_free = True
        self._standoff = standoff
        self._emit = emit
        self._period_s = period_ns / NS_PER_S
        self._facing: Location | None = None
        self._spins = False
        self._goal_place: Location | None = None
        self._limit_m_s = 0.0
        self.configure(tuning)

    def configure(self, tuning: AgentTuning) -> None:
        """Apply settings, now or while it runs."""
        self.tuning = tuning
        t = tuning
        self._turn = Turn(t.turn_rad_s, t.turn_rad_s2, t.aligned_rad)
        limits = (t.places, _ns(t.answer_s), _ns(t.waiting_s), _ns(t.pause_s))
        if not hasattr(self, 'drive'):
            self.drive = GoalFollower(*limits)
        _, self.drive.answer_ns, self.drive.waiting_ns, self.drive.pause_ns = limits

    # ---- turning -----------------------------------------------------------------------------

    def face(self, place: Location | None, t_ns: int) -> None:
        """Start to turn to a location, with an immediate command; None: do not turn."""
        self._facing, self.is_aligned = place, place is None
        if self.is_free:
            self._turn_on(t_ns)

    def _turn_on(self, t_ns: int) -> None:
        """Command the next piece of a turn; at its end nothing, so that others may steer."""
        place, pose = self._facing, self.inputs.pose
        is_fresh = pose is not None and t_ns - self.inputs.pose_ns <= _POSE_NS
        if place is not None and pose is not None and is_fresh:
            rate, stands = self._turn.towards(pose, place.x, place.y, self.tuning.camera_rad,
                                              self._period_s)
            if stands:
                self.is_aligned, self._facing = True, None
        else:
            rate, _ = self._turn.rest(self._period_s)
        if rate or self._spins:
            self._emit(Spin(rate))
        self._spins = rate != 0.0

    # ---- driving -----------------------------------------------------------------------------

    def has_moved_away(self, place: Location) -> bool:
        """Return whether a person has moved from where the robot drives to."""
        if self._goal_place is None:
            return not self.is_beside(place)
        moved_m = math.dist(place.point, self._goal_place.point)
        return moved_m > self.tuning.follow_m or moved_m > _STEP_M and self._would_hinder(place)

    def _would_hinder(self, place: Location) -> bool:
        """Return whether the goal of the robot is too near to a person."""
        goal, t = self.drive.goal, self.tuning
        return goal is not None and self.drive.is_under_way and (
            math.dist(goal[:2], place.point) < t.standoff_m - t.spread_m)

    def go_beside(self, place: Location, t_ns: int) -> None:
        """Drive next to a location, and follow when it moves."""
        if self._goal_place is not None and not self.has_moved_away(place):
            return
        self._goal_place = place
        if self.is_beside(place):
            self._cancel()  # else it drives on to the old location
            self.drive.stop()
            self.drive.arrived = True
        else:
            pose = self.inputs.pose
            self.drive.begin(self._standoff.places(
                place.point, pose[:2] if pose else place.point, self.tuning.places), t_ns)

    def go_to(self, pose: Pose, t_ns: int) -> None:
        """Drive to a pose; one where the robot is already is reached."""
        self._goal_place = None
        now = self.inputs.pose
        if now is not None and math.dist(now[:2], pose[:2]) <= _HOME_M:
            self.drive.stop()
            self.drive.arrived = True
        else:
            self.drive.begin([pose], t_ns)

    def stay_beside(self, place: Location, t_ns: int) -> None:
        """Stay next to a person: follow, back off and turn as they move."""
        t, pose, drive = self.tuning, self.inputs.pose, self.drive
        if pose is None:
            return
        away_m = math.dist(pose[:2], place.point)
        is_too_near = away_m < t.standoff_m - t.spread_m - 0.2 and not drive.is_under_way
        if is_too_near and self._goal_place is not None and (
                math.dist(place.point, self._goal_place.point) > _STEP_M):
            self._goal_place = None
        self.go_beside(place, t_ns)
        self.look_at(place, t_ns)

    def look_at(self, place: Location, t_ns: int) -> None:
        """Turn to a location when the robot stands and faces elsewhere."""
        pose = self.inputs.pose
        if pose is None or self.drive.is_under_way or self._facing is not None:
            return
        if self._off(place, pose) > _LOOKS_AWAY * self.tuning.aligned_rad:
            self.face(place, t_ns)

    def is_beside(self, place: Location) -> bool:
        """Return whether the robot is there, at its distance."""
        pose, t = self.inputs.pose, self.tuning
        return pose is not None and (
            t.standoff_m - t.spread_m <= math.dist(pose[:2], place.point)
            <= t.standoff_m + t.spread_m) and self._standoff.sees(pose[:2], place.point)

    def _off(self, place: Location, pose: Pose) -> float:
        bearing = math.atan2(place.y - pose[1], place.x - pose[0]) - self.tuning.camera_rad
        return abs(math.remainder(bearing - pose[2], math.tau))

    def forget(self) -> None:
        """Clear the goal; the robot drives on until it gets another one."""
        self.drive.stop()
        self._goal_place = self._facing = None
        self.is_aligned = False

    def halt(self) -> None:
        """Stop, and clear the goal."""
        self._cancel()
        self.forget()
        self._turn.stop()
        if self._spins:
            self._spins = False
            self._emit(Spin(0.0))

    def _cancel(self) -> None:
        """Cancel the goal of the planner, driven or waiting."""
        if self.drive.is_open:
            self.drive.is_open = False
            self._emit(Goal(None))

    # ---- time --------------------------------------------------------------------------------

    def tick(self, t_ns: int) -> None:
        """Continue driving and turning."""
        inputs, drive = self.inputs, self.drive
        if inputs.planner_new:
            drive.update(inputs.planner, t_ns, inputs.pose)
        drive.tick(t_ns)
        goal = drive.next_goal(t_ns)
        if goal is not None:
            self._emit(Goal(goal))
        if drive.has_way and drive.is_under_way:
            self._facing = None  # the trajectory turns the robot itself
        self._turn_on(t_ns)

    def limit(self, place: Location | None) -> None:
        """Limit the speed near a person, and not otherwise."""
        t, pose = self.tuning, self.inputs.pose
        is_near = place is not None and pose is not None and (
            math.dist(pose[:2], place.point) < t.near_m)
        limit_m_s = t.near_m_s if is_near else 0.0
        if limit_m_s != self._limit_m_s:
            self._limit_m_s = limit_m_s
            self._emit(LimitSpeed(limit_m_s))

    def is_lost(self, since_ns: int, t_ns: int) -> bool:
        """Return whether the position has been unknown for a while, or since a moment."""
        return t_ns - max(self.inputs.pose_good_ns, since_ns) > _ns(self.tuning.lost_s)

    def is_battery_low(self) -> bool:
        """Return whether the battery is low; an unknown charge is not."""
        return self.inputs.battery < self.tuning.battery_low and not self.inputs.charging


def _ns(seconds: float) -> int:
    return round(seconds * NS_PER_S)
