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
The Trickle timer of the Collection Tree Protocol: beacons are frequent only after a change.

Each interval is twice the last one, and a beacon is sent at a random time in its second half.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from rt_robot_os.features.wsn.routing.protocol import BINARY_MS_NS
from rt_robot_os.features.wsn.routing.protocol import Node
from rt_robot_os.features.wsn.routing.tinyos_random import TinyOsRandom

#: Bounds of the interval in 1/1024 s.
MINIMUM_MS: Final = 128
MAXIMUM_MS: Final = 512_000


class Trickle:
    """
    Calls once in each interval; an interval is twice as long as the one before, up to a bound.

    :param node: for its timer and random numbers.
    :param call: the callback, which may call ``reset``.
    :param minimum_ms: first interval after ``reset`` in 1/1024 s; two or more.
    :param maximum_ms: the bound.
    :ivar interval_ms: the current interval.
    """

    __slots__ = ('_at_ms', '_call', '_maximum_ms', '_minimum_ms', '_passed', '_random', '_timer',
                 'interval_ms')

    def __init__(self, node: Node, call: Callable[[], None], minimum_ms: int = MINIMUM_MS,
                 maximum_ms: int = MAXIMUM_MS) -> None:
        self.interval_ms = minimum_ms
        self._call = call
        self._minimum_ms = minimum_ms
        self._maximum_ms = maximum_ms
        self._at_ms = 0
        self._passed = False
        self._random = TinyOsRandom(node.address)
        self._timer = node.timer(self._expired)

    def start(self, random: TinyOsRandom) -> None:
        """Start after a boot, with the node's new random numbers."""
        self._random = random
        self.reset()

    def reset(self) -> None:
        """Restart with the shortest interval."""
        self.interval_ms = self._minimum_ms
        self._choose()

    def stop(self) -> None:
        """Stop until ``reset``."""
        self._timer.stop()

    def _choose(self) -> None:
        half_ms = self.interval_ms // 2
        self._at_ms = half_ms + self._random.below(half_ms)
        self._passed = False
        self._timer.start(int(self._at_ms * BINARY_MS_NS))

    def _expired(self) -> None:
        if self._passed:
            self.interval_ms = min(2 * self.interval_ms, self._maximum_ms)
            self._choose()
            return
        self._passed = True
        self._timer.start(int((self.interval_ms - self._at_ms) * BINARY_MS_NS))
        self._call()
