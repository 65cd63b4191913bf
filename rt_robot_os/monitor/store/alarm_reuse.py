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

"""Detects that a robot lost its journal and uses the name of an alarm again."""

from __future__ import annotations

from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.messages.alarm_event import AlarmEvent
from rt_robot_os.messages.alarm_state import OPENING_EVENTS

#: Largest backward step of a clock between two events of an alarm.
LATE_NS: Final = 60 * NS_PER_S
#: Largest time difference of one event that a later start records again: clocks are corrected.
AGAIN_NS: Final = NS_PER_S


def is_reused(event: AlarmEvent, seq: int, t_ns: int, last_seq: int, last_t_ns: int, *,
              later_start: bool) -> bool:
    """
    Return whether a name was used again, because the robot's numbering restarted.

    An event that merely arrives late has both a smaller number and an earlier time.

    :param seq: number of the event in the robot's journal; ``last_seq`` is that of the newest
        known event of the alarm.
    :param t_ns: time of the event, UTC; ``last_t_ns`` is that of the newest known event.
    :param later_start: the event is of a later start of the robot than the newest known event.
    """
    margin_ns = AGAIN_NS if later_start else LATE_NS
    return (event.event in OPENING_EVENTS and seq <= last_seq
            and t_ns > last_t_ns + margin_ns and not event.restored)
