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
Choose the next goal of an exploration: a state machine without a clock of its own.

The robot goes to a frontier, stays until nothing there is unknown, and continues with the next.
Frontiers that the planner refuses, or that take too long, are tried once more at the end.
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

#: How long the state of the planner may be of the previous goal; then the goal is repeated.
_ANSWER_S: Final = 8.0
#: How long after a refusal a goal is repeated: the planner may have had an older map.
_MAP_S: Final = 3.0
#: The planner moves goals by less than this; ``done`` from further away is of the previous goal.
_DONE_M: Final = 1.0
_PROGRESS_M: Final = 0.2
_WAY_HOME_M: Final = 50.0
#: Two places nearer to each other than this are one.
_SAME_M: Final = 0.5
_TRIES: Final = 2
#: The nearest frontiers that are put in order: the work doubles with each.
_TOUR: Final = 8
#: Share of the direct way home that counts, as finds on the way lengthen it.
_HOME_SHARE: Final = 0.5
_VISITS: Final = 3
_WHY_MOST: Final = 120
#: The robot turns towards frontiers that are further aside.
_AHEAD_RAD: Final = 0.7
#: Failures in a row without any success after which exploration stops.
_FAILURES: Final = 3


@dataclass(frozen=True)
class ExplorationSettings:
    """
    Parameters of an exploration.

    :ivar radius_m: that must be free round the robot: ``robot_radius_m`` and ``clearance_m`` of
        the planner.
    :ivar least_m: extent of the smallest frontier that is visited.
    :ivar look_s: period of the search for frontiers.
    :ivar settle_s: how long the robot stands at a goal until the map shows what is seen there.
    :ivar patience_s: a goal is given up after this time without progress.
    :ivar slowest_m_s: or, beyond twice that time, when the mean speed is lower.
    :ivar switch_share: the goal is switched to a frontier whose path is less than this share.
    :ivar goes_back: at the end it returns to the start.
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
    frontier: Frontier | None  # None: back to the start
    given_ns: int
    before: str  # the state of the planner until then
    progress_ns: int
    until_ns: int
    again_ns: int
    at: Floats | None = None  # pose of the robot at its last progress
    has_moved: bool = False
    is_answered: bool = False
    is_given_again: bool = False
    there_ns: int = -1


@dataclass
class _FailedFrontier:
    """
    A frontier that was tried without success.

    :ivar tries: how often the robot did not reach it.
    :ivar visits: how often it did, and did not see all of it.
    """

    x: float
    y: float
    why: str = ''
    tries: int = 0
    visits: int = 0


class Explorer:
    """
    Choose the next goal.

    :param settings: None: the defaults.
    :ivar state: one line for operators: ``exploring: ...``, at the end ``closed: nothing is left
        to explore`` with what was given up, or ``stopped: why``.
    :ivar is_done: it has ended; make a new explorer to start again.
    :ivar counts: ``goals``, ``seen`` (frontiers that are gone), ``given_up`` and ``looks``.
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
        Evaluate the progress; call it a few times a second.

        It usually takes microseconds; once in ``look_s`` it searches for frontiers: some 5 ms in a
        flat, a tenth of a second in a map of a million cells.

        :param grid: the present map.
        :param pose: x, y in m and yaw in rad of the robot on it.
        :param planner_state: the last state of the planner; empty when there is none.
        :return: shape (3,): a new goal for the planner; None: the goal is unchanged.
        """
        if self.is_done:
            return None
        here = np.array(pose, dtype=np.float64)  # a copy, as it is stored
        if not np.isfinite(here).all():
            return None
        if self._home is None:
            self._home = here
        goal, failed = self._goal, ''
        is_there = False
        if goal is not None:
            failed = self._watch(goal, now_ns, here, planner_state)
            is_there = self._is_there(goal, now_ns, here, planner_state)
            if self._goal is None:  # it has ended
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

    # ---- progress to a goal ------------------------------------------------------------------

    def _watch(self, goal: _ExplorationGoal, now_ns: int, here: Floats, planner_state: str) -> str:
        """Return why a goal must be given up; empty if it need not."""
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
            self._end(planner_state)  # lost, a fault or a stop: not the fault of this frontier
        if now_ns - goal.progress_ns > self.settings.patience_s * NS_PER_S:
            return (f'no progress for {self.settings.patience_s:g} s; the planner says: '
                    f'{planner_state or "nothing"}')
        if now_ns > goal.until_ns:
            return f'not there after {(now_ns - goal.given_ns) / NS_PER_S:.0f} s'
        return ''

    def _is_there(self, goal: _ExplorationGoal, now_ns: int, here: Floats, planner_state: str
                  ) -> bool:
        """Return whether the robot stands at the goal, and the map had time to be updated."""
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
        """Repeat a goal that was lost, or refused at first."""
        if goal.is_given_again or now_ns < goal.again_ns or (
                goal.has_moved and not planner_state.startswith('refused: ')):
            return False
        goal.is_given_again, goal.is_answered = True, False
        goal.given_ns, goal.before = now_ns, planner_state
        return True

    # ---- next goal ---------------------------------------------------------------------------

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
        # Those that failed come last, when the map is larger.
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
        """Return the first frontier of the shortest path through all of them."""
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

    # ---- failed frontiers --------------------------------------------------------------------

    def _tries(self, frontier: Frontier) -> int:
        return max((left.tries for left in self._left if _is_same(frontier, left.x, left.y)),
                   default=0)

    def _give_up(self, frontier: Frontier, failed: str, here: Floats) -> None:
        """Postpone a frontier, or drop it when nothing more is seen from there."""
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
            return None  # the last scan may not be on the map yet
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
    """Return whether the robot is as near to a frontier as possible, and faces it."""
    bearing = math.atan2(frontier.y - here[1], frontier.x - here[0]) - float(here[2])
    return (math.dist(frontier.stand, here[:2]) < _SAME_M
            and abs(math.remainder(bearing, math.tau)) < _AHEAD_RAD)


def _same(frontier: Frontier, others: Sequence[Frontier]) -> Frontier | None:
    """Return the frontier that remains of another one; None when it is gone."""
    reach_m = max(_SAME_M, frontier.size_m / 2.0)
    best = min(others, default=None,
               key=lambda each: math.dist((each.x, each.y), (frontier.x, frontier.y)))
    if best is None or math.dist((best.x, best.y), (frontier.x, frontier.y)) > reach_m:
        return None
    return best
