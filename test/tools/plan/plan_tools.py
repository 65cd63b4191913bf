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

"""Task sets for the tests of the plan, and the real kernel to try them on."""

from __future__ import annotations

from collections.abc import Sequence
import random

from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import OverrunPolicy
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.tools.plan.task import PlannedTask

UNIT_NS = 10_000
SHORT_NS = 1


def task(name: str, priority: int, execution: int, period: int, **more: object) -> PlannedTask:
    """Make a task whose times are all in units of one nanosecond."""
    return PlannedTask(name, priority, period_ns=period, execution_ns=execution,
                       **more)  # type: ignore[arg-type]


class StallingClock(VirtualClock):
    """A virtual clock on which a job can also make a native call, which nothing preempts."""

    def stall(self, duration_ns: int) -> None:
        """Let time pass without alarms; what came up is served with the last nanosecond."""
        self._now_ns += duration_ns - 1
        self.spend(1)


def uunifast(rng: random.Random, count: int, total: float) -> list[float]:
    """Divide a utilisation evenly at random (Bini and Buttazzo 2005)."""
    found = []
    left = total
    for rest in range(count - 1, 0, -1):
        following: float = left * rng.random() ** (1 / rest)
        found.append(left - following)
        left = following
    return [*found, left]


def random_set(rng: random.Random, count: int, total: float, levels: int,
               backlog: int = 0) -> list[PlannedTask]:
    """Make tasks with periods that divide 1200 units, and priorities of some levels."""
    periods = [p for p in range(10, 241) if 1200 % p == 0]
    priorities = ([rng.randint(1, levels) for _ in range(count)] if levels < count
                  else rng.sample(range(1, levels + 1), count))
    tasks = []
    for index, utilisation in enumerate(uunifast(rng, count, total)):
        period = rng.choice(periods)
        execution = max(1, int(utilisation * period))
        tasks.append(PlannedTask(
            f't{index}', priorities[index], period_ns=period * UNIT_NS,
            execution_ns=execution * UNIT_NS, backlog=backlog))
    return tasks


def worst_responses(tasks: Sequence[PlannedTask], end_ns: int,
                    chains: dict[str, int] | None = None) -> dict[str, int]:
    """
    Run tasks on the kernel and give each one's longest time from release to end.

    :param chains: gets the longest time from the timer at the beginning of a chain.

    The middle part of a job with ``native_ns`` is a native call, that of one with sections is
    spent inside of them, one after the other; with ``backlog`` its overrun policy is catch_up.
    Jobs compute ``SHORT_NS`` less than planned: on the virtual clock a release at the very moment
    at which a job ends still interrupts it, and in the analysis, as in all of the literature, it
    comes too late for that.
    """
    clock = StallingClock()
    kernel = Kernel(clock)
    worst = {task.name: 0 for task in tasks}
    begun: dict[str, int] = {}

    def job(planned: PlannedTask) -> None:
        execution_ns = (planned.execution_ns or 0) - SHORT_NS
        release_ns = kernel.task(planned.name).release_ns
        begun_ns = begun.pop(planned.name, release_ns)
        special_ns = planned.native_ns + sum(n or 0 for n in planned.sections.values())
        before_ns = max(0, execution_ns - special_ns) // 2
        clock.spend(before_ns)
        if planned.native_ns:
            clock.stall(planned.native_ns)
        for name, length_ns in planned.sections.items():
            with kernel.resource(name):
                clock.spend(length_ns or 0)
        clock.spend(execution_ns - special_ns - before_ns)
        worst[planned.name] = max(worst[planned.name], kernel.now_ns() - release_ns)
        if chains is not None:
            chains[planned.name] = max(
                chains.get(planned.name, 0), kernel.now_ns() - begun_ns)
        for other in tasks:
            if any(event.source == planned.name for event in other.events):
                # One that waits already serves both: the earlier beginning counts.
                begun.setdefault(other.name, begun_ns)
                kernel.release(kernel.task(other.name))

    for planned in tasks:
        kernel.add_task(
            planned.name, lambda planned=planned: job(planned),  # type: ignore[misc]
            priority=planned.priority, phase_ns=planned.phase_ns,
            rate_hz=1e9 / planned.period_ns if planned.period_ns else None,
            resources=[kernel.resource(name) for name in planned.sections],
            overrun=OverrunPolicy.CATCH_UP if planned.backlog else OverrunPolicy.SKIP,
            catch_up=planned.backlog or 1)
    kernel.run(end_ns)
    assert not kernel.failures, kernel.failures
    return worst
