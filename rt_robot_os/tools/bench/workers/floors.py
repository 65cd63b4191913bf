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
Floors: plain loops and bare signal handlers that do what the kernel does, without it.

What a machine's host decides (lost time, cold caches, a slow clock) meets them as it meets the
kernel, so that the ratio of both says what the kernel adds. All sleep with ``clock_nanosleep`` to
absolute deadlines, by one call of ctypes, and leave out what they are too late for.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence
import signal
import time
from types import FrameType

import numpy as np

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.kernel import Kernel
from rt_robot_os.linux.timer import Sleeper
from rt_robot_os.tools.bench.case import Samples
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measured
from rt_robot_os.tools.bench.stamps import Stamps
from rt_robot_os.tools.bench.workers.delay import MESSAGE
from rt_robot_os.tools.bench.workers.modules import collect
from rt_robot_os.tools.bench.workers.modules import make_modules
from rt_robot_os.tools.bench.workers.modules import TOPIC_BYTES
from rt_robot_os.tools.bench.workers.preemption import Work
from rt_robot_os.topics import Bus

_STRETCH_NS = 200 * NS_PER_MS
Job = Callable[[], object]


class Group:
    """
    Functions that one plain loop calls at the same moments.

    :ivar due_ns: when next.
    :ivar missed: moments that were left out.
    """

    __slots__ = ('period_ns', 'jobs', 'due_ns', 'missed')

    def __init__(self, period_ns: int, jobs: Sequence[Job]) -> None:
        self.period_ns = period_ns
        self.jobs = jobs
        self.due_ns = self.missed = 0

    def call(self, now_ns: Callable[[], int]) -> None:
        """Call all, and stay on the grid."""
        for job in self.jobs:
            job()
        self.due_ns += self.period_ns
        late_ns = now_ns() - self.due_ns
        if late_ns >= 0:
            left_out = late_ns // self.period_ns + 1
            self.missed += left_out
            self.due_ns += left_out * self.period_ns


def plain_loop(groups: Sequence[Group], begin_ns: int, end_ns: int) -> None:
    """
    Call each group at its moments, the one that is due first before others.

    :param groups: of two that are due at once the first is called first.
    """
    sleep_until_ns, now_ns = Sleeper().sleep_until_ns, time.monotonic_ns
    for group in groups:
        group.due_ns = begin_ns
        group.missed = 0
    while (due_ns := min(group.due_ns for group in groups)) < end_ns:
        if due_ns > now_ns():
            sleep_until_ns(due_ns)
        moment_ns = now_ns()
        for group in groups:
            if group.due_ns <= moment_ns:
                group.call(now_ns)


def modules(harness: Harness) -> Measured:
    """Run periodic modules, see :func:`rt_robot_os.tools.bench.workers.modules.kernel`."""
    a = harness.arguments
    made = make_modules(a)
    jobs: dict[int, list[Job]] = {}
    for (rate, _), module in zip(a['modules'], made):
        jobs.setdefault(round(NS_PER_S / rate), []).append(module.work)
    groups = [Group(period_ns, _receiving(some) if a['receive'] else some)
              for period_ns, some in sorted(jobs.items())]
    total_ns = a['warmup_ns'] + a['measure_ns']
    harness.prepare(freeze=True)
    begin_ns, cpu_ns = time.monotonic_ns(), time.process_time_ns()
    plain_loop(groups, begin_ns, begin_ns + total_ns)
    return collect(made, begin_ns, a, time.process_time_ns() - cpu_ns, total_ns)


def _receiving(jobs: Sequence[Job]) -> Sequence[Job]:
    """Publish first, and let each job take that, with a read pointer of its own."""
    bus = Bus(Kernel())
    bus.declare('test', MESSAGE, {'data': TOPIC_BYTES}, max_subscribers=len(jobs))

    def receiving(take: Job, job: Job) -> Job:
        def both() -> None:
            take()
            job()

        return both

    return [bus.publisher('test').publish,
            *(receiving(bus.subscribe('test', f'module{i}').take, job)
              for i, job in enumerate(jobs))]


