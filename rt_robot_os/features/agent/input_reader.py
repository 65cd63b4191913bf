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

"""Reads the topics of the robot into the inputs of the agent."""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import Final

from rt_robot_os.features.agent.inputs import AgentInputs
from rt_robot_os.features.agent.inputs import Location
from rt_robot_os.features.navigation.trajectory.pose_input import planar
from rt_robot_os.motion.differential import Pose
from rt_robot_os.topics import Subscription

# Of sensor_msgs/msg/BatteryState.
_CHARGING: Final = (1, 4)
_X_X, _Y_Y = 0, 7
# A goal of the agent comes back unmodified.
_SAME_M: Final = 1e-6


class InputReader:
    """
    Reads the newest sample of each topic; safe in the real-time loop.

    :param topics: what is connected, by the names of the module's inputs.
    :param people: topics with the location of each person.
    :ivar own_goal: the last goal that the agent gave.
    """

    def __init__(self, inputs: AgentInputs, topics: Mapping[str, Subscription],
                 people: Mapping[str, Subscription], stddev_max_m: float) -> None:
        self.stddev_max_m = stddev_max_m
        self.own_goal: Pose | None = None
        self._inputs = inputs
        self._people = people
        self._pose = topics.get('pose')
        self._battery = topics.get('battery')
        self._estop = topics.get('estop')
        self._steering = topics.get('steering')
        self._planner = topics.get('planner_state')
        self._voice = topics.get('voice')
        self._goals = topics.get('goals')
        # Earlier samples count, also after a failure: the e-stop may have been set.
        for each in (self._pose, self._battery, self._estop, self._steering, *people.values()):
            if each is not None:
                each.rewind()

    def poll(self) -> None:
        """Read what has come."""
        inputs = self._inputs
        if self._pose is not None and self._pose.latest():
            self._take_pose(self._pose)
        if self._estop is not None and self._estop.latest():
            inputs.estop = bool(self._estop.msg.data)
        if self._steering is not None and self._steering.latest():
            inputs.steering = str(self._steering.msg.data)
        if self._planner is not None and self._planner.latest():
            inputs.planner, inputs.planner_new = str(self._planner.msg.data), True
        if self._battery is not None and self._battery.latest():
            message = self._battery.msg
            inputs.battery = float(message.percentage)
            inputs.charging = int(message.power_supply_status) in _CHARGING
        if self._voice is not None and self._voice.latest():
            inputs.voice = float(self._voice.msg.data)
        else:
            inputs.voice = math.nan  # one sample is handled once
        if self._goals is not None and self._goals.latest():
            self._take_goal(self._goals)
        for name, place in self._people.items():
            if place.latest():
                self._take_place(name, place)

    def _take_pose(self, read: Subscription) -> None:
        pose = planar(read.msg.pose.pose)
        if pose is None:
            return
        inputs = self._inputs
        inputs.pose, inputs.pose_ns = pose, read.stamp_ns
        covariance = read.msg.pose.covariance
        variance = float(covariance[_X_X]) + float(covariance[_Y_Y])
        if 0.0 <= variance <= self.stddev_max_m ** 2:
            inputs.pose_good_ns = read.stamp_ns

    def _take_goal(self, read: Subscription) -> None:
        position = read.msg.pose.position
        own = self.own_goal
        self._inputs.other_goal |= own is None or max(
            abs(position.x - own[0]), abs(position.y - own[1])) > _SAME_M

    def _take_place(self, name: str, read: Subscription) -> None:
        position = read.msg.pose.position
        x, y = float(position.x), float(position.y)
        if math.isfinite(x) and math.isfinite(y):
            self._inputs.people[name] = Location(x, y, name)
