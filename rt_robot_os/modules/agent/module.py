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
The agent as a module: a coroutine that awaits alarms, commands and the next point of its grid.

What :mod:`rt_robot_os.agent` decides is carried out here. Decisions are stamped with the event
that led to them or with the point of the grid at which they were made, never with the time at
which the job came to run: that is another in a replay.
"""

from __future__ import annotations

from collections.abc import Mapping
import json
import math
from typing import Any
from typing import Final

from rt_robot_os.agent.agent import Agent
from rt_robot_os.agent.dialogue import BUTTON
from rt_robot_os.agent.edges import State
from rt_robot_os.agent.machine import Transition
from rt_robot_os.agent.senses import Command
from rt_robot_os.agent.senses import Goal
from rt_robot_os.agent.senses import Limit
from rt_robot_os.agent.senses import Note
from rt_robot_os.agent.senses import Observe
from rt_robot_os.agent.senses import Order
from rt_robot_os.agent.senses import Place
from rt_robot_os.agent.senses import Say
from rt_robot_os.agent.senses import Spin
from rt_robot_os.agent.senses import Trouble
from rt_robot_os.agent.tuning import AgentTuning
from rt_robot_os.alarms.cause import Cause
from rt_robot_os.alarms.cause import Level
from rt_robot_os.errors import ConfigError
from rt_robot_os.kernel import any_of
from rt_robot_os.kernel import Until
from rt_robot_os.kernel import Wait
from rt_robot_os.modules.agent.hearing import Hearing
from rt_robot_os.modules.agent.settings import home_of
from rt_robot_os.modules.agent.settings import SETTINGS
from rt_robot_os.modules.agent.settings import surroundings_of
from rt_robot_os.modules.base import Module
from rt_robot_os.modules.cause_reports import CauseReports
from rt_robot_os.modules.cause_reports import CAUSES_OUTPUT
from rt_robot_os.modules.sensor_packets import survey_from
from rt_robot_os.schema import made
from rt_robot_os.schema import TopicSpec
from rt_robot_os.topics.ports import Input
from rt_robot_os.topics.ports import Output
from rt_robot_os.units import NS_PER_S

_TEXT: Final = 'std_msgs/msg/String'
_TEXT_BYTES: Final = 600
_BLOCKED: Final = 'robot_blocked'
_MOST_BEHIND: Final = 20