def jobs(harness: Harness) -> Measured:
    """Call ``tasks`` functions that do nothing in a row; give the CPU time of a call."""
    a = harness.arguments
    period_ns = round(NS_PER_S / a['rate_hz'])
    group = Group(period_ns, [_nothing] * a['tasks'])
    harness.prepare(freeze=True)
    costs = []
    for _ in range(1 + max(1, a['measure_ns'] // _STRETCH_NS)):
        begin_ns, used_ns = time.monotonic_ns(), time.process_time_ns()
        plain_loop([group], begin_ns + period_ns, begin_ns + period_ns + _STRETCH_NS)
        used_ns = time.process_time_ns() - used_ns
        calls = _STRETCH_NS // period_ns - group.missed
        costs.append(used_ns // (max(1, calls) * a['tasks']))
    return Measured({'cpu_ns': np.array(costs[1:], np.int64)})  # the first is the warm-up


def many(harness: Harness) -> Measured:
    """
    Call very many functions at 200 Hz, in a row, then each at a moment of its own.

    The moments lie closer than a sleep is worth: between them the loop waits awake.

    :return: figures as :func:`rt_robot_os.tools.bench.workers.spacing.many`.
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
            group = Group(period_ns, functions)
            plain_loop([group], begin_ns, begin_ns + a['measure_ns'] // period_ns * period_ns)
            missed = group.missed * tasks
        else:
            missed = _spread(functions, begin_ns, period_ns // tasks, due)
        used_ns = time.thread_time_ns() - used_ns
        figures.update({
            f'reached_hz {key}': a['rate_hz'] * (due - missed) / due, f'missed {key}': missed,
            f'job_us {key}': used_ns / 1e3 / max(1, due - missed), f'looked_us {key}': 0.0,
            f'cpu_percent {key}': 100.0 * used_ns / a['measure_ns']})
    return Measured(figures=figures)


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


def spin(harness: Harness) -> Measured:
    """Sleep until ``spin_ns`` before each moment of a grid, and wait awake for it."""
    a = harness.arguments
    total_ns = a['warmup_ns'] + a['measure_ns']
    stamps = Stamps(2 * total_ns // a['period_ns'] + 1000)
    sleep_until_ns, now_ns, stamp = Sleeper().sleep_until_ns, time.monotonic_ns, stamps.stamp
    harness.prepare(freeze=True)
    phase_ns, used_ns = now_ns() + a['period_ns'], time.process_time_ns()
    due_ns, end_ns = phase_ns, phase_ns + total_ns
    while due_ns <= end_ns:
        sleep_until_ns(due_ns - a['spin_ns'])
        while now_ns() < due_ns:
            pass
        stamp()
        due_ns += a['period_ns'] * (1 + max(0, now_ns() - due_ns) // a['period_ns'])
    late = (stamps.taken() - phase_ns) % a['period_ns']
    return Measured({'late_ns': late[a['warmup_ns'] // a['period_ns']:]}, {
        'cpu_percent': 100.0 * (time.process_time_ns() - used_ns) / total_ns})


def handler(harness: Harness) -> Measured:
    """
    Let a bare signal handler interrupt Python that computes, at the rate of the fast task.

    This is the least that one interpreter can do: a task that interrupts another one is called by
    such a handler.
    """
    a = harness.arguments
    work = Work(a)
    sleep_until_ns, now_ns = Sleeper().sleep_until_ns, time.monotonic_ns
    harness.prepare(freeze=True)

    def fast(signum: int, frame: FrameType | None) -> None:
        work.fast()

    previous = signal.signal(signal.SIGALRM, fast)
    period_s = a['period_ns'] / NS_PER_S
    phase_ns = now_ns()
    signal.setitimer(signal.ITIMER_REAL, period_s, period_s)
    due_ns = phase_ns
    try:
        while due_ns < phase_ns + work.total_ns:
            work.busy()
            due_ns += a['busy_period_ns']
            while now_ns() < due_ns:  # each signal ends a sleep
                sleep_until_ns(due_ns)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, previous)
    return work.measured(phase_ns)


class _Struck(Exception):
    """What the bare handler raises."""


def strike(harness: Harness) -> Measured:
    """Let a bare handler raise in a loop that computes for ever, ``budget_ns`` after its start."""
    a = harness.arguments
    sleep_until_ns, now_ns = Sleeper().sleep_until_ns, time.monotonic_ns
    count = (a['warmup_ns'] + a['measure_ns']) // a['period_ns']
    late = np.zeros(count, np.int64)
    harness.prepare(freeze=True)

    def end(signum: int, frame: FrameType | None) -> None:
        raise _Struck

    previous = signal.signal(signal.SIGALRM, end)
    begin_ns = now_ns()
    try:
        for i in range(count):
            sleep_until_ns(begin_ns + i * a['period_ns'])
            value, started_ns = 1, now_ns()
            try:
                signal.setitimer(signal.ITIMER_REAL, a['budget_ns'] / NS_PER_S)
                while True:
                    value = (value * 31 + 7) & 0xFFFF
            except _Struck:
                late[i] = now_ns() - started_ns - a['budget_ns']
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, previous)
    return Measured({'late_ns': late[a['warmup_ns'] // a['period_ns']:]})


def rows(harness: Harness) -> Measured:
    """
    Run a loop of 1 kHz for long, a row of figures every ``row_ns``.

    :return: samples ``time_s``, ``acquire_hz`` and ``missed``, one a row.
    """
    a = harness.arguments
    harness.prepare(freeze=True)
    found: dict[str, list[float]] = {'time_s': [], 'acquire_hz': [], 'missed': []}
    begin_ns = time.monotonic_ns() + NS_PER_MS
    for number in range(max(1, a['measure_ns'] // a['row_ns'])):
        stamps = Stamps(a['row_ns'] // NS_PER_MS + 100)
        group = Group(NS_PER_MS, [stamps.stamp])
        from_ns = begin_ns + number * a['row_ns']
        plain_loop([group], from_ns, from_ns + a['row_ns'])
        starts: Samples = stamps.taken()
        found['time_s'].append((number + 1) * a['row_ns'] / NS_PER_S)
        found['acquire_hz'].append(0.0 if len(starts) < 2 else (
            (len(starts) - 1) * NS_PER_S / (starts[-1] - starts[0])))
        found['missed'].append(group.missed)
    return Measured({name: np.array(some) for name, some in found.items()})


def _nothing() -> None:
    """Do nothing: what is measured is what calls it."""
