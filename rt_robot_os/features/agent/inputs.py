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

"""The inputs of the agent, of robot and people, and its orders."""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import field
import math
from typing import NamedTuple

from rt_robot_os.messages.agent import ObservationKind
from rt_robot_os.motion.differential import Pose


class Location(NamedTuple):
    """
    Where a person or an object is.

    :ivar x: in the map, in m.
    :ivar y: in the map, in m.
    :ivar source: how it is known, for people.
    """

    x: float
    y: float
    source: str = ''

    @property
    def point(self) -> tuple[float, float]:
        """Return it without its source."""
        return self.x, self.y


@dataclass
class AgentInputs:
    """
    The newest inputs, which the module updates.

    :ivar pose: of the robot; None before the first.
    :ivar pose_ns: moment of that pose.
    :ivar pose_good_ns: moment of the last one that was accurate enough.
    :ivar planner: state of the planner, and ``planner_new`` whether it came since the last tick.
    :ivar estop: the e-stop is set.
    :ivar steering: the active source, from the multiplexer.
    :ivar other_goal: the robot got a goal that is not of the agent since the last tick.
    :ivar battery: charge from 0 to 1; NaN when it is not known.
    :ivar charging: the battery is being charged.
    :ivar voice: level of sound in dB below full scale; NaN without a microphone.
    :ivar people: where they are, by name.
    """

    pose: Pose | None = None
    pose_ns: int = -1
    pose_good_ns: int = -1
    planner: str = ''
    planner_new: bool = False
    estop: bool = False
    steering: str = ''
    other_goal: bool = False
    battery: float = math.nan
    charging: bool = False
    voice: float = math.nan
    people: dict[str, Location] = field(default_factory=dict)


class Say(NamedTuple):
    """A sentence to be spoken."""

    text: str


class Goal(NamedTuple):
    """A goal to drive to; None: stop."""

    pose: Pose | None


class Spin(NamedTuple):
    """A turning rate."""

    rate_rad_s: float


class SendAlarmCommand(NamedTuple):
    """A command about alarms, such as ``confirm 3 by robot``."""

    text: str


class Observe(NamedTuple):
    """An order for cameras and microphone."""

    kind: ObservationKind
    alarm: str
    subject: str


class AddNote(NamedTuple):
    """A note of the findings, for the next notification of an alarm."""

    alarm: str
    text: str


class ReportBlocked(NamedTuple):
    """Whether the robot cannot reach a person, and why; published as a technical cause."""

    active: bool
    text: str = ''


class LimitSpeed(NamedTuple):
    """The speed limit in m/s; 0: no limit."""

    speed_m_s: float


AgentOrder = Say | Goal | Spin | SendAlarmCommand | Observe | AddNote | ReportBlocked | LimitSpeed
