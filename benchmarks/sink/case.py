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

"""The case `sink`: from a node's last byte to the task of its importance (paper 2, Fig. 10)."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence

from benchmarks.sink.subjects import CYCLE
import numpy as np

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.case import FIFO_PRIORITY
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.cases import common
from rt_robot_os.tools.bench.plot import Plot
from rt_robot_os.tools.bench.plot import Series
from rt_robot_os.tools.bench.plot import tail
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Column
from rt_robot_os.tools.bench.result import published_values
from rt_robot_os.tools.bench.result import Requirement
from rt_robot_os.tools.bench.result import Row
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.result import Target

_SUBJECTS = __package__
# In --full the paper's 100 ms.
_INTERVAL_NS, _INTERVAL_FULL_NS = 10 * NS_PER_MS, 100 * NS_PER_MS
_HOUR_S = 3600
_QUICK_S = 60
# 20 alarms a second, and 99 of 100 takes some hundreds; in --full once and longer.
_SHORTEST_S, _FULL_S = 10.0, 30.0
_LIMIT_US = 1000.0
_RATIO = 1.3
_SAMPLE = 'delay_ns'
_LOADED = 10

_SINE_COLUMNS = (
    Column('cycle', 'median', 's', 'a cycle'), Column('error', 'of nominal', '%', 'longer'),
    Column('p50', 'p50', 'us', 'wire to task'), Column('p99', 'p99', 'us', 'wire to task'),
    Column('maximum', 'max', 'us', 'wire to task'), Column('arrived', 'of sent', '%', 'arrived'))
_SINE_NOTES = (
    'A base station on a pty sends a sine (180 values a cycle) as packets of the paper, DataMsg',
    'behind MultihopMsg in a TOS_Msg, byte by byte at 57,600 bps: every 10 ms, in --full every',
    '100 ms as in the paper, where a cycle takes 18.0 s. rt_robot_os: the device `sink` sorts the',
    'packet, a task with the priority of its class has the value. Loop: an ordinary program reads',
    'the port itself, sleeps a period and takes one value. "Computing": so many tasks of the core',
    'of the lowest priority, or threads, compute 8 ms of every 97 ms each. What is not through a',
    'cycle after four times its length is measured by the part that it did. The work queues by',
    'which Linux hands serial bytes on are left where they are. The paper (Xenomai): 18 s at any',
    'load, more without real time.')
_FLOOD_COLUMNS = (
    Column('p50', 'p50', 'us', 'last byte to task'),
    Column('p99', 'p99', 'us', 'last byte to task'),
    Column('maximum', 'max', 'us', 'last byte to task'),
    Column('arrived', 'of sent', '%', 'alarms'))
_FLOOD_NOTES = (
    'The same line without a pause between frames, some 155 a second, as a port at USB hands them',
    'over, every millisecond: readings of six nodes under SurgeTelos, of the lowest class, and',
    'one frame in eight is an alarm. Its delay counts from its last byte to the task that has it.',
    'rt_robot_os: sink, a task for each class, which decodes, and the computing ones, all in one',
    'core. Threads: a thread that waits for bytes decodes them and has the alarm. "Busy',
    'processes": other programs that compute on the CPU of the core. Linux hands serial bytes on',
    'by threads of its work queues, which wait behind what computes on their CPU; with computing',
    'tasks they are kept off it, as the program doctor advises.')
_HOST_COLUMNS = (
    Column('p50', 'p50', 'us', 'a frame'), Column('p90', 'p90', 'us', 'a frame'),
    Column('frames', 'sent', '', 'frames'), Column('lost', 'lost', '', 'frames'),
    Column('cpu', 'of a core', '%', 'CPU'))
_HOST_NOTES = (
    'Decoded whole: framing and every number of the packet. Sorted: framing, class, copies and',
    "the queue, which is the sink's part. At full line rate: 160 frames a second on simulated",
    'time, each in two pieces, with a task for each class that decodes; an hour, in --quick a',
    'minute. The CPU time is that of this process, the simulated clock included.')

_ARGUMENTS = {'busy': 0, 'processes': 0, 'alone': False, 'interval_ns': 0, 'measure_ns': 0,
              'more': 0, 'patience': 1.0, 'start_ns': NS_PER_S}
_RT = ('flood', 'rt_robot_os', 'subjects:realtime', FIFO_PRIORITY)
_THREADS = ('threads', 'threads', 'subjects:threads', 0)
_FLOODS: tuple[tuple[str, str, str, int, str, str, Mapping[str, float]], ...] = (
    (*_RT, '0', 'nothing computes', {}),
    (*_RT, 'processes', '10 busy processes', {'processes': _LOADED}),
    (*_RT, '10', '10 computing', {'busy': _LOADED, 'alone': True}),
    (*_THREADS, '0', 'nothing computes', {}),
    (*_THREADS, '10', '10 computing', {'busy': _LOADED}))
_QUICK_FLOODS = ('flood 0', 'flood 10', 'threads 10')


def _loads(options: BenchOptions) -> Sequence[int]:
    return (_LOADED,) if options.quick else (0, 5, 7, _LOADED)


def _plan(options: BenchOptions) -> Sequence[Run]:
    interval_ns = _INTERVAL_FULL_NS if options.full else _INTERVAL_NS
    more = 0 if options.full else 20
    seconds = options.seconds if options.quick else max(
        _FULL_S if options.full else _SHORTEST_S, options.seconds)

    def run(key: str, label: str, subject: str, priority: int, took_s: float,
            arguments: Mapping[str, float], once: bool = False) -> Run:
        return Run(key, label, f'{_SUBJECTS}.{subject}', {**_ARGUMENTS, **arguments}, 2.9 + took_s,
                   priority=priority, once=once)

    cycle_s = (CYCLE + 1 + more) * interval_ns / NS_PER_S
    flood = {'measure_ns': round(seconds * NS_PER_S)}
    count = 2000 if options.quick else 20_000
    hour_s = _QUICK_S if options.quick else _HOUR_S
    return [
        *(run(f'{key} {busy}', f'{label}, {busy} computing', subject, priority, took_s, {
            'busy': busy, 'interval_ns': interval_ns, 'more': more, 'patience': patience},
            options.full)
          for busy in _loads(options) for key, label, subject, priority, took_s, patience in (
              ('sine rt', 'rt_robot_os', 'subjects:realtime', FIFO_PRIORITY, cycle_s, 1.0),
              ('sine loop', 'loop', 'subjects:loop', 0, 2.0 * cycle_s, 4.0))),
        *(run(f'{key} {load}', f'{label}, {what}', subject, priority, seconds, {**flood, **more_},
              options.full)
          for key, label, subject, priority, load, what, more_ in _FLOODS
          if f'{key} {load}' in _QUICK_FLOODS or not options.quick),
        run('frames', 'a frame', 'host:frames', FIFO_PRIORITY, 0.5, {'count': count}),
        run('hour', 'at full line rate', 'host:hour', 0, hour_s / 60, {'seconds': hour_s},
            once=True)]


def _nominal_s(options: BenchOptions) -> float:
    return CYCLE * (_INTERVAL_FULL_NS if options.full else _INTERVAL_NS) / NS_PER_S


def _longer(options: BenchOptions) -> common.Of:
    nominal_s = _nominal_s(options)

    def of(outcome: RunOutcome) -> float | None:
        cycle_s = outcome.figures.get('cycle_s')
        return None if cycle_s is None else 100.0 * (cycle_s / nominal_s - 1.0)

    return of


def _off(options: BenchOptions) -> common.Of:
    longer = _longer(options)

    def of(outcome: RunOutcome) -> float | None:
        percent = longer(outcome)
        return None if percent is None else abs(percent)

    return of


def _evaluate(options: BenchOptions, outcomes: Outcomes) -> CaseResult:
    tails = common.tails_of(_SAMPLE)
    delays = {'p50': tails['p50'], 'p99': tails['p99'], 'maximum': tails['maximum'],
              'arrived': common.figure('arrived_percent')}
    sines: list[Row] = []
    if options.full:
        sines.append(published_values('paper (Xenomai), 0, 5 and 7 tasks', cycle=18.0))
    sines += [outcomes.row(key, {'cycle': common.figure('cycle_s'), 'error': _longer(options),
                                 **delays}) for key in outcomes.runs if key.startswith('sine')]
    floods: list[Row] = [outcomes.row(key, delays) for key in outcomes.runs
                         if key.startswith(('flood', 'threads'))]
    tables = (Table('A sine from a node (paper 2, Fig. 10)', _SINE_COLUMNS, sines, _SINE_NOTES),
              Table('Alarms in a flood', _FLOOD_COLUMNS, floods, _FLOOD_NOTES),
              Table('What packets cost the host', _HOST_COLUMNS, _host_rows(outcomes),
                    _HOST_NOTES))
    p99 = tails['p99']
    requirements = (Requirement(
        'an alarm of a sensor network handled within 1 ms (p99) in a flood of others, '
        'while the program computes', _LIMIT_US, 'us', {
            'rt_robot_os': outcomes.metric('flood 10', p99),
            'threads': outcomes.metric('threads 10', p99)}, case=CASE.name),)
    return CaseResult(CASE.name, CASE.title, tables, _targets(options, outcomes),
                      (_cycle_plot(options, outcomes), _flood_plot(outcomes)), requirements)


def _host_rows(outcomes: Outcomes) -> list[Row]:
    rows = [outcomes.row('frames', {'p50': common.part_of(sample, 0.5),
                                    'p90': common.part_of(sample, 0.9)}, label)
            for sample, label in (('decode_ns', 'decoded whole'), ('sort_ns', 'sorted'))]
    return [*rows, outcomes.row('hour', {
        'frames': common.figure('frames'), 'lost': common.figure('lost'),
        'cpu': common.figure('cpu_percent')})]


def _targets(options: BenchOptions, outcomes: Outcomes) -> Sequence[Target]:
    p99 = common.part_of(_SAMPLE, 0.99)
    loaded = f'sine rt {_LOADED}'
    why = common.disturbances(outcomes, 'flood 10')
    return (
        Target('alarm in a flood, 10 computing, p99', _LIMIT_US, outcomes.metric('flood 10', p99),
               'us', why=why),
        Target('the same, 10 computing / none', _RATIO,
               outcomes.ratio('flood 10', 'flood 0', p99), why=why),
        Target('the same, 10 busy processes / none', _RATIO,
               outcomes.ratio('flood processes', 'flood 0', p99),
               why=common.disturbances(outcomes, 'flood processes')),
        Target('cycle of the sine off nominal, 10 computing', 0.1,
               outcomes.metric(loaded, _off(options)), '%',
               why=common.disturbances(outcomes, loaded), paper='18 s at any load'),
        Target('a frame decoded whole, p50', 30.0,
               outcomes.metric('frames', common.part_of('decode_ns', 0.5)), 'us',
               why=common.disturbances(outcomes, 'frames')),
        Target('frames lost at full line rate', 0.0,
               outcomes.metric('hour', common.figure('lost'))),
        Target('CPU at full line rate', 5.0, outcomes.metric('hour', common.figure('cpu_percent')),
               '% of a core'))


def _cycle_plot(options: BenchOptions, outcomes: Outcomes) -> Plot:
    series = []
    for key, label in (('sine rt', 'rt_robot_os'), ('sine loop', 'loop')):
        known = [(count, metric.median) for count in _loads(options) if (
            metric := outcomes.metric(f'{key} {count}', common.figure('cycle_s')))]
        series.append(Series(label, [x for x, _ in known], [y for _, y in known], 'marks'))
    return Plot('cycle', 'Time of a cycle of the sine, under load', 'computing tasks or threads',
                'a cycle, s', [each for each in series if each.x],
                f'Nominal is {_nominal_s(options):g} s. Corresponds to Fig. 10 of paper 2.',
                y_from_zero=True, x_ticks=[(count, str(count)) for count in _loads(options)])


def _flood_plot(outcomes: Outcomes) -> Plot:
    series = [tail(outcomes.runs[key].label, np.concatenate(
        [o.samples[_SAMPLE] for o in outcomes.measured(key)]), 1e3)
        for key in outcomes.runs
        if key.startswith(('flood', 'threads')) and outcomes.measured(key)]
    return Plot('tail', 'From the last byte of an alarm to its task, in a flood', 'delay, us',
                'part of the alarms that is handled later', series,
                'Further left and lower is better.', True, True)


CASE = Case('sink', "from a node's last byte to the task of its importance (paper 2, Fig. 10)",
            _plan, _evaluate)
