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
More work than time: what must hold however much is released.

The clock here charges what a machine charges: for each timer that interrupts, for each that is
set, for waking up and for reading the time. So a kernel whose releases cost more than the CPU has
stands still in virtual time as it would on a real machine.
"""

from __future__ import annotations

from dataclasses import dataclass
import os
import signal
import subprocess
import sys

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
from kernel_tools import balance
from kernel_tools import MS
from kernel_tools import ROOT
from kernel_tools import US
import pytest

from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import MonotonicClock
from rt_robot_os.kernel import OverrunPolicy
from rt_robot_os.kernel import Task
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.kernel.clock import Handler

TICK_NS = 25 * US
WAKE_NS = 15 * US
ARM_NS = US
READ_NS = 500
# Two interrupts with all that they do, at most what one job brings: its own, and one in vain.
JOB_NS = 2 * (TICK_NS + 4 * ARM_NS + 12 * READ_NS)


class CostlyClock(VirtualClock):
    """A virtual clock on which timers and readings take time."""

    def __init__(self) -> None:
        super().__init__()
        self.ticks = 0

    def _read(self) -> int:
        self._now_ns += READ_NS
        return self._now_ns

    def attach(self, on_tick: Handler, on_interrupt: Handler, on_break: Handler) -> None:
        def tick() -> None:
            self.ticks += 1
            self._now_ns += TICK_NS
            on_tick()

        super().attach(tick, on_interrupt, on_break)

    def arm(self, deadline_ns: int) -> None:
        self._now_ns += ARM_NS
        super().arm(deadline_ns)

    def arm_spare(self, deadline_ns: int) -> None:
        self._now_ns += ARM_NS
        super().arm_spare(deadline_ns)

    def wait_masked(self) -> bool:
        came = super().wait_masked()
        self._now_ns += WAKE_NS
        return came


def due(kernel: Kernel, task: Task, now_ns: int) -> int:
    """Give the number of points of a task's grid up to a time."""
    return max(0, (now_ns - kernel.start_ns - task.spec.phase_ns) // task.period_ns + 1)


# ---- many tasks that do nothing --------------------------------------------------------------


def spread(number: int, duration_ns: int) -> Kernel:
    """Run tasks at 200 Hz, each at a moment of its own, with priorities from 1 to 98."""
    kernel = Kernel(CostlyClock())
    for index in range(number):
        kernel.add_task(f'{index}', lambda: None, priority=1 + index * 97 // (number - 1),
                        rate_hz=200.0, phase_ns=index * 5 * MS // number)
    kernel.run(duration_ns)
    return kernel


def test_tasks_that_do_nothing_are_never_too_many_for_the_highest() -> None:
    throughput = []
    for number in (50, 100, 200, 300, 600, 1000):
        kernel = spread(number, 500 * MS)
        tasks = kernel.tasks
        top = tasks[-number // 5:]
        assert all(task.runs >= 0.999 * task.releases - 1 for task in top), number
        assert [task.releases for task in tasks] == [100] * number
        assert not any(map(balance, tasks))
        throughput.append(sum(task.runs for task in tasks))
        # In the order of priority: by level, since equals share.
        shares: dict[int, list[int]] = {}
        for task in tasks:
            shares.setdefault(task.priority, []).append(task.runs)
        means = [sum(runs) / len(runs) for _, runs in sorted(shares.items())]
        assert all(low <= high + 3 for low, high in zip(means, means[1:])), number
    loaded = [jobs for jobs in throughput if jobs > 0.5 * max(throughput)]
    assert throughput[-1] >= 0.8 * max(throughput) and len(loaded) >= 2


# ---- any task set ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Declared:
    """A task; times in nanoseconds."""

    priority: int
    period_ns: int
    phase_ns: int
    execution_ns: int


@st.composite
def loads(draw: st.DrawFn) -> list[Declared]:
    """Draw tasks that ask for 0.5 to 10 times what there is."""
    load = draw(st.sampled_from((0.5, 0.8, 1.0, 1.5, 3.0, 10.0)))
    number = draw(st.integers(2, 60))
    weights = [draw(st.integers(1, 10)) for _ in range(number)]
    tasks = []
    for weight in weights:
        period_ns = draw(st.integers(500, 10_000)) * US
        share = load * weight / sum(weights)
        tasks.append(Declared(
            draw(st.integers(1, 98)), period_ns, draw(st.integers(0, 10_000)) * US,
            max(0, round(share * period_ns) - JOB_NS // 2)))
    return tasks


def response_ns(task: Declared, tasks: list[Declared]) -> int | None:
    """Give the longest time from a release to the end of its job; None: longer than its period."""
    others = [t for t in tasks if t is not task and t.priority >= task.priority]
    response = task.execution_ns + 2 * JOB_NS
    while response <= task.period_ns:
        demand = task.execution_ns + 2 * JOB_NS + sum(
            (-(-response // t.period_ns) + 1) * (t.execution_ns + JOB_NS) for t in others)
        if demand <= response:
            return response
        response = demand
    return None


@settings(max_examples=60)
@given(loads())
def test_who_fits_misses_nothing_and_work_goes_on_under_any_load(tasks: list[Declared]) -> None:
    kernel = Kernel(CostlyClock())
    for index, declared in enumerate(tasks):
        kernel.add_task(
            f'{index}', lambda d=declared: kernel.clock.spend(d.execution_ns),
            priority=declared.priority, rate_hz=1e9 / declared.period_ns,
            phase_ns=declared.phase_ns)
    kernel.run(100 * MS)
    elapsed_ns = 100 * MS
    for declared, task in zip(tasks, kernel.tasks):
        assert balance(task) == 0
        assert task.releases == due(kernel, task, kernel.start_ns + elapsed_ns - 1)
        if response_ns(declared, tasks) is not None:
            assert task.missed <= 1, 'but the one that the end of the run cut off'
    jobs = sum(task.runs for task in kernel.tasks)
    busy_ns = sum(task.execution_total_ns for task in kernel.tasks)
    # As long as one waits in vain, there is always something to do.
    starved = [declared.phase_ns for declared, task in zip(tasks, kernel.tasks) if not task.runs]
    if starved:
        assert busy_ns + jobs * JOB_NS + min(starved) + MS > elapsed_ns
    ticks = kernel.clock.ticks  # type: ignore[attr-defined]
    assert ticks <= 2 * jobs + len(tasks) + 10
    assert 0 <= kernel.overhead_ns <= jobs * JOB_NS + ticks * JOB_NS + elapsed_ns // 10


@pytest.mark.parametrize('phase_ns', [US, 250 * US])
def test_interrupts_for_a_task_that_cannot_run_do_not_starve_the_one_above_it(
        phase_ns: int) -> None:
    kernel = Kernel(CostlyClock())
    spend = kernel.clock.spend
    kernel.add_task('low', lambda: spend(215 * US), priority=1, rate_hz=2000.0)
    # An interrupt costs 30 us here: with one in vain each period it would not fit.
    high = kernel.add_task('high', lambda: spend(450 * US), priority=2, rate_hz=2000.0,
                           phase_ns=phase_ns)
    kernel.run(100 * MS)
    assert high.missed == 0 and high.runs >= 199


# ---- accounts --------------------------------------------------------------------------------


@pytest.mark.parametrize('overrun', OverrunPolicy)
def test_what_a_starving_task_counts_is_exact_whenever_it_is_read(overrun: OverrunPolicy) -> None:
    kernel = Kernel(VirtualClock())
    read = []

    def hog() -> None:
        for _ in range(7):
            kernel.clock.spend(1300 * US)
            seen = starving.statistics()
            read.append(seen.releases - due(kernel, starving, kernel.now_ns()))
            assert seen.releases == seen.runs + seen.missed + seen.coalesced + len(
                starving.backlog) + starving.pending + starving.rephasing

    starving = kernel.add_task('starving', lambda: kernel.clock.spend(1200 * US), priority=10,
                               rate_hz=1000.0, overrun=overrun, catch_up=2)
    kernel.add_task('hog', hog, priority=90, rate_hz=100.0)
    kernel.run(95 * MS)
    assert balance(starving) == 0
    assert starving.missed > 20 or overrun is OverrunPolicy.REPHASE
    if overrun in (OverrunPolicy.SKIP, OverrunPolicy.CATCH_UP):
        assert read == [0] * len(read)
        assert starving.releases == 95


def test_statistics_that_are_reset_in_an_overload_count_from_there_on() -> None:
    kernel = Kernel(VirtualClock())

    def hog() -> None:
        kernel.clock.spend(5500 * US)
        starving.reset_statistics()
        assert (starving.releases, starving.missed) == (1, 0)  # the one that waits
        kernel.clock.spend(3 * MS)
        assert starving.statistics().missed == 3

    starving = kernel.add_task('starving', lambda: None, priority=10, rate_hz=1000.0)
    kernel.add_task('hog', hog, priority=90, rate_hz=100.0, phase_ns=500 * US)
    kernel.run(10 * MS)
    assert (starving.releases, starving.runs, starving.missed) == (4, 1, 3)


def test_events_for_a_task_that_waits_are_counted_each_and_served_once() -> None:
    kernel = Kernel(VirtualClock())
    task = kernel.add_task('task', lambda: None, priority=10)

    def job() -> None:
        for _ in range(1000):
            kernel.release(task)

    kernel.add_task('job', job, priority=50, rate_hz=100.0)
    kernel.run(5 * MS)
    assert (task.releases, task.runs, task.coalesced) == (1000, 1, 999)


# ---- on the real clock -----------------------------------------------------------------------


def test_a_line_that_chatters_is_not_heard_while_its_task_waits() -> None:
    kernel = Kernel(MonotonicClock())
    reading, writing = os.pipe()
    content = []
    reader = kernel.add_task('reader', lambda: content.append(os.read(reading, 100_000)),
                             priority=10)
    kernel.add_interrupt(reading, reader, separation_ns=0)

    def chatter() -> None:
        for _ in range(2000):
            os.write(writing, b'x')
        heard.append(kernel.statistics().sources[0].arrivals)

    heard: list[int] = []
    kernel.add_task('chatter', chatter, priority=50, rate_hz=0.1)
    kernel.add_task('end', lambda: kernel.stop(), priority=5, rate_hz=0.1, phase_ns=MS)
    kernel.run()
    os.close(reading), os.close(writing)
    assert len(b''.join(content)) == 2000, 'heard again after its job'
    assert 1 <= heard[0] <= 2
    assert not balance(reader)


CROWD = """
from rt_robot_os.kernel import Kernel

kernel = Kernel()
count = 0

def top():
    global count
    count += 1
    if count == 20:
        print('running', flush=True)

for index in range(2000):
    kernel.add_task(f'{index}', lambda: None, priority=1 + index * 97 // 1999, rate_hz=200.0,
                    phase_ns=index * 5_000_000 // 2000)
kernel.add_task('top', top, priority=99, rate_hz=100.0)
try:
    kernel.run()
except KeyboardInterrupt:
    print('stopped', all(t.releases == t.runs + t.missed for t in kernel.tasks))
"""


def test_ctrl_c_stops_a_kernel_that_has_far_too_much_to_do() -> None:
    environment = {**os.environ, 'PYTHONPATH': os.pathsep.join(
        [str(ROOT), os.environ.get('PYTHONPATH', '')])}
    with subprocess.Popen([sys.executable, '-c', CROWD], stdout=subprocess.PIPE, text=True,
                          env=environment) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == 'running\n'
            process.send_signal(signal.SIGINT)
            rest, _ = process.communicate(timeout=300)
        finally:
            process.kill()
    assert rest == 'stopped True\n'
