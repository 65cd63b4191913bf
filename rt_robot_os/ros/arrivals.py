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
How old a sample from ROS 2 is when the node carries it to the core.

A sample ages from the moment at which its publisher wrote it (the source timestamp of DDS), not
from the moment at which this process had the time to read it: after a freeze of the node, the
network or the machine, what waited is old. That timestamp comes from the system clock of the
publisher's machine, which may differ from ours or be set. So the two clocks are not compared as
they are: the smallest difference of the last 10 to 20 s is taken for the offset between the
clocks, and what a sample has beyond it for its age, as clock filters do (RFC 5905, section 10).

- A publisher's clock that is set forward: its samples count as new.
- One that is set back, or a delay that begins: its samples are as much too old, which holds the
  robot for 10 to 20 s. Then the difference is taken for that of the clocks.
- Nothing is known of a publisher yet, or our own clock was set: what comes within 0.25 s after
  this process did not run counts from the moment at which it ran last.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
import threading
import time
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S

#: A process that did not run for longer than this was frozen; see :meth:`OwnGaps.note`.
GAP_NS: Final = 250 * NS_PER_MS
_NOTED_EVERY_S: Final = 0.1
# Within that time after it what had waited has been read.
_DRAINED_NS: Final = 250 * NS_PER_MS
_STEP_NS: Final = 50 * NS_PER_MS
_WINDOW_NS: Final = 10 * NS_PER_S
# A sample that is older when it comes is counted; a network needs less.
_DELAYED_NS: Final = 100 * NS_PER_MS


def _boottime_ns() -> int:
    return time.clock_gettime_ns(time.CLOCK_BOOTTIME)


class OwnGaps:
    """
    Notice that this process did not run, and that its system clock was set.

    :param boottime_ns: CLOCK_BOOTTIME, which counts while the machine is suspended.
    :param wall_ns: the system clock.
    :ivar gaps: times that the process did not run for longer than :data:`GAP_NS`.
    :ivar longest_ns: the longest of them.
    :ivar clock_steps: times that the system clock was set.
    """

    def __init__(self, boottime_ns: Callable[[], int] = _boottime_ns,
                 wall_ns: Callable[[], int] = time.time_ns) -> None:
        self.gaps = self.longest_ns = self.clock_steps = 0
        self._boottime_ns = boottime_ns
        self._wall_ns = wall_ns
        self._ran_ns = boottime_ns()
        self._offset_ns = wall_ns() - self._ran_ns
        self._since_ns = self._until_ns = 0
        self._clock_until_ns = 0
        self._lock = threading.Lock()
        self._ended = threading.Event()

    def watch(self) -> None:
        """
        Note ten times a second from now on, in a thread of its own.

        Callbacks do not tell: while one of them takes long, DDS goes on to receive.
        """
        threading.Thread(target=self._watch, name='rt_robot_os gaps', daemon=True).start()

    def close(self) -> None:
        """End the thread."""
        self._ended.set()

    def _watch(self) -> None:
        while not self._ended.wait(_NOTED_EVERY_S):
            self.note()

    def note(self) -> tuple[int, int]:
        """
        Note that this process runs, at least ten times a second; from any thread.

        :return: the time of CLOCK_BOOTTIME, and of the system clock.
        """
        with self._lock:
            return self._note()

    def _note(self) -> tuple[int, int]:
        now_ns, wall_ns = self._boottime_ns(), self._wall_ns()
        gap_ns = now_ns - self._ran_ns
        step_ns = wall_ns - now_ns - self._offset_ns
        is_gap, is_step = gap_ns > GAP_NS, abs(step_ns) > _STEP_NS
        if is_gap:
            self.gaps += 1
            self.longest_ns = max(self.longest_ns, gap_ns)
        if is_gap or is_step:
            if now_ns >= self._until_ns:  # else what waits is from before the gap before
                self._since_ns = self._ran_ns
            self._until_ns = now_ns + _DRAINED_NS
        if is_step:
            self.clock_steps += 1
            self._clock_until_ns = self._until_ns
        # Followed all the time: a clock that is slewed is not set.
        self._offset_ns = wall_ns - now_ns
        self._ran_ns = now_ns
        return now_ns, wall_ns

    def waited_ns(self, now_ns: int, known: bool) -> int:
        """
        Return how long a sample may have waited for this process.

        :param now_ns: as :meth:`note` gave it.
        :param known: the clock of its publisher is known, which says more unless ours was set.
        """
        if now_ns >= (self._clock_until_ns if known else self._until_ns):
            return 0
        return now_ns - self._since_ns


