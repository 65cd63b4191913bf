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

"""The case `delay` (paper 1, test 2): how long after publishing a subscriber has the message."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence

from benchmarks.delay.subjects import DELAY
from benchmarks.delay.subjects import key as variant
from benchmarks.delay.subjects import SLEEPING
from benchmarks.delay.subjects import SMALL_BYTES
from benchmarks.delay.subjects import WAITING
from benchmarks.delay.subjects import WARM
import numpy as np

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.tools.bench import facts
from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import BUILDS
from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.case import COMPILED
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.case import UNPINNED
from rt_robot_os.tools.bench.cases import common
from rt_robot_os.tools.bench.plot import Plot
from rt_robot_os.tools.bench.plot import Series
from rt_robot_os.tools.bench.plot import tail
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Column
from rt_robot_os.tools.bench.result import Metric
from rt_robot_os.tools.bench.result import published_values
from rt_robot_os.tools.bench.result import Requirement
from rt_robot_os.tools.bench.result import Row
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.result import Target

PERIOD_NS = 2 * NS_PER_MS
SIZES = (64, 256, 1024, 2048, 64 * 1024, 1024 * 1024)
_PAPER_US = {2048: (31, 32), 1024: (30, 30), 256: (29, 32), 64: (31, 32)}
_WARMUP_NS, _TURN_WARMUP_NS = NS_PER_S // 10, NS_PER_S // 20
# Each run has many variants; a quarter of the time is enough for each.
_SHARE = 4
_REQUIRED_US = 10.0

_COLUMNS = (
    Column('p50', 'p50', 'us', 'delay'), Column('p50', 'p50 range', 'us', 'delay', spread=True),
    Column('p99', 'p99', 'us', 'delay'), Column('p999', 'p99.9', 'us', 'delay'),
    Column('maximum', 'max', 'us', 'delay'), Column('arrived', 'of due', '%', 'arrived'))
_NOTES = (
    'A 500 Hz task stamps and publishes a UInt8MultiArray of this size (as CDR); a more important',
    'task, released by the publication, takes it and stamps. With several subscribers: until the',
    'last one has it. rclpy: timer, publisher and subscriptions in one process. Threads: bytes in',
    'a queue.SimpleQueue for each. HORUS: a dictionary with a string of this size; it has no room',
    'for more than 4 KB, and gives a message to one of several nodes. The same CPU, SCHED_FIFO',
    '(MultiThreadedExecutor, HORUS: all CPUs). The paper: averages, the largest of them as max.')
_BUILD_COLUMNS = (
    Column('p50', 'p50', 'us', 'delay'), Column('p50', 'p50 range', 'us', 'delay', spread=True),
    Column('p99', 'p99', 'us', 'delay'), Column('maximum', 'max', 'us', 'delay'),
    common.RATIO_COLUMN)
_BUILD_NOTES = (
    'Messages of 64 B every 2 ms. Bare loop: publish, take and note in Python, without a kernel,',
    'after 2 ms of sleep: what the caches cost, which are cold then; or after 2 ms of waiting',
    'awake. Fifth in a row: four other messages just before it warmed the caches. Targets are',
    'ratios: how cold the caches of an idle CPU are is decided by the machine, and differs by the',
    'factor of ten from run to run; the loop that sleeps as long has the same.')
_BUILD_ROWS = ((DELAY, 'from task to task'), (SLEEPING, 'bare loop that sleeps'),
               (WARM, 'from task to task, fifth in a row'),
               (WAITING, 'bare loop that never sleeps'))
# Of a larger message: of one of 64 B. The delay itself is compared with a bare loop: what the
# caches cost after 2 ms, the machine decides.
_SIZE_RATIO = 1.5
_BUILD_RATIO, _BARE_RATIO = 0.5, 1.5
_P50 = {sample: common.part_of(sample, 0.5) for sample, _ in _BUILD_ROWS}


def _variants(options: BenchOptions) -> Sequence[tuple[int, int]]:
    if options.quick:
        return (*((size, 1) for size in SIZES), (64, 4))
    numbers = (1, 4, 16) if options.full else (1, 4)
    return tuple((size, count) for count in numbers for size in SIZES
                 if count == 1 or size in (64, 2048, 64 * 1024))


def _plan(options: BenchOptions) -> Sequence[Run]:
    measure_ns = round(options.seconds * NS_PER_S / _SHARE)
    variants = _variants(options)
    seconds = len(variants) * (_WARMUP_NS + measure_ns) / NS_PER_S
    # Of single figures that targets compare: more of them.
    turns_ns = 2 * measure_ns
    turns_s = 4 * (2 * _TURN_WARMUP_NS + turns_ns) / NS_PER_S
    arguments = {'variants': variants, 'period_ns': PERIOD_NS, 'warmup_ns': _WARMUP_NS,
                 'measure_ns': measure_ns}

    def peer(name: str) -> Run:
        return Run(name, common.RCLPY_LABELS[name], f'{__package__}.peers:executor',
                   {**arguments, 'executor': name}, common.START_PEER_S + seconds * 1.1,
                   *common.RCLPY_PLACES[name])

    return (
        Run('kernel', 'rt_robot_os topic', f'{__package__}.subjects:kernel',
            arguments,
            common.START_S + seconds),
        *(peer(name) for name in common.rclpy(options)),
        Run('threads', 'Python threads, SimpleQueue',
            f'{__package__}.threads:delay',
            arguments, common.START_S + seconds),
        *common.both_builds(
            Run('turns', 'a small message', f'{__package__}.subjects:cold_and_warm',
                {**arguments, 'warmup_ns': _TURN_WARMUP_NS, 'measure_ns': turns_ns},
                common.START_S + turns_s)),
        Run('horus', common.HORUS_LABEL, f'{__package__}.horus:delay', arguments,
            common.START_S + seconds, UNPINNED))


def _arrived(name: str) -> common.Of:
    def of(outcome: RunOutcome) -> float | None:
        if name not in outcome.samples:
            return None
        return 100.0 * min(1.0, len(outcome.samples[name]) / outcome.figures['due'])

    return of


def size_text(size: int) -> str:
    """Write a number of bytes as people do."""
    for unit, factor in (('MB', 1 << 20), ('KB', 1 << 10)):
        if size >= 16 * 1024 and size >= factor:
            return f'{size // factor} {unit}'
    return f'{size} B'


def _evaluate(options: BenchOptions, outcomes: Outcomes) -> CaseResult:
    rows: list[Row] = []
    for size, subscribers in _variants(options):
        name = f'{size_text(size):>6}, {subscribers:>2} sub{"s" if subscribers > 1 else " "}'
        if subscribers == 1 and size in _PAPER_US:
            mean, most = _PAPER_US[size]
            rows.append(published_values(f'{name} paper', p50=mean, maximum=most))
        sample = variant(size, subscribers)
        rows += [outcomes.row(key, {**common.tails_of(sample), 'arrived': _arrived(sample)},
                              f'{name} {run.label}') for key, run in _systems(outcomes)]
    why = _why(outcomes)
    small = common.part_of(variant(SMALL_BYTES, 1), 0.5)
    targets = [Target(f'delay p50, {size_text(size)} / {SMALL_BYTES} B', _SIZE_RATIO,
                      outcomes.between('kernel', common.part_of(variant(size, 1), 0.5),
                                       'kernel', small),
                      why=why, paper=f'{_PAPER_US[size][0]} us for each')
               for size in SIZES if size in _PAPER_US and size > SMALL_BYTES]
    targets = [*_build_targets(outcomes, why), *targets]
    p50 = common.part_of(variant(64, 1), 0.5)
    requirements = (Requirement(
        'a message to another task of the program in 10 us, median', _REQUIRED_US, 'us',
        common.systems(outcomes, p50), case=CASE.name),)
    builds: list[Row] = []
    for sample, label in _BUILD_ROWS:
        builds += common.build_rows(outcomes, 'turns', label, common.tails_of(sample))
    return CaseResult(
        CASE.name, CASE.title,
        (Table('', _COLUMNS, rows, _NOTES),
         Table('Compiled and in pure Python, beside a bare loop', _BUILD_COLUMNS, builds,
               _BUILD_NOTES)),
        targets, (_sizes_plot(options, outcomes), _tails_plot(outcomes)), requirements,
        _facts(outcomes))


def _systems(outcomes: Outcomes) -> Sequence[tuple[str, Run]]:
    """Return the runs that are compared as systems, without those of one build."""
    return [(key, run) for key, run in outcomes.runs.items() if not run.build]


def _build_targets(outcomes: Outcomes, why: str) -> Sequence[Target]:
    key = common.key_of('turns', COMPILED)

    def over_bare(outcome: RunOutcome) -> float | None:
        above, below = _P50[DELAY](outcome), _P50[SLEEPING](outcome)
        return above / below if above and below else None

    return (Target('delay p50, 64 B, compiled / pure', _BUILD_RATIO,
                   common.build_ratio(outcomes, 'turns', _P50[DELAY]), why=why),
            Target('delay p50, 64 B, compiled / bare loop', _BARE_RATIO,
                   outcomes.metric(key, over_bare), why=why))


def _facts(outcomes: Outcomes) -> Mapping[str, Metric | None]:
    return {facts.of_build(name, build):
            outcomes.metric(common.key_of('turns', build), _P50[sample])
            for build in BUILDS
            for name, sample in ((facts.DELAY, DELAY), (facts.BARE_DELAY, SLEEPING))}


def _why(outcomes: Outcomes) -> str:
    """Return what the delay is when the caches are warm: the rest is theirs."""
    warm, sleeping, waiting = (outcomes.metric(common.ours(outcomes, 'turns'), _P50[name])
                               for name in (WARM, SLEEPING, WAITING))
    told = '' if warm is None or sleeping is None or waiting is None else (
        f'the fifth of five messages in a row takes {warm.median:.1f} us: the rest is the caches '
        'of the CPU, cold after 2 ms. To publish and take in a bare loop, without any kernel, '
        f'takes {sleeping.median:.1f} us after 2 ms of sleep, and {waiting.median:.1f} us after '
        '2 ms of waiting awake; ')
    return told + common.disturbances(outcomes, 'kernel')


def _sizes_plot(options: BenchOptions, outcomes: Outcomes) -> Plot:
    series = [Series('paper', sorted(_PAPER_US), [_PAPER_US[size][0] for size in
                                                  sorted(_PAPER_US)], 'marks')]
    for key, run in _systems(outcomes):
        known = [(size, metric.median) for size in SIZES if (metric := outcomes.metric(
            key, common.part_of(variant(size, 1), 0.5))) is not None]
        if known:
            series.append(Series(run.label, [x for x, _ in known], [y for _, y in known],
                                 'marks'))
    return Plot('size', 'Delay of a message, one subscriber, p50', 'bytes', 'delay, us', series,
                'Lower is better.', True, True)


def _tails_plot(outcomes: Outcomes) -> Plot:
    name = variant(64, 1)
    series = [tail(run.label, np.concatenate([o.samples[name] for o in outcomes.measured(key)]),
                   1e3) for key, run in _systems(outcomes) if outcomes.measured(key)]
    return Plot('tail', 'Delay of a message of 64 B', 'delay, us',
                'part of the messages that is later', series,
                'Further left and lower is better.', True, True)


CASE = Case('delay', 'from publishing a message to a subscribed task that has it (test 2)', _plan,
            _evaluate, docs_repeats=5)
