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

"""An agent on the virtual clock, with a robot and a planner that do as a test says."""

from __future__ import annotations

from collections.abc import Callable
import json
import math
from typing import Any

from live_maps import map_topic
from rt_robot_os.features.agent.module import AgentModule
from rt_robot_os.testing.module_bench import ModuleBench
from rt_robot_os.topics import Publisher

TEXT = 'std_msgs/msg/String'
ON_MAP = {'header.frame_id': 'map'}


class AgentRig(ModuleBench):
    """
    The agent among topics that a test writes.

    :ivar pose: of the robot; it turns as commanded, and is at a goal ``way_s`` after it was given.
    :ivar planner: what the planner says of a goal, in order; the last is said to all that follow.
    """

    def __init__(self, **settings: Any) -> None:
        super().__init__()
        self.pose = (1.0, 1.0, 0.0)
        self.stddev_m = 0.05
        self.is_located = True
        self.way_s = 5.0
        self.planner: list[str] = ['done']
        self.goals: list[tuple[float, float, float]] = []
        self.texts = {name: self._text_topic(name) for name in (
            'alarms/events', 'agent/command', 'agent/answer', 'agent/observed', 'planner/state',
            'steering')}
        self._estop = self.topic('estop', 'std_msgs/msg/Bool')
        self._pose = self.topic('pose', 'geometry_msgs/msg/PoseWithCovarianceStamped', ON_MAP)
        self._battery = self.topic('battery', 'sensor_msgs/msg/BatteryState', {
            'header.frame_id': 'base_link', 'location': '', 'serial_number': '',
            'cell_voltage': 0, 'cell_temperature': 0})
        self._place = self.topic('health/anna/place', 'geometry_msgs/msg/PoseStamped', ON_MAP)
        self.level = self.topic('sound/level', 'std_msgs/msg/Float32')
        self.button = self.topic('wsn/wrist/alarm', 'std_msgs/msg/Float64')
        self.topic('goal_pose', 'geometry_msgs/msg/PoseStamped', ON_MAP)
        self.charts = map_topic(self.bus)
        self.agent = self.add(AgentModule, 'agent', **{
            'people': ['anna'], 'nodes': ['wrist 5 5 1 on anna alarm', 'kitchen 8 1 2 smoke'],
            'voice_topic': 'sound/level', 'answer_topics': ['wsn/wrist/alarm'],
            **settings})
        self.watched = {name: self.watch(name) for name in (
            'agent/transitions', 'agent/say', 'agent/state', 'agent/observe', 'alarms/command',
            'alarms/causes', 'speed_limit')}
        self.spins = self.watch('cmd_vel_agent')
        self.cancels = self.watch('trajectory_cancel')
        self._goal_in = self.watch('goal_pose')
        self._spin_in = self.watch('cmd_vel_agent')
        self._cancel_in = self.watch('trajectory_cancel')
        self._seq = 0
        self._due: list[tuple[int, str]] = []
        self.kernel.add_task('robot', self._live, priority=60, rate_hz=50.0)

    def _text_topic(self, name: str) -> Publisher:
        self.bus.declare(name, TEXT, tail=6000, depth=64)
        return self.bus.publisher(name)

    # ---- the robot ------------------------------------------------------------------------

    def _live(self) -> None:
        now_ns = self.kernel.now_ns()
        x, y, yaw = self.pose
        if self._spin_in.latest():
            self.rate = float(self._spin_in.msg.angular.z)
            self._spin_ns = now_ns
        if now_ns - getattr(self, '_spin_ns', -10**9) < 200_000_000:
            yaw += self.rate * 0.02
        self.pose = x, y, yaw
        if self._cancel_in.latest():
            self._due.clear()
        while self._goal_in.take():
            self._take_goal(now_ns)
        while self._due and self._due[0][0] <= now_ns:
            text = self._due.pop(0)[1]
            if text == 'done':
                self.pose = self.goals[-1]
            self.say('planner/state', text)
        if self.is_located:
            message = self._pose.msg.pose
            message.pose.position = self.pose[0], self.pose[1], 0.0
            message.pose.orientation = (
                0.0, 0.0, math.sin(self.pose[2] / 2), math.cos(self.pose[2] / 2))
            message.covariance[0] = self.stddev_m ** 2
            self._pose.publish()

    def _take_goal(self, now_ns: int) -> None:
        message = self._goal_in.msg.pose
        yaw = 2.0 * math.atan2(message.orientation.z, message.orientation.w)
        self.goals.append((message.position.x, message.position.y, yaw))
        end = self.planner.pop(0) if len(self.planner) > 1 else self.planner[0]
        self._due = [(now_ns + 300_000_000, 'planned: 3.00 m')]
        if end.startswith(('refused', 'silent')):
            self._due.clear()
        if end != 'silent':
            self._due.append((now_ns + round(self.way_s * 1e9), end))

    # ---- what a test says -------------------------------------------------------------------

    def say(self, topic: str, text: str) -> None:
        """Publish a text now."""
        self.texts[topic].msg.data = text
        self.texts[topic].publish()

    def alarm(self, state: str, alarm: str = '1', level: str = 'critical', subject: str = 'anna',
              **more: Any) -> None:
        """Publish an event of an alarm now."""
        self._seq += 1
        self.say('alarms/events', json.dumps({
            'seq': self._seq, 't_ns': 0, 'alarm': alarm, 'event': state, 'state': state,
            'level': level, 'subject': subject, 'kinds': ['fall'], 'text': 'fall', **more}))

    def place(self, x: float, y: float) -> None:
        """Publish where anna is now."""
        self._place.msg.pose.position = x, y, 0.0
        self._place.publish()

    def press_estop(self, value: bool, steering: str = '') -> None:
        """Press the e-stop, or let it go; say who steers then."""
        self._estop.msg.data = value
        self._estop.publish()
        self.say('steering', steering or ('nobody: e-stop, asked for' if value else 'nobody'))

    def charge(self, share: float) -> None:
        """Publish the charge of the battery now."""
        self._battery.msg.percentage = share
        self._battery.publish()

    def observe(self, *kinds: str, alarm: str = '1') -> None:
        """Answer orders to look and listen."""
        for kind in kinds or ('picture', 'clip', 'sound'):
            self.say('agent/observed', json.dumps({
                'alarm': alarm, 'kind': kind, 'file': f'{kind}.jpg', 'level_db': -31.6,
                **({'problem': 'no room'} if kind == 'clip' else {})}))

    def press(self, code: float) -> None:
        """Press anna's button now."""
        self.button.msg.data = code
        self.button.publish()

    def in_order(self, *steps: tuple[float, Callable[[], object]]) -> None:
        """Do something at each of some times, in s."""
        for at_s, do in steps:
            self.at(at_s, do)

    # ---- what came of it --------------------------------------------------------------------

    def told(self, topic: str) -> list[str]:
        """Return all texts of a topic."""
        read, found = self.watched[topic], []
        read.rewind()
        while read.take():
            found.append(str(read.msg.data))
        return found

    def transitions(self) -> list[dict[str, Any]]:
        """Return all transitions."""
        return [json.loads(text) for text in self.told('agent/transitions')]

    def path(self) -> list[str]:
        """Return the states that it went through, after idle."""
        return [each['to'] for each in self.transitions() if each['from'] != each['to']]
