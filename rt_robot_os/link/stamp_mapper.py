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
Map times on CLOCK_MONOTONIC to the time of day, without ever running backwards.

The system clock is stepped (by NTP or by hand), CLOCK_MONOTONIC is not. The mapping is one offset,
which is compared with the system clock regularly:

* the system clock is ahead by more than ``STEP_NS``: follow immediately;
* anything else: approach it slowly, and change intervals between stamps by at most 5 %.

In addition a :class:`StampLine` for each topic never returns a stamp that is not after the last.

If ROS time comes from another clock (simulated time), nothing is smoothed: such a clock runs at
any speed, stops and is set back, and the mapping follows it unmodified.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
import time

STEP_NS = 50_000_000
SLEW = 0.05
RECENT = 64


class StampMapper:
    """
    The mapping of one process.

    :param monotonic_ns: CLOCK_MONOTONIC.
    :param wall_ns: the time of day, since 1970.
    :ivar error_ns: how far the mapping was behind the system clock at the last comparison;
        negative when it is ahead and waits.
    :ivar forward_steps: number of steps that it followed immediately.
    :ivar follows: set while the time of day is simulated: it is followed immediately, in both
        directions.
    :ivar recent: the last times that were mapped, with their time of day.
    :ivar resets: how often a simulated clock was set back; stamps may then decrease once.
    """

    def __init__(self, monotonic_ns: Callable[[], int] = time.monotonic_ns,
                 wall_ns: Callable[[], int] = time.time_ns) -> None:
        self._monotonic_ns = monotonic_ns
        self._wall_ns = wall_ns
        self.forward_steps = self.resets = 0
        self.follows = False
        self.recent: dict[int, int] = {}
        self.error_ns = 0
        self._compared_ns = monotonic_ns()
        self.offset_ns = wall_ns() - self._compared_ns

    def compare(self) -> None:
        """Compare with the system clock and correct the mapping; call it a few times a second."""
        now_ns = self._monotonic_ns()
        error_ns = self._wall_ns() - now_ns - self.offset_ns
        elapsed_ns = now_ns - self._compared_ns
        allowed_ns = int(elapsed_ns * SLEW)
        self._compared_ns = now_ns
        self.error_ns = error_ns
        if self.follows:
            self.error_ns = 0
            if abs(error_ns) > STEP_NS:
                self.recent.clear()
            # A clock that is stopped falls behind by at most the elapsed time.
            self.resets += error_ns < -elapsed_ns - STEP_NS
            self.offset_ns += error_ns
        elif error_ns > STEP_NS:
            self.forward_steps += 1
            self.recent.clear()
            self.offset_ns += error_ns
        else:
            self.offset_ns += max(-allowed_ns, min(allowed_ns, error_ns))

    def wall_of(self, stamp_ns: int) -> int:
        """
        Map a time; the last times that were mapped keep their result.

        So an image and its calibration, or the topics of one frame of a device, keep equal stamps
        although the offset changes in between: synchronisers rely on that.
        """
        recent = self.recent
        wall_ns = recent.get(stamp_ns)
        if wall_ns is None:
            if len(recent) >= RECENT:
                del recent[next(iter(recent))]
            wall_ns = recent[stamp_ns] = stamp_ns + self.offset_ns
        return wall_ns

    def line(self) -> StampLine:
        """Make the stamps of one topic."""
        return StampLine(self)


class StampLine:
    """The stamps of one topic, strictly increasing."""

    __slots__ = ('_mapper', '_known', '_last_ns', '_resets')

    def __init__(self, mapper: StampMapper) -> None:
        self._mapper = mapper
        self._known: Mapping[int, int] = mapper.recent
        self._last_ns = 0
        self._resets = mapper.resets

    def wall_ns(self, stamp_ns: int) -> int:
        """
        Map the stamp of the next sample.

        :param stamp_ns: on CLOCK_MONOTONIC.
        :return: nanoseconds since 1970.
        """
        wall_ns = self._known.get(stamp_ns)
        if wall_ns is None:
            wall_ns = self._mapper.wall_of(stamp_ns)
        if wall_ns <= self._last_ns:
            if self._resets == self._mapper.resets:
                wall_ns = self._last_ns + 1
            self._resets = self._mapper.resets
        self._last_ns = wall_ns
        return wall_ns
