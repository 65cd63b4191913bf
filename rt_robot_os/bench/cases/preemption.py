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

from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from typing import Any

from rt_robot_os.bench.case import Case
from rt_robot_os.bench.case import Options
from rt_robot_os.bench.case import Outcome
from rt_robot_os.bench.case import Outcomes
from rt_robot_os.bench.case import Run
from rt_robot_os.bench.case import UNPINNED
from rt_robot_os.bench.result import Aim
from rt_robot_os.bench.result import CaseResult
from rt_robot_os.bench.result import Column
from rt_robot_os.bench.result import Metric
from rt_robot_os.bench.result import Row
from rt_robot_os.bench.result import Table
from rt_robot_os.bench.stats import inside_any
from rt_robot_os.bench.stats import percentile
from rt_robot_os.bench.stats import Timing
from rt_robot_os.bench.stats import timing
from rt_robot_os.units import NS_PER_MS
from rt_robot_os.units import NS_PER_S
from rt_robot_os.units import NS_PER_US

PERIOD_NS = NS_PER_MS
BUSY_NS = 20 * NS_PER_MS
BUSY_PERIOD_NS = 100 * NS_PER_MS
_WARMUP_NS = NS_PER_S // 2
_START_S = 1.0
_FLOOR_RATIO = 1.3
_PEER_RATIO = 100.0

_WORKERS = 'rt_robot_os.bench.workers.preemption'
_PEERS = 'rt_robot_os.bench.peers.preemption'
_RCLPY = ('single', 'multi', 'events')
_COLUMNS = (
    Column('p50', 'p50', 'us', 'latency'), Column('p99', 'p99', 'us', 'latency'),
    Column('p99', 'p99 range', 'us', 'latency', spread=True),
    Column('p999', 'p99.9', 'us', 'latency'), Column('maximum', 'max', 'us', 'latency'),
    Column('interval_p99', 'p99', 'us', 'interval'), Column('calls_part', 'of due', '%', 'calls'))
_NOTES = (
    '1 kHz task; a less important one computes 20 ms of plain Python every 100 ms. Latency: from',
    'the release on the 1 ms grid to the first line of the task; a call that is 20 ms late has',
    '20 ms. All on one CPU under SCHED_FIFO. clock_nanosleep is one thread that does nothing',
    'else; what computes beside it is a process without SCHED_FIFO on the same CPU: as much as',
    "the others' task (20 %), or always. 'Into the computation': releases that fell into it.",
    'Range: lowest and highest of the repeats; the other figures are their medians.',
)


def _plan(options: Options) -> Sequence[Run]:
    common = {'period_ns': PERIOD_NS, 'busy_ns': BUSY_NS, 'busy_period_ns': BUSY_PERIOD_NS,
              'warmup_ns': _WARMUP_NS, 'measure_ns': round(options.seconds * NS_PER_S)}
    seconds = options.seconds + _WARMUP_NS / NS_PER_S + _START_S

    def run(key: str, label: str, worker: str, arguments: Mapping[str, Any], **more: int) -> Run:
        return Run(key, label, worker, {**common, **arguments}, seconds, **more)

    def peer(name: str, label: str, switch_s: float = 0.0, **more: int) -> Run:
        return run(f'{name}{"" if not more else " free"}{" tuned" if switch_s else ""}', label,
                   f'{_PEERS}:executor', {'executor': name, 'switch_interval_s': switch_s}, **more)

    return (
        run('floor none', 'clock_nanosleep, CPU idle', f'{_WORKERS}:floor', {'load': 'none'}),
        run('floor same', 'clock_nanosleep, CPU busy 20 %', f'{_WORKERS}:floor', {'load': 'same'}),
        run('floor always', 'clock_nanosleep, CPU busy', f'{_WORKERS}:floor', {'load': 'always'}),
        run('kernel', 'rt_robot_os kernel', f'{_WORKERS}:kernel', {}),
        peer('single', 'rclpy SingleThreadedExecutor'),
        peer('multi', 'rclpy MultiThreadedExecutor'),
        peer('events', 'rclpy EventsExecutor'),
        peer('multi', '  Multi, all CPUs, no FIFO', cpu=UNPINNED, priority=0),
        peer('multi', '  the same, switch interval 0.1 ms', 1e-4, cpu=UNPINNED, priority=0),
    )


def _timing(outcome: Outcome) -> Timing:
    begin_ns = int(outcome.figures['begin_ns'])
    return timing(outcome.samples['starts'], int(outcome.figures['phase_ns']), PERIOD_NS, begin_ns,
                  begin_ns + int(outcome.figures['measure_ns']))


def _latency(part: float, into_computation: bool = False) -> Callable[[Outcome], float | None]:
    def of(outcome: Outcome) -> float | None:
        measured = _timing(outcome)
        latencies = measured.latencies
        if into_computation:
            latencies = latencies[inside_any(measured.releases, outcome.samples['busy_begins'],
                                             outcome.samples['busy_ends'])]
        value = percentile(latencies, part)
        return None if value is None else value / NS_PER_US

    return of


def _interval(outcome: Outcome) -> float | None:
    value = percentile(_timing(outcome).intervals, 0.99)
    return None if value is None else value / NS_PER_US


def _calls(outcome: Outcome) -> float:
    measured = _timing(outcome)
    return 100.0 * measured.calls / measured.expected


def _metrics(into_computation: bool = False) -> dict[str, Callable[[Outcome], float | None]]:
    latencies = {name: _latency(part, into_computation) for name, part in (
        ('p50', 0.5), ('p99', 0.99), ('p999', 0.999), ('maximum', 1.0))}
    return latencies if into_computation else {
        **latencies, 'interval_p99': _interval, 'calls_part': _calls}


def _evaluate(options: Options, outcomes: Outcomes) -> CaseResult:
    rows: list[Row] = []
    for key in outcomes.runs:
        rows.append(outcomes.row(key, _metrics()))
        if key == 'kernel' and outcomes.measured(key):
            rows.append(outcomes.row(key, _metrics(True), '  into the computation'))
    aims = (
        Aim('p99 / p99 of clock_nanosleep, CPU busy 20 %', _FLOOR_RATIO,
            outcomes.ratio('kernel', 'floor same', _latency(0.99))),
        Aim('p99 into the computation / the same, CPU busy', _FLOOR_RATIO,
            _into_computation_ratio(outcomes)),
        Aim('p99: times less than the best rclpy executor', _PEER_RATIO,
            _best_peer(outcomes, _RCLPY), at_most=False),
        Aim('... than the best of all rclpy rows', _PEER_RATIO,
            _best_peer(outcomes, [key for key in outcomes.runs if key.startswith(_RCLPY)]),
            at_most=False),
    )
    return CaseResult(CASE.name, CASE.title, (Table('', _COLUMNS, rows, _NOTES),), aims)


def _into_computation_ratio(outcomes: Outcomes) -> Metric | None:
    def of(outcome: Outcome) -> float | None:
        return _latency(0.99, len(outcome.samples['busy_begins']) > 0)(outcome)

    return outcomes.ratio('kernel', 'floor always', of)


def _best_peer(outcomes: Outcomes, keys: Sequence[str]) -> Metric | None:
    """Compare with the peer that is best in the median, not with a different one each repeat."""
    ratios = [ratio for key in keys
              if (ratio := outcomes.ratio(key, 'kernel', _latency(0.99))) is not None]
    return min(ratios, key=lambda ratio: ratio.median, default=None)


CASE = Case('preemption', 'a 1 kHz task over one that computes: latency and jitter', _plan,
            _evaluate)
