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

"""Drive to a pose by goals for a planner: try one pose after the other, and stop in time."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Final

from rt_robot_os.motion.differential import Pose

# Distance from the goal within which the planner's `done` is accepted: it moves goals to free
# ground, and a `done` of an earlier goal must not count.
_DONE_M: Final = 1.0


class GoalFollower:
    """
    Drives to one of several poses; safe in the real-time loop.

    :param tries: how many goals are given for one drive.
    :param answer_ns: time-out of the planner.
    :param waiting_ns: how long the planner may wait for a free path.
    :param pause_ns: how long to wait before the next goal.
    :ivar goal: the last that was given; None without.
    :ivar has_way: the planner has a path to it.
    :ivar arrived: the robot is there.
    :ivar problem: why no pose was reached; empty without.
    :ivar is_open: the planner has a goal, or may have: the robot would drive there, now or when a
        path becomes free.
    """

    def __init__(self, tries: int, answer_ns: int, waiting_ns: int, pause_ns: int) -> None:
        self.tries = tries
        self.answer_ns, self.waiting_ns, self.pause_ns = answer_ns, waiting_ns, pause_ns
        self.is_open = False
        self._left: list[Pose] = []
        self.stop()

    def stop(self) -> None:
        """Drop the goal; the one that was given is not cancelled."""
        self.goal: Pose | None = None
        self.has_way = self.arrived = False
        self.problem = ''
        self._tried = 0
        self._left = []
        self._given_ns = self._told_ns = self._next_ns = -1
        self._waits_ns = -1
        self._why = ''

    @property
    def is_under_way(self) -> bool:
        """Whether a goal was given and has no result yet."""
        return self.goal is not None and not self.arrived and not self.problem

    def begin(self, poses: Sequence[Pose], t_ns: int) -> None:
        """
        Drive to the first of some poses, or to the next one that can be reached.

        :param poses: in the order in which they are tried.
        """
        self.stop()
        self._left = list(poses[:self.tries])
        self._next_ns = t_ns
        if not self._left:
            self.problem = 'no place to stand beside it'

    def next_goal(self, t_ns: int) -> Pose | None:
        """Return a goal when one is due."""
        if self.arrived or self.problem or self._next_ns < 0 or t_ns < self._next_ns:
            return None
        self.goal = self._left.pop(0)
        self._tried += 1
        self._given_ns, self._told_ns, self._next_ns, self._waits_ns = t_ns, -1, -1, -1
        self.has_way, self.is_open = False, True
        return self.goal

    def update(self, state: str, t_ns: int, robot: Pose | None) -> None:
        """
        Handle a state of the planner that came after the goal.

        :param robot: where the robot is; None when it is not known.
        """
        if self.goal is None or self._next_ns >= 0:
            return
        self._told_ns = t_ns
        if state.startswith('planned') or state in ('driving', 'turning'):
            self.has_way, self._waits_ns = True, -1
        elif state == 'done':
            if robot is None or math.dist(robot[:2], self.goal[:2]) <= _DONE_M:
                self.arrived, self.is_open = True, False
        elif state.startswith(('refused: ', 'stopped: ')):
            self.is_open = False
            self._fail(state.partition(': ')[2], t_ns)
        elif state.startswith('waiting: ') and self._waits_ns < 0:
            self._waits_ns, self._why = t_ns, state.partition(': ')[2]

    def tick(self, t_ns: int) -> None:
        """Check the time-outs."""
        if self.goal is None or self._next_ns >= 0 or self.arrived or self.problem:
            return
        if self._told_ns < 0 and t_ns - self._given_ns >= self.answer_ns:
            self._fail('the planner does not answer', t_ns)
        elif self._waits_ns >= 0 and t_ns - self._waits_ns >= self.waiting_ns:
            self._fail(self._why, t_ns)

    def _fail(self, why: str, t_ns: int) -> None:
        self.has_way = False
        if self._left:
            self._next_ns = t_ns + self.pause_ns
        else:
            self.problem = why if self._tried == 1 else f'{why} ({self._tried} places tried)'
