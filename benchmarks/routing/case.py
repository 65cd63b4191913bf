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


"""The case `routing`: sensor networks at home, where CTP collapses, what a moving sink gains."""

from __future__ import annotations

from collections.abc import Sequence
import math

import numpy as np

from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.case import UNPINNED
from rt_robot_os.tools.bench.cases import common
from rt_robot_os.tools.bench.plot import Plot
from rt_robot_os.tools.bench.plot import Series
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Column
from rt_robot_os.tools.bench.result import Metric
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.result import Target

_SUBJECTS = f'{__package__}.subjects'
_HOME, _LOAD, _RELAYS = 'home', 'load', 'relays'

# Key, shipped scenario, protocol, in words.
_ROWS: Sequence[tuple[str, str, str, str]] = (
    ('ctp', 'home12', 'ctp', 'CTP'),
    ('paper', 'home12', 'paper', 'paper: least cost, rounds each 4 s'),
    ('lqi', 'home12', 'multihoplqi', 'MultiHopLQI, beacons each 32 s'),
    ('ctp moving', 'home12_moving', 'ctp', 'CTP, sink drives'),
    ('paper moving', 'home12_moving', 'paper', 'paper, sink drives'),
    ('lqi moving', 'home12_moving', 'multihoplqi', 'MultiHopLQI, sink drives'))
_LABELS = {key: label for key, _, _, label in _ROWS}
_PROTOCOLS = ('ctp', 'multihoplqi')
_PERIODS = (800, 1600, 3200, 6400, 12800)
_SIZES = (30, 100, 200)
_BEACON_S = 4.0
_SINKS = {'corner': 'sink in a corner', 'fixed': 'sink in the middle',
          'moving': 'sink drives'}
# Of few nodes the tree has hot spots of its own, wherever the sink is.
_MANY = 200
_BINARY_S = 1024


def _length(options: BenchOptions) -> dict[str, int]:
    if options.quick:
        return {'home': 300, 'home_seeds': 1, 'load': 60, 'load_seeds': 1, 'relays': 300,
                'relay_seeds': 2}
    return {'home': 1800, 'home_seeds': 2, 'load': 300, 'load_seeds': 2 if options.full else 1,
            'relays': 600, 'relay_seeds': 10 if options.full else 3}


def _sizes(options: BenchOptions) -> Sequence[int]:
    return _SIZES[:1] if options.quick else _SIZES


def _periods(options: BenchOptions) -> Sequence[int]:
    return _PERIODS[::2] if options.quick else _PERIODS


def _plan(options: BenchOptions) -> Sequence[Run]:
    length = _length(options)
    # A second of a network of 12 takes some 4 ms, of 25 in collapse 30 ms, of 200 30 ms; two
    # processors share them.
    return (
        Run(_HOME, 'twelve nodes in a flat', f'{_SUBJECTS}:home', {
            'rows': [row[:3] for row in _ROWS], 'seconds': length['home'],
            'seeds': length['home_seeds']},
            2 + 0.002 * len(_ROWS) * length['home'] * length['home_seeds'], UNPINNED, 0,
            once=True),
        Run(_LOAD, 'a noisy grid of 25 under load', f'{_SUBJECTS}:load', {
            'protocols': _PROTOCOLS, 'periods_binary_ms': _periods(options),
            'seconds': length['load'], 'seeds': length['load_seeds']},
            2 + 0.015 * 2 * len(_periods(options)) * length['load'] * length['load_seeds'],
            UNPINNED, 0, once=True),
        Run(_RELAYS, 'a sink that stands, and one that drives', f'{_SUBJECTS}:relays', {
            'sizes': _sizes(options), 'seconds': length['relays'],
            'seeds': length['relay_seeds']},
            2 + 0.00006 * len(_SINKS) * sum(_sizes(options))
            * length['relays'] * length['relay_seeds'],
            UNPINNED, 0, once=True))


def _mean(name: str, scale: float) -> common.Of:
    def of(outcome: RunOutcome) -> float | None:
        values = outcome.samples.get(name)
        return None if values is None or not len(values) else float(values.mean()) / scale

    return of


def _spread(name: str, scale: float) -> common.Of:
    def of(outcome: RunOutcome) -> float | None:
        values = outcome.samples.get(name)
        if values is None or len(values) < 2:
            return None
        return float(np.std(values, ddof=1)) / scale

    return of


