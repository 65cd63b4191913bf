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

"""Taking samples inside what is measured, and what that costs."""

from __future__ import annotations

from array import array
import statistics
import time

import numpy as np

from rt_robot_os.tools.bench.case import Samples

_COST_BLOCKS = 21
_COST_CALLS = 5000


class Stamps:
    """
    Moments on CLOCK_MONOTONIC in memory that is there beforehand; safe in the real-time loop.

    :param room: how many are kept; further ones are dropped and counted.
    :ivar count: how many are kept so far.
    """

    __slots__ = ('count', 'dropped', '_times', '_room', '_now_ns')

    def __init__(self, room: int) -> None:
        self.count = self.dropped = 0
        self._times = array('q', bytes(8 * room))
        self._room = room
        self._now_ns = time.monotonic_ns

    def stamp(self) -> None:
        """Note the present moment."""
        now_ns = self._now_ns()
        count = self.count
        if count < self._room:
            self._times[count] = now_ns
            self.count = count + 1
        else:
            self.dropped += 1

    def taken(self) -> Samples:
        """Return what was noted, in order."""
        return np.array(self._times[:self.count], np.int64)


def cost_ns() -> float:
    """Measure what :meth:`Stamps.stamp` costs on this machine: the harness's own part."""
    blocks = []
    for _ in range(_COST_BLOCKS):
        stamps = Stamps(_COST_CALLS)
        stamp = stamps.stamp
        begin_ns = time.perf_counter_ns()
        for _ in range(_COST_CALLS):
            stamp()
        blocks.append((time.perf_counter_ns() - begin_ns) / _COST_CALLS)
    return statistics.median(blocks)
