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

"""The arithmetic of the benchmark: percentiles, and the latency of calls on a grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rt_robot_os.tools.bench.case import Samples

NDArrayBool = NDArray[np.bool_]

# A percentile of fewer samples than this times 1 / (1 - part) is the maximum by another name.
_SAMPLES_BEYOND = 1


def percentile(samples: Samples | Sequence[int], part: float) -> float | None:
    """
    Return the least sample that a part of all samples does not exceed (nearest rank).

    :param part: above 0 and at most 1; 1 gives the maximum.
    :return: a sample, never a value between two; None when there are too few of them
        from the maximum.
    """
    count = len(samples)
    if not count or (part < 1 and count * (1 - part) < _SAMPLES_BEYOND - 1e-9):
        return None
    rank = max(1, int(np.ceil(part * count - 1e-9)))
    return float(np.partition(np.asarray(samples, np.int64), rank - 1)[rank - 1])


@dataclass(frozen=True)
class Timing:
    """
    Calls of a periodic task.

    :ivar releases: when each served release was due.
    :ivar latencies: from there to the call, in nanoseconds.
    :ivar intervals: from one call to the next.
    :ivar expected: releases in the window.
    :ivar extra: calls for which no release was open, such as bursts after a stall.
    """

    releases: Samples
    latencies: Samples
    intervals: Samples
    expected: int
    extra: int

    @property
    def calls(self) -> int:
        """Releases that were served."""
        return len(self.latencies)


def timing(starts: Samples, phase_ns: int, period_ns: int, begin_ns: int, end_ns: int) -> Timing:
    """
    Compare the calls of a periodic task with its grid, by the same rule for every system.

    A call serves the earliest release since the call before it; releases in between that are
    passed as well are missed. So a call that comes 20 ms late has a latency of 20 ms.

    :param starts: when each call began, ascending.
    :param phase_ns: any point of the grid.
    :param begin_ns: only releases from here on count,
    :param end_ns: and before this moment.
    """
    starts = np.asarray(starts, np.int64)
    releases = phase_ns + ((starts[:-1] - phase_ns) // period_ns + 1) * period_ns
    calls, intervals = starts[1:], np.diff(starts)
    inside = (releases >= begin_ns) & (releases < end_ns)
    releases, calls, intervals = releases[inside], calls[inside], intervals[inside]
    served = calls >= releases
    expected = -((begin_ns - phase_ns) // -period_ns), -((end_ns - phase_ns) // -period_ns)
    return Timing(releases[served], (calls - releases)[served], intervals,
                  expected[1] - expected[0], int(np.count_nonzero(~served)))


def inside_any(moments: Samples, begins: Samples, ends: Samples) -> NDArrayBool:
    """
    Return which moments lie in one of several stretches of time.

    :param begins: of the stretches, ascending; they do not overlap.
    :param ends: of the same stretches.
    """
    if not len(begins):
        return np.zeros(len(moments), np.bool_)
    index = np.searchsorted(begins, moments, side='right') - 1
    known = index >= 0
    inside: NDArrayBool = known & (moments < ends[np.where(known, index, 0)])
    return inside


def frequencies(starts: Samples, every: int, begin_ns: int, end_ns: int, window_ns: int
                ) -> NDArray[np.float64]:
    """
    Return the actual frequency of a periodic call in each window of time.

    It is the number of periods from the last stamp before a window, or else the first in it, to
    the last one in it, divided by the time between the two. So a missed call makes it lower, a
    late one at an edge hardly moves it, and no stall falls between two windows.

    :param starts: when every ``every``-th call began, ascending.
    :param begin_ns: the first window begins here; a last one that is not whole is left out.
    :return: hertz; 0 for a window without calls.
    """
    count = max(1, (end_ns - begin_ns) // window_ns)
    edges = begin_ns + np.arange(count + 1) * min(window_ns, end_ns - begin_ns)
    places = np.searchsorted(starts, edges)
    found = np.zeros(count)
    for i, (low, high) in enumerate(zip(places[:-1], places[1:])):
        first, last = max(0, low - 1), high - 1
        if high > low and last > first:
            found[i] = 1e9 * every * (last - first) / (starts[last] - starts[first])
    return found
