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

"""A bounded log of the events of the scheduler; the golden traces of the tests are such logs."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass


@dataclass(frozen=True)
class TraceEvent:
    """
    One event.

    :ivar kind: ``start``, ``end`` or ``fail``.
    :ivar depth: number of preempted jobs below it.
    """

    at_ns: int
    kind: str
    task: str
    depth: int


class TraceLog:
    """
    The last events of a kernel.

    :param capacity: maximum number of events; older ones are dropped and counted.
    """

    def __init__(self, capacity: int = 10_000) -> None:
        self._events: deque[TraceEvent] = deque(maxlen=capacity)
        self._depth = 0
        self.total = 0

    def __call__(self, at_ns: int, kind: str, task: str) -> None:
        """Add an event; safe in the real-time loop."""
        if kind == 'start':
            self._events.append(TraceEvent(at_ns, kind, task, self._depth))
            self._depth += 1
        else:
            self._depth -= 1
            self._events.append(TraceEvent(at_ns, kind, task, self._depth))
        self.total += 1

    @property
    def dropped(self) -> int:
        """Return the number of dropped events."""
        return self.total - len(self._events)

    def events(self) -> tuple[TraceEvent, ...]:
        """Return the stored events, oldest first."""
        return tuple(self._events)

    def text(self, times: bool = False) -> str:
        """
        Return the trace as lines, indented by the nesting depth.

        :param times: begin each line with the time in microseconds.
        """
        lines = []
        for event in self._events:
            stamp = f'{event.at_ns / 1000:10.1f} ' if times else ''
            lines.append(f'{stamp}{"  " * event.depth}{event.task} {event.kind}')
        return '\n'.join(lines) + '\n'
