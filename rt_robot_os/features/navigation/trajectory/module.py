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
Drive the robot to goals and along paths: velocity commands at its own rate.

The module subscribes to poses of a localiser, odometry and goals or paths, and publishes commands
for the velocity multiplexer. When it is done it stops publishing, so that other sources may steer.
Each stop has a reason, and only a new goal or path makes the robot move again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
import math
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import declared
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import made
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.motor_faults import hold_reason
from rt_robot_os.features.navigation.trajectory.pose_input import planar
from rt_robot_os.features.navigation.trajectory.pose_input import PoseInput
from rt_robot_os.modules.base import Module
from rt_robot_os.modules.command_age import COMMAND_AGE
from rt_robot_os.modules.command_age import stale_reason
from rt_robot_os.motion.controllers import CONTROLLERS
from rt_robot_os.motion.controllers import make_controller
from rt_robot_os.motion.controllers.base import Velocity
from rt_robot_os.motion.controllers.table import gain_fields
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.follower import Follower
from rt_robot_os.motion.follower import Phase
from rt_robot_os.motion.follower_tuning import FollowerTuning
from rt_robot_os.motion.reference_path import PathError
from rt_robot_os.motion.velocity_limits import VelocityLimits
from rt_robot_os.topics.ports import Input
from rt_robot_os.topics.ports import Output
from rt_robot_os.topics.subscription import Subscription

_GOAL: Final = 'geometry_msgs/msg/PoseStamped'
_TRIPLETS: Final = 'std_msgs/msg/Float64MultiArray'
_REQUEST_TOPICS: Final = ('goal', 'plan', 'path')
_STOP_REASONS: Final = {'cancel': 'cancelled', 'estop': 'e-stop'}
_STATE_LENGTH: Final = 200
# A client that connects late gets the state within this time.
_STATE_AGAIN_NS: Final = NS_PER_S


class _DriveRequest(NamedTuple):
    """
    A goal, a plan or a path.

    :ivar kind: ``goal``, ``plan`` or ``path``.
    """

    stamp_ns: int
    kind: str
    input: Subscription  # noqa: A003


