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
When the samples of clients entered, on CLOCK_MONOTONIC, also after the machine was suspended.

A client stamps each sample when it sends it, so that the sample ages while it waits in a socket.
CLOCK_MONOTONIC does not count while the machine is suspended: what was stamped before that is
older than it says.
"""

from __future__ import annotations

from typing import Final

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.kernel import Clock

# Below that it is the time between two readings of clocks.
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
        """Notice a suspension; call it before samples are received."""
        suspended_ns = self._clock.suspended_ns()
        lost_ns = suspended_ns - self._suspended_ns
        self._suspended_ns = suspended_ns
        if lost_ns >= SUSPENDED_LEAST_NS:
            self.suspensions += 1
            self._resumed_ns, self._lost_ns = now_ns, lost_ns

    def stamp_of(self, stamp_ns: int, now_ns: int) -> int:
        """
        Return the moment at which a sample entered; 0 for now.

        :param stamp_ns: of the client. One in the future would make a command seem fresh for
            ever: it counts as now.
        """
        if not 0 < stamp_ns <= now_ns:
            return 0
        if stamp_ns <= self._resumed_ns:
            return max(1, stamp_ns - self._lost_ns)
        return stamp_ns
