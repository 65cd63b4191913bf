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
"""Twenty callbacks that ask for more and more of the CPU: what each of them gets."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
import time
from typing import Any

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.kernel import Kernel
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.subjects.compute import compute
from rt_robot_os.tools.bench.subjects.threads import Threads

TASKS = 20


class OverloadCallbacks:
    """
    The callbacks of one load, the same for all systems; the first is the most important.

    :ivar measure_ns: how long it runs.
    :ivar period_ns: of each.
    :ivar jobs: what they do: compute for ``work_ns``, until the end of the measurement.
    :ivar over: is called then: the timer that ends an executor may never get its turn.
    :ivar counts: how often each did.
    """

    def __init__(self, a: Mapping[str, Any], percent: int) -> None:
        self.measure_ns: int = a['longer_ns'].get(str(percent), a['measure_ns'])
        self.period_ns = round(100 * TASKS * a['work_ns'] / percent)
        self.counts = [0] * TASKS
        self.over: Callable[[], None] = _nothing
        self._end_ns = 0
        self._work_ns: int = a['work_ns']
        self.jobs: Sequence[Callable[[], None]] = [self._job(n) for n in range(TASKS)]

    def _job(self, number: int) -> Callable[[], None]:
        def job() -> None:
            now_ns = time.monotonic_ns()
            self._end_ns = self._end_ns or now_ns + self.measure_ns
            if now_ns >= self._end_ns:
                self.over()
                return
            compute(self._work_ns)
            self.counts[number] += 1

        return job


def _nothing() -> None:
    """Do nothing."""


def figures(a: Mapping[str, Any], run: Callable[[OverloadCallbacks], None]) -> Measurement:
    """
    Run all loads, one after the other.

    :return: figures ``served LOAD NUMBER``: percent of the calls asked for, and ``jobs LOAD``: a
        second.
    """
    found: dict[str, float] = {}
    for percent in a['loads']:
        crowd = OverloadCallbacks(a, percent)
        run(crowd)
        asked = crowd.measure_ns / crowd.period_ns
        for number, count in enumerate(crowd.counts):
            found[f'served {percent} {number}'] = min(100.0, 100 * count / asked)
        found[f'jobs {percent}'] = sum(crowd.counts) * NS_PER_S / crowd.measure_ns
    return Measurement({}, found)


def kernel(harness: Harness) -> Measurement:
    """Run them as tasks of a kernel, each at a moment of its own."""
    a = harness.arguments
    harness.prepare(freeze=True)

    def run(crowd: OverloadCallbacks) -> None:
        tested = Kernel()
        for number, job in enumerate(crowd.jobs):
            tested.add_task(f'{number}', job, priority=95 - 4 * number,
                            rate_hz=NS_PER_S / crowd.period_ns,
                            phase_ns=number * crowd.period_ns // TASKS)
        tested.run(crowd.measure_ns)

    return figures(a, run)


def threads(harness: Harness) -> Measurement:
    """Run each in a thread, with falling priorities of SCHED_FIFO where Linux allows that."""
    a = harness.arguments
    harness.prepare()

    def run(crowd: OverloadCallbacks) -> None:
        Threads([(crowd.period_ns, max(0, harness.priority - 3 * number), job)
                 for number, job in enumerate(crowd.jobs)], crowd.measure_ns).run()

    return figures(a, run)
