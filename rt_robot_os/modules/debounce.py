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

"""A condition that changes only after it has lasted for a time (debouncing)."""

from __future__ import annotations

import math


class Debounce:
    """
    A condition with an on-delay and an off-delay; safe in the real-time loop.

    Times are those of the samples and of the deadlines between them, so the result does not depend
    on when it is evaluated.

    :ivar on: the debounced state.
    :ivar on_ns: duration for which the condition has to be true.
    :ivar off_ns: duration for which it has to be false.
    """

    __slots__ = ('on', 'on_ns', 'off_ns', '_since_ns')

    def __init__(self, on_ns: int, off_ns: int) -> None:
        self.on = False
        self.on_ns = on_ns
        self.off_ns = off_ns
        self._since_ns = -1

    def put(self, is_so: bool, stamp_ns: int) -> None:
        """Set the condition from a time on; call :meth:`advance` to that time before."""
        if is_so == self.on:
            self._since_ns = -1
        elif self._since_ns < 0:
            self._since_ns = stamp_ns

    def reset(self) -> None:
        """Restart the delays: the condition is unknown at this moment."""
        self._since_ns = -1

    @property
    def due_ns(self) -> float:
        """Return when the state changes without further input; infinite if it does not."""
        if self._since_ns < 0:
            return math.inf
        return self._since_ns + (self.off_ns if self.on else self.on_ns)

    def advance(self, now_ns: int) -> int:
        """
        Advance the time.

        :return: when the state changed; -1 when it did not.
        """
        due_ns = self.due_ns
        if due_ns > now_ns:
            return -1
        self.on = not self.on
        self._since_ns = -1
        return int(due_ns)
