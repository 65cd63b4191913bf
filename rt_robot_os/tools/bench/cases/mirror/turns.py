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

"""The difference that something makes to the CPU time of a process, taken in turns."""

from __future__ import annotations

from collections.abc import Callable
import time

import numpy as np

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.tools.bench.case import Samples
from rt_robot_os.tools.bench.harness import Measurement

STRETCH_NS = 250 * NS_PER_MS
_SETTLE_NS = 20 * NS_PER_MS


class MirrorTurns:
    """
    A job for a periodic task that does a thing for a stretch, then another, then the first again.

    At the end of each stretch the CPU time of the process is noted, so that what else it spends
    is in both.

    :param with_it: does what is measured.
    :param without: the same without.
    :param between: called after each stretch, outside of what is measured.
    :param peer: returns the CPU time that another process has used, in ns.
    """

    def __init__(self, with_it: Callable[[], object], without: Callable[[], object],
                 between: Callable[[], None] | None = None,
                 peer: Callable[[], int] | None = None) -> None:
        self._functions = (without, with_it)
        self._between = between
        self._clocks = (time.process_time_ns, *((peer,) if peer is not None else ()))
        self._costs: tuple[list[tuple[float, ...]], list[tuple[float, ...]]] = ([], [])
        self._turn = 0
        self._now_ns = time.monotonic_ns
        self._begin()

    def _begin(self) -> None:
        self._count = self._from_ns = 0
        self._cpu_ns: tuple[int, ...] = ()
        self._begun_ns = self._now_ns()

    def job(self) -> None:
        """Do it once; the first times of a stretch do not count."""
        self._functions[self._turn]()
        now_ns = self._now_ns()
        if now_ns < self._begun_ns + _SETTLE_NS:
            return
        if not self._from_ns:
            self._from_ns, self._cpu_ns = now_ns, self._used()
            return
        self._count += 1
        if now_ns >= self._from_ns + STRETCH_NS:
            self._costs[self._turn].append(tuple(
                (used_ns - before_ns) / self._count
                for used_ns, before_ns in zip(self._used(), self._cpu_ns)))
            self._turn = 1 - self._turn
            if self._between is not None:
                self._between()
            self._begin()

    def _used(self) -> tuple[int, ...]:
        return tuple(clock() for clock in self._clocks)

    def differences(self, warmup_ns: int) -> Measurement:
        """
        Compare each stretch with the one before it: ``difference_ns``, ``peer_difference_ns``.

        :raises RuntimeError: there was no time for a pair.
        """
        skip = max(1, warmup_ns // (2 * STRETCH_NS))
        pairs = list(zip(*self._costs))[skip:]
        if not pairs:
            raise RuntimeError('too short to compare a stretch with it and one without')
        samples: dict[str, Samples] = {}
        for i, prefix in zip(range(len(self._clocks)), ('', 'peer_')):
            off, on = (np.array([pair[turn][i] for pair in pairs]).round().astype(np.int64)
                       for turn in (0, 1))
            samples |= {f'{prefix}with_ns': on, f'{prefix}without_ns': off,
                        f'{prefix}difference_ns': on - off}
        return Measurement(samples)
