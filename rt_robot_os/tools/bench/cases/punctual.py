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

"""How punctual a 1 kHz task of a core is beside this or that: what such cases share."""

from __future__ import annotations

from collections.abc import Mapping

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.cases import common
from rt_robot_os.tools.bench.result import Column
from rt_robot_os.tools.bench.stats import percentile
from rt_robot_os.tools.bench.stats import Timing
from rt_robot_os.tools.bench.stats import timing

PERIOD_NS = NS_PER_MS
COLUMNS = (
    Column('p50', 'p50', 'us', 'latency'), Column('p99', 'p99', 'us', 'latency'),
    Column('p99', 'p99 range', 'us', 'latency', spread=True),
    Column('p999', 'p99.9', 'us', 'latency'), Column('maximum', 'max', 'us', 'latency'),
    Column('calls', 'of due', '%', 'calls'), Column('cpu', 'core', '%', 'CPU'))


def timing_of(outcome: RunOutcome) -> Timing:
    """Hold the starts of the task against its grid."""
    begin_ns = int(outcome.figures['begin_ns'])
    return timing(outcome.samples['starts'], int(outcome.figures['phase_ns']), PERIOD_NS,
                  begin_ns, begin_ns + int(outcome.figures['measure_ns']))


def latency(part: float) -> common.Of:
    """Take a percentile of the latencies in microseconds; 1.0 is the maximum."""
    def of(outcome: RunOutcome) -> float | None:
        value = percentile(timing_of(outcome).latencies, part)
        return None if value is None else value / NS_PER_US

    return of


METRICS: Mapping[str, common.Of] = {
    'p50': latency(0.5), 'p99': latency(0.99), 'p999': latency(0.999), 'maximum': latency(1.0),
    'cpu': common.figure('cpu_percent'),
    'calls': lambda outcome: 100.0 * timing_of(outcome).calls / timing_of(outcome).expected}
