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
Suspicion of a fall from a node that reports nothing but how hard it was struck.

A blow, then nothing that moves: that is all such a node can tell, so the suspicion is a weak one,
and comes late. Who is struck and goes on moving has not fallen.
"""

from __future__ import annotations

from typing import Final
from typing import NamedTuple

from rt_robot_os.base.units import NS_PER_S

#: How much such a suspicion is worth, 0 to 1.
CONFIDENCE: Final = 0.3

_MOVES: Final = 3


class PeakLimits(NamedTuple):
    """
    When a blow is one, in g and s.

    :ivar blow_g: from here on it is a blow.
    :ivar moves_g: a report of as much, after the blow, is a movement.
    :ivar quiet_s: so long nothing may move after the blow.
    """

    blow_g: float = 3.0
    moves_g: float = 1.3
    quiet_s: float = 10.0


class PeakWatch:
    """
    Watch the reports of one node; safe in the real-time loop.

    :ivar blow_g: the blow that is thought of; 0 without.
    :ivar fallen: that is what is suspected.
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
        """Return when it has been quiet long enough; None without a blow."""
        return None if self.fallen or not self.blow_g else self._since_ns + self._quiet_ns

    def add(self, stamp_ns: int, peak_g: float) -> bool:
        """
        Take a report.

        :return: whether it shows that somebody who was thought to have fallen moves again.
        """
        limits = self._limits
        if peak_g >= limits.blow_g and not self.fallen:
            self.blow_g = max(self.blow_g, peak_g)
            self._since_ns = stamp_ns  # reports of one blow, or of steps that are no fall
        elif peak_g >= limits.moves_g:
            if not self.fallen:
                self.blow_g = 0.0
                return False
            self._moves += 1
            if self._moves >= _MOVES:
                self.fallen, self.blow_g, self._moves = False, 0.0, 0
                return True
        return False

    def pass_time(self, now_ns: int) -> bool:
        """Return whether it has now been quiet for so long that a fall is suspected."""
        due_ns = self.due_ns
        if due_ns is None or now_ns < due_ns:
            return False
        self.fallen, self._moves = True, 0
        return True
