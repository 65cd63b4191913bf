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
"""The states of an alarm and the kinds of events in its life, with what each means."""

from __future__ import annotations

from enum import Enum
from typing import Final


class AlarmState(Enum):
    """Where an alarm is in its life; docs/alarms.md maps the states to ISA-18.2."""

    #: It waits for a person to confirm or cancel it; without an answer it is raised.
    SUSPECTED = 'suspected'
    #: It is active and not acknowledged: notifications repeat and escalate.
    RAISED = 'raised'
    #: A person has acknowledged it; it is active until it is resolved.
    ACKNOWLEDGED = 'acknowledged'
    #: It has ended.
    RESOLVED = 'resolved'
    #: It was suspected and has ended, because there was no emergency.
    CANCELLED = 'cancelled'

    @property
    def is_open(self) -> bool:
        """Return whether the alarm has not ended."""
        return self.value not in CLOSED_STATES

    @property
    def is_loud(self) -> bool:
        """Return whether the alarm is open and not acknowledged."""
        return self.value in LOUD_STATES


#: The values of the states in which an alarm has ended. A state that this release does not know
#: is of a newer one and counts as open: an open alarm must not disappear.
CLOSED_STATES: Final = frozenset({'resolved', 'cancelled'})
#: The values of the states in which an alarm waits to be acknowledged.
LOUD_STATES: Final = frozenset({'suspected', 'raised'})
#: The states by their values.
ALARM_STATES: Final = {each.value: each for each in AlarmState}


class AlarmEventKind(Enum):
    """What happened to an alarm."""

    SUSPECTED = 'suspected'
    RAISED = 'raised'
    #: A test was opened.
    TEST = 'test'
    #: A person confirmed a suspected alarm.
    CONFIRMED = 'confirmed'
    #: A cause was added, or became worse.
    CAUSE = 'cause'
    ACKNOWLEDGED = 'acknowledged'
    #: It was acknowledged, and is raised again.
    UNACKNOWLEDGED = 'unacknowledged'
    #: An operator requested the next step of the escalation.
    HURRIED = 'hurried'
    #: A note was added.
    NOTED = 'noted'
    RESOLVED = 'resolved'
    CANCELLED = 'cancelled'
    #: Notifications of the first step of the escalation, of a later one, of the same one again.
    NOTIFIED = 'notified'
    ESCALATED = 'escalated'
    REPEATED = 'repeated'
    #: The escalation has reached its last step.
    TOP = 'top'
    #: A channel delivered a notification, or could not.
    DELIVERED = 'delivered'
    FAILED = 'failed'


#: The events with which an alarm begins, and those with which it becomes raised, by value.
OPENING_EVENTS: Final = frozenset({'suspected', 'raised', 'test'})
RAISING_EVENTS: Final = frozenset({'raised', 'confirmed'})
