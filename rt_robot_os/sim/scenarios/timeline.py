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

"""Discrete events in virtual time."""

from __future__ import annotations

from collections.abc import Callable
import heapq
import itertools

from rt_robot_os.base.units import NS_PER_S

Action = Callable[[], None]


class VirtualTimeline:
    """
    Actions in the order of their times; of equal times in the order in which they were added.

    :ivar now_ns: the virtual time.
    """

    def __init__(self, now_ns: int = 0) -> None:
        self.now_ns = now_ns
        self._due: list[tuple[int, int, Action]] = []
        self._count = itertools.count()

    def at(self, time_ns: int, action: Action) -> None:
        """Add an action at a time."""
        heapq.heappush(self._due, (time_ns, next(self._count), action))

    def after(self, delay_ns: int, action: Action) -> None:
        """Add an action after a delay; a negative one counts as none."""
        self.at(self.now_ns + max(0, delay_ns), action)

    def step(self) -> bool:
        """Advance to the next action and run it; return False when there is none."""
        if not self._due:
            return False
        self.now_ns, _, action = heapq.heappop(self._due)
        action()
        return True

    def run_until(self, time_ns: int) -> None:
        """Advance to a time and run all that is due; the actions see that time."""
        self.now_ns = time_ns
        while self._due and self._due[0][0] <= time_ns:
            heapq.heappop(self._due)[2]()

    def clear(self) -> None:
        """Drop all actions, as a process does that is killed."""
        self._due.clear()


def seconds(duration_s: float) -> int:
    """Return a duration in nanoseconds."""
    return round(duration_s * NS_PER_S)
