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
Monitor a gate: when measurements that it keeps rejecting must be accepted after all.

A gate rejects inconsistent measurements. If the estimate is wrong, as after a bad start or an
unmeasured turn, a gate alone rejects everything forever. Refused numbers that differ
from the estimate by the same amount, for long enough, are as good as measured poses that agree
after a robot was carried away. Safe in the real-time loop.
"""

from __future__ import annotations

import math
from typing import Final

from rt_robot_os.base.units import NS_PER_S

# Two numbers agree when they differ by less than so many standard deviations of their difference.
_SIGMAS: Final = 3.0
# Samples of the mean at most, so that it follows a slow drift.
_COUNT_MOST: Final = 20


class GateMonitor:
    """
    The results of the gate of one measured number.

    :param seconds: how long refused ones must agree to be accepted; 0: they never are.
    :param least: how many of them there must be.
    :ivar accepted: used.
    :ivar refused: left out by the gate.
    :ivar in_row: refused since the last that was used.
    :ivar reopened: times that refused ones were accepted.
    :ivar offset: mean of measured minus estimated, of those that agree.
    :ivar way_m: driven since the last that was used.
    """

    def __init__(self, seconds: float, least: int) -> None:
        self.accepted = self.refused = self.in_row = self.reopened = 0
        self.offset = self.way_m = 0.0
        self._wait_ns = round(seconds * NS_PER_S)
        self._least = least
        self._agreeing = 0
        self._since_ns = self._first_ns = 0
        self._last_ns = 0

    @property
    def refused_s(self) -> float:
        """Return for how long all have been refused; 0 when the last was used."""
        return (self._last_ns - self._first_ns) / NS_PER_S if self.in_row else 0.0

    def restart(self) -> None:
        """Discard those that were refused in a row: the clock has changed."""
        self.in_row = self._agreeing = 0
        self.way_m = 0.0

    def add(self, stamp_ns: int, accepted: bool, innovation: float, variance: float,
            way_m: float = 0.0) -> bool:
        """
        Add one.

        :param innovation: measured minus estimated; an angle is wrapped.
        :param variance: of the measurement.
        :param way_m: driven since the one before.
        :return: whether refused ones have agreed for long enough to be accepted.
        """
        if accepted:
            self.accepted += 1
            self.in_row = self._agreeing = 0
            self.way_m = 0.0
            return False
        self.refused += 1
        self.in_row += 1
        self.way_m += abs(way_m)
        self._last_ns = stamp_ns
        if self.in_row == 1:
            self._first_ns = stamp_ns
        if not self._agreeing or abs(math.remainder(innovation - self.offset, math.tau)) > (
                _SIGMAS * math.sqrt(2.0 * variance)):
            self._agreeing, self._since_ns, self.offset = 1, stamp_ns, innovation
        else:
            self._agreeing += 1
            self.offset += math.remainder(innovation - self.offset, math.tau) / min(
                self._agreeing, _COUNT_MOST)
        return (self._wait_ns > 0 and self._agreeing >= self._least
                and stamp_ns - self._since_ns >= self._wait_ns)

    def reopen(self) -> None:
        """Count that refused ones are accepted now, and start again."""
        self.reopened += 1
        self.in_row = self._agreeing = 0
        self.way_m = 0.0
