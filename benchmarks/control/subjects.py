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

"""What the case control measures: the time of a step, and vectors of others."""

from __future__ import annotations

from collections.abc import Callable
import math
from pathlib import Path

from benchmarks.control.vectors import compare
from benchmarks.trajectory.drives import eight
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.navigation.trajectory import Trajectory
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.motion.controllers import make_controller
from rt_robot_os.motion.differential import moved
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.follower import Follower
from rt_robot_os.motion.reference import PathReference
from rt_robot_os.motion.spline import legs
from rt_robot_os.motion.velocity_limits import VelocityLimits
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.subjects.operation_cost import block_means_ps
from rt_robot_os.topics import Bus

_PERIOD_S = 0.02
_PERIOD_NS = 20_000_000
_MAP = {'header.frame_id': 'map'}
_ODOM = {'header.frame_id': 'odom', 'child_frame_id': 'base_link'}
_EIGHT = tuple(eight())
_LIMITS = VelocityLimits(angular_max_rad_s=2.0, lateral_max_m_s2=1.0)


def vectors(harness: Harness) -> Measurement:
    """Compare with the vectors of a file: how many there are, and the worst difference."""
    figures: dict[str, float] = {}
    for each in compare(Path(harness.arguments['data'])):
        figures[f'{each.group} cases'] = float(each.cases)
        figures[f'{each.group} worst'] = each.worst
    return Measurement({}, figures)


def steps(harness: Harness) -> Measurement:
    """Measure what a step of each law costs, in picoseconds."""
    tested: dict[str, Callable[[], object]] = {}
    for law in harness.arguments['laws']:
        tested[f'{law} law'] = _law(law)
        tested[f'{law} follower'] = FollowerStep(law)
        tested[f'{law} module'] = ModuleStep(law)
    tested['path'] = _path()
    harness.prepare(freeze=True)
    share_ns = harness.arguments['measure_ns'] // len(tested)
    return Measurement({name: block_means_ps(operation, share_ns)
                        for name, operation in tested.items()})


def _law(name: str) -> Callable[[], object]:
    """Give a step of a law somewhere on an eight; the reference stays there."""
    law = make_controller(name)
    path, = legs(_EIGHT, 0.8)
    reference = PathReference(path, _LIMITS)
    for _ in range(200):
        reference.advance(_PERIOD_S)
    x, y, heading, _ = path.at(reference.along_m)
    pose = x + 0.01, y - 0.01, heading + 0.02
    reference.nearest_m = reference.along_m

    def step() -> None:
        reference.time_s -= _PERIOD_S
        law.step(pose, reference, _PERIOD_S, (0.3, 0.1))

    return step


class FollowerStep:
    """A step of a robot that drives eights, and does as it is told."""

    def __init__(self, name: str) -> None:
        self.pose: Pose = _EIGHT[0]
        self._follower = Follower(make_controller(name), _LIMITS)
        self._command: tuple[float, float] | None = None

    def __call__(self) -> None:
        """Drive on for a period."""
        if self._command is None:
            self.pose = _EIGHT[0]
            self._follower.go(_EIGHT, self.pose)
        else:
            self.pose = moved(self.pose, self._command[0] * _PERIOD_S,
                              self._command[1] * _PERIOD_S)
        self._command = self._follower.step(self.pose, _PERIOD_S, self._command)


class ModuleStep:
    """A job of the module with odometry and a pose to take, topics and all."""

    def __init__(self, name: str) -> None:
        self.pose: Pose = _EIGHT[0]
        # The clock stands still, so that all stamps are of now and nothing gets old.
        bus = Bus(Kernel(VirtualClock(start_ns=NS_PER_S)))
        bus.declare('pose', 'geometry_msgs/msg/PoseWithCovarianceStamped', _MAP)
        bus.declare('odom', 'nav_msgs/msg/Odometry', _ODOM)
        bus.declare('plan', 'std_msgs/msg/Float64MultiArray',
                    {'layout.dim': [], 'layout.data_offset': 0}, tail=3000)
        self._pose, self._odom, self._plan = (
            bus.publisher(topic) for topic in ('pose', 'odom', 'plan'))
        self._module = Trajectory('tested', {
            **{each.name: each.default for each in Trajectory.fields()}, 'law': name,
            'goal_topic': '', 'plan_topic': 'plan', 'angular_max_rad_s': 2.0,
            'lateral_max_m_s2': 1.0})
        self._module.declare(bus, 1 / _PERIOD_S)
        self._module.bind(bus, bus.kernel.add_task('tested', self._module.job, priority=40,
                                                   rate_hz=1 / _PERIOD_S))
        self._command = bus.subscribe('cmd_vel_trajectory', 'motors')
        self._module.configure()
        self._module.activate()
        self._plan.msg.data = [number for pose in _EIGHT for number in pose]
        self._stamp_ns = NS_PER_S

    def __call__(self) -> None:
        """Drive on for a period."""
        self._stamp_ns += _PERIOD_NS
        x, y, yaw = self.pose
        half = math.sin(yaw / 2), math.cos(yaw / 2)
        for publisher in (self._odom, self._pose):
            publisher.msg.pose.pose.position = x, y, 0.0
            publisher.msg.pose.pose.orientation = 0.0, 0.0, *half
            publisher.publish(self._stamp_ns)
        self._module.step()
        if not self._command.take():
            self._plan.publish(self._stamp_ns)
            return
        linear, angular = self._command.msg.linear.x, self._command.msg.angular.z
        twist = self._odom.msg.twist.twist
        twist.linear.x, twist.angular.z = linear, angular
        self.pose = moved(self.pose, linear * _PERIOD_S, angular * _PERIOD_S)


def _path() -> Callable[[], object]:
    """Give the making of a reference from 400 poses."""
    def lay() -> None:
        path, = legs(_EIGHT, 0.8)
        PathReference(path, _LIMITS)

    return lay
