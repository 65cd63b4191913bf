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

"""HORUS (horus-robotics on PyPI), where it is installed: a Rust scheduler with Python nodes."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.tools.bench.cases.preemption.subjects import PreemptionWork
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement

PRIORITY = 80


def node(name: str, tick: Callable[[], object], **options: Any) -> Any:
    """Make a node that calls a function without arguments."""
    return import_module('horus').Node(name=name, tick=lambda node: tick(), **options)


def nodes(harness: Harness) -> Measurement:
    """
    Run a fast node on the last CPU beside one that computes in HORUS's own thread pool.

    HORUS does not report its grid. The earliest call gives it: latencies are a little too small.
    """
    a = harness.arguments
    horus = import_module('horus')
    work = PreemptionWork(a)
    rate_hz = NS_PER_S / a['period_ns']
    made = [
        node('fast', work.fast, rate=rate_hz, order=0, priority=PRIORITY,
             core=harness.own_cpu),
        node('computing', work.busy, rate=NS_PER_S / a['busy_period_ns'], order=5, compute=True)]
    if a['middle_period_ns']:
        made.append(node('middle', work.middle, rate=NS_PER_S / a['middle_period_ns'], order=2,
                         priority=PRIORITY // 2))
    horus.run(*made, rt=True, tick_rate=rate_hz, duration=work.total_ns / NS_PER_S)
    starts, period_ns = work.measured(0).samples['starts'], a['period_ns']
    if not len(starts):
        raise RuntimeError('HORUS never called its node')
    offsets = (starts - starts[0] + period_ns // 2) % period_ns - period_ns // 2
    # It starts its nodes one after the other: the end of the time is not theirs.
    return work.measured(int(starts[0] + offsets.min()),
                         measure_ns=a['measure_ns'] - NS_PER_S // 10)
