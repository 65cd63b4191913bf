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

"""What else happened while something was measured: how a missed target finds its reason."""

from __future__ import annotations

from collections.abc import Mapping
import os
from pathlib import Path
import resource
import statistics
import time

from rt_robot_os.base.units import NS_PER_MS

# Said when the counters name no culprit.
NOTHING = ('no disturbance from outside was counted, so it is the program itself, the interpreter '
           'or the virtual machine')
_PREFIX = 'env '
#: A turn of a plain loop: how fast this CPU runs Python just now.
LOOP = _PREFIX + 'loop_ns'
_BLOCKS, _TURNS = 5, 2000
_WAITED_MS = 1.0
_WAKE_UP_MS = 0.005


def _stolen_ticks() -> int:
    """Read the time that the host of a virtual machine gave to others; 0 when untold."""
    try:
        words = Path('/proc/stat').read_text().partition('\n')[0].split()
        return int(words[8])
    except (OSError, IndexError, ValueError):
        return 0


def _waited_ns() -> int:
    """Read for how long this thread was ready and waited for the CPU; 0 when untold."""
    try:
        return int(Path('/proc/thread-self/schedstat').read_text().split()[1])
    except (OSError, IndexError, ValueError):
        return 0


def loop_ns() -> float:
    """Measure what a turn of a plain loop takes, in some 0.2 ms."""
    blocks = []
    for _ in range(_BLOCKS):
        begin_ns = time.perf_counter_ns()
        for _ in range(_TURNS):
            pass
        blocks.append((time.perf_counter_ns() - begin_ns) / _TURNS)
    return statistics.median(blocks)


class MachineState:
    """Counters of the process and the machine, from making this to :meth:`figures`."""

    def __init__(self) -> None:
        self._loop_ns = loop_ns()
        self._before = self._now()

    @staticmethod
    def _now() -> dict[str, float]:
        usage = resource.getrusage(resource.RUSAGE_SELF)
        return {
            'stolen_ms': _stolen_ticks() * 1000 / os.sysconf('SC_CLK_TCK'),
            'waited_ms': _waited_ns() / NS_PER_MS,
            'switches_forced': usage.ru_nivcsw, 'switches': usage.ru_nvcsw,
            'faults': usage.ru_minflt, 'faults_disk': usage.ru_majflt,
            'cpu_ms': (usage.ru_utime + usage.ru_stime) * 1000}

    def figures(self) -> dict[str, float]:
        """Return what happened since then, and the mean pace before and after."""
        now = self._now()
        return {**{_PREFIX + name: now[name] - before for name, before in self._before.items()},
                LOOP: (self._loop_ns + loop_ns()) / 2}


def away(figures: Mapping[str, float]) -> float | None:
    """
    Return how long a measurement was ready and had no CPU.

    :return: ms: what the host took (of all CPUs, in steps of 10 ms) or what Linux counted as
        waiting, which is mostly the same time; None where that was not counted.
    """
    if _PREFIX + 'waited_ms' not in figures:
        return None
    return max(figures.get(_PREFIX + 'stolen_ms', 0.0), _waited_ms(figures))


def _waited_ms(figures: Mapping[str, float]) -> float:
    """Return the waiting that other processes caused: each wake-up waits for a moment."""
    return (figures.get(_PREFIX + 'waited_ms', 0.0)
            - _WAKE_UP_MS * figures.get(_PREFIX + 'switches', 0.0))


def explain(figures: Mapping[str, float]) -> str:
    """Return in words what disturbed a measurement; empty when nothing is known to have."""
    stolen_ms = figures.get(_PREFIX + 'stolen_ms', 0.0)
    forced = figures.get(_PREFIX + 'switches_forced', 0.0)
    faults = figures.get(_PREFIX + 'faults_disk', 0.0)
    waited_ms = _waited_ms(figures)
    parts = []
    if waited_ms >= _WAITED_MS:
        parts.append(f'it was ready and waited {waited_ms:.0f} ms for its CPU, which others had')
    if stolen_ms >= 10:
        parts.append(f'the host took {stolen_ms:.0f} ms of CPU time away')
    if forced >= 10:
        parts.append(f'other processes interrupted it {forced:.0f} times')
    if faults >= 1:
        parts.append(f'{faults:.0f} page{"s" if faults > 1 else ""} of memory came from disk')
    return ', '.join(parts)
