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
A queue of events on a virtual clock, in integer ns.

Events of the same time run in the order in which they were scheduled, so runs are reproducible.
An event has at most one entry in the queue. Its owner can schedule it again and again: only the
entry is allocated.
"""

from __future__ import annotations

from collections.abc import Callable
from heapq import heapify
from heapq import heappop
from heapq import heappush

#: Number of cancelled entries that may stay in the queue, whatever its length.
_STALE_AT_LEAST = 1000


class Event:
    """
    A call that can be scheduled.

    :ivar call: called at the scheduled time; it may be replaced.
    :ivar number: of the entry in the queue; 0 while it is not scheduled.
    """

    __slots__ = ('call', 'number')

    def __init__(self, call: Callable[[], None]) -> None:
        """:param call: see the class."""
        self.call = call
        self.number = 0


class EventQueue:
    """
    The scheduled events.

    :ivar now_ns: the time of the running event, or up to which all events have run.
    :ivar executed: number of events that have run.
    """

    __slots__ = ('now_ns', 'executed', '_heap', '_number', '_stale')

    def __init__(self) -> None:
        """Create an empty queue at time 0."""
        self.now_ns = 0
        self.executed = 0
        self._heap: list[tuple[int, int, Event]] = []
        self._number = 0
        self._stale = 0

    def __len__(self) -> int:
        """Return the number of scheduled events."""
        return len(self._heap) - self._stale

    def at(self, time_ns: int, event: Event) -> None:
        """
        Schedule an event; if it is scheduled already, the new time replaces the old one.

        :param time_ns: not before ``now_ns``.
        :raises ValueError: the time is in the past.
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
        """Remove an event from the queue; may be repeated."""
        if event.number:
            event.number = 0
            self._forget_one()

    def _forget_one(self) -> None:
        """Count a cancelled entry, and remove such entries if there are too many."""
        self._stale += 1
        heap = self._heap
        if self._stale > _STALE_AT_LEAST and 2 * self._stale > len(heap):
            heap[:] = [entry for entry in heap if entry[2].number == entry[1]]
            heapify(heap)
            self._stale = 0

    def next_ns(self) -> int | None:
        """Return the time of the next event; None without one."""
        heap = self._heap
        while heap and heap[0][2].number != heap[0][1]:
            heappop(heap)
            self._stale -= 1
        return heap[0][0] if heap else None

    def run_until(self, time_ns: int) -> None:
        """
        Run all events up to a time, inclusive.

        An exception of an event ends the call; the queue stays consistent and can continue.
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