def _extreme(name: str, scale: float, least: bool = False) -> common.Of:
    def of(outcome: RunOutcome) -> float | None:
        values = outcome.samples.get(name)
        if values is None or not len(values):
            return None
        return float(values.min() if least else values.max()) / scale

    return of


def _home(outcomes: Outcomes) -> Table:
    columns = (
        Column('delivery', 'mean', '%', 'delivered'), Column('worst', 'worst', '%', 'delivered'),
        Column('frames', 'a packet', '', 'frames'), Column('p95', 'p95', 'ms', 'latency'),
        Column('breaks', 'a run', '', 'breaks'), Column('longest', 'longest', 's', 'breaks'),
        Column('serial', 'on the line', '', 'duplicates'),
        Column('duplicates', 'to the application', '', 'duplicates'),
        Column('differ', 'not as in truth', 'nodes', 'losses'),
        Column('speed', 'of real time', '', 'times'))
    return Table('home: 12 nodes, a packet each 781 ms', columns, [outcomes.row(_HOME, {
        'delivery': _mean(f'{key} delivery_ppm', 1e4),
        'worst': _extreme(f'{key} delivery_ppm', 1e4, least=True),
        'frames': _mean(f'{key} frames_milli', 1e3), 'p95': _mean(f'{key} p95_us', 1e3),
        'breaks': _mean(f'{key} breaks', 1), 'longest': _extreme(f'{key} longest_ms', 1e3),
        'serial': _mean(f'{key} serial_duplicates', 1),
        'duplicates': _extreme(f'{key} duplicates', 1), 'differ': _extreme(f'{key} differ', 1),
        'speed': _mean(f'{key} speed', 1)}, label) for key, label in _LABELS.items()],
        ('The scenarios home12 and home12_moving: the flat, four rooms, the radio at -25 dBm,',
         'quiet. The sink drives through all rooms at 0.3 m/s, round and round. A break: two or',
         'more packets of a node in a row are lost; it lasts until one is made that comes. Losses',
         "of each node as the robot's model of the network counts them from the sequence numbers,",
         'and in truth.'))


def _load(options: BenchOptions, outcomes: Outcomes) -> Table:
    columns = [Column(f'{protocol} {key}', title, unit, group)
               for key, group, unit in (('delivery', 'delivered', '%'),
                                        ('frames', 'frames a packet', ''),
                                        ('p95', 'latency p95', 'ms'))
               for protocol, title in zip(_PROTOCOLS, ('CTP', 'MultiHopLQI'))]
    rows = []
    for period in _periods(options):
        of: dict[str, common.Of] = {}
        for protocol in _PROTOCOLS:
            key = f'{protocol} {period}'
            of[f'{protocol} delivery'] = _mean(f'{key} delivery_ppm', 1e4)
            of[f'{protocol} frames'] = _mean(f'{key} frames_milli', 1e3)
            of[f'{protocol} p95'] = _mean(f'{key} p95_us', 1e3)
        rows.append(outcomes.row(_LOAD, of, f'a packet each {period / _BINARY_S * 1000:,.0f} ms'))
    return Table('load: where CTP collapses', columns, rows, (
        'The scenario ctp_collapse: 5 by 5 nodes, much noise. CTP sends a packet up to 30 times;',
        'where most of them fail, that fills the channel and makes more of them fail. Do not use',
        'it for a packet a second of some 15 nodes or more beside busy Wi-Fi: send less often, or',
        'use MultiHopLQI, which gives up after 6, and loses some at any load.'))


