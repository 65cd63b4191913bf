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

"""The emergencies of a scenario of alarms, and who is notified of them."""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import field
from random import Random
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.messages.cause import Level

#: The recipients, by the names of their channels.
RECIPIENTS: Final = ('operator', 'family', 'emergency')
_KINDS: Final = (('fall', Level.CRITICAL), ('help', Level.CRITICAL), ('smoke', Level.CRITICAL),
                 ('news2', Level.URGENT), ('no_movement', Level.URGENT),
                 ('pulse_low', Level.CRITICAL))
_LASTS_S: Final = (90.0, 400.0)


@dataclass
class InjectedEmergency:
    """
    An emergency of a person.

    :ivar helper: the recipient who acknowledges it; empty: none does.
    :ivar seen: a recipient was shown it.
    :ivar exhausted: its escalation has come to the last step.
    :ivar ids: the numbers of its alarms.
    """

    subject: str
    kind: str
    level: Level
    lasts_ns: int
    helper: str
    active: bool = False
    seen: bool = False
    acknowledged: bool = False
    exhausted: bool = False
    ids: set[str] = field(default_factory=set)

    @property
    def settled(self) -> bool:
        """Return whether it was acknowledged, or its escalation is exhausted."""
        return self.acknowledged or (self.exhausted and self.seen)


def random_emergency(random: Random, number: int) -> InjectedEmergency:
    """Draw an emergency that some recipient is notified of; not always one who acknowledges."""
    kind, level = random.choice(_KINDS)
    helper = random.choice((*RECIPIENTS, ''))
    if level is Level.URGENT and helper == 'emergency':
        helper = 'family'  # the last step of what is urgent
    lasts_ns = round(random.uniform(*_LASTS_S) * NS_PER_S)
    return InjectedEmergency(f'p{number}', kind, level, lasts_ns, helper)
