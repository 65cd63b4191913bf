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
The times at which samples of clients entered, corrected for suspensions of the machine.

A client stamps each sample when it sends it, so that the sample ages while it waits in a socket.
CLOCK_MONOTONIC stands still while the machine is suspended: a sample that was stamped before the
suspension is older than its stamp says.
"""

from __future__ import annotations

from typing import Final

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.kernel import Clock

# A shorter difference is only the time between reading the two clocks.
SUSPENDED_LEAST_NS: Final = 50 * NS_PER_MS


class EntryTimes:
    """
    Correct the stamps of clients; safe in the real-time loop.

    :ivar suspensions: times that the machine was suspended while the core ran.
    """

    __slots__ = ('suspensions', '_clock', '_suspended_ns', '_resumed_ns', '_lost_ns')

    def __init__(self, clock: Clock) -> None:
        self.suspensions = 0
        self._clock = clock
        self._suspended_ns = clock.suspended_ns()
        self._resumed_ns = self._lost_ns = 0

    def update(self, now_ns: int) -> None:
        """Detect a suspension; call it before samples are received."""
        suspended_ns = self._clock.suspended_ns()
        lost_ns = suspended_ns - self._suspended_ns
        self._suspended_ns = suspended_ns
        if lost_ns >= SUSPENDED_LEAST_NS:
            self.suspensions += 1
            self._resumed_ns, self._lost_ns = now_ns, lost_ns

    def stamp_of(self, stamp_ns: int, now_ns: int) -> int:
        """
        Return the time at which a sample entered; 0 for now.

        :param stamp_ns: of the client. A stamp in the future counts as now: otherwise a command
            would stay fresh forever.
        """
        if not 0 < stamp_ns <= now_ns:
            return 0
        if stamp_ns <= self._resumed_ns:
            return max(1, stamp_ns - self._lost_ns)
        return stamp_ns
