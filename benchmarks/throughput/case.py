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

"""The case `throughput`: messages and bytes a second through a ring, beside memcpy."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.delay.case import size_text
from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.cases import common
from rt_robot_os.tools.bench.plot import Plot
from rt_robot_os.tools.bench.plot import Series
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Column
from rt_robot_os.tools.bench.result import published_values
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.result import Target
from rt_robot_os.tools.bench.stats import percentile

SIZES = (64, 256, 1024, 2048, 16 * 1024, 64 * 1024, 1024 * 1024)
_PAPER_BYTES_S = 2048.0
_COLUMNS = (
    Column('messages', 'messages', '1000/s', 'ring'), Column('bytes', 'payload', 'MB/s', 'ring'),
    Column('bytes', 'range', 'MB/s', 'ring', spread=True),
    Column('copy', 'payload', 'MB/s', 'memcpy'), Column('ratio', 'ratio', '', 'time over memcpy'))
_NOTES = (
    'One task writes the payload into the message, publishes, and takes it: three copies of the',
    'bytes. memcpy: one copy from a buffer to another by the same NumPy assignment, in turns of',
    '2 ms with the other. Medians of these turns. 16 slots of 1 MB do not fit into the cache, the',
    'two buffers of memcpy do. The paper states 2 K Bytes a second.')


def _plan(options: BenchOptions) -> Sequence[Run]:
    return (Run('rings', 'rings', f'{__package__}.subjects:rings',
                {'sizes': SIZES, 'measure_ns': options.measure_ns},
                common.START_S + options.seconds),)


def _time_ps(kind: str, size: int) -> common.Of:
    return lambda outcome: percentile(outcome.samples[f'{kind} {size}'], 0.5)


def _per_second(kind: str, size: int, amount: float) -> common.Of:
    def of(outcome: RunOutcome) -> float | None:
        taken = _time_ps(kind, size)(outcome)
        return None if taken is None else amount * 1e12 / taken

    return of


def _ratio(size: int) -> common.Of:
    def of(outcome: RunOutcome) -> float | None:
        ring, copy = _time_ps('ring', size)(outcome), _time_ps('copy', size)(outcome)
        return None if ring is None or copy is None else ring / copy

    return of


def _evaluate(options: BenchOptions, outcomes: Outcomes) -> CaseResult:
    rows = [published_values('paper (FreeRTOS on STM32F4)', bytes=_PAPER_BYTES_S / 1e6)]
    rows += [outcomes.row('rings', {
        'messages': _per_second('ring', size, 1e-3),
        'bytes': _per_second('ring', size, size / 1e6),
        'copy': _per_second('copy', size, size / 1e6), 'ratio': _ratio(size),
    }, f'rt_robot_os, {size_text(size)}') for size in SIZES]
    targets = (Target('64 KB: time / time of three memcpy', 2.0, outcomes.metric(
        'rings', lambda o: _third(_ratio(64 * 1024)(o))),
        why=common.disturbances(outcomes, 'rings')),)
    series = []
    for kind, label in (('ring', 'rt_robot_os'), ('copy', 'memcpy')):
        known = [(size, metric.median) for size in SIZES if (metric := outcomes.metric(
            'rings', _per_second(kind, size, size / 1e6))) is not None]
        series.append(Series(label, [x for x, _ in known], [y for _, y in known], 'marks'))
    plot = Plot('bytes', 'Payload through a ring', 'size of a message', 'payload, MB/s', series,
                'Higher is better. memcpy copies the bytes once, the way through a ring three '
                'times.', True, True,
                x_ticks=[(size, size_text(size)) for size in SIZES if size != 1024])
    return CaseResult(CASE.name, CASE.title, (Table('', _COLUMNS, rows, _NOTES),), targets,
                      (plot,))


def _third(ratio: float | None) -> float | None:
    return None if ratio is None else ratio / 3


CASE = Case('throughput', 'messages and bytes a second through a ring, beside memcpy', _plan,
            _evaluate, docs_repeats=3)
