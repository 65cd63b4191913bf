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

"""By how much counters grew lately: a warning stays for a while after its cause, then ends."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from dataclasses import field

HOLD_S = 10.0


@dataclass
class _Counter:
    total: int
    gains: deque[tuple[float, int]] = field(default_factory=deque)
    gained: int = 0


class Recent:
    """
    Remember when each counter of a core grew.

    :param hold_s: for how long that counts.
    """

    def __init__(self, hold_s: float = HOLD_S) -> None:
        self.hold_s = hold_s
        self._now_s = 0.0
        self._young = False
        self._counters: dict[str, _Counter] = {}
        self._seen: set[str] = set()

    def begin(self, now_s: float, age_s: float) -> None:
        """
        Begin a round; what was not asked for in the one before is forgotten.

        :param now_s: the core's time.
        :param age_s: how long the core has run: all that a young one has counted is new.
        """
        self._counters = {k: c for k, c in self._counters.items() if k in self._seen}
        self._seen = set()
        self._now_s = now_s
        self._young = age_s < self.hold_s

    def clear(self) -> None:
        """Forget everything: it is another core."""
        self._counters.clear()

    def gained(self, key: str, total: int) -> int:
        """
        Return by how much a counter grew within the time that counts.

        :param key: any name of the counter, the same in each round.
        """
        self._seen.add(key)
        counter = self._counters.get(key)
        if counter is None or total < counter.total:
            base = 0 if self._young or counter is not None else total
            counter = self._counters[key] = _Counter(base)
        if total > counter.total:
            counter.gains.append((self._now_s, total - counter.total))
            counter.gained += total - counter.total
            counter.total = total
        while counter.gains and self._now_s - counter.gains[0][0] >= self.hold_s:
            counter.gained -= counter.gains.popleft()[1]
        return counter.gained
