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
Where a robot goes next to see all of a place: a state machine without a clock of its own.

It goes to a frontier, stays with it until nothing is unknown there any more, and takes the next.
What the planner refuses, or what takes too long, is left and tried once more at the end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Final

import numpy as np

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.mapping.slam.frontiers import Frontier
from rt_robot_os.features.mapping.slam.frontiers import frontiers_of
from rt_robot_os.features.mapping.slam.frontiers import Horizon
from rt_robot_os.features.mapping.slam.tour import first_of_tour
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.motion.grid_map import GridMap

CLOSED: Final = 'closed: nothing is left to explore'

#: So long what the planner says may be of the goal before; then the goal is given once more.
_ANSWER_S: Final = 8.0
#: And so long after it was refused: the planner may not have had the newest map.
_MAP_S: Final = 3.0
#: The planner moves goals by less than this; ``done`` from further away is of the goal before.
_DONE_M: Final = 1.0
_PROGRESS_M: Final = 0.2
_WAY_HOME_M: Final = 50.0
#: Two places so near to each other are one.
_SAME_M: Final = 0.5
_TRIES: Final = 2
#: So many of the nearest are put in order: the work doubles with each.
_TOUR: Final = 8
#: What is found on the way lengthens it: only a part of the straight way home is counted.
_HOME_SHARE: Final = 0.5
_VISITS: Final = 3
_WHY_MOST: Final = 120
#: What is more beside the robot than that is looked at by turning.
_AHEAD_RAD: Final = 0.7
#: After so many failures without having come anywhere it is not the places.
_FAILURES: Final = 3


@dataclass(frozen=True)
class ExplorationSettings:
    """
    How to explore.

    :ivar radius_m: that must be free round the robot: ``robot_radius_m`` and ``clearance_m`` of
        the planner.
    :ivar least_m: the extent of the smallest frontier that is gone to.
    :ivar look_s: how often frontiers are looked for.
    :ivar settle_s: how long the robot stands at a goal until the map shows what is seen there.
    :ivar patience_s: a goal is given up after so long without progress.
    :ivar slowest_m_s: and when it is slower than this on the whole, beyond twice that time.
    :ivar switch_share: another frontier is gone to when the way is less than this share.
    :ivar goes_back: at last it goes back to where it began.
    """

    radius_m: float = 0.35
    least_m: float = 0.4
    look_s: float = 1.0
    settle_s: float = 3.0
    patience_s: float = 30.0
    slowest_m_s: float = 0.05
    switch_share: float = 0.4
    goes_back: bool = True


@dataclass
class _ExplorationGoal:
    pose: Floats
    frontier: Frontier | None  # None: back to where it began
    given_ns: int
    before: str  # what the planner said until then
    progress_ns: int
    until_ns: int
    again_ns: int
    at: Floats | None = None  # the robot, when it last moved by something
    has_moved: bool = False
    is_answered: bool = False
    is_given_again: bool = False
    there_ns: int = -1


@dataclass
class _FailedFrontier:
    """
    A place that was tried in vain.

    :ivar tries: how often the robot did not come there.
    :ivar visits: how often it did, and did not see all.
    """

    x: float
    y: float
    why: str = ''
    tries: int = 0
    visits: int = 0


