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

"""How late a periodic job is, counted by one rule for all callers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rt_robot_os.kernel.histogram import Histogram
from rt_robot_os.kernel.histogram import Summary


class Lateness:
    """
    Counts, for each call, the time since the earliest release that it serves.

    A call that comes 2.3 periods late serves one release and has missed two.

    :param period_ns: of the grid.
    :param skipped: releases at the start that do not count: caches and page tables are cold.
    """

    __slots__ = ('histogram', 'missed', 'next_ns', '_period_ns', '_skipped')

    def __init__(self, period_ns: int, skipped: int) -> None:
        self.histogram = Histogram()
        self.missed = 0
        self.next_ns = 0
        self._period_ns = period_ns
        self._skipped = skipped

    def call(self, now_ns: int) -> None:
        """Count a call; safe in the real-time loop."""
        late_ns = now_ns - self.next_ns
        if late_ns < 0:
            return
        missed = late_ns // self._period_ns
        self.next_ns += (missed + 1) * self._period_ns
        if self._skipped > 0:
            self._skipped -= missed + 1
            return
        self.missed += missed
        self.histogram.add(late_ns)

    def result(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        counts = {str(index): count for index, count in enumerate(self.histogram.counts) if count}
        return {'counts': counts, 'maximum_ns': self.histogram.maximum_ns, 'missed': self.missed}


@dataclass(frozen=True)
class Measured:
    """
    A finished measurement.

    :ivar counts: by bucket of :mod:`rt_robot_os.kernel.histogram`.
    :ivar missed: releases that another one's call came too late for.
    """

    counts: Mapping[int, int]
    summary: Summary
    missed: int


def measured(result: Mapping[str, Any]) -> Measured:
    """Read what :meth:`Lateness.result` gave."""
    histogram = Histogram()
    counts = {int(index): int(count) for index, count in result['counts'].items()}
    for index, count in counts.items():
        histogram.counts[index] = count
    histogram.maximum_ns = int(result['maximum_ns'])
    return Measured(counts, histogram.summary(), int(result['missed']))
