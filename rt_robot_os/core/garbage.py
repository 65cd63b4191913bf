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

"""Collect cyclic garbage where there is time for it: while the kernel idles."""

from __future__ import annotations

from collections.abc import Callable
import gc

from rt_robot_os.units import NS_PER_MS
from rt_robot_os.units import NS_PER_S

_FIRST_GUESS_NS = NS_PER_MS
_MARGIN = 2


class SlackCollector:
    """
    Run the collector about once a second, only in a gap that is long enough.

    A collection cannot be preempted, so it is only started when the next release is at least
    twice as far away as the longest collection so far took.

    :ivar collections: how many there were.
    :ivar longest_ns: the longest of them.
    """

    def __init__(self, now_ns: Callable[[], int], interval_ns: int = NS_PER_S) -> None:
        self.collections = 0
        self.longest_ns = 0
        self._now_ns = now_ns
        self._interval_ns = interval_ns
        self._next_ns = 0

    def idle(self, slack_ns: int) -> None:
        """
        Collect if it is time and the gap is long enough; called by the kernel.

        :param slack_ns: until the next release.
        """
        now_ns = self._now_ns()
        if now_ns < self._next_ns or slack_ns < _MARGIN * max(self.longest_ns, _FIRST_GUESS_NS):
            return
        gc.collect()
        end_ns = self._now_ns()
        self.collections += 1
        self.longest_ns = max(self.longest_ns, end_ns - now_ns)
        self._next_ns = end_ns + self._interval_ns