class Explorer:
    """
    Decide where to go next.

    :param settings: None: the defaults.
    :ivar state: one line for people: ``exploring: ...``, at last ``closed: nothing is left to
        explore`` with what was given up, or ``stopped: why``.
    :ivar is_done: it is over; a new one begins anew.
    :ivar counts: ``goals``, ``seen`` (frontiers that are no longer), ``given_up`` and ``looks``.
    """

    def __init__(self, settings: ExplorationSettings | None = None) -> None:
        self.settings = settings or ExplorationSettings()
        self.state = 'exploring: looking round'
        self.is_done = False
        self.counts = dict.fromkeys(('goals', 'seen', 'given_up', 'looks'), 0)
        self._home: Floats | None = None
        self._goal: _ExplorationGoal | None = None
        self._left: list[_FailedFrontier] = []
        self._look_ns = -1
        self._failures = 0
        self._unplaced_ns = self._closing_ns = -1
        self._looked_at: GridMap | None = None

    def step(self, now_ns: int, grid: GridMap, pose: Sequence[float] | Floats,
             planner_state: str) -> Floats | None:
        """
        Look at how it goes; call it some times a second.

        Mostly it takes microseconds; once in ``look_s`` it looks for frontiers: some 5 ms in a
        flat, a tenth of a second in a map of a million cells.

        :param grid: the map as it is now.
        :param pose: x, y in m and yaw in rad of the robot on it.
        :param planner_state: what the planner said last; empty when nothing.
        :return: shape (3,): a new goal for the planner; None: no other than before.
        """
        if self.is_done:
            return None
        here = np.array(pose, dtype=np.float64)  # a copy: it is remembered
        if not np.isfinite(here).all():
            return None
        if self._home is None:
            self._home = here
        goal, failed = self._goal, ''
        is_there = False
        if goal is not None:
            failed = self._watch(goal, now_ns, here, planner_state)
            is_there = self._is_there(goal, now_ns, here, planner_state)
            if self._goal is None:  # it is over
                return None
        if goal is not None and not (failed or is_there):
            if self._is_given_again(goal, now_ns, planner_state):
                return goal.pose
        if not (failed or is_there) and now_ns < self._look_ns:
            return None
        self._look_ns = now_ns + round(self.settings.look_s * NS_PER_S)
        if goal is not None and goal.frontier is None:
            self._go_back(failed, is_there)
            return None
        if goal is not None and not (failed or is_there) and grid is self._looked_at:
            return None
        self._looked_at = grid
        return self._look(now_ns, grid, here, planner_state, failed, is_there)

    # ---- how it goes with a goal -------------------------------------------------------------

    def _watch(self, goal: _ExplorationGoal, now_ns: int, here: Floats, planner_state: str) -> str:
        """Return why a goal has to be given up; empty when it has not."""
        goal.is_answered |= planner_state != goal.before
        is_late = now_ns - goal.given_ns > _ANSWER_S * NS_PER_S
        apart_m = math.dist(here[:2], goal.pose[:2])
        if goal.at is None or math.dist(here[:2], goal.at[:2]) > _PROGRESS_M:
            goal.has_moved = goal.at is not None
            goal.at, goal.progress_ns = here, now_ns
        if (goal.is_answered or is_late) and planner_state.startswith('refused: '):
            if goal.is_given_again:
                return planner_state
            goal.again_ns = min(goal.again_ns, now_ns + round(_MAP_S * NS_PER_S))
        if is_late and planner_state == 'done' and apart_m > _DONE_M:
            return f'the planner is done {apart_m:.1f} m before it'
        if goal.is_answered and planner_state.startswith('stopped: '):
            if planner_state.startswith('stopped: blocked'):
                return planner_state
            self._end(planner_state)  # lost, a fault, somebody: it is not the place
        if now_ns - goal.progress_ns > self.settings.patience_s * NS_PER_S:
            return (f'no progress for {self.settings.patience_s:g} s; the planner says: '
                    f'{planner_state or "nothing"}')
        if now_ns > goal.until_ns:
            return f'not there after {(now_ns - goal.given_ns) / NS_PER_S:.0f} s'
        return ''

    def _is_there(self, goal: _ExplorationGoal, now_ns: int, here: Floats, planner_state: str
                  ) -> bool:
        """Say whether the robot stands where it wanted to, and the map had time to show it."""
        apart_m = math.dist(here[:2], goal.pose[:2])
        is_late = now_ns - goal.given_ns > _ANSWER_S * NS_PER_S
        done = (goal.is_answered or is_late) and planner_state == 'done' and apart_m < _DONE_M
        if not done and apart_m > _PROGRESS_M:
            goal.there_ns = -1
        elif goal.there_ns < 0:
            goal.there_ns = now_ns
        return goal.there_ns >= 0 and (
            now_ns - goal.there_ns >= self.settings.settle_s * NS_PER_S)

    def _is_given_again(self, goal: _ExplorationGoal, now_ns: int, planner_state: str) -> bool:
        """Give a goal once more that got lost on its way, or was refused at first."""
        if goal.is_given_again or now_ns < goal.again_ns or (
                goal.has_moved and not planner_state.startswith('refused: ')):
            return False
        goal.is_given_again, goal.is_answered = True, False
        goal.given_ns, goal.before = now_ns, planner_state
        return True

    # ---- where to go -------------------------------------------------------------------------

    def _look(self, now_ns: int, grid: GridMap, here: Floats, planner_state: str, failed: str,
              is_there: bool) -> Floats | None:
        self.counts['looks'] += 1
        horizon = frontiers_of(grid, (float(here[0]), float(here[1])), self.settings.radius_m,
                               self.settings.least_m)
        if horizon.ground is None:
            self._wait_for_ground(now_ns, here)
            return None
        self._unplaced_ns = -1
        goal = self._goal
        if goal is not None and goal.frontier is not None:
            still = _same(goal.frontier, horizon.frontiers)
            if still is None:
                self.counts['seen'] += 1
                self._failures = 0
            elif failed or is_there:
                self._give_up(still, failed, here)
            if self.is_done:
                return None
        # Those that were refused come last, when more is known.
        tries = {id(each): self._tries(each) for each in horizon.frontiers}
        fewest = min(tries.values(), default=_TRIES)
        if fewest >= _TRIES:
            return self._turn_back(now_ns, here, horizon, planner_state)
        self._closing_ns = -1
        open_now = [each for each in horizon.frontiers if tries[id(each)] == fewest]
        return self._choose(now_ns, horizon, open_now, planner_state)

    def _choose(self, now_ns: int, horizon: Horizon, frontiers: list[Frontier],
                planner_state: str) -> Floats | None:
        goal = self._goal
        if goal is not None and goal.frontier is not None:
            same = _same(goal.frontier, frontiers)
            if same is not None and self._is_kept(same, frontiers[0]):
                self._say(goal.pose, len(frontiers))
                return None
        best = self._first(horizon, frontiers[:_TOUR])
        x, y = best.stand
        yaw = math.atan2(best.y - y, best.x - x)
        return self._give(now_ns, np.array((x, y, yaw)), best, planner_state, len(frontiers))

    def _is_kept(self, same: Frontier, nearest: Frontier) -> bool:
        share = self.settings.switch_share
        return nearest is same or max(nearest.way_m, _PROGRESS_M) > share * same.way_m

    def _first(self, horizon: Horizon, frontiers: list[Frontier]) -> Frontier:
        """Return the frontier that the shortest way to all of them begins with."""
        s = self.settings
        between = horizon.ways_between(frontiers)
        ways = [each.way_m for each in frontiers]
        ends = [0.0] * len(frontiers)
        if s.goes_back and self._home is not None:
            ends = [_HOME_SHARE * math.dist(each.stand, self._home[:2]) for each in frontiers]
        return frontiers[first_of_tour(ways, between, ends)]

    def _give(self, now_ns: int, pose: Floats, frontier: Frontier | None, planner_state: str,
              left: int) -> Floats:
        way_m = _WAY_HOME_M if frontier is None else frontier.way_m
        longest_s = 2.0 * self.settings.patience_s + way_m / self.settings.slowest_m_s
        self._goal = _ExplorationGoal(pose, frontier, now_ns, planner_state, now_ns,
                                      now_ns + round(longest_s * NS_PER_S),
                                      now_ns + round(_ANSWER_S * NS_PER_S))
        self.counts['goals'] += 1
        self._say(pose, left)
        return pose

    def _say(self, pose: Floats, left: int) -> None:
        self.state = f'exploring: to {pose[0]:.1f}, {pose[1]:.1f}; places left: {left}'

    def _wait_for_ground(self, now_ns: int, here: Floats) -> None:
        if self._unplaced_ns < 0:
            self._unplaced_ns = now_ns
        where = f'the robot at {here[0]:.2f}, {here[1]:.2f} has no free ground round it on the map'
        self.state = f'exploring: waiting, {where}'
        if now_ns - self._unplaced_ns > self.settings.patience_s * NS_PER_S:
            self._end(f'stopped: {where}')

    # ---- what is left ------------------------------------------------------------------------

    def _tries(self, frontier: Frontier) -> int:
        return max((left.tries for left in self._left if _is_same(frontier, left.x, left.y)),
                   default=0)

    def _give_up(self, frontier: Frontier, failed: str, here: Floats) -> None:
        """Leave a frontier: for the end, or for good when nothing more is seen from there."""
        self._goal = None
        left = next((each for each in self._left if _is_same(frontier, each.x, each.y)), None)
        if left is None:
            left = _FailedFrontier(frontier.x, frontier.y)
            self._left.append(left)
        if failed:
            left.tries, left.why = left.tries + 1, failed[:_WHY_MOST]
            self._failures += 1
        else:
            left.visits += 1
            self._failures = 0
            if _is_seen_from(frontier, here) or left.visits >= _VISITS:
                left.tries, left.why = _TRIES, ''
        self.counts['given_up'] += left.tries == _TRIES
        if self._failures >= _FAILURES and not self.counts['seen']:
            self._end(f'stopped: none of {self._failures} places could be gone to, the last: '
                      f'{failed[:_WHY_MOST]}')

    def _turn_back(self, now_ns: int, here: Floats, horizon: Horizon, planner_state: str
                   ) -> Floats | None:
        self._goal = None
        if self._closing_ns < 0:
            self._closing_ns = now_ns
        if now_ns - self._closing_ns < self.settings.settle_s * NS_PER_S:
            return None  # the map may not show yet what was seen last
        if horizon.out_of_reach and horizon.ground is not None and self._home is not None and (
                not horizon.ground.has((float(self._home[0]), float(self._home[1])))):
            self._end(f'stopped: no way out at {here[0]:.2f}, {here[1]:.2f} is wide enough; '
                      f'{horizon.out_of_reach} places are left')
            return None
        if (self.settings.goes_back and self._home is not None
                and math.dist(here[:2], self._home[:2]) > _PROGRESS_M):
            goal = self._give(now_ns, self._home, None, planner_state, 0)
            self.state = 'exploring: nothing is left, going back to where it began'
            return goal
        self._end(self._closed())
        return None

    def _go_back(self, failed: str, is_there: bool) -> None:
        if failed:
            self._end(f'{self._closed()}; not gone back: {failed}')
        elif is_there:
            self._end(self._closed())

    def _closed(self) -> str:
        failed = [each for each in self._left if each.why]
        if not failed:
            return CLOSED
        return f'{CLOSED}; given up: {len(failed)}, the last: {failed[-1].why}'

    def _end(self, state: str) -> None:
        self.state, self.is_done, self._goal = state, True, None


def _is_same(frontier: Frontier, x: float, y: float) -> bool:
    return math.dist((frontier.x, frontier.y), (x, y)) < _SAME_M


def _is_seen_from(frontier: Frontier, here: Floats) -> bool:
    """Say whether the robot cannot come nearer to a frontier, and looks at it already."""
    bearing = math.atan2(frontier.y - here[1], frontier.x - here[0]) - float(here[2])
    return (math.dist(frontier.stand, here[:2]) < _SAME_M
            and abs(math.remainder(bearing, math.tau)) < _AHEAD_RAD)


def _same(frontier: Frontier, others: Sequence[Frontier]) -> Frontier | None:
    """Return the frontier that is what is left of another; None when nothing is."""
    reach_m = max(_SAME_M, frontier.size_m / 2.0)
    best = min(others, default=None,
               key=lambda each: math.dist((each.x, each.y), (frontier.x, frontier.y)))
    if best is None or math.dist((best.x, best.y), (frontier.x, frontier.y)) > reach_m:
        return None
    return best