def _relays(options: BenchOptions, outcomes: Outcomes) -> Table:
    columns = (
        Column('load', 'mean', '', 'relay load, largest over mean'),
        Column('load spread', '+-', '', 'relay load, largest over mean'),
        Column('charge', 'mean', '', 'charge, largest over mean'),
        Column('charge spread', '+-', '', 'charge, largest over mean'),
        Column('days', 'mean', 'days', 'first battery empty'),
        Column('days spread', '+-', 'days', 'first battery empty'),
        Column('delivery', 'mean', '%', 'delivered'), Column('frames', 'a packet', '', 'frames'))
    rows = []
    for size in _sizes(options):
        for sink, words in _SINKS.items():
            key = f'{size} {sink}'
            of: dict[str, common.Of] = {
                'delivery': _mean(f'{key} delivery_ppm', 1e4),
                'frames': _mean(f'{key} frames_milli', 1e3)}
            for column in ('load', 'charge', 'days'):
                of[column] = _mean(f'{key} {column}_milli', 1e3)
                of[f'{column} spread'] = _spread(f'{key} {column}_milli', 1e3)
            rows.append(outcomes.row(_RELAYS, of, f'{size} nodes, {words}'))
    return Table('relays: what a moving sink gains', columns, rows, (
        'The scenario relay_load: random nodes, 64 m2 each, a packet and a beacon each 15 s, the',
        'radios asleep 99 % of the time. The sink stands in a corner, in the middle, or drives',
        'around the middle at 0.5 m/s. Mean and deviation of the seeds. A sink that moves',
        'shares out what there is to relay, but routes to it are longer and break: it pays where',
        'there are many hops, or the sink would stand at the edge. With radios that always listen',
        'all batteries are empty after 4.8 days, whoever relays.'))


def _targets(outcomes: Outcomes) -> Sequence[Target]:
    def least(text: str, limit: float, key: str) -> Target:
        return Target(text, limit, outcomes.metric(_HOME, _mean(f'{key} delivery_ppm', 1e4)), '%',
                      at_most=False)

    def most(name: str) -> Metric | None:
        values = [outcomes.metric(_HOME, _extreme(f'{key} {name}', 1)) for key in _LABELS]
        known = [value.highest for value in values if value is not None]
        return Metric((max(known),)) if known else None

    return [
        least('home, CTP: delivered', 99.5, 'ctp'),
        least('home, paper: delivered', 99.0, 'paper'),
        least('home, paper, sink drives: delivered', 98.0, 'paper moving'),
        Target('home, paper, sink drives: longest break', 2 * _BEACON_S,
               outcomes.metric(_HOME, _extreme('paper moving longest_ms', 1e3)), 's'),
        Target('duplicates to the application', 0, most('duplicates'), ''),
        Target('packets withheld from the application', 0, most('withheld'), ''),
        Target('nodes whose losses are not as in truth', 0, most('differ'), ''),
        Target(f'{_MANY} nodes: relay load, driving over standing',
               1.0, _gain(outcomes, _MANY), '')]


def _gain(outcomes: Outcomes, size: int) -> Metric | None:
    def of(outcome: RunOutcome) -> float | None:
        moving = _mean(f'{size} moving load_milli', 1)(outcome)
        fixed = _mean(f'{size} fixed load_milli', 1)(outcome)
        return moving / fixed if moving is not None and fixed else None

    return outcomes.metric(_RELAYS, of)


def _plots(options: BenchOptions, outcomes: Outcomes) -> Sequence[Plot]:
    plots: list[Plot] = []
    for outcome in outcomes.measured(_LOAD)[:1]:
        periods = _periods(options)
        plots.append(Plot(
            'collapse', 'Where CTP collapses', 'a packet of each node each, s', 'delivered, %', [
                Series(title, [period / _BINARY_S for period in periods],
                       [_mean(f'{protocol} {period} delivery_ppm', 1e4)(outcome) or 0.0
                        for period in periods], 'marks')
                for protocol, title in zip(_PROTOCOLS, ('CTP', 'MultiHopLQI'))],
            '25 nodes beside busy Wi-Fi.', x_log=True, y_range=(0.0, 102.0)))
    for outcome in outcomes.measured(_RELAYS)[:1]:
        plots.append(Plot(
            'relays', 'The node that sends most', 'nodes', 'frames, of the mean of all nodes', [
                Series(words, list(map(float, _sizes(options))),
                       [_mean(f'{size} {sink} load_milli', 1e3)(outcome) or math.nan
                        for size in _sizes(options)], 'marks')
                for sink, words in _SINKS.items()],
            'Whoever is near a sink that stands carries the packets of all others.',
            y_from_zero=True))
    return plots


def _evaluate(options: BenchOptions, outcomes: Outcomes) -> CaseResult:
    return CaseResult(CASE.name, CASE.title, [
        _home(outcomes), _load(options, outcomes), _relays(options, outcomes)],
        _targets(outcomes), _plots(options, outcomes))


CASE = Case('routing', 'sensor networks: at home, under load, with a sink that moves',
            _plan, _evaluate)
