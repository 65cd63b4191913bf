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
The measuring process: a 1 kHz grid on bare ``clock_nanosleep``, then in this package's kernel.

Run as ``python -m rt_robot_os.tools.doctor.wakeup_child PARENT JSON``; it prints one line of JSON.
A process of its own, prepared as the core is, so that the priority of the doctor stays.
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
import json
import signal
import sys
import time
from typing import Any

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.kernel import Kernel
from rt_robot_os.linux import realtime
from rt_robot_os.linux.process import run_child
from rt_robot_os.linux.realtime import CpuLatencyRequest
from rt_robot_os.linux.realtime import request_cpu_latency
from rt_robot_os.linux.timer import Sleeper
from rt_robot_os.tools.doctor.lateness import Lateness

PERIOD_NS = NS_PER_MS
SKIPPED = 100


def prepare(job: Mapping[str, Any]) -> tuple[list[realtime.RtResult], CpuLatencyRequest | None]:
    """
    Set the process up in the order in which the core does it.

    :return: what Linux granted, and what has to be held until the end.
    """
    held = None
    results = [realtime.set_timer_slack()]
    if job['cpu'] != -2:
        results.append(realtime.set_affinity(job['cpu']))
    if job['lock_memory']:
        results.append(realtime.lock_memory())
    if job['cpu_latency_us'] >= 0:
        result, held = request_cpu_latency(job['cpu_latency_us'])
        results.append(result)
    realtime.freeze_garbage()
    if job['priority']:
        results.append(realtime.set_fifo(job['priority']))
    return results, held


def bare(duration_ns: int) -> Lateness:
    """Sleep from release to release: nothing in Python can be earlier."""
    lateness = Lateness(PERIOD_NS, SKIPPED)
    sleep_until_ns, now_ns = Sleeper().sleep_until_ns, time.monotonic_ns
    lateness.next_ns = now_ns() + PERIOD_NS
    end_ns = lateness.next_ns + SKIPPED * PERIOD_NS + duration_ns
    while lateness.next_ns < end_ns:
        sleep_until_ns(lateness.next_ns)
        lateness.call(now_ns())
    return lateness


def in_kernel(duration_ns: int, spin_ns: int) -> Lateness:
    """Let the kernel run one task, which does nothing but read the clock."""
    lateness = Lateness(PERIOD_NS, SKIPPED)
    kernel = Kernel(spin_ns=spin_ns)
    now_ns = time.monotonic_ns

    def job() -> None:
        if not lateness.next_ns:
            lateness.next_ns = kernel.start_ns
        lateness.call(now_ns())

    kernel.add_task('measured', job, priority=50, rate_hz=NS_PER_S / PERIOD_NS)
    kernel.run(SKIPPED * PERIOD_NS + duration_ns)
    return lateness


def main(arguments: Sequence[str]) -> int:
    """Measure each for half of the time, and report."""
    job = json.loads(arguments[0])
    results, held = prepare(job)
    half_ns = round(job['seconds'] * NS_PER_S / 2)
    spin_ns = round(job['spin_us'] * NS_PER_US)
    answer = {'machine': bare(half_ns).result(), 'kernel': in_kernel(half_ns, spin_ns).result(),
              'refused': [result.step for result in results if not result.ok]}
    if held is not None:
        held.close()
    print(json.dumps(answer))
    return 0


if __name__ == '__main__':
    sys.exit(run_child(main, signal.SIGKILL))
