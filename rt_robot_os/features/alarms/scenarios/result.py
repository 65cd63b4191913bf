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

"""What became of the emergencies of all scenarios, as JSON and as text."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict
from dataclasses import dataclass
from dataclasses import field
from typing import Any


@dataclass
class RehearsalResult:
    """
    What became of all emergencies; the names are those of the JSON.

    :ivar top: not acknowledged, escalation exhausted.
    :ivar lost: neither of both; the numbers of their scenarios are in ``scenes_lost``.
    :ivar shown_twice: notifications that were shown a second time as if they were new.
    :ivar folded: shown a second time and marked as repeated, after a crash during delivery.
    :ivar told_anew: emergencies with another alarm number after a crash: nothing was written of
        the first, or the journal did not answer.
    :ivar forgotten: alarms that were notified, and that a later core did not know.
    :ivar went_wrong: injected faults, by kind.
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
