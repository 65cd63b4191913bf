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

"""How important a record is: what is sent first, and evicted last when the disk is full."""

from __future__ import annotations

from enum import IntEnum


class Importance(IntEnum):
    """A class of records; a smaller number is sent first, a larger one evicted first."""

    #: The life of an alarm.
    ALARM = 0
    #: What the agent did, what an operator did, faults.
    EVENT = 1
    #: Pictures, clips and sound of an alarm.
    MEDIA = 2
    #: Vital signs, scores, places of people.
    OBSERVATION = 3
    #: Batteries, losses, counters.
    NETWORK = 4
