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
Plan paths on a map to goals, and replan when an obstacle blocks them.

Planning takes from milliseconds to seconds. It is done in pieces that more important tasks
preempt, a few in each job, with pauses in which less important ones run.
"""

from __future__ import annotations

from collections.abc import Generator
from collections.abc import Mapping
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.mapping.live_map import check_map
from rt_robot_os.features.mapping.live_map import LiveMap
from rt_robot_os.features.mapping.live_map import MAP_MESSAGE
from rt_robot_os.features.navigation.collision_guard.sensors import sensor_mounting
from rt_robot_os.features.navigation.planner.dynamic_obstacles import DynamicObstacles
from rt_robot_os.features.navigation.planner.ground import PlanningGround
from rt_robot_os.features.navigation.planner.ground import POSES_MAXIMUM
from rt_robot_os.features.navigation.planner.map_movements import MapMovements
from rt_robot_os.features.navigation.planner.planned_path import ahead_on
from rt_robot_os.features.navigation.planner.planned_path import moved_with
from rt_robot_os.features.navigation.planner.planned_path import PathProgress
from rt_robot_os.features.navigation.planner.settings import SETTINGS
from rt_robot_os.features.navigation.trajectory.pose_input import planar
from rt_robot_os.modules.base import Module
from rt_robot_os.modules.command_age import stale_reason
from rt_robot_os.modules.wake_up import WakeUp
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.route import Route
from rt_robot_os.motion.route import RouteError
from rt_robot_os.topics.ports import Input
from rt_robot_os.topics.ports import Output

_TEXT: Final = 'std_msgs/msg/String'
_TEXT_LENGTH: Final = 200
# Pieces of planning in a job, some 3 ms, and of a new map, some 1 ms, and the pause after them.
_PIECES: Final = 40
_MAP_PIECES: Final = 15
_PAUSE_NS: Final = 3 * NS_PER_MS
# The follower repeats its state this often, so that an old state is no answer.
_ANSWER_NS: Final = NS_PER_S
_AHEAD_M: Final = 3.0


class Planner(Module):
    """Plan paths to goals."""

    goal = Input('goal_pose', wake=True, message='geometry_msgs/msg/PoseStamped')
    pose = Input('pose', message='geometry_msgs/msg/PoseWithCovarianceStamped')
    followed = Input('trajectory/state', wake=True, message=_TEXT)
    map = Input('', message=MAP_MESSAGE, initial=True, newest=True)  # noqa: A003
    cancel = Input('', message='std_msgs/msg/Bool', wake=True)
    correction = Input('', message='geometry_msgs/msg/PoseWithCovarianceStamped', wake=True)
    plan = Output('plan', 'std_msgs/msg/Float64MultiArray', depth=2, tail=3 * POSES_MAXIMUM)
    state = Output('planner/state', _TEXT, tail=_TEXT_LENGTH)

    SETTINGS = SETTINGS

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Check the settings; the map is read later.

        :raises ConfigError: there is no map.
        """
        super().__init__(name, settings)
        check_map(settings['map'], bool(settings['map_topic']), name)
        self._pose: Pose = (0.0, 0.0, 0.0)
        self._pose_ns = -1
        self._goal: Pose | None = None
        self._is_wanted = False
        self._job: Generator[None, None, Route] | None = None
        self._route: Route | None = None
        self._route_ns = self._begun_ns = 0
        self._is_followed = False
        self._has_plan = False  # a plan is active
        self._is_previous_goal = False  # and leads to the previous goal
        self._is_possible = False  # there is a path without obstacles
        self._blocked_reason = ''  # why there is none with obstacles
        self._obstacles: list[int] = []
        self._progress = PathProgress()
        self._retry_ns = self._look_ns = 0
        self._is_blocked = False  # the follower is blocked
        self._goals = self._plans = self._refused = self._expanded = self._closed = 0
        self._took_ms = 0.0
        self._reported = ''

    # ---- ports -------------------------------------------------------------------------------

    def connected(self, attribute: str) -> bool:
        """Do not subscribe to inputs without a topic."""
        return bool(self.topic_of(attribute))

    def listed_inputs(self) -> Mapping[str, Input]:
        """Return an input for each scanner; they release nothing."""
        return {topic: Input(topic, message='sensor_msgs/msg/LaserScan')
                for topic in self.settings['scan_topics']}

    # ---- life --------------------------------------------------------------------------------

    def configure(self) -> None:
        """
        Read the map.

        :raises ConfigError: it cannot be read, or poses, goals and maps are in different frames.
        """
        s = self.settings
        frames = {self.topic_of(port): str(getattr(self, port).msg.header.frame_id)
                  for port in ('goal', 'pose')}
        if len(set(frames.values())) > 1:
            described = ', '.join(f'{topic} in {frame!r}' for topic, frame in frames.items())
            raise ConfigError([f'{self.name}: {described}: declare both in the frame of the map'])
        self._radius_m = s['robot_radius_m'] + s['clearance_m']
        self._ground = PlanningGround(LiveMap(
            s['map'], self.map if self.connected('map') else None, frames[self.topic_of('pose')],
            self.name, self.log), s)
        self._corrections = MapMovements(
            self.correction if self.connected('correction') else None, self._ground.map)
        self._dynamic_obstacles = DynamicObstacles(
            [(read, sensor_mounting(read, self.mountings, self.name))
             for read in self.listed.values()],
            s)
        self._dynamic_obstacles.terrain = self._ground.terrain
        self._wake_up = WakeUp(self.kernel, self.task)

    def activate(self) -> None:
        """Begin without a goal, also after a failure."""
        self._goal = self._job = self._route = None
        self._is_wanted = False

    def changed(self, name: str) -> None:
        """Apply a setting; unknown_is_free changes the whole terrain."""
        if name == 'unknown_is_free':
            self._ground.unknown_is_free = self.settings[name]

    def step(self) -> None:
        """Read the inputs, and continue planning."""
        now_ns = self.plan.topic.kernel.now_ns()
        self._read_pose(now_ns)
        if is_new := self.goal.latest():
            self._read_goal(now_ns)
        self._read_cancels(is_new, now_ns)
        self._apply_map_movements(now_ns)
        if self._corrections.pending:
            self._wake_up.no_later_than(now_ns + _PAUSE_NS)
            return
        if self.connected('followed'):
            while self.followed.take():
                self._read_follower_state(str(self.followed.msg.data), self.followed.stamp_ns,
                                          now_ns)
        awaits_map = self._corrections.awaits_map(now_ns)
        if self._pose_is_fresh(now_ns) and not awaits_map:
            self._dynamic_obstacles.update(self._pose, now_ns)
        if self._job is None and self._ground.is_behind:
            self._update_ground(now_ns)
        if self._goal is None:
            return
        if self._pose_is_fresh(now_ns):
            self._check_path_ahead(now_ns)
        if self._is_wanted and now_ns >= self._retry_ns and not awaits_map:
            self._begin(now_ns)
        if self._job is not None:
            self._continue(now_ns)

    def statistics(self) -> Mapping[str, Any]:
        """Return the state of planning, its duration, and the counters."""
        if not hasattr(self, '_ground'):
            return {}
        no_way = self._reported.startswith(('refused: ', 'waiting: '))
        return {'warning': self._reported if no_way else self._ground.warning(),
                'state': self._reported,
                'goals': self._goals, 'goals_refused': self._refused, 'plans': self._plans,
                'ways_closed_by_map': self._closed,
                'planned_in_ms': self._took_ms, 'cells_expanded': self._expanded,
                'obstacle_cells': len(self._dynamic_obstacles),
                'length_m': self._route.length_m if self._route else 0.0,
                'corrections': self._corrections.count, **self._ground.statistics()}

    # ---- inputs ------------------------------------------------------------------------------

    def _read_pose(self, now_ns: int) -> None:
        if self.pose.latest():
            pose = planar(self.pose.msg.pose.pose)
            if pose is not None:
                self._pose, self._pose_ns = pose, min(self.pose.stamp_ns, now_ns)

    def _pose_is_fresh(self, now_ns: int) -> bool:
        return self._pose_ns >= 0 and (
            now_ns - self._pose_ns <= self.settings['pose_timeout_s'] * NS_PER_S)

    def _read_goal(self, now_ns: int) -> None:
        goal = planar(self.goal.msg.pose)
        self._goals += 1
        self._goal, self._job, self._route = goal, None, None
        self._reported = ''  # the client waits for a state, also for a repeated one
        self._progress.restart()
        self._retry_ns = self._look_ns = now_ns
        self._is_blocked = self._is_possible = False
        self._is_previous_goal = self._has_plan
        self._is_wanted = goal is not None
        why = ('the goal is no pose' if goal is None else
               stale_reason(self.goal.stamp_ns, now_ns, self.settings))
        if why:
            self._refuse(why, now_ns)

    def _read_cancels(self, is_new: bool, now_ns: int) -> None:
        """
        Cancel the goal; the follower is stopped, too, unless the plan is newer.

        :param is_new: the goal has just arrived: an older cancellation does not apply to it.
        """
        while self.connected('cancel') and self.cancel.take():
            stamp_ns = self.cancel.stamp_ns
            is_for_it = not is_new or stamp_ns >= self.goal.stamp_ns
            if self.cancel.msg.data and self._goal is not None and is_for_it:
                if self._has_plan and self._route_ns >= stamp_ns:
                    self._publish_plan(None, now_ns)
                self._has_plan = False
                self._end('stopped: cancelled', now_ns)

    def _read_follower_state(self, state: str, stamp_ns: int, now_ns: int) -> None:
        """Process a state of the follower."""
        if self._goal is None or self._route is None or stamp_ns < self._route_ns:
            return
        if state in ('driving', 'turning'):
            self._is_followed = True
            return
        if not self._is_followed and stamp_ns < self._route_ns + _ANSWER_NS:
            return  # it refers to the previous plan
        if state == 'done':
            self._has_plan = False
            self._end('done', now_ns)
        elif state.startswith('stopped: off the path') and self._ground.map.is_live:
            self._is_followed = False  # a growing map may move under the robot
            self._retry(now_ns)
        elif state.startswith('stopped: blocked'):
            if self._is_followed:
                self._is_followed = False
                self._is_blocked = True
                self._retry(now_ns)
        elif state.startswith('stopped: '):
            self._has_plan = False
            self._end(state, now_ns)

    def _apply_map_movements(self, now_ns: int) -> None:
        """Move the plan with the map, and replan on the moved map."""
        self._corrections.receive(now_ns)
        movement = self._corrections.settled(self._pose, self._pose_ns, now_ns)
        if movement is None:
            return
        self._dynamic_obstacles.set_terrain(self._ground.terrain, movement.moved)
        if self._goal is None:
            return
        self._job, self._is_wanted = None, True
        self._retry_ns = now_ns
        if self._route is not None and movement.is_little:
            # Relative to the robot nothing has moved: it drives on.
            self._route, self._route_ns = moved_with(movement.moved, self._route), now_ns
            self._is_followed = False
            self._publish_plan(self._route, now_ns)
            self._is_previous_goal = True
        elif self._has_plan:
            self._is_previous_goal = True
            self._wait(f'the map moved by {movement.by_m:.2f} m', now_ns)

    def _check_path_ahead(self, now_ns: int) -> None:
        """Replan when an obstacle has blocked the path for a while."""
        if self._route is None or self._is_wanted or self._job is not None:
            return
        if now_ns >= self._look_ns and self._dynamic_obstacles.blocks(
                ahead_on(self._route.poses, self._pose, self._radius_m, _AHEAD_M),
                self._radius_m, now_ns, round(self.settings['blocked_s'] * NS_PER_S)):
            self._look_ns = now_ns + round(self.settings['retry_s'] * NS_PER_S)
            self._retry(now_ns)

    def _update_ground(self, now_ns: int) -> None:
        """Update the terrain to the newest map; a path that stays free is continued."""
        ground = self._ground
        if not ground.advance(_MAP_PIECES):
            if ground.is_behind:
                self._wake_up.no_later_than(self.plan.topic.kernel.now_ns() + _PAUSE_NS)
            return
        self._dynamic_obstacles.set_terrain(ground.terrain)
        if self._is_wanted:
            self._retry_ns = now_ns
        elif self._route is not None and (
                place := ground.blocked_at(self._route.poses, self._pose)) is not None:
            self._closed += 1
            self.log.info('the map blocks the path at %.2f, %.2f: planning another one',
                          *place)
            self._is_previous_goal = True
            self._retry(now_ns)

    # ---- planning ----------------------------------------------------------------------------

    def _retry(self, now_ns: int) -> None:
        held_ns = self._progress.held_ns(self._pose, now_ns)
        if held_ns > self.settings['patience_s'] * NS_PER_S:
            self._refuse(f'blocked for {self.settings["patience_s"]:g} s', now_ns)
            return
        self._is_wanted = True

    def _begin(self, now_ns: int) -> None:
        if self._goal is None:
            return
        if self._ground.planner is None:
            self._wait('no map yet', now_ns)
            return
        if not self._pose_is_fresh(now_ns):
            self._wait('no pose' + (' yet' if self._pose_ns < 0 else ' any more'), now_ns)
            return
        self._is_wanted = False
        self._blocked_reason = ''
        self._begun_ns = now_ns
        self._obstacles = self._dynamic_obstacles.standing(
            now_ns, 0 if self._is_blocked else round(self.settings['blocked_s'] * NS_PER_S))
        self._is_blocked = False
        self._job = self._ground.planner.plan(self._pose, self._goal, self._obstacles)
        self._report('planning', now_ns)

    def _continue(self, now_ns: int) -> None:
        """Do some pieces of planning."""
        job = self._job
        try:
            for _ in range(_PIECES):
                if job is not None:
                    next(job)
        except StopIteration as ended:
            self._job = None
            self._planned(ended.value)
        except RouteError as error:
            self._job = None
            self._failed(str(error), now_ns)
        else:
            self._wake_up.no_later_than(self.plan.topic.kernel.now_ns() + _PAUSE_NS)

    def _planned(self, route: Route) -> None:
        now_ns = self.plan.topic.kernel.now_ns()
        self._is_possible = True
        if self._blocked_reason:
            self._schedule_retry(self._blocked_reason, now_ns)
            return
        self._route, self._route_ns = route, now_ns
        self._is_followed = False
        self._plans += 1
        self._took_ms = (now_ns - self._begun_ns) / NS_PER_MS
        if self._ground.planner is not None:
            self._expanded = self._ground.planner.search.expanded
        self._publish_plan(route, now_ns)
        moved = f', goal moved by {route.moved_m:.2f} m' if route.moved_m > 0.0 else ''
        self._report(f'planned: {route.length_m:.2f} m{moved}', now_ns)

    def _failed(self, why: str, now_ns: int) -> None:
        """Wait for obstacles to go; refuse what the map forbids."""
        if self._is_possible and (self._obstacles or self._ground.map.is_live):
            self._schedule_retry(why, now_ns)  # the map may change
        elif not self._obstacles or self._blocked_reason:
            self._refuse(why, now_ns)
        elif self._ground.planner is not None and self._goal is not None:
            # Planning without obstacles shows whether waiting helps.
            self._blocked_reason = why
            self._job = self._ground.planner.plan(self._pose, self._goal, ())
            self._wake_up.no_later_than(now_ns + _PAUSE_NS)

    def _schedule_retry(self, why: str, now_ns: int) -> None:
        self._retry(now_ns)
        if self._goal is not None:
            self._retry_ns = now_ns + round(self.settings['retry_s'] * NS_PER_S)
            self._wake_up.no_later_than(self._retry_ns)
            self._wait(why, now_ns)

    def _wait(self, why: str, now_ns: int) -> None:
        """Report why there is no plan, and stop the follower of the previous one."""
        if self._is_previous_goal:
            self._route = None
            self._publish_plan(None, now_ns)
        self._report(f'waiting: {why}', now_ns)

    def _publish_plan(self, route: Route | None, now_ns: int) -> None:
        """Publish a plan; an empty one stops the follower of the previous one."""
        self._has_plan, self._is_previous_goal = route is not None, False
        self.plan.msg.data = [number for pose in route.poses for number in pose] if route else []
        self.plan.publish(now_ns)

    def _refuse(self, why: str, now_ns: int) -> None:
        self._refused += 1
        self.log.warn('goal refused: %s', why)
        if self._has_plan:
            self._publish_plan(None, now_ns)
        self._end(f'refused: {why}', now_ns)

    def _end(self, state: str, now_ns: int) -> None:
        self._goal = self._route = self._job = None
        self._is_wanted = False
        self._report(state, now_ns)

    def _report(self, state: str, now_ns: int) -> None:
        if state == self._reported:
            return
        self._reported = state
        self.state.msg.data = state[:_TEXT_LENGTH]
        self.state.publish(now_ns)
