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

"""A periodic task over one that computes: this package's kernel, and the floor of the machine."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
import signal
import time
from types import FrameType
from typing import Any

import numpy as np

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.kernel import Kernel
from rt_robot_os.linux.timer import Sleeper
from rt_robot_os.tools.bench.case import Samples
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.stamps import Stamps
from rt_robot_os.tools.bench.subjects.compute import compute
from rt_robot_os.tools.bench.subjects.compute import native_call
from rt_robot_os.tools.bench.subjects.threads import Threads

LOAD = 'rt_robot_os.tools.bench.subjects.compute:load'


class PreemptionWork:
    """
    The callbacks of a run and their notes, the same for all systems.

    :ivar fast: the periodic one whose latency is measured.
    """

    def __init__(self, a: Mapping[str, Any]) -> None:
        self._a = a
        self.total_ns: int = a['warmup_ns'] + a['measure_ns']
        self._fast = Stamps(2 * self.total_ns // a['period_ns'] + 1000)
        self._middle = Stamps(2 * self.total_ns // (a['middle_period_ns'] or NS_PER_S) + 1000)
        self._busy = Stamps(2 * (2 * self.total_ns // a['busy_period_ns'] + 10))
        self.fast = self._fast.stamp
        self._native: Callable[[], object] | None = (
            native_call(a['busy_ns']) if a['native'] else None)

    def middle(self) -> None:
        """Note the moment and compute; only with ``middle_period_ns``."""
        self._middle.stamp()
        compute(self._a['middle_busy_ns'])

    def busy(self) -> None:
        """Compute, in one native call with ``native``, and note from when to when."""
        self._busy.stamp()
        if self._native is None:
            compute(self._a['busy_ns'])
        else:
            self._native()
        self._busy.stamp()

    def measured(self, phase_ns: int, **figures: float) -> Measurement:
        """
        Return the notes.

        :param phase_ns: a moment of the grid.
        """
        edges = self._busy.taken()
        edges = edges[:len(edges) // 2 * 2]
        return Measurement(
            {'starts': self._fast.taken(), 'middle_starts': self._middle.taken(),
             'busy_begins': edges[::2], 'busy_ends': edges[1::2]},
            {'phase_ns': phase_ns, 'begin_ns': phase_ns + self._a['warmup_ns'],
             'measure_ns': self._a['measure_ns'], **figures})


def kernel(harness: Harness) -> Measurement:
    """Run the tasks in the kernel, in a process as the core prepares it."""
    a = harness.arguments
    work = PreemptionWork(a)
    tested = Kernel()
    tested.add_task('fast', work.fast, priority=50, rate_hz=NS_PER_S / a['period_ns'])
    if a['middle_period_ns']:
        tested.add_task('middle', work.middle, priority=30,
                        rate_hz=NS_PER_S / a['middle_period_ns'])
    busy = tested.add_task('computing', work.busy, priority=10,
                           rate_hz=NS_PER_S / a['busy_period_ns'])
    harness.prepare(freeze=True)
    tested.run(work.total_ns)
    return work.measured(tested.start_ns, charged_ns=busy.blocked_maximum_ns)


def floor(harness: Harness) -> Measurement:
    """
    Loop on ``clock_nanosleep`` with absolute deadlines: nothing in Python can be earlier.

    There is one thread here, so that what computes is another process, on the same CPU, without
    real time: ``load`` is ``none``, ``same`` (as much as the other systems' lower task) or
    ``always``.
    """
    a = harness.arguments
    if a['load'] == 'none':
        return _sleep(harness)
    busy_ns = a['busy_ns'] if a['load'] == 'same' else 0
    arguments = {'busy_ns': busy_ns, 'period_ns': a['busy_period_ns']}
    with harness.helper(LOAD, arguments, same_cpu=True):
        return _sleep(harness)


def _sleep(harness: Harness) -> Measurement:
    a = harness.arguments
    harness.prepare(freeze=True)
    starts, phase_ns = sleep_loop(a['period_ns'], a['warmup_ns'] + a['measure_ns'])
    none = np.zeros(0, np.int64)
    return Measurement({'starts': starts, 'busy_begins': none, 'busy_ends': none},
                       {'phase_ns': phase_ns, 'begin_ns': phase_ns + a['warmup_ns'],
                        'measure_ns': a['measure_ns']})


def sleep_loop(period_ns: int, total_ns: int) -> tuple[Samples, int]:
    """
    Sleep until each point of a grid.

    :return: when it woke each time, and the first point.
    """
    stamps = Stamps(2 * total_ns // period_ns + 1000)
    phase_ns = time.monotonic_ns() + period_ns
    end_ns = phase_ns + total_ns
    deadline_ns = phase_ns
    sleep_until_ns, stamp, now_ns = Sleeper().sleep_until_ns, stamps.stamp, time.monotonic_ns
    while deadline_ns <= end_ns:
        sleep_until_ns(deadline_ns)
        stamp()
        deadline_ns += period_ns
        late_ns = now_ns() - deadline_ns
        if late_ns >= 0:
            deadline_ns += (late_ns // period_ns + 1) * period_ns
    return stamps.taken(), phase_ns


def handler(harness: Harness) -> Measurement:
    """
    Let a bare signal handler interrupt Python that computes, at the rate of the fast task.

    This is the least that one interpreter can do: a task that interrupts another one is called by
    such a handler.
    """
    a = harness.arguments
    work = PreemptionWork(a)
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


def threads(harness: Harness) -> Measurement:
    """Run a fast thread over one that computes, which has a lower priority of SCHED_FIFO."""
    a = harness.arguments
    work = PreemptionWork(a)
    jobs = [(a['period_ns'], harness.priority, work.fast),
            (a['busy_period_ns'], harness.priority // 4, work.busy)]
    if a['middle_period_ns']:
        jobs.insert(1, (a['middle_period_ns'], harness.priority // 2, work.middle))
    harness.prepare()
    tested = Threads(jobs, work.total_ns)
    tested.run()
    return work.measured(tested.begin_ns)
