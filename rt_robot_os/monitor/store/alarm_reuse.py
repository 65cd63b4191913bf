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

"""Whether an event begins another alarm of the same name: the robot lost its journal."""

from __future__ import annotations

from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.messages.alarm_event import AlarmEvent
from rt_robot_os.messages.alarm_state import OPENING_EVENTS

#: A clock may step back by so much between two events of an alarm.
LATE_NS: Final = 60 * NS_PER_S
#: The same event, recorded again by a later start, may differ by so much: clocks are corrected.
AGAIN_NS: Final = NS_PER_S


def is_reused(event: AlarmEvent, seq: int, t_ns: int, last_seq: int, last_t_ns: int, *,
              later_start: bool) -> bool:
    """
    Return whether a name was given again: the robot numbers from the beginning.

    An event that is only late has both a smaller number and an earlier time.

    :param seq: number of the event in the robot's journal; ``last_seq`` is of the newest event
        that is known of the alarm.
    :param t_ns: UTC of the event; ``last_t_ns`` of that newest one.
    :param later_start: the event is of a later start of the robot than that newest one.
    """
    margin_ns = AGAIN_NS if later_start else LATE_NS
    return (event.event in OPENING_EVENTS and seq <= last_seq
            and t_ns > last_t_ns + margin_ns and not event.restored)
