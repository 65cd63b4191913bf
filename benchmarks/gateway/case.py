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

"""The case `gateway`: what a gateway and those who watch cost the punctuality of the core."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.cases import common
from rt_robot_os.tools.bench.cases import punctual
from rt_robot_os.tools.bench.plot import Plot
from rt_robot_os.tools.bench.plot import tail
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Column
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.result import Target

_WARMUP_NS = 3000 * NS_PER_MS
_LIMIT = 1.1
_SIGNALS = 30
_VIEWERS = 20
_SUBJECT = f'{__package__}.subjects:core'
_COLUMNS = (*punctual.COLUMNS, Column('sent', 'samples', '/s', 'to the gateway'))
_NOTES = (
    'A 1 kHz task in a core that publishes 30 signals at 20 Hz, and a scan of 682 rays at',
    '10 Hz. The gateway, a stand-in for the server and 20 viewers that get each of its',
    'messages are on the other CPUs. Nobody looks: the gateway asks for the newest once a second.')


def _plan(options: BenchOptions) -> Sequence[Run]:
    seconds = common.START_S + _WARMUP_NS / NS_PER_S + options.seconds

    def run(key: str, label: str, gateway: int, viewers: int = 0) -> Run:
        return Run(key, label, _SUBJECT, {
            'gateway': gateway, 'viewers': viewers, 'signals': _SIGNALS,
            'period_ns': punctual.PERIOD_NS, 'warmup_ns': _WARMUP_NS,
            'measure_ns': options.measure_ns}, seconds)

    return (run('none', 'no gateway', 0),
            *(() if options.quick else (run('idle', 'gateway, nobody looks', 1),)),
            run('watched', 'gateway, 20 viewers', 1, _VIEWERS))


_METRICS: dict[str, common.Of] = {
    **punctual.METRICS,
    'sent': lambda outcome: outcome.figures['sent'] / (
        outcome.figures['measure_ns'] / NS_PER_S)}


def _evaluate(options: BenchOptions, outcomes: Outcomes) -> CaseResult:
    targets = [Target(f'p99 with {text} / none', _LIMIT,
                      outcomes.ratio(key, 'none', punctual.latency(0.99)),
                      why='the core sends the samples, and all share the caches and the host; '
                      + common.disturbances(outcomes, key))
               for key, text in (('idle', 'a gateway'), ('watched', 'gateway and viewers'))
               if key in outcomes.runs]
    plot = Plot('gateway', 'How late a 1 kHz task of the core is', 'latency, us',
                'part of the calls that is later',
                [tail(run.label, np.concatenate(
                    [punctual.timing_of(o).latencies for o in outcomes.measured(key)]), 1e3)
                 for key, run in outcomes.runs.items() if outcomes.measured(key)],
                'The closer the curves, the less the monitor reaches the core.', True, True)
    rows = [outcomes.row(key, _METRICS) for key in outcomes.runs]
    return CaseResult(CASE.name, CASE.title, (
        Table('The core while a gateway carries to a monitor', _COLUMNS, rows, _NOTES),),
        targets, (plot,))


CASE = Case('gateway', 'the core beside a gateway, a server and viewers', _plan, _evaluate)
