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

"""What happens to people in a rehearsal of alarms, and what became of it."""

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

#: Those at the ends of the channels.
PEOPLE: Final = ('operator', 'family', 'emergency')
_KINDS: Final = (('fall', Level.CRITICAL), ('help', Level.CRITICAL), ('smoke', Level.CRITICAL),
                 ('news2', Level.URGENT), ('no_movement', Level.URGENT),
                 ('pulse_low', Level.CRITICAL))
_LASTS_S: Final = (90.0, 400.0)


@dataclass
class RehearsedEmergency:
    """
    Something that happens to somebody.

    :ivar helper: whose answer it gets; empty: nobody's.
    :ivar seen: somebody has been shown it.
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
        """Return whether it is with somebody, or has been told as far as there are people."""
        return self.acknowledged or (self.top and self.seen)


def emergency_by_chance(random: Random, number: int) -> RehearsedEmergency:
    """Make an emergency of which somebody will hear, if not always somebody who helps."""
    kind, level = random.choice(_KINDS)
    helper = random.choice((*PEOPLE, ''))
    if level is Level.URGENT and helper == 'emergency':
        helper = 'family'  # the last who are told of what is urgent
    return RehearsedEmergency(f'p{number}', kind, level, round(random.uniform(*_LASTS_S) * NS_PER_S),
                     helper)


@dataclass
class RehearsalResult:
    """
    What became of all emergencies.

    :ivar lost: neither acknowledged nor told up to the top; their scenes in ``scenes_lost``.
    :ivar shown_twice: notifications that somebody was shown a second time as if they were new.
    :ivar folded: that came a second time and said so, after a crash in the middle of a delivery.
    :ivar told_anew: emergencies that have another number since a crash: nothing was written of the
        first one, or the journal did not answer.
    :ivar forgotten: alarms that somebody was told of, and that a later core did not know.
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
