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

"""Detect gaps in which nothing ran: a stopped or starved process, or a suspended machine."""

from __future__ import annotations

from typing import Final

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.kernel import Clock

#: A gap: no round for longer than this, and for longer than some periods.
GAP_NS: Final = 250 * NS_PER_MS
#: Within this time after a gap Linux has delivered the bytes that waited in a port.
EMPTIED_NS: Final = 50 * NS_PER_MS
_PERIODS: Final = 3


class Gaps:
    """
    The gaps between the rounds of one device; safe in the real-time loop.

    Whatever the cause (SIGSTOP, suspend, swapping, a long native call, a task of higher priority
    that does not end), the device was not served: its last command may be old, and so may be the
    bytes in its port.

    :ivar count: number of gaps.
    :ivar longest_ns: length of the longest.
    :ivar last_ns: length of the last.
    :ivar since_ns: beginning of the last, on the kernel's clock.
    """

    __slots__ = ('count', 'longest_ns', 'last_ns', 'since_ns', '_clock', '_ran_ns',
                 '_suspended_ns')

    def __init__(self, clock: Clock) -> None:
        self.count = self.longest_ns = self.last_ns = self.since_ns = 0
        self._clock = clock
        self._ran_ns = -1
        self._suspended_ns = 0

    def restart(self) -> None:
        """Restart with the next round: nothing was served until now."""
        self._ran_ns = -1

    def round(self, now_ns: int, period_ns: int) -> int:  # noqa: A003
        """
        Record a round.

        :param period_ns: longest time between two rounds.
        :return: the length of the gap that ends with this round; 0 without one.
        """
        ran_ns, self._ran_ns = self._ran_ns, now_ns
        suspended_ns = self._clock.suspended_ns()
        gap_ns = now_ns - ran_ns + suspended_ns - self._suspended_ns
        self._suspended_ns = suspended_ns
        if ran_ns < 0 or gap_ns <= GAP_NS or gap_ns <= _PERIODS * period_ns:
            return 0
        self.count += 1
        self.longest_ns = max(self.longest_ns, gap_ns)
        self.last_ns = gap_ns
        self.since_ns = ran_ns
        return gap_ns
