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

"""The emergencies of a rehearsal of alarms, and the result."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict
from dataclasses import dataclass
from dataclasses import field
from random import Random
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.messages.cause import Level

#: The people at the ends of the channels.
PEOPLE: Final = ('operator', 'family', 'emergency')
_KINDS: Final = (('fall', Level.CRITICAL), ('help', Level.CRITICAL), ('smoke', Level.CRITICAL),
                 ('news2', Level.URGENT), ('no_movement', Level.URGENT),
                 ('pulse_low', Level.CRITICAL))
_LASTS_S: Final = (90.0, 400.0)


@dataclass
class RehearsedEmergency:
    """
    An emergency of a person.

    :ivar helper: the person who answers; empty: nobody does.
    :ivar seen: a person was shown a notification of it.
    """

    subject: str
    kind: str
    level: Level
    lasts_ns: int
    helper: str
    active: bool = False
    seen: bool = False
    acknowledged: bool = False
    top: bool = False
    begun: int = 0
    ids: set[str] = field(default_factory=set)

    @property
    def ended(self) -> bool:
        """Return whether it is acknowledged, or its escalation exhausted."""
        return self.acknowledged or (self.top and self.seen)


def emergency_by_chance(random: Random, number: int) -> RehearsedEmergency:
    """Make an emergency that a person will be shown, though not always one who answers."""
    kind, level = random.choice(_KINDS)
    helper = random.choice((*PEOPLE, ''))
    if level is Level.URGENT and helper == 'emergency':
        helper = 'family'  # the last step of urgent alarms
    lasts_ns = round(random.uniform(*_LASTS_S) * NS_PER_S)
    return RehearsedEmergency(f'p{number}', kind, level, lasts_ns, helper)


@dataclass
class RehearsalResult:
    """
    The result for all emergencies.

    :ivar lost: neither acknowledged nor exhausted; their scenes are in ``scenes_lost``.
    :ivar shown_twice: notifications that a person was shown again as if they were new.
    :ivar folded: that came a second time and said so, after a crash in the middle of a delivery.
    :ivar told_anew: emergencies with a new number after a crash: nothing of the first one was
        stored, or the journal did not answer.
    :ivar forgotten: alarms that a person was notified of and that a later core did not know.
    :ivar digest: of all events; the same for the same seed.
    """

    alarms: int = 0
    acknowledged: int = 0
    top: int = 0
    lost: int = 0
    shown: int = 0
    shown_twice: int = 0
    folded: int = 0
    told_anew: int = 0
    forgotten: int = 0
    virtual_hours: float = 0.0
    went_wrong: Counter[str] = field(default_factory=Counter)
    scenes_lost: list[int] = field(default_factory=list)
    digest: str = ''

    @property
    def passed(self) -> bool:
        """Return whether nothing was lost and nothing shown twice."""
        return not (self.lost or self.shown_twice)

    def as_dict(self) -> dict[str, Any]:
        """Return it for JSON."""
        return {'passed': self.passed, **asdict(self),
                'went_wrong': dict(sorted(self.went_wrong.items()))}

    def lines(self) -> list[str]:
        """Return it for people."""
        wrong = ', '.join(f'{count} {what.replace("_", " ")}'
                          for what, count in sorted(self.went_wrong.items()))
        return [
            f'{self.alarms} emergencies in {self.virtual_hours:g} hours of virtual time:',
            f'  {self.acknowledged} acknowledged, {self.top} told up to the top',
            f'  {self.lost} lost', f'  {self.shown} notifications shown, {self.shown_twice} of '
            f'them twice; {self.folded} came again and said so',
            f'  {self.told_anew} alarms with another number since a crash, {self.forgotten} '
            'forgotten',
            f'what went wrong: {wrong}',
            *([f'scenes with losses: {", ".join(map(str, self.scenes_lost))}'] if (
                self.scenes_lost) else []), f'digest {self.digest}']
