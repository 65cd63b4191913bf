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

"""Rate limit for changes of a user's watches, by cost, over all their connections."""

from __future__ import annotations

from typing import Final

#: Most watches of one user, over all connections.
WATCHES_MOST: Final = 48
#: Minimum cost of a watch, and cost of each comparison of a name with a pattern, in seconds.
WATCH_S: Final = 0.25
COMPARISON_S: Final = 2e-5
#: Cost that a user may use in one burst; it is regained in real time.
BURST_S: Final = 10.0
_USERS_MOST: Final = 2000


class WatchQuota:
    """The watch quota of users; for the event loop alone."""

    def __init__(self) -> None:
        self._next_s: dict[str, float] = {}
        self._watches: dict[str, int] = {}

    def wait_s(self, user: str, comparisons: int, now_s: float) -> float:
        """
        Charge a user for a watch.

        :param comparisons: number of comparisons of names with patterns.
        :param now_s: by a monotonic clock.
        :return: how long to wait before it is served.
        """
        before = self._next_s.pop(user, now_s - BURST_S)
        if len(self._next_s) >= _USERS_MOST:
            del self._next_s[next(iter(self._next_s))]
        found = max(before, now_s - BURST_S) + max(WATCH_S, comparisons * COMPARISON_S)
        self._next_s[user] = found
        return max(0.0, found - now_s)

    def begin(self, user: str) -> bool:
        """Add a watch; False when the user has too many."""
        if self._watches.get(user, 0) >= WATCHES_MOST:
            return False
        self._watches[user] = self._watches.get(user, 0) + 1
        return True

    def end(self, user: str) -> None:
        """Remove a watch."""
        self._watches[user] -= 1
        if not self._watches[user]:
            del self._watches[user]
