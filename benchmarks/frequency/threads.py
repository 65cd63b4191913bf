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

"""Periodic modules in Python threads that sleep until their next deadline."""

from __future__ import annotations

import time

from benchmarks.frequency.subjects import collect
from benchmarks.frequency.subjects import make_modules
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.subjects.threads import Threads


def modules(harness: Harness) -> Measurement:
    """Run periodic modules, see :func:`benchmarks.frequency.subjects.kernel`."""
    a = harness.arguments
    made = make_modules(a)
    harness.prepare()
    tested = Threads(
        [(round(NS_PER_S / rate), min(priority, harness.priority), module.work)
         for (rate, priority), module in zip(a['modules'], made)],
        a['warmup_ns'] + a['measure_ns'])
    begin_ns, cpu_ns = time.monotonic_ns(), time.process_time_ns()
    tested.run()
    return collect(made, tested.begin_ns, a, time.process_time_ns() - cpu_ns,
                   time.monotonic_ns() - begin_ns)
