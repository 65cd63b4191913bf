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
What happens when: a queue of events on a virtual clock, in integer ns.

Events of one instant run in the order in which they were planned, so that a run is the same each
time. An event is planned at most once; whoever owns it plans it again and again, and nothing but
the entry in the queue is allocated.
"""

from __future__ import annotations

from collections.abc import Callable
from heapq import heapify
from heapq import heappop
from heapq import heappush

#: So many cancelled entries may stay in the queue, whatever its length.
_STALE_AT_LEAST = 1000


class Event:
    """
    Something that can be planned.

    :ivar call: runs when the time has come; may be another each time.
    :ivar number: of the entry in the queue; 0 while it is not planned.
    """

    __slots__ = ('call', 'number')

    def __init__(self, call: Callable[[], None]) -> None:
        """:param call: see the class."""
        self.call = call
        self.number = 0


class EventQueue:
    """
    The events to come.

    :ivar now_ns: the time of the event that runs, or up to which all have run.
    :ivar executed: how many events have run.
    """

    __slots__ = ('now_ns', 'executed', '_heap', '_number', '_stale')

    def __init__(self) -> None:
        """Start at 0 with nothing to do."""
        self.now_ns = 0
        self.executed = 0
        self._heap: list[tuple[int, int, Event]] = []
        self._number = 0
        self._stale = 0

    def __len__(self) -> int:
        """Return how many events are planned."""
        return len(self._heap) - self._stale

    def at(self, time_ns: int, event: Event) -> None:
        """
        Plan an event; if it is planned already, only the new time counts.

        :param time_ns: not before ``now_ns``.
        :raises ValueError: for a time that is past.
        """
        if time_ns < self.now_ns:
            raise ValueError(f'an event at {time_ns} ns: it is {self.now_ns} ns already')
        if event.number:
            event.number = 0
            self._forget_one()
        number = self._number + 1
        self._number = event.number = number
        heappush(self._heap, (time_ns, number, event))

    def cancel(self, event: Event) -> None:
        """Plan no longer; may be repeated."""
        if event.number:
            event.number = 0
            self._forget_one()

    def _forget_one(self) -> None:
        """Count an entry whose event is not that of its number any more."""
        self._stale += 1
        heap = self._heap
        if self._stale > _STALE_AT_LEAST and 2 * self._stale > len(heap):
            heap[:] = [entry for entry in heap if entry[2].number == entry[1]]
            heapify(heap)
            self._stale = 0

    def next_ns(self) -> int | None:
        """Return when the next event is; None without one."""
        heap = self._heap
        while heap and heap[0][2].number != heap[0][1]:
            heappop(heap)
            self._stale -= 1
        return heap[0][0] if heap else None

    def run_until(self, time_ns: int) -> None:
        """
        Run the events up to a time, that of the time itself included.

        An exception of an event ends the call; the queue stays whole, and may run on.
        """
        heap = self._heap
        executed = 0
        try:
            while heap and heap[0][0] <= time_ns:
                when, number, event = heappop(heap)
                if event.number == number:
                    event.number = 0
                    self.now_ns = when
                    executed += 1
                    event.call()
                else:
                    self._stale -= 1
        finally:
            self.executed += executed
        self.now_ns = max(self.now_ns, time_ns)
