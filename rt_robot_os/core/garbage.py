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


"""Collect cyclic garbage in the slack of the schedule, while the kernel idles."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
import gc

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import NS_PER_US

INTERVAL_NS = NS_PER_S
_SHORTEST_GUESS_NS = 20 * NS_PER_US
_MARGIN = 2
# Number of intervals without a sufficient gap after which the margin is dropped, after which a gap
# for the shortest run suffices, and after which it is reported.
_PATIENCE = 10
_IMPATIENCE = 30
_OVERDUE = 60
# Only the last runs count: a run that was slow by chance must not count forever.
_REMEMBERED = 8


class SlackCollector:
    """
    Run the collector about once a second, only in a sufficiently long gap.

    A collection cannot be preempted, so it is only started when the time to the next release is at
    least twice the longest of the last collections; after a long wait once the longest, and
    finally once the shortest of them. Computing time counts: time that Linux used meanwhile says
    nothing about the next collection.

    :param computed_ns: computing time of this thread; by default the time.
    :ivar collections: the number of collections.
    :ivar on_overdue: called once when no gap was long enough for a minute.
    """

    def __init__(self, now_ns: Callable[[], int], computed_ns: Callable[[], int] | None = None,
                 interval_ns: int = INTERVAL_NS) -> None:
        self.collections = 0
        self.on_overdue: Callable[[str], object] | None = None
        self._now_ns = now_ns
        self._computed_ns = computed_ns or now_ns
        self._took_ns: deque[int] = deque([0], maxlen=_REMEMBERED)
        self._interval_ns = interval_ns
        self._next_ns = 0
        self._reported = False

    def prime(self) -> None:
        """Collect before the loop starts, and learn how long it takes."""
        for _ in range(2):  # the first one collects the garbage of the start
            took_ns = self._collect()
        self._took_ns.clear()
        self._took_ns.append(took_ns)
        self._next_ns = self._now_ns() + self._interval_ns

    @property
    def longest_ns(self) -> int:
        """Return the computing time of the longest of the last collections."""
        return max(self._took_ns)

    def _collect(self) -> int:
        begin_ns = self._computed_ns()
        gc.collect()
        took_ns = self._computed_ns() - begin_ns
        self._took_ns.append(took_ns)
        return took_ns

    def idle(self, slack_ns: int) -> None:
        """
        Collect if it is due and the gap is long enough; called by the kernel.

        :param slack_ns: until the next release.
        """
        now_ns = self._now_ns()
        waited_ns = now_ns - self._next_ns
        if waited_ns < 0:
            return
        if waited_ns < _IMPATIENCE * self._interval_ns:
            margin = _MARGIN if waited_ns < _PATIENCE * self._interval_ns else 1
            wanted_ns = margin * max(self.longest_ns, _SHORTEST_GUESS_NS)
        else:
            wanted_ns = min(self._took_ns)
        if slack_ns < wanted_ns:
            if waited_ns > _OVERDUE * self._interval_ns and not self._reported:
                self._report(wanted_ns)
            return
        took_ns = self._collect()
        if waited_ns >= _IMPATIENCE * self._interval_ns:  # longer runs were exceptions
            self._took_ns.clear()
            self._took_ns.append(took_ns)
        self.collections += 1
        self._next_ns = self._now_ns() + self._interval_ns

    def _report(self, wanted_ns: int) -> None:
        self._reported = True
        if self.on_overdue is not None:
            self.on_overdue(
                'no gap between jobs is long enough to collect cyclic garbage, which takes '
                f'{wanted_ns // NS_PER_US} us; {gc.get_count()[0]} objects wait. Memory grows if '
                'jobs create cycles: lower rates, move phases (see plan), or avoid cycles')
