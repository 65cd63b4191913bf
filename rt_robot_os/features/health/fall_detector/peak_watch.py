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
Suspected falls from a node that reports only peaks of its acceleration.

An impact without movement after it is all that such a node can show, so the suspicion is weak and
late. A person who keeps moving after an impact has not fallen.
"""

from __future__ import annotations

from typing import Final
from typing import NamedTuple

from rt_robot_os.base.units import NS_PER_S

#: Confidence of such a suspicion, 0 to 1.
CONFIDENCE: Final = 0.3

_MOVES: Final = 3


class PeakLimits(NamedTuple):
    """
    Limits in g and s.

    :ivar blow_g: least peak of an impact.
    :ivar moves_g: least peak of a movement after an impact.
    :ivar quiet_s: time without movement after an impact that makes a suspected fall.
    """

    blow_g: float = 3.0
    moves_g: float = 1.3
    quiet_s: float = 10.0


class PeakWatch:
    """
    Evaluate the reports of one node; safe in the real-time loop.

    :ivar blow_g: peak of the current impact; 0 without one.
    :ivar fallen: whether a fall is suspected.
    """

    def __init__(self, limits: PeakLimits = PeakLimits()) -> None:
        self._limits = limits
        self._quiet_ns = round(limits.quiet_s * NS_PER_S)
        self.blow_g = 0.0
        self.fallen = False
        self._since_ns = 0
        self._moves = 0

    @property
    def due_ns(self) -> int | None:
        """Return when a fall will be suspected; None without an impact."""
        return None if self.fallen or not self.blow_g else self._since_ns + self._quiet_ns

    def add(self, stamp_ns: int, peak_g: float) -> bool:
        """
        Process a report.

        :return: whether a person with a suspected fall moves again.
        """
        limits = self._limits
        if peak_g >= limits.blow_g and not self.fallen:
            self.blow_g = max(self.blow_g, peak_g)
            self._since_ns = stamp_ns  # several reports of one impact, or steps
        elif peak_g >= limits.moves_g:
            if not self.fallen:
                self.blow_g = 0.0
                return False
            self._moves += 1
            if self._moves >= _MOVES:
                self.fallen, self.blow_g, self._moves = False, 0.0, 0
                return True
        return False

    def advance(self, now_ns: int) -> bool:
        """Process the deadline until a time; return whether a fall is suspected now."""
        due_ns = self.due_ns
        if due_ns is None or now_ns < due_ns:
            return False
        self.fallen, self._moves = True, 0
        return True
