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

import time

import numpy as np

from rt_robot_os.bench.harness import Harness
from rt_robot_os.bench.harness import Measured
from rt_robot_os.bench.stamps import Stamps
from rt_robot_os.bench.workers.compute import compute
from rt_robot_os.kernel import Kernel
from rt_robot_os.linux.timer import Sleeper
from rt_robot_os.units import NS_PER_S

LOAD = 'rt_robot_os.bench.workers.compute:load'


def kernel(harness: Harness) -> Measured:
    """Run both tasks in the kernel, in a process as the core prepares it."""
    a = harness.arguments
    total_ns = a['warmup_ns'] + a['measure_ns']
    fast = Stamps(2 * total_ns // a['period_ns'] + 1000)
    busy = Stamps(2 * (2 * total_ns // a['busy_period_ns'] + 10))

    def computing() -> None:
        busy.stamp()
        compute(a['busy_ns'])
        busy.stamp()

    tested = Kernel()
    tested.add_task('fast', fast.stamp, priority=50, rate_hz=NS_PER_S / a['period_ns'])
    tested.add_task('computing', computing, priority=10, rate_hz=NS_PER_S / a['busy_period_ns'])
    harness.prepare(freeze=True)
    tested.run(total_ns)
    edges = busy.taken()
    edges = edges[:len(edges) // 2 * 2]
    return Measured(
        {'starts': fast.taken(), 'busy_begins': edges[::2], 'busy_ends': edges[1::2]},
        {'phase_ns': tested.start_ns, 'begin_ns': tested.start_ns + a['warmup_ns'],
         'measure_ns': a['measure_ns']})


def floor(harness: Harness) -> Measured:
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


def _sleep(harness: Harness) -> Measured:
    a = harness.arguments
    period_ns = a['period_ns']
    fast = Stamps(2 * (a['warmup_ns'] + a['measure_ns']) // period_ns + 1000)
    sleeper = Sleeper()
    harness.prepare(freeze=True)
    phase_ns = time.monotonic_ns() + period_ns
    begin_ns = phase_ns + a['warmup_ns']
    end_ns = begin_ns + a['measure_ns']
    deadline_ns = phase_ns
    sleep_until_ns, stamp, now_ns = sleeper.sleep_until_ns, fast.stamp, time.monotonic_ns
    while deadline_ns <= end_ns:
        sleep_until_ns(deadline_ns)
        stamp()
        deadline_ns += period_ns
        late_ns = now_ns() - deadline_ns
        if late_ns >= 0:
            deadline_ns += (late_ns // period_ns + 1) * period_ns
    none = np.zeros(0, np.int64)
    return Measured({'starts': fast.taken(), 'busy_begins': none, 'busy_ends': none},
                    {'phase_ns': phase_ns, 'begin_ns': begin_ns,
                     'measure_ns': a['measure_ns']})
