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
Compute the age of a sample from ROS 2 when the node sends it to the core.

The age counts from the time at which the publisher wrote the sample (the source timestamp of DDS),
not from the time at which this process reads it: after a suspension of the node, the network or
the machine, waiting samples are old. The timestamp comes from the system clock of the publisher's
machine, which may differ from the clock of this machine, or be set. So the smallest difference of
the two clocks in the last 10 to 20 s is their offset, and a larger difference is the age of a
sample, as in clock filters (RFC 5905, section 10).

- If a publisher's clock is set forward, its samples count as new.
- If it is set back, or a delay begins, its samples are too old by that much, which stops the robot
  for 10 to 20 s. After that the difference counts as part of the offset.
- If the offset is not known yet, or the clock of this machine was set, a sample that arrives
  within 0.25 s after a gap of this process counts from the time before the gap.
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

#: A process that did not run for longer than this was suspended; see :meth:`OwnGaps.note`.
GAP_NS: Final = 250 * NS_PER_MS
_NOTED_EVERY_S: Final = 0.1
# Within this time after a gap the waiting samples have been read.
_DRAINED_NS: Final = 250 * NS_PER_MS
_STEP_NS: Final = 50 * NS_PER_MS
_WINDOW_NS: Final = 10 * NS_PER_S
# A sample that is older on arrival is counted; a network needs less.
_DELAYED_NS: Final = 100 * NS_PER_MS


def _boottime_ns() -> int:
    return time.clock_gettime_ns(time.CLOCK_BOOTTIME)


class OwnGaps:
    """
    Detect times in which this process did not run, and changes of its system clock.

    :param boottime_ns: CLOCK_BOOTTIME, which counts while the machine is suspended.
    :param wall_ns: the system clock.
    :ivar gaps: number of times that the process did not run for longer than :data:`GAP_NS`.
    :ivar longest_ns: the longest gap.
    :ivar clock_steps: number of times that the system clock was set.
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
        Call :meth:`note` ten times a second, in a separate thread.

        Callbacks are not sufficient: DDS continues to receive during a long callback.
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
            if now_ns >= self._until_ns:  # otherwise waiting samples are from before the last gap
                self._since_ns = self._ran_ns
            self._until_ns = now_ns + _DRAINED_NS
        if is_step:
            self.clock_steps += 1
            self._clock_until_ns = self._until_ns
        # Always followed: slewing of the clock is not a step.
        self._offset_ns = wall_ns - now_ns
        self._ran_ns = now_ns
        return now_ns, wall_ns

    def waited_ns(self, now_ns: int, known: bool) -> int:
        """
        Return how long a sample may have waited for this process.

        :param now_ns: as :meth:`note` gave it.
        :param known: the offset of its publisher's clock is known, which is more precise unless
            the clock of this machine was set.
        """
        if now_ns >= (self._clock_until_ns if known else self._until_ns):
            return 0
        return now_ns - self._since_ns


class Arrivals:
    """
    The ages of the samples of one topic.

    :param gaps: of this process, shared by all topics.
    :param latched: a publisher may send samples that it wrote long ago (``transient_local``): the
        clocks are compared without an offset.
    :ivar delay_ms: age of the last sample on arrival.
    :ivar delayed: samples that were older than 100 ms on arrival.
    """

    def __init__(self, gaps: OwnGaps, latched: bool = False) -> None:
        self.delay_ms = 0.0
        self.delayed = 0
        self._gaps = gaps
        self._latched = latched
        self._begun_ns = 0
        # The smallest differences of the clocks in the last window, and in this one.
        self._before_ns: int | None = None
        self._least_ns: int | None = None
        self._reported = 0

    def age_ns(self, info: Mapping[str, Any]) -> int:
        """
        Return the age of a sample.

        :param info: from rclpy: ``source_timestamp`` and ``received_timestamp``.
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
        """Return a difference of the clocks less their offset."""
        if now_ns - self._begun_ns >= _WINDOW_NS:
            recent = now_ns - self._begun_ns < 2 * _WINDOW_NS
            self._before_ns = self._least_ns if recent else None
            self._least_ns = None
            self._begun_ns = now_ns
        offset_ns = self._offset_ns()
        waited_ns = self._gaps.waited_ns(now_ns, offset_ns is not None)
        if offset_ns is None and waited_ns:
            return waited_ns  # the difference may include the wait, so it is not stored
        if self._least_ns is None or difference_ns < self._least_ns:
            self._least_ns = difference_ns
        if offset_ns is None:
            return 0
        return max(waited_ns, difference_ns - offset_ns)

    def _offset_ns(self) -> int | None:
        known = [each for each in (self._before_ns, self._least_ns) if each is not None]
        return min(known, default=None)

    def counters(self) -> dict[str, Any]:
        """Return values for ``/diagnostics``; ``warning`` is about samples since the last call."""
        gaps = self._gaps
        counted: dict[str, Any] = {
            'delay_ms': self.delay_ms, 'delayed': self.delayed, 'node_gaps': gaps.gaps,
            'node_gap_maximum_ms': gaps.longest_ns / NS_PER_MS, 'clock_steps': gaps.clock_steps}
        offset_ns = self._offset_ns()
        if offset_ns is not None:
            counted['clock_offset_ms'] = round(offset_ns / NS_PER_MS, 1)
        if self.delayed != self._reported:
            counted['warning'] = (
                f'{self.delayed - self._reported} samples were old on arrival, the last '
                f'{self.delay_ms:.0f} ms: the node or the network was delayed, or a clock was set')
            self._reported = self.delayed
        return counted
