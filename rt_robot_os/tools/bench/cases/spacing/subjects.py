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

"""What a job costs by how far releases lie apart, and how a thousand tasks keep their rate."""

from __future__ import annotations

from collections.abc import Mapping
import resource
import statistics
import time
from typing import Any
from typing import NamedTuple

import numpy as np

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.kernel import Kernel
from rt_robot_os.linux.timer import Sleeper
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement

_STRETCH_NS = 100 * NS_PER_MS
_TURNS = 2


class Stretch(NamedTuple):
    """
    What came of letting tasks run for a while.

    :ivar missed: releases that no job served.
    :ivar used_ns: CPU time of the thread,
    :ivar looked_ns: and of it what passed in looking at the clock instead of sleeping.
    """

    jobs: int
    missed: int
    used_ns: int
    looked_ns: int


class SpacedTasks:
    """
    Tasks of one rate that do nothing, at phases that lie so far apart.

    :param spacing_ns: 0 releases them together.
    """

    def __init__(self, count: int, rate_hz: int, spacing_ns: int) -> None:
        self._kernel = Kernel()
        for i in range(count):
            self._kernel.add_task(f'task{i}', _nothing, priority=10 + i % 80, rate_hz=rate_hz,
                                  phase_ns=i * spacing_ns)

    def run(self, duration_ns: int) -> Stretch:
        """Let them run."""
        tasks = self._kernel.tasks
        jobs, missed = sum(t.runs for t in tasks), sum(t.missed for t in tasks)
        looked_ns = self._kernel.polled_ns
        begin_ns = time.thread_time_ns()
        self._kernel.run(duration_ns)
        used_ns = time.thread_time_ns() - begin_ns
        return Stretch(sum(t.runs for t in tasks) - jobs, sum(t.missed for t in tasks) - missed,
                       used_ns, self._kernel.polled_ns - looked_ns)


def tasks_at(spacing_ns: int, most: int, period_ns: int) -> int:
    """Return how many tasks of a period find a moment of their own; at most ``most``."""
    return most if not spacing_ns else min(most, period_ns // spacing_ns)


def curve(harness: Harness) -> Measurement:
    """
    Measure the CPU time of a job at each spacing, in turns; count how often the process slept.

    :return: for each spacing samples ``NS`` (nanoseconds a job), and figures ``sleeps NS``, by
        job, and ``looked NS``: nanoseconds a job.
    """
    a = harness.arguments
    harness.prepare(freeze=True)
    spacings = a['spacings_ns']
    stretches = max(1, a['measure_ns'] // (len(spacings) * _TURNS * _STRETCH_NS))
    costs: dict[str, list[int]] = {str(spacing_ns): [] for spacing_ns in spacings}
    looked: dict[str, list[float]] = {name: [] for name in costs}
    for _ in range(_TURNS):
        for spacing_ns in spacings:
            crowd = _crowd(a, spacing_ns)
            crowd.run(a['warmup_ns'])
            for _ in range(stretches):
                took = crowd.run(_STRETCH_NS)
                costs[str(spacing_ns)].append(took.used_ns // max(1, took.jobs))
                looked[str(spacing_ns)].append(took.looked_ns / max(1, took.jobs))
    figures = {f'looked {name}': statistics.median(some) for name, some in looked.items()}
    for spacing_ns in spacings:
        figures.update(_counted(a, spacing_ns))
    return Measurement({name: np.array(some, np.int64) for name, some in costs.items()}, figures)


def _crowd(a: Mapping[str, Any], spacing_ns: int) -> SpacedTasks:
    count = tasks_at(spacing_ns, a['tasks'], NS_PER_S // a['rate_hz'])
    return SpacedTasks(count, a['rate_hz'], spacing_ns)


def _counted(a: Mapping[str, Any], spacing_ns: int) -> Mapping[str, float]:
    crowd = _crowd(a, spacing_ns)
    sleeps = resource.getrusage(resource.RUSAGE_SELF).ru_nvcsw
    jobs = max(1, crowd.run(_STRETCH_NS).jobs)
    sleeps = resource.getrusage(resource.RUSAGE_SELF).ru_nvcsw - sleeps
    return {f'sleeps {spacing_ns}': sleeps / jobs}


def wakes(harness: Harness) -> Measurement:
    """Divide the CPU time of a bare ``clock_nanosleep`` loop by its wake-ups, at each spacing."""
    a = harness.arguments
    sleeper = Sleeper()
    harness.prepare(freeze=True)
    stretches = max(2, a['measure_ns'] // (len(a['spacings_ns']) * _STRETCH_NS))
    costs: dict[str, list[int]] = {str(period_ns): [] for period_ns in a['spacings_ns']}
    for _ in range(1 + stretches):
        for period_ns in a['spacings_ns']:
            count = _STRETCH_NS // period_ns
            deadline_ns = time.monotonic_ns()
            begin_ns = time.thread_time_ns()
            for _ in range(count):
                deadline_ns += period_ns
                sleeper.sleep_until_ns(deadline_ns)
            costs[str(period_ns)].append((time.thread_time_ns() - begin_ns) // count)
    # The first turn is the warm-up.
    return Measurement({name: np.array(some[1:], np.int64) for name, some in costs.items()})


def many(harness: Harness) -> Measurement:
    """
    Let very many tasks run, released together, then at phases over the whole period.

    :return: figures ``reached_hz KEY``, ``missed KEY`` (releases), ``job_us KEY``,
        ``looked_us KEY`` (of it) and ``cpu_percent KEY``: of ``together`` and of ``spread``.
    """
    a = harness.arguments
    period_ns = NS_PER_S // a['rate_hz']
    crowds = {'together': SpacedTasks(a['tasks'], a['rate_hz'], 0),
              'spread': SpacedTasks(a['tasks'], a['rate_hz'], period_ns // a['tasks'])}
    harness.prepare(freeze=True)
    # To the middle of a period: tasks that are released together are not cut off.
    duration_ns = max(1, a['measure_ns'] // period_ns) * period_ns - period_ns // 2
    figures: dict[str, float] = {}
    for key, crowd in crowds.items():
        crowd.run(a['warmup_ns'])
        took = crowd.run(duration_ns)
        jobs = max(1, took.jobs)
        figures.update({
            f'reached_hz {key}': a['rate_hz'] * took.jobs / max(1, took.jobs + took.missed),
            f'missed {key}': took.missed, f'job_us {key}': took.used_ns / 1e3 / jobs,
            f'looked_us {key}': took.looked_ns / 1e3 / jobs,
            f'cpu_percent {key}': 100.0 * took.used_ns / duration_ns})
    return Measurement(figures=figures)


def _nothing() -> None:
    """Do nothing: what is measured is the kernel."""