class Arrivals:
    """
    The ages of the samples of one topic.

    :param gaps: of this process, shared by all topics.
    :param latched: a publisher may give samples that it wrote long ago (``transient_local``): the
        clocks are compared as they are.
    :ivar delay_ms: age of the last sample when it came.
    :ivar delayed: samples that were older than 100 ms when they came.
    """

    def __init__(self, gaps: OwnGaps, latched: bool = False) -> None:
        self.delay_ms = 0.0
        self.delayed = 0
        self._gaps = gaps
        self._latched = latched
        self._begun_ns = 0
        # The smallest differences of the clocks: of the window before, and of this one.
        self._before_ns: int | None = None
        self._least_ns: int | None = None
        self._told = 0

    def age_ns(self, info: Mapping[str, Any]) -> int:
        """
        Return how old a sample is.

        :param info: what rclpy says of it: ``source_timestamp`` and ``received_timestamp``.
        """
        now_ns, wall_ns = self._gaps.note()
        source_ns = int(info.get('source_timestamp') or 0)
        received_ns = int(info.get('received_timestamp') or 0)
        age_ns = wall_ns - received_ns if received_ns else 0
        if source_ns and self._latched:
            age_ns = max(age_ns, wall_ns - source_ns)
        elif source_ns:
            age_ns = max(age_ns, self._beyond_offset(now_ns, wall_ns - source_ns))
        else:
            age_ns = max(age_ns, self._gaps.waited_ns(now_ns, False))
        age_ns = max(0, age_ns)
        self.delay_ms = round(age_ns / NS_PER_MS, 1)
        self.delayed += age_ns > _DELAYED_NS
        return age_ns

    def _beyond_offset(self, now_ns: int, difference_ns: int) -> int:
        """Return what a difference of the clocks has beyond their offset."""
        if now_ns - self._begun_ns >= _WINDOW_NS:
            recent = now_ns - self._begun_ns < 2 * _WINDOW_NS
            self._before_ns = self._least_ns if recent else None
            self._least_ns = None
            self._begun_ns = now_ns
        offset_ns = self._offset_ns()
        waited_ns = self._gaps.waited_ns(now_ns, offset_ns is not None)
        if offset_ns is None and waited_ns:
            return waited_ns  # its difference may be that of the wait: nothing is learnt from it
        if self._least_ns is None or difference_ns < self._least_ns:
            self._least_ns = difference_ns
        if offset_ns is None:
            return 0
        return max(waited_ns, difference_ns - offset_ns)

    def _offset_ns(self) -> int | None:
        known = [each for each in (self._before_ns, self._least_ns) if each is not None]
        return min(known, default=None)

    def counters(self) -> dict[str, Any]:
        """Return what ``/diagnostics`` shows; ``warning`` tells of samples since the last call."""
        gaps = self._gaps
        counted: dict[str, Any] = {
            'delay_ms': self.delay_ms, 'delayed': self.delayed, 'node_gaps': gaps.gaps,
            'node_gap_maximum_ms': gaps.longest_ns / NS_PER_MS, 'clock_steps': gaps.clock_steps}
        offset_ns = self._offset_ns()
        if offset_ns is not None:
            counted['clock_offset_ms'] = round(offset_ns / NS_PER_MS, 1)
        if self.delayed != self._told:
            counted['warning'] = (
                f'{self.delayed - self._told} samples were old when they came, the last '
                f'{self.delay_ms:.0f} ms: the node or the network was held up, or a clock was set')
            self._told = self.delayed
        return counted
