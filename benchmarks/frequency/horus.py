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

"""Periodic modules as nodes of HORUS (horus-robotics on PyPI), where it is installed."""

from __future__ import annotations

from importlib import import_module
import time

from benchmarks.frequency.subjects import collect
from benchmarks.frequency.subjects import make_modules
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.tools.bench.cases.preemption.horus import node
from rt_robot_os.tools.bench.cases.preemption.horus import PRIORITY
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement

# Of its scheduler: the fastest node sets it, and no faster tick than it says it can do.
_TICK_MAXIMUM_HZ = 2000.0


def modules(harness: Harness) -> Measurement:
    """
    Run periodic modules, see :func:`benchmarks.frequency.subjects.kernel`.

    HORUS refuses two nodes on one CPU of their own: it may use all.
    """
    a = harness.arguments
    horus = import_module('horus')
    made = make_modules(a)
    order = sorted(range(len(made)), key=lambda i: -a['modules'][i][1])
    nodes = [node(f'module{i}', made[i].work, rate=a['modules'][i][0], order=rank,
                  priority=min(PRIORITY, a['modules'][i][1]))
             for rank, i in enumerate(order)]
    total_ns = a['warmup_ns'] + a['measure_ns']
    begin_ns, cpu_ns = time.monotonic_ns(), time.process_time_ns()
    horus.run(*nodes, rt=True, tick_rate=min(_TICK_MAXIMUM_HZ, max(r for r, _ in a['modules'])),
              duration=total_ns / NS_PER_S)
    used_ns, duration_ns = time.process_time_ns() - cpu_ns, time.monotonic_ns() - begin_ns
    return collect(made, begin_ns, a, used_ns, duration_ns)
