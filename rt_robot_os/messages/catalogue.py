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
All messages that cross a process as JSON or text, with their topics, senders and receivers.

``scripts/message_schema.py`` writes ``docs/messages.json`` and ``docs/messages.md`` from it.
"""

from __future__ import annotations

from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.messages import agent
from rt_robot_os.messages import alarm_commands
from rt_robot_os.messages import alarm_event
from rt_robot_os.messages import cause
from rt_robot_os.messages import command_answer
from rt_robot_os.messages import journal
from rt_robot_os.messages import node_reading
from rt_robot_os.messages import notification
from rt_robot_os.messages.codec import Codec


class MessageEntry(NamedTuple):
    """
    A message.

    :ivar message: its class.
    :ivar codec: its fields.
    :ivar place: the topic, or where else it is sent.
    :ivar sender: the part of the robot that sends it.
    :ivar receivers: the parts that receive it.
    """

    message: type
    codec: Codec[Any]
    place: str
    sender: str
    receivers: str


MESSAGES: Final = (
    MessageEntry(cause.Cause, cause.CODEC, 'topic `alarms/causes`',
                 'modules that detect causes, clients', 'module `alarms`'),
    MessageEntry(alarm_event.AlarmEvent, alarm_event.CODEC, 'topic `alarms/events`',
                 'module `alarms`', 'module `agent`, gateway, server, `alarms watch`'),
    MessageEntry(alarm_commands.AlarmCommand, alarm_commands.CODEC,
                 'topic `alarms/command`, as text', 'operators, module `agent`, gateway',
                 'module `alarms`'),
    MessageEntry(command_answer.CommandAnswer, command_answer.CODEC, 'topic `alarms/answer`',
                 'module `alarms`', '`alarms`, gateway, ROS services'),
    MessageEntry(notification.Notification, notification.NOTIFICATION, 'topic `alarms/notify`',
                 'module `alarms`', 'notifier'),
    MessageEntry(notification.DeliveryReport, notification.DELIVERY_REPORT,
                 'topic `alarms/report`', 'notifier, clients', 'module `alarms`'),
    MessageEntry(journal.JournalRecord, journal.JOURNAL_RECORD, 'topic `alarms/journal`',
                 'module `alarms`', 'device `journal`, `alarms journal`'),
    MessageEntry(journal.JournalReply, journal.JOURNAL_REPLY, 'topic `alarms/stored`',
                 'device `journal`', 'module `alarms`'),
    MessageEntry(agent.AgentTransition, agent.TRANSITION, 'topic `agent/transitions`',
                 'module `agent`', 'gateway, server'),
    MessageEntry(agent.ObservationOrder, agent.ORDER, 'topic `agent/observe`',
                 'module `agent`, gateway', 'module `observer`'),
    MessageEntry(agent.Observation, agent.OBSERVATION, 'topic `agent/observed`',
                 'module `observer`', 'modules `agent` and `alarms`, gateway'),
    MessageEntry(node_reading.NodeReading, node_reading.CODEC,
                 'signal `wsn/nodes` and records of type `node` of the uplink', 'gateway',
                 'server'),
)
