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
Logarithmic histograms of durations: eight buckets per octave, each at most 12.5 % wide.

The histograms of a task are in :class:`rt_robot_os.kernel.task_core.TaskCore`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

# Enough for any difference of two times: an index needs no check.
BUCKETS: Final = 488
LAST_LIMIT_NS: Final = 1 << 63


def bucket(duration_ns: int) -> int:
    """
    Return the number of the bucket of a duration.

    :param duration_ns: from 0 up to, but not including, ``LAST_LIMIT_NS`` (292 years).
    """
    shift = duration_ns.bit_length() - 4
    if shift <= 0:
        return duration_ns
    return (shift << 3) + (duration_ns >> shift)


def bucket_limits(index: int) -> tuple[int, int]:
    """
    Return the limits of a bucket: the inverse of :func:`bucket`.

    :return: the shortest duration of the bucket and that of the next one, in nanoseconds.
    """
    if index < 16:
        return index, index + 1
    shift = (index >> 3) - 1
    mantissa = (index & 7) + 8
    return mantissa << shift, (mantissa + 1) << shift


@dataclass(frozen=True)
class Summary:
    """
    Percentiles of a histogram.

    :ivar count: number of durations.
    :ivar p50_ns: the median (resolution 12.5 %).
    :ivar maximum_ns: the longest duration, exact.
    """

    count: int = 0
    p50_ns: int = 0
    p99_ns: int = 0
    p999_ns: int = 0
    maximum_ns: int = 0


def percentile(counts: Sequence[int], total: int, part: float, maximum_ns: int) -> int:
    """
    Return the duration that a fraction of all durations does not exceed.

    :param counts: one number per bucket.
    :param total: their sum.
    :param part: from 0 to 1.
    :param maximum_ns: the longest duration; the result is not above it.
    """
    wanted = max(1, -int(-part * total // 1))
    seen = 0
    for index, count in enumerate(counts):
        seen += count
        if seen >= wanted:
            low, high = bucket_limits(index)
            return min((low + high) // 2, maximum_ns)
    return maximum_ns


def summarise(counts: Sequence[int], maximum_ns: int) -> Summary:
    """
    Summarise the counts of a histogram; not for the real-time loop.

    :param counts: one number per bucket.
    :param maximum_ns: the longest duration.
    """
    total = sum(counts)
    if not total:
        return Summary()
    p50, p99, p999 = (percentile(counts, total, part, maximum_ns) for part in (.5, .99, .999))
    return Summary(total, p50, p99, p999, maximum_ns)


class Histogram:
    """
    Counts of durations by bucket, with the exact maximum.

    :param counts: one number per bucket; by default all are 0.
    :param maximum_ns: the longest duration in them.
    """

    __slots__ = ('counts', 'maximum_ns')

    def __init__(self, counts: list[int] | None = None, maximum_ns: int = 0) -> None:
        self.counts = [0] * BUCKETS if counts is None else counts
        self.maximum_ns = maximum_ns

    def add(self, duration_ns: int) -> None:
        """Count a duration of at least 0; safe in the real-time loop."""
        self.counts[bucket(duration_ns)] += 1
        if duration_ns > self.maximum_ns:
            self.maximum_ns = duration_ns

    def clear(self) -> None:
        """Reset all counts; the list stays the same object."""
        self.counts[:] = [0] * BUCKETS
        self.maximum_ns = 0

    def summary(self) -> Summary:
        """Return the summary; not for the real-time loop."""
        return summarise(self.counts, self.maximum_ns)
