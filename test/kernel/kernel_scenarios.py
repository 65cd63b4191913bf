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
Scenarios that run the same on the virtual clock and on the real one.

Their jobs wait for events ("until the higher task has run"), so that the order does not depend on
how fast the machine is. Where a timer has to preempt, ``MARGIN_NS`` lies between two releases.
"""

from __future__ import annotations

from collections.abc import Callable

from kernel_tools import MS
from kernel_tools import spin_until
from kernel_tools import waits
import pytest

from rt_robot_os.kernel import BudgetPolicy
from rt_robot_os.kernel import Clock
from rt_robot_os.kernel import Event
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import TraceEvent
from rt_robot_os.kernel import TraceLog
from rt_robot_os.topics import Bus

MARGIN_NS = 40 * MS
ONCE_HZ = 0.01


def nested_timers(kernel: Kernel) -> None:
    """Let timers preempt: low by mid, mid by high; another low one waits for all of them."""
    def low_job() -> None:
        spin_until(kernel, lambda: mid.runs)

    def mid_job() -> None:
        spin_until(kernel, lambda: high.runs)

    kernel.add_task('lowest', kernel.stop, priority=5, rate_hz=ONCE_HZ)
    kernel.add_task('low', low_job, priority=10, rate_hz=ONCE_HZ)
    mid = kernel.add_task('mid', mid_job, priority=50, rate_hz=ONCE_HZ, phase_ns=MARGIN_NS)
    high = kernel.add_task('high', lambda: None, priority=90, rate_hz=ONCE_HZ,
                           phase_ns=2 * MARGIN_NS)


def publication(kernel: Kernel) -> None:
    """Publish to subscribers above, equal to and below the publisher; one publishes on."""
    pytest.importorskip('std_msgs', reason='the ROS 2 message packages are not installed')
    bus = Bus(kernel)
    bus.declare('raw', 'std_msgs/msg/Float64')
    bus.declare('filtered', 'std_msgs/msg/Float64')
    raw, filtered = bus.publisher('raw'), bus.publisher('filtered')
    below = kernel.add_task('below', kernel.stop, priority=20)
    equal = kernel.add_task('equal', lambda: None, priority=50)
    above = kernel.add_task('above', filtered.publish, priority=80)
    top = kernel.add_task('top', lambda: None, priority=95)
    for topic, task in (('raw', below), ('raw', equal), ('raw', above), ('filtered', top)):
        bus.subscribe(topic, task.name, task=task)
    kernel.add_task('publisher', raw.publish, priority=50, rate_hz=ONCE_HZ)


def equals(kernel: Kernel) -> None:
    """Release equals while a higher one runs: by release time, then by declaration."""
    def block() -> None:
        spin_until(kernel, lambda: all(waits(task) for task in tasks))

    kernel.add_task('blocker', block, priority=90, rate_hz=ONCE_HZ)
    tasks = [kernel.add_task(name, lambda: None, priority=30, rate_hz=ONCE_HZ, phase_ns=at * MS)
             for name, at in (('declared_1_due_20', 20), ('declared_2_due_20', 20),
                              ('declared_3_due_10', 10), ('declared_4_due_30', 30))]
    kernel.add_task('last', kernel.stop, priority=1, rate_hz=ONCE_HZ)


def overrun(kernel: Kernel) -> None:
    """Let a job take more than three periods: its releases are skipped, those above are not."""
    rate_hz = 1e9 / MARGIN_NS

    def slow_job() -> None:
        if slow.runs:
            kernel.stop()
        spin_until(kernel, lambda: steady.runs >= 4)

    steady = kernel.add_task('steady', lambda: None, priority=80, rate_hz=rate_hz)
    slow = kernel.add_task('slow', slow_job, priority=50, rate_hz=rate_hz)


def failure(kernel: Kernel) -> None:
    """Raise in a job that preempted one and was preempted by one: both others go on."""
    def low_job() -> None:
        spin_until(kernel, lambda: bad.failures)
        kernel.stop()

    def bad_job() -> None:
        kernel.release(helper)
        raise ValueError('as it was told')

    kernel.add_task('low', low_job, priority=10, rate_hz=ONCE_HZ)
    bad = kernel.add_task('bad', bad_job, priority=60, rate_hz=ONCE_HZ, phase_ns=MARGIN_NS)
    helper = kernel.add_task('helper', lambda: None, priority=90)


def events(kernel: Kernel) -> None:
    """Release oneself, an equal, a lower and a higher task, some of them twice."""
    def job() -> None:
        if not task.runs:
            for other in (lower, task, equal, higher, equal, task, lower, higher):
                kernel.release(other)

    task = kernel.add_task('task', job, priority=50, rate_hz=ONCE_HZ)
    equal = kernel.add_task('equal', lambda: None, priority=50)
    lower = kernel.add_task('lower', kernel.stop, priority=20)
    higher = kernel.add_task('higher', lambda: None, priority=80)


def ceiling(kernel: Kernel) -> None:
    """Hold a resource: its users wait until it is left, one above its ceiling does not."""
    shared = kernel.resource('shared')

    def low_job() -> None:
        with shared:
            spin_until(kernel, lambda: waits(user) and waits(middle) and above.runs)
        kernel.stop()

    def user_job() -> None:
        with shared:
            pass

    kernel.add_task('low', low_job, priority=10, rate_hz=ONCE_HZ, resources=[shared])
    user = kernel.add_task('user', user_job, priority=50, rate_hz=ONCE_HZ, phase_ns=MARGIN_NS,
                           resources=[shared])
    middle = kernel.add_task('middle', lambda: None, priority=30, rate_hz=ONCE_HZ,
                             phase_ns=2 * MARGIN_NS)
    above = kernel.add_task('above', lambda: None, priority=70, rate_hz=ONCE_HZ,
                            phase_ns=3 * MARGIN_NS)


def budget(kernel: Kernel) -> None:
    """Abort a job without end, on top of another; who lies below or comes above is not hit."""
    def low_job() -> None:
        spin_until(kernel, lambda: runaway.aborted)
        kernel.stop()

    def runaway_job() -> None:
        spin_until(kernel, lambda: False)

    kernel.add_task('low', low_job, priority=10, rate_hz=ONCE_HZ)
    runaway = kernel.add_task('runaway', runaway_job, priority=50, rate_hz=ONCE_HZ,
                              phase_ns=MARGIN_NS, budget_ns=2 * MARGIN_NS,
                              on_budget=BudgetPolicy.ABORT)
    kernel.add_task('high', lambda: None, priority=90, rate_hz=ONCE_HZ, phase_ns=2 * MARGIN_NS)


def coroutine(kernel: Kernel) -> None:
    """Await an event in the middle: what comes before and after it are two jobs."""
    event = Event(kernel)

    async def body() -> None:
        spin_until(kernel, lambda: high.runs)
        await event.wait()
        kernel.stop()

    kernel.add_async_task('mission', body, priority=50)
    high = kernel.add_task('high', lambda: None, priority=90, rate_hz=ONCE_HZ, phase_ns=MARGIN_NS)
    kernel.add_task('low', event.set, priority=10, rate_hz=ONCE_HZ)


SCENARIOS: dict[str, Callable[[Kernel], None]] = {
    scenario.__name__: scenario
    for scenario in (
        nested_timers, publication, equals, overrun, failure, events, ceiling, budget, coroutine)}


def run_scenario(name: str, clock: Clock) -> tuple[Kernel, TraceLog]:
    """Run a scenario on a clock of one's choice and give its trace."""
    kernel = Kernel(clock)
    log = TraceLog()
    kernel.trace = log
    SCENARIOS[name](kernel)
    kernel.run()
    return kernel, log


def moments(kernel: Kernel, log: TraceLog) -> dict[tuple[str, str, int], int]:
    """Give the time of each event since the start: by task, kind and how many came before."""
    found: dict[tuple[str, str, int], int] = {}

    def key(event: TraceEvent) -> tuple[str, str, int]:
        number = 0
        while (event.task, event.kind, number) in found:
            number += 1
        return event.task, event.kind, number

    for event in log.events():
        found[key(event)] = event.at_ns - kernel.start_ns
    return found
