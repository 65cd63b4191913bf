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

"""The floor of a job: a plain loop that calls functions, in a row or each at its moment."""

from __future__ import annotations

from collections.abc import Sequence
import time

import numpy as np

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.subjects.plain_loop import Job
from rt_robot_os.tools.bench.subjects.plain_loop import LoopGroup
from rt_robot_os.tools.bench.subjects.plain_loop import plain_loop

_STRETCH_NS = 200 * NS_PER_MS


def jobs(harness: Harness) -> Measurement:
    """Call ``tasks`` functions that do nothing in a row; give the CPU time of a call."""
    a = harness.arguments
    period_ns = round(NS_PER_S / a['rate_hz'])
    group = LoopGroup(period_ns, [_nothing] * a['tasks'])
    harness.prepare(freeze=True)
    costs = []
    for _ in range(1 + max(1, a['measure_ns'] // _STRETCH_NS)):
        begin_ns, used_ns = time.monotonic_ns(), time.process_time_ns()
        plain_loop([group], begin_ns + period_ns, begin_ns + period_ns + _STRETCH_NS)
        used_ns = time.process_time_ns() - used_ns
        calls = _STRETCH_NS // period_ns - group.missed
        costs.append(used_ns // (max(1, calls) * a['tasks']))
    return Measurement({'cpu_ns': np.array(costs[1:], np.int64)})  # the first is the warm-up


def many(harness: Harness) -> Measurement:
    """
    Call very many functions at 200 Hz, in a row, then each at a moment of its own.

    The moments lie closer than a sleep is worth: between them the loop waits awake.

    :return: figures as :func:`rt_robot_os.tools.bench.cases.spacing.subjects.many`.
    """
    a = harness.arguments
    period_ns, tasks = NS_PER_S // a['rate_hz'], a['tasks']
    functions: Sequence[Job] = [_nothing] * tasks
    harness.prepare(freeze=True)
    figures: dict[str, float] = {}
    for key in ('together', 'spread'):
        begin_ns, used_ns = time.monotonic_ns() + period_ns, time.thread_time_ns()
        due = a['measure_ns'] // period_ns * tasks
        if key == 'together':
            group = LoopGroup(period_ns, functions)
            plain_loop([group], begin_ns, begin_ns + a['measure_ns'] // period_ns * period_ns)
            missed = group.missed * tasks
        else:
            missed = _spread(functions, begin_ns, period_ns // tasks, due)
        used_ns = time.thread_time_ns() - used_ns
        figures.update({
            f'reached_hz {key}': a['rate_hz'] * (due - missed) / due, f'missed {key}': missed,
            f'job_us {key}': used_ns / 1e3 / max(1, due - missed), f'looked_us {key}': 0.0,
            f'cpu_percent {key}': 100.0 * used_ns / a['measure_ns']})
    return Measurement(figures=figures)


def _spread(functions: Sequence[Job], begin_ns: int, spacing_ns: int, due: int) -> int:
    """Return how many were left out: those that were late by a period of their own."""
    now_ns, count, period_ns = time.monotonic_ns, len(functions), spacing_ns * len(functions)
    missed = 0
    for number in range(due):
        due_ns = begin_ns + number * spacing_ns
        while (moment_ns := now_ns()) < due_ns:
            pass
        if moment_ns >= due_ns + period_ns:
            missed += 1
        else:
            functions[number % count]()
    return missed


def _nothing() -> None:
    """Do nothing: what is measured is what calls it."""
