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

"""The rules of alarms: delays, limits, and the escalation of each level."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.alarms.escalation import EscalationStep
from rt_robot_os.features.alarms.escalation import parse_steps
from rt_robot_os.messages.cause import Level

#: Each channel and the seconds until the next step; see :func:`parse_steps`.
DEFAULT_STEPS: Final[Mapping[Level, tuple[str, ...]]] = {
    Level.CRITICAL: ('robot 0', 'operator 30 repeat 10', 'family 60', 'emergency 120'),
    Level.URGENT: ('robot 0', 'operator 60 repeat 30', 'family 120'),
    Level.WARNING: ('operator 600',),
    Level.TECHNICAL: ('operator 3600',),
}


def _default_steps() -> dict[Level, tuple[EscalationStep, ...]]:
    return {level: parse_steps(texts) for level, texts in DEFAULT_STEPS.items()}


@dataclass(frozen=True)
class Rules:
    """
    The rules of an alarm table.

    :ivar steps: of the escalation, by level.
    :ivar confirm_kinds: kinds of causes that begin as a suspicion.
    :ivar confirm_ns: a suspicion that is neither confirmed nor cancelled is raised after it.
    :ivar remind_ns: an acknowledged alarm that is not resolved is raised again after it.
    :ivar resolve_after_ns: an acknowledged alarm resolves itself when its causes have been clear
        for that long.
    :ivar unseen_levels: alarms of these levels resolve themselves without being acknowledged, too.
    :ivar again_ns: a cause that returns sooner is flapping: it is only counted.
    :ivar refresh_ns: an active cause is published again within that time.
    :ivar delivery_timeout_ns: a notification without a report has failed after it.
    :ivar silence_most_ns: the longest time for which the robot's voice is muted.
    :ivar alarms_most: the most open alarms.
    """

    steps: Mapping[Level, tuple[EscalationStep, ...]] = field(default_factory=_default_steps)
    confirm_kinds: frozenset[str] = frozenset({'fall'})
    confirm_ns: int = 30 * NS_PER_S
    remind_ns: int = 900 * NS_PER_S
    resolve_after_ns: int = 120 * NS_PER_S
    unseen_levels: frozenset[Level] = frozenset({Level.TECHNICAL})
    again_ns: int = 20 * NS_PER_S
    refresh_ns: int = 30 * NS_PER_S
    delivery_timeout_ns: int = 10 * NS_PER_S
    silence_most_ns: int = 120 * NS_PER_S
    alarms_most: int = 32
