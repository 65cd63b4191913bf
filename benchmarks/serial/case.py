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

"""The case `serial` (paper 2, Fig. 10): from a serial wire to a consumer, under load."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.case import FIFO_PRIORITY
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.cases import common
from rt_robot_os.tools.bench.plot import Plot
from rt_robot_os.tools.bench.plot import Series
from rt_robot_os.tools.bench.plot import tail
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Column
from rt_robot_os.tools.bench.result import Requirement
from rt_robot_os.tools.bench.result import Row
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.result import Target

_INTERVAL_NS = 10 * NS_PER_MS
_INTERVAL_FULL_NS = 100 * NS_PER_MS
_FULL_S = 18.5
_REQUIRED_US = 1000.0
_PATHS = (('rt', 'rt_robot_os', 'realtime', FIFO_PRIORITY), ('plain', 'plain thread', 'plain', 0))

_COLUMNS = (
    Column('read50', 'p50', 'us', 'wire to reader'), Column('read99', 'p99', 'us',
                                                            'wire to reader'),
    Column('readmax', 'max', 'us', 'wire to reader'),
    Column('p50', 'p50', 'us', 'wire to consumer'), Column('p99', 'p99', 'us', 'wire to consumer'),
    Column('maximum', 'max', 'us', 'wire to consumer'),
    Column('arrived', 'of sent', '%', 'arrived'))
_NOTES = (
    'A simulated node sends a sine (magnitude 4, 180 samples a cycle) as frames of 11 bytes,',
    'byte by byte at 57,600 bps, over a pty (a serial line made of software): every 10 ms, in',
    '--full every 100 ms for a cycle of 18 s as in the paper. Delays count from the last byte of',
    'a frame. rt_robot_os: the reader is a task of the core that the port interrupts, the',
    'consumer another process without real time, at the link. Plain thread: the reader is a',
    'thread that blocks in read(), the consumer another thread of that ordinary process, by a',
    'queue: the shorter way. "Busy processes": other programs that compute all the time on the',
    'same CPU. "Busy inside": no other programs, but ten tasks of the core (ten threads of the',
    'process) of less importance compute 8 ms of every 97 ms each: what a robot program may do',
    'to its own serial ports. The consumer of the core has another CPU then. "Queues elsewhere":',
    'Linux hands serial bytes on by threads of its work queues, which wait behind what computes',
    'on their CPU; here they are kept off the CPU of the reader for the time, as the program',
    'doctor advises. The paper (Xenomai): 18 s for a cycle at any load, more without real time.')


def _loads(options: BenchOptions) -> Sequence[int]:
    return (0, 10) if options.quick else (0, 2, 5, 7, 10) if options.full else (0, 5, 10)


def _plan(options: BenchOptions) -> Sequence[Run]:
    interval_ns = _INTERVAL_FULL_NS if options.full else _INTERVAL_NS
    seconds = _FULL_S if options.full else max(1.4, options.seconds)

    def run(key: str, label: str, subject: str, priority: int, processes: int, inside: int,
            alone: bool = False) -> Run:
        return Run(key, label, f'{__package__}.subjects:{subject}', {
            'processes': processes, 'inside': inside, 'alone': alone, 'interval_ns': interval_ns,
            'measure_ns': round(seconds * NS_PER_S)}, 2.9 + seconds, priority=priority,
            once=options.full)

    runs = [run(f'{key} {count}', f'{label}, {count} busy processes', subject, priority, count, 0)
            for count in _loads(options) for key, label, subject, priority in _PATHS]
    for alone in (False,) if options.quick else (False, True):
        runs += [run(f'{key} {"alone" if alone else "inside"}',
                     f'{label}, 10 {"inside, queues elsewhere" if alone else "busy inside"}',
                     subject, priority, 0, 10, alone) for key, label, subject, priority in _PATHS]
    return runs


def _evaluate(options: BenchOptions, outcomes: Outcomes) -> CaseResult:
    read, consumed = common.tails_of('decoded_ns'), common.tails_of('consumed_ns')
    rows: list[Row] = [outcomes.row(key, {
        'read50': read['p50'], 'read99': read['p99'], 'readmax': read['maximum'],
        'p50': consumed['p50'], 'p99': consumed['p99'], 'maximum': consumed['maximum'],
        'arrived': common.figure('arrived_percent')}) for key in outcomes.runs]
    targets = (
        Target('reader p99, 10 busy processes / none', 1.3,
               outcomes.ratio('rt 10', 'rt 0', read['p99']),
               why=_why(outcomes, 'rt 10')),
        Target('10 busy inside: p99 of the thread / of the task', 10.0,
               outcomes.ratio('plain inside', 'rt inside', read['p99']), at_most=False,
               why=_why(outcomes, 'rt inside')))
    requirements = [
        Requirement(f'a serial frame read within 1 ms (p99) while 10 tasks of the same program '
                    f'compute{what}', _REQUIRED_US, 'us', {
                        'rt_robot_os': outcomes.metric(f'rt {key}', read['p99']),
                        'threads': outcomes.metric(f'plain {key}', read['p99'])}, case=CASE.name)
        for key, what in (('inside', ''), ('alone', ", Linux's work queues kept off its CPU"))
        if f'rt {key}' in outcomes.runs]
    return CaseResult(CASE.name, CASE.title, (Table('', _COLUMNS, rows, _NOTES),), targets,
                      (_loads_plot(options, outcomes), _tails_plot(outcomes)), requirements)


def _why(outcomes: Outcomes, key: str) -> str:
    """Return whether Linux's threads that hand serial bytes on wait for the measured CPU."""
    here = outcomes.metric(key, common.figure('workers_here'))
    if here is not None and here.median > 0:
        return ('Linux hands serial bytes on by threads of its unbound work queues; they may run '
                'on the CPU of the core and wait there behind what computes. Remedy: keep them '
                'off it, such as `echo 1 > /sys/devices/virtual/workqueue/cpumask` for CPU 0 only')
    return common.disturbances(outcomes, key)


def _loads_plot(options: BenchOptions, outcomes: Outcomes) -> Plot:
    series = []
    for key, label, _, _ in _PATHS:
        for name, what in (('decoded_ns', 'reader'), ('consumed_ns', 'consumer')):
            known = [(count, metric.median) for count in _loads(options) if (
                metric := outcomes.metric(f'{key} {count}', common.part_of(name, 0.99)))]
            series.append(Series(f'{label}, {what}', [x for x, _ in known],
                                 [y for _, y in known], 'marks'))
    return Plot('load', 'Delay from the wire, p99, under load', 'busy processes on the same CPU',
                'delay, us', [s for s in series if s.x],
                'Lower is better. Corresponds to Fig. 10 of paper 2.', False, True,
                x_ticks=[(count, str(count)) for count in _loads(options)])


def _tails_plot(outcomes: Outcomes) -> Plot:
    series = []
    for key in ('rt 10', 'plain 10', 'rt inside', 'plain inside', 'rt alone', 'plain alone'):
        if key in outcomes.runs and outcomes.measured(key):
            series.append(tail(outcomes.runs[key].label, np.concatenate(
                [o.samples['decoded_ns'] for o in outcomes.measured(key)]), 1e3))
    return Plot('tail', 'Delay from the wire to the reader', 'delay, us',
                'part of the frames that is later', series, 'Further left and lower is better.',
                True, True)


CASE = Case('serial', 'from a serial wire to its reader and a consumer (paper 2, Fig. 10)', _plan,
            _evaluate)
