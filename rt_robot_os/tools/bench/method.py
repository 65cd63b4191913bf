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

"""How it was measured, in words: what a reader needs to trust or to doubt the figures."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from typing import Any

COST_AIM_NS = 300
PEERS = (
    'rt_robot_os: tasks of one kernel in one process prepared as the core prepares itself: '
    'SCHED_FIFO, one CPU, locked memory, garbage collector frozen.',
    'rclpy SingleThreadedExecutor, MultiThreadedExecutor (4 threads), EventsExecutor (of '
    'rclpy.experimental): one node, a timer for each module on the steady clock, each callback in '
    'a mutually exclusive group of its own, as the page "Using Callback Groups" of the ROS 2 '
    'documentation advises for callbacks that shall run beside each other. rmw_fastrtps, a ROS '
    'domain of its own, publisher and subscriptions in one process. SCHED_FIFO and one CPU as '
    'above; the MultiThreadedExecutor all CPUs without SCHED_FIFO, because its threads starve '
    'each other otherwise (the case preemption shows both).',
    'Python threads: one threading.Thread a module, absolute deadlines, each thread with its own '
    'SCHED_FIFO priority, default switch interval of 5 ms.',
    'HORUS (horus-robotics on PyPI): one horus.Node a module with rate, order, priority, core '
    'and, for what computes, compute=True, run by horus.run(rt=True), as its documentation shows. '
    'It refuses to pin two nodes to one CPU, and so may use all; in the case preemption the fast '
    'node is pinned, the one that computes is in its thread pool. Its time grid is not reported: '
    'the earliest call stands for that, which makes its latencies a little too small.',
    'clock_nanosleep: a bare loop on absolute deadlines in one thread under SCHED_FIFO, called '
    'from Python by one ctypes call: nothing in Python can be earlier. cyclictest: the same in C.',
    'Floors, to which targets are ratios: that loop (how late, and the CPU time of a wake-up; '
    'ctypes takes less than 1 us of it); a plain loop that calls functions one after the other '
    'when it woke up, leaves out what it is too late for and stays on the grid, as the kernel '
    'does (how often, and the CPU time of a call); a bare signal handler of Python that '
    'interrupts Python (how late; an exception from it for aborts); calls of an empty function. '
    'Same CPU, same priority, in turns with what they are compared with.',
)

BY_HAND = """\
import json

import numpy as np

samples = np.load('wakeup.npz')                  # in the folder of --out
late_ns = np.sort(samples['kernel/0/late_ns'])   # run/repeat/sample: the first repeat
rank = int(np.ceil(0.99 * len(late_ns)))         # nearest rank: a sample, never between two
print(late_ns[rank - 1] / 1000)                  # p99 in us; the table: median of the repeats

samples = np.load('preemption.npz')              # when calls began; each was due on a grid of 1 ms
figures = json.loads(str(samples['meta']))['kernel'][0]['figures']
starts = samples['kernel/0/starts'].astype(np.int64)
due = figures['phase_ns'] + ((starts[:-1] - figures['phase_ns']) // 10**6 + 1) * 10**6
end_ns = figures['begin_ns'] + figures['measure_ns']
latency_ns = (starts[1:] - due)[(due >= figures['begin_ns']) & (due < end_ns)]
latency_ns = np.sort(latency_ns[latency_ns >= 0])
print(latency_ns[int(np.ceil(0.99 * len(latency_ns))) - 1] / 1000)"""


def _times(options: Mapping[str, Any]) -> str:
    # What an earlier version has written does not know of this.
    most = options['repeats']
    return f'{most} times' if not options.get('docs') else (
        f'up to {most} times where small figures are compared, once in cases that take long')


def method(machine: Mapping[str, Any], conditions: Mapping[str, Any],
           options: Mapping[str, Any]) -> Sequence[str]:
    """Describe the method of one call of the program."""
    cost_ns = conditions['harness_ns_per_sample']
    lines = [
        f'Interleaving: each system runs in a fresh process for {options["seconds"]:g} s (a '
        'case may divide or multiply that), then the next; when all have run, all run again, '
        f'in the reverse order; {_times(options)}. What disturbs the machine for '
        'a while meets all of them.',
        'Figures: the median of the repeats, with the lowest and the highest beside it. Ratios '
        'are taken repeat by repeat, between runs that lay close together, then their median. '
        'Percentiles are samples (nearest rank), never between two; a percentile that too few '
        'samples support is not shown.',
        'Two builds: the hot path of rt_robot_os runs in C, or in pure Python. The '
        'cases micro, delay and spacing measure both, in processes that take turns, and show '
        'their ratio; where nothing is compiled, the row says why. All other cases run what this '
        'machine has: ' + machine.get('build', 'pure Python') + '.',
        'Warm-up: the first 0.2 to 0.6 s of each run are not counted; imports, set-up and '
        'matching of publishers lie before.',
        f'The harness: a sample is one clock reading into memory that was allocated before, '
        f'{cost_ns / 1000:.2f} us on this machine in this run (target: at most '
        f'{COST_AIM_NS / 1000:g} us, {"reached" if cost_ns <= COST_AIM_NS else "MISSED"}). It is '
        'in the figures of all systems alike and is not taken off. Costs of single operations are '
        'means of blocks of calls with the empty loop taken off.',
        'Latency is counted from the moment on the time grid at which a call was due, by the same '
        'rule for all systems: a call that comes 20 ms late has 20 ms, and the calls that were '
        'left out for it are missed.',
        'Raw samples of every run lie in the folder that --out named, beside index.html: one .npz '
        'file of NumPy a case, with the arrays `run/repeat/sample` and `meta` (JSON: single '
        'figures and counters of each repeat); `bench.json` names the run of each row. Each case '
        'says which runs its rows are. `bench --page FOLDER` computes every table, plot and '
        'verdict from them again; the formulas are in rt_robot_os/tools/bench/cases/NAME.py. How '
        'a figure is computed by hand is shown below.',
    ]
    pace = conditions.get('loop_ns')
    if pace:
        lines.append(
            f'The pace of the machine: beside each measurement the same process times a plain '
            f'Python loop. A turn took {pace["median"]:.1f} ns in the median of '
            f'{pace["processes"]} processes, {pace["least"]:.1f} in the fastest and '
            f'{pace["most"]:.1f} in the slowest: so much did the machine itself vary.')
    if machine['virtual']:
        lines.append(
            'A virtual machine: when its host gives the CPU to others, everything in it stands '
            'still. That makes the tails (p99.9, max) of all systems, of bare C as well; compare '
            'them with the rows of the floor, and judge by p50, p99 and the ratios.')
    if machine['load_average'][0] > len(machine['cores_allowed']) / 2:
        lines.append(f'The machine was busy with other work (load average '
                     f'{machine["load_average"][0]:.1f}) when this began: do not quote.')
    return lines
