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

"""Publishes the orders of the agent, each as a message on its topic."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
import math
from typing import Any
from typing import Final

from rt_robot_os.base.logger import Logger
from rt_robot_os.features.agent.inputs import AddNote
from rt_robot_os.features.agent.inputs import AgentOrder
from rt_robot_os.features.agent.inputs import Goal
from rt_robot_os.features.agent.inputs import LimitSpeed
from rt_robot_os.features.agent.inputs import Observe
from rt_robot_os.features.agent.inputs import ReportBlocked
from rt_robot_os.features.agent.inputs import Say
from rt_robot_os.features.agent.inputs import SendAlarmCommand
from rt_robot_os.features.agent.inputs import Spin
from rt_robot_os.features.agent.machine import StateTransition
from rt_robot_os.messages.agent import ObservationOrder
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import Level
from rt_robot_os.modules.cause_reports import CauseReports
from rt_robot_os.motion.differential import Pose
from rt_robot_os.topics import Publisher

#: The technical cause that the robot cannot reach a person.
BLOCKED: Final = 'robot_blocked'
_LONGEST: Final = 200
_BEFORE_S, _AFTER_S = 10.0, 10.0


class OutputWriter:
    """
    The outputs of the agent; safe in the real-time loop.

    :param outputs: publishers of the module, by the names of its outputs; what is not connected is
        left out.
    :param name: of the robot, and so the subject of its technical causes.
    :param gave_goal: receives each goal, before it is published.
    """

    def __init__(self, outputs: Mapping[str, Publisher], source: str, name: str, log: Logger,
                 gave_goal: Callable[[Pose], None]) -> None:
        self._out = outputs
        self._name = name
        self._log = log
        self._gave_goal = gave_goal
        self._causes = CauseReports(outputs['causes'], source) if 'causes' in outputs else None
        self._told = ''
        self._counts = {'goals': 0, 'transitions': 0, 'turn_commands': 0}
        self._do: Mapping[type, Callable[[Any, int], None]] = {
            Spin: self._spin, Goal: self._goal, Say: self._say, SendAlarmCommand: self._command,
            Observe: self._observe, AddNote: self._note, ReportBlocked: self._trouble,
            LimitSpeed: self._limit, StateTransition: self._transition}

    def publish(self, order: AgentOrder | StateTransition, stamp_ns: int) -> None:
        """Publish an order or a transition."""
        self._do[type(order)](order, stamp_ns)

    def publish_state(self, text: str, stamp_ns: int) -> None:
        """Publish the state of the agent, when it has changed."""
        if text != self._told:
            self._told = text
            self._text('state', text[:_LONGEST], stamp_ns)

    def refresh(self, stamp_ns: int) -> None:
        """Publish active causes again."""
        if self._causes is not None and self._causes.due_ns <= stamp_ns:
            self._causes.refresh(stamp_ns)

    def statistics(self) -> Mapping[str, Any]:
        """Return the counters."""
        return dict(self._counts)

    def _spin(self, order: Spin, stamp_ns: int) -> None:
        out = self._out.get('turn')
        if out is None:
            return
        self._counts['turn_commands'] += 1
        out.msg.angular.z = order.rate_rad_s
        out.publish(stamp_ns)

    def _goal(self, order: Goal, stamp_ns: int) -> None:
        if order.pose is None:
            out = self._out.get('cancel')
            if out is not None:
                out.msg.data = True
                out.publish(stamp_ns)
            return
        out = self._out.get('goal')
        if out is None:
            return
        self._counts['goals'] += 1
        x, y, yaw = order.pose
        self._gave_goal(order.pose)
        out.msg.pose.position = x, y, 0.0
        out.msg.pose.orientation = 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)
        out.publish(stamp_ns)

    def _limit(self, order: LimitSpeed, stamp_ns: int) -> None:
        out = self._out.get('speed_limit')
        if out is not None:
            out.msg.data = order.speed_m_s
            out.publish(stamp_ns)

    def _say(self, order: Say, stamp_ns: int) -> None:
        self._text('say', order.text[:_LONGEST], stamp_ns)

    def _command(self, order: SendAlarmCommand, stamp_ns: int) -> None:
        self._text('alarm_command', order.text[:_LONGEST], stamp_ns)

    def _note(self, order: AddNote, stamp_ns: int) -> None:
        self._text('alarm_command', f'note {order.alarm} by {self._name} {order.text}'[:_LONGEST],
                   stamp_ns)

    def _observe(self, order: Observe, stamp_ns: int) -> None:
        self._text('order', ObservationOrder(order.kind, order.alarm, order.subject, _BEFORE_S,
                                             _AFTER_S).to_json(), stamp_ns)

    def _trouble(self, order: ReportBlocked, stamp_ns: int) -> None:
        if self._causes is not None:
            self._causes.report(Cause(BLOCKED, self._name, Level.TECHNICAL, order.active,
                                      order.text), stamp_ns)

    def _transition(self, made: StateTransition, stamp_ns: int) -> None:
        self._counts['transitions'] += 1
        self._text('transitions', made.message().to_json(), stamp_ns)
        self._log.info('%s to %s: %s', made.source.value, made.target.value, made.why)

    def _text(self, attribute: str, text: str, stamp_ns: int) -> None:
        out = self._out.get(attribute)
        if out is not None:
            out.msg.data = text
            out.publish(stamp_ns)
