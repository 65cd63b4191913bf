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

"""The case `network`: how fast sensor networks are simulated, from 10 to 10,000 nodes."""

from __future__ import annotations

from collections.abc import Sequence
from math import log

from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.cases import common
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Column
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.result import Target

_SUBJECTS = f'{__package__}.subjects'
_SIMPY = f'{__package__}.peers:simpy_queue'
_SIZES = (10, 100, 1000, 10_000)
_QUICK_SIZES = (10, 100, 1000)
_PERIOD_S = 60.0
_PER_DAY_S = 600.0
_START_S = 2.0
# What a node costs before the measurement: to be made, and its part of the first 100 s.
_NODE_S = 0.004
_SMALL, _LARGE = 100, 10_000
_SMALL_TIMES, _LARGE_TIMES = 100.0, 1.0


def _key(size: int, period_s: float = _PERIOD_S) -> str:
    return f'{size} every {period_s:.0f} s'


def _plan(options: BenchOptions) -> Sequence[Run]:
    sizes = _QUICK_SIZES if options.quick else _SIZES
    loads = [(size, _PERIOD_S) for size in sizes]
    if _LARGE in sizes:
        loads.append((_LARGE, _PER_DAY_S))
    runs = [Run(_key(size, period_s), f'{size:,} nodes, readings every {period_s:.0f} s',
                f'{_SUBJECTS}:simulate', {'nodes': size, 'period_s': period_s,
                                          'measure_ns': options.measure_ns},
                _START_S + size * _NODE_S + options.seconds, once=size >= _LARGE)
            for size, period_s in loads]
    for size in sizes:
        arguments = {'nodes': size, 'measure_ns': options.measure_ns}
        runs += [Run(f'queue {size}', f'queue alone, {size:,} events planned',
                     f'{_SUBJECTS}:own_queue', arguments, _START_S + options.seconds),
                 Run(f'simpy {size}', f'simpy, {size:,} processes', _SIMPY, arguments,
                     _START_S + options.seconds)]
    return runs


def _figure(name: str) -> common.Of:
    def of(outcome: RunOutcome) -> float | None:
        return outcome.figures.get(name)

    return of


def _networks(outcomes: Outcomes) -> Table:
    columns = (Column('times', 'times real time', '', 'speed'),
               Column('event', 'an event', 'us', 'cost'),
               Column('decided', 'a frame at a node', 'us', 'cost'),
               Column('set up', 'set up', 's', 'start'),
               Column('routed', 'with a route', '%', 'after 100 s'))
    rows = [outcomes.row(key, {
        'times': _figure('times_real_time'), 'event': _figure('event_us'),
        'decided': _figure('decided_us'), 'set up': _figure('set_up_s'),
        'routed': _figure('routed')}) for key in outcomes.runs if 'every' in key]
    return Table('simulated networks', columns, rows, (
        'MultiHopLQI with beacons every 32 s on a grid of 35 m, where a frame reaches about 16',
        'others; a sink for each thousand nodes. CPU time after 100 simulated seconds. An event',
        'is one of the queue; "a frame at a node": the time for each node at which was decided',
        'what becomes of a frame, all else included.'))


def _queues(outcomes: Outcomes) -> Table:
    rows = [outcomes.row(key, {'event': _figure('event_us')})
            for key in outcomes.runs if 'every' not in key]
    return Table('queues of events', (Column('event', 'an event', 'us', 'cost'),), rows, (
        'Each event plans itself anew, at random within a second.',))


def _growth(outcomes: Outcomes) -> common.Of:
    """Return how the cost of an event grew, over how log n did."""
    small = outcomes.metric(_key(_SMALL), _figure('event_us'))

    def of(outcome: RunOutcome) -> float | None:
        if small is None or 'event_us' not in outcome.figures:
            return None
        return outcome.figures['event_us'] / small.median / (log(_LARGE) / log(_SMALL))

    return of


def _evaluate(options: BenchOptions, outcomes: Outcomes) -> CaseResult:
    times = _figure('times_real_time')
    targets = [Target(f'{_SMALL} nodes, times real time', _SMALL_TIMES,
                      outcomes.metric(_key(_SMALL), times), at_most=False)]
    if _key(_LARGE) in outcomes.runs:
        targets += [Target(f'{_LARGE:,} nodes, times real time', _LARGE_TIMES,
                           outcomes.metric(_key(_LARGE), times), at_most=False),
                    Target("growth of an event's cost over that of log n", 1.0,
                           outcomes.metric(_key(_LARGE), _growth(outcomes)))]
    return CaseResult(CASE.name, CASE.title, [_networks(outcomes), _queues(outcomes)], targets)


CASE = Case('network', 'simulated sensor networks from 10 to 10,000 nodes', _plan, _evaluate)
