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

"""The floor of periodic modules: one plain loop that calls them all."""

from __future__ import annotations

from collections.abc import Sequence
import time

from benchmarks.delay.subjects import MESSAGE
from benchmarks.frequency.subjects import collect
from benchmarks.frequency.subjects import make_modules
from benchmarks.frequency.subjects import TOPIC_BYTES
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.kernel import Kernel
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.subjects.plain_loop import Job
from rt_robot_os.tools.bench.subjects.plain_loop import LoopGroup
from rt_robot_os.tools.bench.subjects.plain_loop import plain_loop
from rt_robot_os.topics import Bus


def modules(harness: Harness) -> Measurement:
    """Run periodic modules, see :func:`benchmarks.frequency.subjects.kernel`."""
    a = harness.arguments
    made = make_modules(a)
    jobs: dict[int, list[Job]] = {}
    for (rate, _), module in zip(a['modules'], made):
        jobs.setdefault(round(NS_PER_S / rate), []).append(module.work)
    groups = [LoopGroup(period_ns, _receiving(some) if a['receive'] else some)
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