class Trajectory(Module):
    """Follow goals and paths."""

    pose = Input('pose', message='geometry_msgs/msg/PoseWithCovarianceStamped')
    odom = Input('odom', message='nav_msgs/msg/Odometry')
    goal = Input('goal_pose', message=_GOAL)
    plan = Input('plan', message=_TRIPLETS)
    path = Input('path', message=_TRIPLETS)
    cancel = Input('trajectory/cancel', message='std_msgs/msg/Bool')
    estop = Input('estop', message='std_msgs/msg/Bool')
    estop_release = Input('', message='std_msgs/msg/Bool')
    motor_faults = Input('', message='std_msgs/msg/UInt32')
    command = Output('cmd_vel_trajectory', 'geometry_msgs/msg/Twist')
    state = Output('trajectory/state', 'std_msgs/msg/String', tail=_STATE_LENGTH)
    progress = Output('trajectory/progress', 'std_msgs/msg/Float64')
    error = Output('trajectory/error', 'geometry_msgs/msg/Vector3Stamped',
                   {'header.frame_id': 'base_link'})

    SETTINGS = (
        Field('law', str, 'kanayama', 'Tracking law: kanayama and samson follow a reference in '
              'time, regulated_pure_pursuit and park_kuipers its path, as in Nav2',
              choices=tuple(CONTROLLERS), live=True),
        Field('goal_topic', str, 'goal_pose', 'Goals that are driven to on a straight line, a '
              'geometry_msgs/msg/PoseStamped; empty: goals are for a planner'),
        Field('plan_topic', str, '', 'Paths of a planner, a std_msgs/msg/Float64MultiArray of x, '
              'y, yaw for each pose; empty: there is none'),
        Field('path_topic', str, '', 'Paths of other programs, such as a nav_msgs/msg/Path from '
              'ROS, in the same form; empty: there are none'),
        Field('cancel_topic', str, '', 'True stops the robot, a std_msgs/msg/Bool; empty: there '
              'is none'),
        Field('estop_topic', str, '', 'The e-stop of the multiplexer: true ends what is driven, '
              'too; empty: the robot goes on when the e-stop is released, unless it was blocked '
              'for too long'),
        Field('estop_release_topic', str, '',
              'What releases that e-stop: goals before the release '
              'are refused; empty: the robot starts with them when it is released'),
        Field('motor_faults_topic', str, '', 'Faults of the motor board: one that holds the '
              'wheels ends what is driven; empty: the robot is blocked then'),
        *declared(VelocityLimits), *declared(FollowerTuning),
        Field('motor_lag_s', float, 0.1, 'How long the wheels take to follow a command: the time '
              'constant of the motors and the delay of their line; the pose is predicted '
              'that far ahead', 's', 0.0, 2.0, live=True),
        Field('pose_timeout_s', float, 0.5, 'Age of a pose or of odometry at which the robot '
              'stops', 's', 0.02, 60.0, live=True),
        Field('position_stddev_max_m', float, 0.3, 'Stop when the position is less certain', 'm',
              0.001, 100.0, live=True),
        Field('heading_stddev_max_rad', float, 0.3, 'Stop when the heading is less certain', 'rad',
              0.001, 10.0, live=True),
        Field('correction_m_s', float, 0.1, 'How fast a step in the pose is applied, so that '
              'the wheels make no step', 'm/s', 0.001, 100.0, live=True),
        Field('correction_rad_s', float, 0.3, 'The same of the heading', 'rad/s', 0.001, 100.0,
              live=True),
        COMMAND_AGE, *gain_fields(),
    )

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Make the tracking law.

        :raises ConfigError: there is nothing to follow, or no rate.
        """
        super().__init__(name, settings)
        if not any(settings[f'{wish}_topic'] for wish in _REQUEST_TOPICS):
            raise ConfigError([f'{name}: goal_topic, plan_topic and path_topic are all empty: '
                               'there is nothing to follow; set one of them'])
        self._follower = Follower(make_controller(settings['law'], settings))
        self._pose_input: PoseInput | None = None
        self._faults: Subscription | None = None
        self._estop_release: Subscription | None = None
        self._is_estop_pressed = self._is_estop_latched = False
        self._motor_fault_reason = ''
        self._reported = ''
        self._reported_ns = 0
        self._goals = self._refused = self._cancelled = 0
        self._apply()

    # ---- ports -------------------------------------------------------------------------------

    def connected(self, attribute: str) -> bool:
        """Do not subscribe to inputs without a topic."""
        return bool(self.topic_of(attribute))

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return the outputs; state, progress and error have no fixed rate."""
        return tuple(replace(each, rate_hz=0.0) for each in super().publications())

    # ---- life --------------------------------------------------------------------------------

    def configure(self) -> None:
        """
        Check that all poses are on one map.

        :raises ConfigError: they are not, or the module has no rate.
        """
        if not self.period_ns:
            raise ConfigError([f'{self.name}.rate_hz is missing: commands are computed for a '
                               'period, such as that of rate_hz: 50.0'])
        frame = self.pose.msg.header.frame_id
        if self.connected('goal') and self.goal.msg.header.frame_id != frame:
            raise ConfigError([
                f'{self.name}: {self.topic_of("goal")} is in the frame '
                f'{self.goal.msg.header.frame_id!r}, {self.topic_of("pose")} in {frame!r}: '
                'declare both in the frame of the map'])
        self._request_inputs: list[tuple[str, Subscription]] = [
            (wish, getattr(self, wish)) for wish in _REQUEST_TOPICS if self.connected(wish)]
        # Looked up once: a query of the ports costs more than a step.
        self._stop_inputs: list[tuple[str, Subscription]] = [
            (why, getattr(self, port)) for port, why in _STOP_REASONS.items()
            if self.connected(port)]
        self._estop_release = (self.estop_release if self.connected('estop_release')
                               and self.connected('estop') else None)
        self._faults = self.motor_faults if self.connected('motor_faults') else None
        self._pose_input = PoseInput(self.pose, self.odom)
        self._apply()

    def activate(self) -> None:
        """Start at rest, also after a failure: only a new goal makes the robot move."""
        self._follower.abandon('restarted' if self._follower.phase is not Phase.REST else '')

    def deactivate(self) -> None:
        """Drop the present goal."""
        self._follower.abandon('shut down' if self._follower.phase is not Phase.REST else '')

    def safe_state(self) -> None:
        """Publish a standstill, and drop the present goal."""
        self._follower.abandon('safe state')
        self._publish_command((0.0, 0.0))

    def changed(self, name: str) -> None:
        """Apply a setting between two steps."""
        self._apply()
        if name == 'law' or name.startswith(tuple(CONTROLLERS)):
            self._follower.controller = make_controller(self.settings['law'], self.settings)

    def _apply(self) -> None:
        s, follower = self.settings, self._follower
        follower.limits = made(VelocityLimits, s)
        follower.tuning = made(FollowerTuning, s)
        if self._pose_input is not None:
            prediction = self._pose_input.prediction
            prediction.correction_m_s = s['correction_m_s']
            prediction.correction_rad_s = s['correction_rad_s']

    # ---- work --------------------------------------------------------------------------------

    def step(self) -> None:
        """Read the inputs, and publish the command for the period that begins now."""
        where, follower, s = self._pose_input, self._follower, self.settings
        if where is None or self.kernel is None:
            return
        now_ns = self.kernel.now_ns()
        period_s = self.period_ns / NS_PER_S
        where.receive(now_ns)
        problem = where.problem(now_ns, s['pose_timeout_s'], s['position_stddev_max_m'],
                                s['heading_stddev_max_rad']) or self._motor_fault()
        pose = (0.0, 0.0, 0.0)
        if where.prediction.known:
            pose = where.prediction.at(now_ns, s['motor_lag_s'], period_s)
        pose = self._read_requests(pose, where.prediction.velocity, problem, now_ns)
        if problem and follower.driving:
            follower.stop(problem)
        command = follower.step(pose, period_s, where.prediction.velocity)
        if command is not None:
            self._publish_command(command)
            self.progress.msg.data = follower.progress
            self.progress.publish(now_ns)
            self.error.msg.vector = follower.error
            self.error.publish(now_ns)
        self._report_state(now_ns)

    def _motor_fault(self) -> str:
        """Return why the motor board holds the wheels; empty when it does not."""
        source, bits, new = self._faults, 0, False
        while source is not None and source.take():
            # A fault that came and went since the last step has stopped the wheels, too.
            bits, new = bits | int(source.msg.data), True
        if new:
            self._motor_fault_reason = hold_reason(bits)
        return self._motor_fault_reason

    def _read_requests(self, pose: Pose, velocity: Velocity, problem: str, now_ns: int) -> Pose:
        """Execute the newest goal, path or cancellation; return the pose to continue with."""
        request = self._newest_request()
        is_stopped = self._apply_stops(request)
        self._apply_estop_release()
        if request is None or is_stopped:
            return pose
        self._goals += 1
        try:
            poses = self._requested_poses(request, problem, now_ns)
            pose = self._without_corrections(pose)
            self._follower.go(poses, pose, velocity)
        except PathError as error:
            self._refused += 1
            self._follower.stop(str(error))
            self.log.warn('%s: not driven: %s', request.input.topic.name, error, throttle_s=1.0)
        return pose

    def _newest_request(self) -> _DriveRequest | None:
        newest: _DriveRequest | None = None
        for kind, source in self._request_inputs:
            if source.latest() and (newest is None or source.stamp_ns >= newest.stamp_ns):
                newest = _DriveRequest(source.stamp_ns, kind, source)
        return newest

    def _apply_stops(self, request: _DriveRequest | None) -> bool:
        """Execute cancellations and e-stops; return whether one is newer than a request."""
        is_newer = False
        for reason, source in self._stop_inputs:
            while source.take():
                if reason == _STOP_REASONS['estop']:
                    self._is_estop_pressed = bool(source.msg.data)
                    self._is_estop_latched |= (
                        self._is_estop_pressed and self._estop_release is not None)
                if source.msg.data and (request is None or is_newer
                                        or source.stamp_ns >= request.stamp_ns):
                    is_newer = True
                    if self._follower.driving:
                        self._cancelled += 1
                        self._follower.stop(reason)
        return is_newer

    def _apply_estop_release(self) -> None:
        while self._estop_release is not None and self._estop_release.take():
            if self._estop_release.msg.data:
                self._is_estop_latched = self._is_estop_pressed  # as in the multiplexer

    def _requested_poses(self, request: _DriveRequest, problem: str, now_ns: int) -> list[Pose]:
        """
        Return the poses of a request.

        :raises PathError: it is malformed or too old, or the robot must not drive now.
        """
        poses = self._goal_poses() if request.kind == 'goal' else _triplets(request.input.msg)
        if request.kind == 'plan' and not poses:
            raise PathError('the planner took the plan back')
        # The age of a plan does not count: the planner has checked that of its goal.
        if request.kind != 'plan' and (
                why := stale_reason(request.stamp_ns, now_ns, self.settings)):
            raise PathError(why)
        if self._is_estop_latched:
            problem = 'e-stop, not released yet'
        if problem:
            raise PathError(problem)
        return poses

    def _without_corrections(self, pose: Pose) -> Pose:
        """Return the pose with all corrections applied: the new path includes them."""
        where = self._pose_input
        if where is None or self.kernel is None or not where.prediction.known:
            return pose
        where.prediction.apply_corrections()
        return where.prediction.at(self.kernel.now_ns(), self.settings['motor_lag_s'], 0.0)

    def _goal_poses(self) -> list[Pose]:
        """Return the goal after a check."""
        message = self.goal.msg.pose
        goal = planar(message)
        if goal is None:
            x, y, _ = message.position
            raise PathError(f'goal is no pose: position {x:g}, {y:g}, orientation '
                            + ', '.join(f'{each:g}' for each in message.orientation))
        return [goal]

    def _publish_command(self, command: tuple[float, float]) -> None:
        message = self.command.msg
        message.linear = command[0], 0.0, 0.0
        message.angular = 0.0, 0.0, command[1]
        self.command.publish()

    def _report_state(self, now_ns: int) -> None:
        state = self._follower.state
        if state != self._reported or now_ns - self._reported_ns >= _STATE_AGAIN_NS:
            if state != self._reported:
                self.log.info('%s', state)
            self._reported, self._reported_ns = state, now_ns
            self.state.msg.data = state[:_STATE_LENGTH]
            self.state.publish(now_ns)

    def statistics(self) -> Mapping[str, Any]:
        """Return the state of driving, and the counters of inputs."""
        where, follower = self._pose_input, self._follower
        if where is None or self.kernel is None:
            return {}
        counters = where.counters
        pose_age_s = where.pose_source.age_s(self.kernel.now_ns())
        ahead, left, turn = follower.error
        warning = ''
        if follower.state.startswith('stopped: ') and 'cancelled' not in follower.state:
            warning = follower.state
        elif math.isinf(pose_age_s):
            warning = f'no pose yet on {self.topic_of("pose")}'
        return {
            'warning': warning, 'state': follower.state, 'law': follower.controller.NAME,
            'progress': follower.progress, 'error_along_m': ahead, 'error_across_m': left,
            'error_heading_deg': math.degrees(turn), 'goals': self._goals,
            'goals_refused': self._refused, 'cancelled': self._cancelled,
            'poses': counters.poses, 'poses_refused': counters.poses_refused,
            'odometry': counters.odometry, 'odometry_refused': counters.odometry_refused,
            'odometry_began_anew': where.prediction.resets, 'pose_jumps': where.prediction.jumps,
            'pose_age_s': -1.0 if math.isinf(pose_age_s) else pose_age_s}


def _triplets(message: Any) -> list[Pose]:
    """
    Read the poses of a path.

    :raises PathError: a pose has three numbers, and some are left over.
    """
    data = [float(each) for each in message.data]
    if len(data) % 3:
        raise PathError(f'path has {len(data)} numbers: each pose has three, x, y and yaw')
    return list(zip(data[0::3], data[1::3], data[2::3]))
