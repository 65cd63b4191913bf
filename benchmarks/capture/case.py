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

"""The case `capture`: what a camera and a microphone cost the punctuality of the core."""

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

_WARMUP_NS = 2000 * NS_PER_MS
_LIMIT = 1.1
_SUBJECT = f'{__package__}.subjects:core'
_COLUMNS = (
    *punctual.COLUMNS,
    Column('frames', 'frames', '/s', 'captured'), Column('lost', 'lost', '', 'captured'))
_NOTES = (
    'A 1 kHz task in a core with a camera (640x480 rgb8, 30 Hz, raw and as JPEG) and a microphone',
    '(48 kHz, blocks of 20 ms), both made up by capture processes on the other CPUs. Mirrored: a',
    'client on the other CPUs takes every sample through shared memory.')


def _plan(options: BenchOptions) -> Sequence[Run]:
    seconds = common.START_S + _WARMUP_NS / NS_PER_S + options.seconds

    def run(key: str, label: str, devices: Sequence[str], mirrored: int = 0) -> Run:
        return Run(key, label, _SUBJECT, {
            'devices': list(devices), 'mirrored': mirrored, 'period_ns': punctual.PERIOD_NS,
            'compressed_topic': 'camera/image_raw/compressed', 'warmup_ns': _WARMUP_NS,
            'measure_ns': options.measure_ns}, seconds)

    both = ('camera', 'microphone')
    return (run('none', 'nothing captured', ()), run('both', 'camera and microphone', both),
            *(() if options.quick else (run('sound', 'microphone', both[1:]),)),
            run('mirrored', 'both, mirrored', both, 1))


_METRICS: dict[str, common.Of] = {
    **punctual.METRICS,
    'frames': lambda outcome: outcome.figures['frames'] / (
        outcome.figures['measure_ns'] / NS_PER_S),
    'lost': common.figure('lost')}


def _evaluate(options: BenchOptions, outcomes: Outcomes) -> CaseResult:
    targets = [Target(f'p99 with {text} / nothing captured', _LIMIT,
                      outcomes.ratio(key, 'none', punctual.latency(0.99)),
                      why='the core copies 64 KiB at a time and the capture processes share the '
                      'caches and the host; ' + common.disturbances(outcomes, key))
               for key, text in (('both', 'camera and sound'), ('mirrored', 'both, mirrored'))]
    plot = Plot('capture', 'How late a 1 kHz task of the core is', 'latency, us',
                'part of the calls that is later',
                [tail(run.label, np.concatenate(
                    [punctual.timing_of(o).latencies for o in outcomes.measured(key)]), 1e3)
                 for key, run in outcomes.runs.items() if outcomes.measured(key)],
                'The closer the curves, the less capturing reaches the core.', True, True)
    rows = [outcomes.row(key, _METRICS) for key in outcomes.runs]
    return CaseResult(CASE.name, CASE.title, (
        Table('The core while a camera and a microphone are captured', _COLUMNS, rows, _NOTES),),
        targets, (plot,))


CASE = Case('capture', 'the core beside a camera and a microphone', _plan, _evaluate)
