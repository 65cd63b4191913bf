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

"""The case `delay`: how long after publishing a subscriber has the message."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence

from rt_robot_os.bench.case import Case
from rt_robot_os.bench.case import Options
from rt_robot_os.bench.case import Outcome
from rt_robot_os.bench.case import Outcomes
from rt_robot_os.bench.case import Run
from rt_robot_os.bench.result import Aim
from rt_robot_os.bench.result import CaseResult
from rt_robot_os.bench.result import Column
from rt_robot_os.bench.result import Table
from rt_robot_os.bench.stats import percentile
from rt_robot_os.bench.workers.delay import key as variant
from rt_robot_os.units import NS_PER_MS
from rt_robot_os.units import NS_PER_S
from rt_robot_os.units import NS_PER_US

PERIOD_NS = 2 * NS_PER_MS
SIZES = (64, 256, 1024, 2048)
SIZES_FULL = (*SIZES, 64 * 1024, 1024 * 1024)
SUBSCRIBERS = (1, 4)
_WARMUP_NS = NS_PER_S // 5
# Each run has many variants; a quarter of the time is enough for each.
_SHARE = 4
_START_S = 1.5
_LIMIT_US = 3.0

_RUNS = (
    ('kernel', 'rt_robot_os topic', 'rt_robot_os.bench.workers.delay:kernel', ''),
    ('events', 'rclpy EventsExecutor', 'rt_robot_os.bench.peers.delay:executor', 'events'),
    ('single', 'rclpy SingleThreadedExecutor', 'rt_robot_os.bench.peers.delay:executor', 'single'),
)
_COLUMNS = (
    Column('p50', 'p50', 'us', 'delay'), Column('p50', 'p50 range', 'us', 'delay', spread=True),
    Column('p99', 'p99', 'us', 'delay'), Column('p999', 'p99.9', 'us', 'delay'),
    Column('maximum', 'max', 'us', 'delay'), Column('arrived', 'of due', '%', 'arrived'))
_NOTES = (
    'A 500 Hz task stamps and publishes a UInt8MultiArray of this size (as CDR); a more important',
    'task, released by the publication, takes it and stamps. With 4 subscribers: until the last',
    'one has it. rclpy: timer, publisher and subscriptions in one process. The same CPU,',
    'SCHED_FIFO.')


def _sizes(options: Options) -> Sequence[int]:
    return SIZES_FULL if options.full else SIZES


def _plan(options: Options) -> Sequence[Run]:
    measure_ns = round(options.seconds * NS_PER_S / _SHARE)
    sizes = _sizes(options)
    seconds = _START_S + len(sizes) * len(SUBSCRIBERS) * (_WARMUP_NS + measure_ns) / NS_PER_S
    arguments = {'sizes': sizes, 'subscribers': SUBSCRIBERS, 'period_ns': PERIOD_NS,
                 'warmup_ns': _WARMUP_NS, 'measure_ns': measure_ns}
    return [Run(name, label, worker, {**arguments, 'executor': executor}, seconds)
            for name, label, worker, executor in _RUNS]


def _delay(size: int, subscribers: int, part: float) -> Callable[[Outcome], float | None]:
    def of(outcome: Outcome) -> float | None:
        value = percentile(outcome.samples[variant(size, subscribers)], part)
        return None if value is None else value / NS_PER_US

    return of


def _arrived(size: int, subscribers: int) -> Callable[[Outcome], float | None]:
    name = variant(size, subscribers)
    return lambda outcome: 100.0 * min(1.0, len(outcome.samples[name]) / outcome.figures['due'])


def size_text(size: int) -> str:
    """Write a number of bytes as people do."""
    for unit, factor in (('MB', 1 << 20), ('KB', 1 << 10)):
        if size >= 16 * 1024 and size >= factor:
            return f'{size // factor} {unit}'
    return f'{size} B'


def _evaluate(options: Options, outcomes: Outcomes) -> CaseResult:
    rows = []
    for subscribers in SUBSCRIBERS:
        for size in _sizes(options):
            for key in outcomes.runs:
                name = f'{size_text(size):>7}, {subscribers} sub{"s" if subscribers > 1 else " "}'
                rows.append(outcomes.row(key, {
                    **{column: _delay(size, subscribers, part) for column, part in (
                        ('p50', 0.5), ('p99', 0.99), ('p999', 0.999), ('maximum', 1.0))},
                    'arrived': _arrived(size, subscribers),
                }, f'{name} {outcomes.runs[key].label}'))
    aims = [Aim(f'delay p50, {size_text(size)}, 1 subscriber', _LIMIT_US,
                outcomes.metric('kernel', _delay(size, 1, 0.5)), 'us') for size in SIZES]
    return CaseResult(CASE.name, CASE.title, (Table('', _COLUMNS, rows, _NOTES),), aims)


CASE = Case('delay', 'from publishing a message to a subscribed task that has it', _plan,
            _evaluate)
