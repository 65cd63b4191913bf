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

"""The case `mirror`: what it costs the core and the node to show a topic to ROS 2."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence

import numpy as np

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.cases import common
from rt_robot_os.tools.bench.cases import punctual
from rt_robot_os.tools.bench.cases.mirror import load_case as mirror_load
from rt_robot_os.tools.bench.cases.mirror.turns import STRETCH_NS
from rt_robot_os.tools.bench.plot import Plot
from rt_robot_os.tools.bench.plot import tail
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Column
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.result import Target
from rt_robot_os.tools.bench.stats import percentile

_RATE_HZ = 2000
_GATHER_MS = 5.0
# Between those that are drawn: the table has them.
_NOT_DRAWN = ('mirror 1', 'mirror 10')
_WARMUP_NS = 600 * NS_PER_MS
_START_S = 1.2
_CORE = f'{__package__}.subjects'
_NODE = f'{__package__}.peers:node'

_TOPICS, _TOPIC_RATE_HZ = 50, 100
_ISOLATION_WARMUP_NS = 1000 * NS_PER_MS
_ISOLATION_LIMIT = 1.1
_ISOLATION = f'{__package__}.isolation:core'

_ISOLATION_COLUMNS = (*punctual.COLUMNS, Column('sent', 'sent', '/s', 'mirrored'))
_ISOLATION_NOTES = (
    'A 1 kHz task in a core that publishes an Imu on each of 50 topics at 100 Hz; a ROS node on',
    'the other CPUs mirrors as many of them as the row says. Storm: participants with a publisher',
    'and a subscription each join and leave without pause. Stopped: the node gets SIGSTOP.')
_COLUMNS = common.cost_columns('CPU time')
_NOTES = (
    'One Imu (324 B). Core: 2 kHz, stretches of 0.25 s with and without, CPU time of the process;',
    'the difference is what mirroring costs, the dispatch of the link included. Samples go out',
    'together, here by eight: half of the ring. The client sleeps between two packets, on another',
    'CPU: sending wakes it. Bare socket: only that send for each sample, from a kernel task.',
    'Node: CPU time of the publishing thread, blocks of 100.')
_ROWS = (
    ('core', 'difference_ns', 'core: mirror to a client of the link'),
    ('single', 'difference_ns', '  with link_gather_ms 0: each immediately'),
    ('floor', 'difference_ns', '  a bare socket: send and wake'),
    ('core', 'without_ns', '  beside: publish without mirror, job'),
    ('node 0', 'carry_ns', 'node: stamp and publish raw'),
    ('node 0', 'build_ns', 'rclpy: build and publish an Imu'),
    ('node 1', 'carry_ns', 'node: raw, a subscriber listens'),
    ('node 1', 'build_ns', 'rclpy: build, a subscriber listens'),
)


def _plan(options: BenchOptions) -> Sequence[Run]:
    seconds = _START_S + _WARMUP_NS / NS_PER_S + options.seconds
    # Room for one pair of stretches after the first, which is never counted.
    measure_ns = max(options.measure_ns, 5 * STRETCH_NS)
    arguments = {'rate_hz': _RATE_HZ, 'warmup_ns': _WARMUP_NS, 'measure_ns': measure_ns}
    return (
        *_isolation_plan(options), *mirror_load.plan(options),
        *(Run(key, label, f'{_CORE}:core', {**arguments, 'gather_ms': gather_ms}, seconds)
          for key, label, gather_ms in (('core', 'core with a mirror', _GATHER_MS),
                                        ('single', 'core, nothing gathered', 0.0))
          if key == 'core' or not options.quick),
        *(() if options.quick else (
            Run('floor', 'bare socket', f'{_CORE}:floor', arguments, seconds),)),
        *(Run(f'node {count}', f'node, {count} subscribers', _NODE,
              {**arguments, 'subscribers': count}, seconds + count)
          for count in ((0,) if options.quick else (0, 1))),
    )


def _isolation_plan(options: BenchOptions) -> Sequence[Run]:
    seconds = common.START_PEER_S + 1.2 + _ISOLATION_WARMUP_NS / NS_PER_S + options.seconds

    def run(key: str, label: str, mirrored: int, storm: int = 0, stop: int = 0) -> Run:
        return Run(key, label, _ISOLATION, {
            'topics': _TOPICS, 'rate_hz': _TOPIC_RATE_HZ, 'mirrored': mirrored, 'storm': storm,
            'stop': stop, 'period_ns': punctual.PERIOD_NS, 'warmup_ns': _ISOLATION_WARMUP_NS,
            'measure_ns': options.measure_ns}, seconds + 2 * storm)

    counts = (0, 50) if options.quick else (0, 1, 10, 50)
    return (*(run(f'mirror {count}', f'{count} topics mirrored', count) for count in counts),
            run('storm', '50 mirrored, DDS storm', 50, storm=1),
            run('stop', '50 mirrored, node stopped', 50, stop=1))


_ISOLATION_METRICS: dict[str, common.Of] = {
    **punctual.METRICS,
    'sent': lambda outcome: outcome.figures['sent'] / (outcome.figures['measure_ns'] / NS_PER_S)}


def _isolation(outcomes: Outcomes) -> tuple[Table, Sequence[Target], Plot]:
    keys = [key for key in outcomes.runs if key in ('storm', 'stop') or key[:6] == 'mirror']
    rows = [outcomes.row(key, _ISOLATION_METRICS) for key in keys]
    targets = [Target(f'p99 with {text} / no topic mirrored', _ISOLATION_LIMIT,
                      outcomes.ratio(key, 'mirror 0', punctual.latency(0.99)),
                      why='sending is a task of the core: when a send is under way as an alarm '
                      'comes, the alarm waits for the end of the system call; '
                      + common.disturbances(outcomes, key))
               for key, text in (('mirror 50', '50 topics'), ('stop', 'the node stopped'))]
    targets.append(Target('p99 with a DDS storm / no topic mirrored', _ISOLATION_LIMIT,
                          outcomes.ratio('storm', 'mirror 0', punctual.latency(0.99)),
                          why='the storm takes the other CPU and its share of the caches and of '
                          'the host; ' + common.disturbances(outcomes, 'storm')))
    plot = Plot('isolation', 'How late a 1 kHz task of the core is', 'latency, us',
                'part of the calls that is later',
                [tail(outcomes.runs[key].label, np.concatenate(
                    [punctual.timing_of(o).latencies for o in outcomes.measured(key)]), 1e3)
                 for key in keys if outcomes.measured(key) and key not in _NOT_DRAWN],
                'The closer the curves, the less the ROS side reaches the core.', True, True)
    return Table('The core while the ROS side is busy', _ISOLATION_COLUMNS, rows,
                 _ISOLATION_NOTES), targets, plot


def _cost(name: str, part: float) -> Callable[[RunOutcome], float | None]:
    def of(outcome: RunOutcome) -> float | None:
        value = percentile(outcome.samples[name], part)
        return None if value is None else value / NS_PER_US

    return of


def _dearer(outcome: RunOutcome) -> float | None:
    """Take the cost of mirroring; a difference below zero is noise, and no cost."""
    value = _cost('difference_ns', 0.5)(outcome)
    return None if value is None or value <= 0 else value


def _sending(outcomes: Outcomes) -> str:
    """Return what the system call that wakes the client costs by itself."""
    floor = outcomes.metric('floor', _cost('difference_ns', 0.5))
    bare = '' if floor is None else (
        'a packet of eight samples is a system call that wakes another process: '
        f'{floor.median:.1f} us, in a virtual machine an interrupt between processors; the rest '
        'is a job of the link that runs with cold caches; ')
    return bare + common.disturbances(outcomes, 'core')


def _evaluate(options: BenchOptions, outcomes: Outcomes) -> CaseResult:
    rows = [outcomes.row(key, {column: _cost(name, part) for column, part in (
        ('p10', 0.1), ('p50', 0.5), ('p90', 0.9))}, label)
        for key, name, label in _ROWS if key in outcomes.runs]
    load, load_targets = mirror_load.evaluate(outcomes)
    targets = (
        Target('core: CPU of an Imu of one topic of 2 kHz', mirror_load.LIMIT_US,
               outcomes.metric('core', _dearer), 'us',
               why=_sending(outcomes)),
        Target('node: CPU of an Imu, publishing thread alone', mirror_load.LIMIT_US,
               outcomes.metric('node 0', _cost('carry_ns', 0.5)), 'us',
               why=common.disturbances(outcomes, 'node 0')),
        *load_targets)
    isolation, isolation_targets, plot = _isolation(outcomes)
    return CaseResult(
        CASE.name, CASE.title,
        (isolation, *load, Table('Cost of one mirrored Imu', _COLUMNS, rows, _NOTES)),
        (*isolation_targets, *targets), (plot,))


CASE = Case('mirror', 'the core under mirrored topics, a DDS storm, a stopped node; costs', _plan,
            _evaluate)
