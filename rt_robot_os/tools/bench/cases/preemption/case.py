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

"""The case `preemption`: how late a task runs while a less important one computes."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.tools.bench import facts
from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.case import FIFO_PRIORITY
from rt_robot_os.tools.bench.case import LAST_CPU
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import PURE
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.case import UNPINNED
from rt_robot_os.tools.bench.cases import common
from rt_robot_os.tools.bench.plot import histogram
from rt_robot_os.tools.bench.plot import Plot
from rt_robot_os.tools.bench.plot import tail
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Column
from rt_robot_os.tools.bench.result import Requirement
from rt_robot_os.tools.bench.result import Row
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.result import Target
from rt_robot_os.tools.bench.stats import inside_any
from rt_robot_os.tools.bench.stats import percentile
from rt_robot_os.tools.bench.stats import Timing
from rt_robot_os.tools.bench.stats import timing

PERIOD_NS = NS_PER_MS
BUSY_NS = 20 * NS_PER_MS
BUSY_PERIOD_NS = 100 * NS_PER_MS
_WARMUP_NS = NS_PER_S // 2
_START_S = 1.0
_FLOOR_RATIO = 1.5
# An interpreter looks for signals between two bytecodes, and in native code it does not: the floor
# of a task that interrupts another one is a bare signal handler, not another process.
_PEER_RATIO, _ANY_PEER_RATIO = 100.0, 10.0
_MIDDLE_PERIOD_NS = 5 * NS_PER_MS
_MIDDLE_BUSY_NS = NS_PER_MS
_REQUIRED_US = 100.0
_REQUIRED_NATIVE_US = 1000.0
_PURE_KEY = common.key_of('kernel', PURE)
_KERNELS = ('kernel', _PURE_KEY)
_HANDLER = 'floor handler'

_SUBJECTS = f'{__package__}.subjects'
_PEERS = f'{__package__}.peers'
_LATENCY = (
    Column('p50', 'p50', 'us', 'latency'), Column('p99', 'p99', 'us', 'latency'),
    Column('p99', 'p99 range', 'us', 'latency', spread=True),
    Column('p999', 'p99.9', 'us', 'latency'), Column('maximum', 'max', 'us', 'latency'))
_COLUMNS = (
    *_LATENCY, Column('interval_p99', 'p99', 'us', 'interval'),
    Column('calls_part', 'of due', '%', 'calls'))
_LEVEL_COLUMNS = (*_LATENCY, Column('calls_part', 'of due', '%', 'calls'),
                  Column('charged', 'native', 'us', 'charged'))
_NOTES = (
    '1 kHz task; a less important one computes 20 ms of plain Python every 100 ms. Latency: from',
    'the release on the 1 ms grid to the first line of the task; a call that is 20 ms late has 20',
    'ms. Of due: calls there were, of those there should have been. One CPU, SCHED_FIFO, but',
    'where a row says otherwise (HORUS computes in its thread pool, on any CPU). clock_nanosleep:',
    'one thread that does nothing else; what computes beside it is a process without SCHED_FIFO',
    "on the same CPU: as much as the others' task (20 %), or always. 'Into the computation': the",
    'releases that fell into it. Signal handler: setitimer, and a function of Python that it',
    'calls in the midst of the same computation; no interpreter can do it sooner, however it is',
    'asked. With a switch interval of 0.1 ms threads hand over 50 times sooner: that row is to be',
    'a tenth as good. The kernel: in the build that this machine has, and once more in pure',
    'Python. Range: lowest and highest of the repeats; the other figures are their medians.',
)
_LEVEL_NOTES = (
    'Three levels: the 1 kHz task over a 200 Hz task that computes 1 ms over the one of 20 ms.',
    'Native call: the 20 ms are one single call of native code, a sum(). No bytecode',
    'ends in it, so that nothing in the same interpreter can preempt it; the kernel charges the',
    'delay to the task that made the call. Work like that belongs into another process.',
)


def _plan(options: BenchOptions) -> Sequence[Run]:
    common_arguments = {
        'period_ns': PERIOD_NS, 'busy_ns': BUSY_NS, 'busy_period_ns': BUSY_PERIOD_NS,
        'middle_period_ns': 0, 'middle_busy_ns': _MIDDLE_BUSY_NS, 'native': 0,
        'switch_interval_s': 0.0, 'warmup_ns': _WARMUP_NS,
        'measure_ns': options.measure_ns}
    seconds = options.seconds + _WARMUP_NS / NS_PER_S + common.START_S

    def run(key: str, label: str, subject: str, arguments: Mapping[str, Any], cpu: int = LAST_CPU,
            priority: int = FIFO_PRIORITY) -> Run:
        return Run(key, label, subject, {**common_arguments, **arguments}, seconds, cpu, priority)

    def peer(key: str, label: str, executor: str, arguments: Mapping[str, Any],
             **more: int) -> Run:
        return run(key, label, f'{_PEERS}:executor', {'executor': executor, **arguments}, **more)

    free: Mapping[str, int] = {'cpu': UNPINNED, 'priority': 0}
    levels: Mapping[str, Any] = {'middle_period_ns': _MIDDLE_PERIOD_NS}
    native: Mapping[str, Any] = {'native': 1}
    return (
        run('floor none', 'clock_nanosleep, CPU idle', f'{_SUBJECTS}:floor', {'load': 'none'}),
        run('floor same', 'clock_nanosleep, CPU busy 20 %', f'{_SUBJECTS}:floor',
            {'load': 'same'}),
        run('floor always', 'clock_nanosleep, CPU busy', f'{_SUBJECTS}:floor', {'load': 'always'}),
        run(_HANDLER, 'bare signal handler of Python', f'{_SUBJECTS}:handler', {}),
        run('kernel', common.KERNEL_LABEL, f'{_SUBJECTS}:kernel', {}),
        *(() if options.quick else (replace(
            run(_PURE_KEY, f'{common.KERNEL_LABEL}, {common.BUILD_LABELS[PURE]}',
                f'{_SUBJECTS}:kernel', {}), build=PURE),)),
        *(peer(name, common.RCLPY_LABELS[name], name, {}) for name in common.rclpy(options)),
        *(() if options.quick else (
            peer('multi free', '  Multi, all CPUs, no FIFO', 'multi', {}, **free),
            peer('multi free tuned', '  the same, switch interval 0.1 ms', 'multi',
                 {'switch_interval_s': 1e-4}, **free))),
        run('threads', common.THREADS_LABEL, f'{_SUBJECTS}:threads', {}),
        run('horus', common.HORUS_LABEL, f'{__package__}.horus:nodes', {}, cpu=UNPINNED),
        run('levels kernel', 'rt_robot_os, three levels', f'{_SUBJECTS}:kernel', levels),
        *(() if options.quick else (
            peer('levels events', 'rclpy Events, three levels', 'events', levels),
            run('levels threads', 'Python threads, three levels', f'{_SUBJECTS}:threads',
                levels),)),
        run('native kernel', 'rt_robot_os, native call', f'{_SUBJECTS}:kernel', native),
        *(() if options.quick else (
            peer('native events', 'rclpy Events, native call', 'events', native),)),
    )


def _timing(outcome: RunOutcome, name: str = 'starts', period_ns: int = PERIOD_NS) -> Timing:
    begin_ns = int(outcome.figures['begin_ns'])
    return timing(outcome.samples[name], int(outcome.figures['phase_ns']), period_ns, begin_ns,
                  begin_ns + int(outcome.figures['measure_ns']))


def _latency(part: float, into_computation: bool = False) -> common.Of:
    def of(outcome: RunOutcome) -> float | None:
        measured = _timing(outcome)
        latencies = measured.latencies
        if into_computation:
            latencies = latencies[inside_any(measured.releases, outcome.samples['busy_begins'],
                                             outcome.samples['busy_ends'])]
        value = percentile(latencies, part)
        return None if value is None else value / NS_PER_US

    return of


def _middle_latency(part: float) -> common.Of:
    def of(outcome: RunOutcome) -> float | None:
        value = percentile(_timing(outcome, 'middle_starts', _MIDDLE_PERIOD_NS).latencies, part)
        return None if value is None else value / NS_PER_US

    return of


def _interval(outcome: RunOutcome) -> float | None:
    value = percentile(_timing(outcome).intervals, 0.99)
    return None if value is None else value / NS_PER_US


def _calls(outcome: RunOutcome) -> float:
    measured = _timing(outcome)
    return 100.0 * measured.calls / measured.expected


_PARTS = (('p50', 0.5), ('p99', 0.99), ('p999', 0.999), ('maximum', 1.0))


def _metrics(into_computation: bool = False) -> dict[str, common.Of]:
    latencies = {name: _latency(part, into_computation) for name, part in _PARTS}
    return latencies if into_computation else {
        **latencies, 'interval_p99': _interval, 'calls_part': _calls}


def _evaluate(options: BenchOptions, outcomes: Outcomes) -> CaseResult:
    rows: list[Row] = []
    levels: list[Row] = []
    for key in outcomes.runs:
        if key.startswith(('levels', 'native')):
            levels += _level_rows(outcomes, key)
            continue
        rows.append(outcomes.row(key, _metrics()))
        if key in (*_KERNELS, _HANDLER) and outcomes.measured(key):
            pure = f', {common.BUILD_LABELS[PURE]}' if key == _PURE_KEY else ''
            rows.append(outcomes.row(key, _metrics(True), f'  into the computation{pure}'))
    why = common.disturbances(outcomes, 'kernel')
    all_rclpy = (*common.RCLPY, 'multi free', 'multi free tuned')
    targets = (
        Target('p99 / that of clock_nanosleep, CPU busy 20 %', _FLOOR_RATIO,
               outcomes.ratio('kernel', 'floor same', _latency(0.99)), why=why),
        Target('p99 in the computation / of a bare handler', _FLOOR_RATIO,
               outcomes.ratio('kernel', _HANDLER, _latency(0.99, True)), why=why),
        Target('p99 of the best rclpy executor / of the kernel', _PEER_RATIO,
               common.best_ratio(outcomes, common.RCLPY, 'kernel', _latency(0.99)), at_most=False,
               why=why),
        Target('p99 of the best rclpy row of all / of the kernel', _ANY_PEER_RATIO,
               common.best_ratio(outcomes, all_rclpy, 'kernel', _latency(0.99)), at_most=False,
               why='a switch interval of 0.1 ms makes the threads of rclpy hand over sooner; the '
               f'kernel cannot be earlier than the floor of the machine; {why}'),
    )
    requirements = (
        Requirement('1 kHz task at most 100 us late (p99) while another computes 20 ms of Python',
                    _REQUIRED_US, 'us', {
                        **common.systems(outcomes, _latency(0.99)),
                        'best rclpy': common.best(outcomes, all_rclpy, _latency(0.99))},
                    case=CASE.name),
        Requirement('1 kHz task at most 1 ms late (p99) while another is in native code for 20 ms',
                    _REQUIRED_NATIVE_US, 'us', {
                        'rt_robot_os': outcomes.metric('native kernel', _latency(0.99)),
                        'best rclpy': outcomes.metric('native events', _latency(0.99))},
                    case=CASE.name))
    return CaseResult(
        CASE.name, CASE.title,
        (Table('', _COLUMNS, rows, _NOTES),
         Table('Three levels, and native code', _LEVEL_COLUMNS, levels, _LEVEL_NOTES)), targets,
        (_intervals_plot(outcomes), *_tails_plots(outcomes)), requirements,
        {facts.PREEMPTING_P99: outcomes.metric('kernel', _latency(0.99)),
         facts.LOADED_LATE_P99: outcomes.metric('floor same', _latency(0.99))})


def _level_rows(outcomes: Outcomes, key: str) -> list[Row]:
    fast = {name: of for name, of in _metrics().items() if name != 'interval_p99'}
    if not key.startswith('levels') or not outcomes.measured(key):
        return [outcomes.row(key, {**fast, 'charged': common.figure('charged_ns', 1e3)})]
    return [outcomes.row(key, fast, f'{outcomes.runs[key].label}: 1 kHz'),
            outcomes.row(key, {name: _middle_latency(part) for name, part in _PARTS},
                         '  200 Hz')]


def _intervals_plot(outcomes: Outcomes) -> Plot:
    series = []
    for key, label in (('events', 'rclpy EventsExecutor'), ('kernel', 'rt_robot_os')):
        intervals = [_timing(outcome).intervals for outcome in outcomes.measured(key)]
        if intervals:
            series.append(histogram(label, np.concatenate(intervals), NS_PER_MS, 0.1, 30))
    return Plot('interval', 'A 1 kHz task beside one that computes 20 ms every 100 ms',
                'time from one call to the next, ms', 'part of all calls, %', series,
                'Each call should come 1 ms after the one before: the closer to 1 ms the better. '
                'Bars at 20 ms are calls that waited for the computation. All repeats together.',
                True, True)


def _tails_plots(outcomes: Outcomes) -> tuple[Plot, ...]:
    floors, peers = [], []
    for key, run in outcomes.runs.items():
        latencies = [_timing(outcome).latencies for outcome in outcomes.measured(key)]
        if latencies and not key.startswith(('levels', 'native', 'multi free')):
            curve = tail(run.label, np.concatenate(latencies), NS_PER_US)
            if key.startswith('floor') or key in _KERNELS:
                floors.append(curve)
            if not key.startswith('floor'):
                peers.append(curve)
    caption = 'Further left and lower is better: where a curve crosses 1 % is its p99.'
    return tuple(
        Plot(name, title, 'latency, us', 'part of the calls that is later', series, caption, True,
             True)
        for name, title, series in (
            ('latency', 'How late the 1 kHz task is, beside what the machine can do', floors),
            ('latency-peers', 'How late the 1 kHz task is in each system', peers)))


CASE = Case('preemption', 'a 1 kHz task over one that computes: latency and jitter', _plan,
            _evaluate, docs_repeats=3)
