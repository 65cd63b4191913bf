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

"""What several cases share: ways to take figures out of outcomes, the peers, reasons."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import replace
import statistics

from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import BUILDS
from rt_robot_os.tools.bench.case import COMPILED
from rt_robot_os.tools.bench.case import FIFO_PRIORITY
from rt_robot_os.tools.bench.case import LAST_CPU
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import PURE
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.case import UNPINNED
from rt_robot_os.tools.bench.machine_state import explain
from rt_robot_os.tools.bench.machine_state import LOOP
from rt_robot_os.tools.bench.machine_state import NOTHING
from rt_robot_os.tools.bench.result import Column
from rt_robot_os.tools.bench.result import Metric
from rt_robot_os.tools.bench.result import Row
from rt_robot_os.tools.bench.stats import percentile

Of = Callable[[RunOutcome], 'float | None']

# Of one second's start: interpreter and NumPy; rclpy and its discovery on top.
START_S = 0.8
_SLOWER = 1.25
START_PEER_S = 1.6

RCLPY = ('single', 'multi', 'events')
# A first look leaves out the one that takes longest to start, and is none of the best.
_QUICK_RCLPY = ('single', 'events')
RCLPY_LABELS: Mapping[str, str] = {
    'single': 'rclpy SingleThreadedExecutor', 'multi': 'rclpy MultiThreadedExecutor',
    'events': 'rclpy EventsExecutor'}
# (CPU, priority): on one CPU under SCHED_FIFO the threads of the MultiThreadedExecutor starve
# each other; it gets what is best for it.
RCLPY_PLACES: Mapping[str, tuple[int, int]] = {
    'single': (LAST_CPU, FIFO_PRIORITY), 'multi': (UNPINNED, 0),
    'events': (LAST_CPU, FIFO_PRIORITY)}
HORUS_LABEL = 'HORUS'
THREADS_LABEL = 'Python threads'
KERNEL_LABEL = 'rt_robot_os kernel'
LOOP_LABEL = 'clock_nanosleep, plain loop'
BUILD_LABELS: Mapping[str, str] = {COMPILED: 'compiled', PURE: 'pure Python'}
RATIO_COLUMN = Column('ratio', 'of pure', '', 'p50')


def rclpy(options: BenchOptions) -> Sequence[str]:
    """Return which executors of rclpy are measured."""
    return _QUICK_RCLPY if options.quick else RCLPY


def cost_columns(group: str, spread: str = 'p50 range') -> tuple[Column, ...]:
    """Make the columns of a cost: the median of the samples, its spread, and two percentiles."""
    return (Column('p50', 'p50', 'us', group), Column('p50', spread, 'us', group, spread=True),
            Column('p10', 'p10', 'us', group), Column('p90', 'p90', 'us', group))


def part_of(sample: str, part: float, scale: float = 1e3) -> Of:
    """Take a percentile of a sample; 1.0 is the maximum."""
    def of(outcome: RunOutcome) -> float | None:
        values = outcome.samples.get(sample)
        value = None if values is None else percentile(values, part)
        return None if value is None else value / scale

    return of


def tails_of(sample: str, scale: float = 1e3) -> dict[str, Of]:
    """Take p50, p99, p99.9 and the maximum of a sample."""
    return {'p50': part_of(sample, 0.5, scale), 'p99': part_of(sample, 0.99, scale),
            'p999': part_of(sample, 0.999, scale), 'maximum': part_of(sample, 1.0, scale)}


def figure(name: str, scale: float = 1.0) -> Of:
    """Take a single number."""
    def of(outcome: RunOutcome) -> float | None:
        value = outcome.figures.get(name)
        return None if value is None else value / scale

    return of


def best(outcomes: Outcomes, keys: Sequence[str], of: Of, least: bool = True) -> Metric | None:
    """Return the metric of the run that is best in the median; None without any."""
    known = [metric for key in keys if key in outcomes.runs
             and (metric := outcomes.metric(key, of)) is not None]
    if not known:
        return None
    pick = min if least else max
    return pick(known, key=lambda metric: metric.median)


def best_ratio(outcomes: Outcomes, keys: Sequence[str], ours: str, of: Of) -> Metric | None:
    """Compare with the peer that is best in the median, not with a different one each repeat."""
    ratios = [ratio for key in keys if key in outcomes.runs
              if (ratio := outcomes.ratio(key, ours, of)) is not None]
    return min(ratios, key=lambda ratio: ratio.median, default=None)


def systems(outcomes: Outcomes, of: Of, ours: str = 'kernel', least: bool = True
            ) -> Mapping[str, Metric | None]:
    """Take a figure of each system that is compared."""
    def metric(key: str) -> Metric | None:
        return outcomes.metric(key, of) if key in outcomes.runs else None

    return {'rt_robot_os': metric(ours), 'best rclpy': best(outcomes, RCLPY, of, least),
            'HORUS': metric('horus'), 'threads': metric('threads')}


def key_of(key: str, build: str) -> str:
    """Return the key of a run that is measured in each build."""
    return f'{key} {build}'


def both_builds(*runs: Run) -> Sequence[Run]:
    """Let each run be measured in each build, one right after the other."""
    return tuple(replace(run, key=key_of(run.key, build), build=build,
                         label=f'{run.label}, {BUILD_LABELS[build]}')
                 for run in runs for build in BUILDS)


def ours(outcomes: Outcomes, key: str) -> str:
    """Return the key of the build that a user gets: the compiled one where it was measured."""
    compiled = key_of(key, COMPILED)
    return compiled if outcomes.measured(compiled) else key_of(key, PURE)


def build_ratio(outcomes: Outcomes, key: str, of: Of) -> Metric | None:
    """Divide a figure of the compiled build by that of pure Python, repeat by repeat."""
    return outcomes.ratio(key_of(key, COMPILED), key_of(key, PURE), of)


def build_rows(outcomes: Outcomes, key: str, label: str, of: Mapping[str, Of]) -> list[Row]:
    """
    Make a row for each build; the compiled one has the ratio of both.

    :param of: as for :meth:`Outcomes.row`; the ratio is that of ``p50``.
    """
    rows = [outcomes.row(key_of(key, build), of, f'{label}, {BUILD_LABELS[build]}')
            for build in BUILDS]
    if rows[0].metrics:
        rows[0] = with_metric(rows[0], 'ratio', build_ratio(outcomes, key, of['p50']))
    return rows


def with_metric(row: Row, name: str, metric: Metric | None) -> Row:
    """Return the row with a metric more."""
    return replace(row, metrics={**row.metrics, name: metric})


def _slower(outcomes: Outcomes, key: str) -> str:
    """Say that the CPU itself was slow, where a plain loop shows it."""
    paces = {name: [pace for outcome in outcomes.measured(name)
                    if (pace := outcome.figures.get(LOOP))] for name in outcomes.runs}
    if not paces.get(key):
        return ''
    factor = statistics.median(paces[key]) / min(min(some) for some in paces.values() if some)
    return '' if factor < _SLOWER else (
        f'even a plain Python loop ran {factor:.1f} times slower beside it than in the best '
        'process of this case: the CPU gave less, as the host of a virtual machine decides')


def disturbances(outcomes: Outcomes, key: str) -> str:
    """Return what disturbed a run, as far as its counters show; the last of the repeats."""
    refused = [step for outcome in outcomes.measured(key)
               for step, in_force, _ in outcome.realtime if not in_force and 'FIFO' in step]
    if refused:
        return f'{refused[0]} was refused: every other process of the machine can delay it'
    if not any('env waited_ms' in outcome.figures for outcome in outcomes.measured(key)):
        return 'not known: what else happened was not counted (the run did not end by itself)'
    slow = _slower(outcomes, key)
    if slow:
        return slow
    found = [text for outcome in outcomes.measured(key) if (text := explain(outcome.figures))]
    return found[-1] if found else NOTHING
