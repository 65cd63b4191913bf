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

"""The rows of the case `mirror` about many topics: what a sample costs, how many a second go."""

from __future__ import annotations

from collections.abc import Sequence
import math

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.cases import common
from rt_robot_os.tools.bench.cases.mirror.load_subjects import CORE_GAVE_IN
from rt_robot_os.tools.bench.cases.mirror.load_subjects import FIRST_HZ
from rt_robot_os.tools.bench.cases.mirror.load_subjects import GROWTH
from rt_robot_os.tools.bench.cases.mirror.load_subjects import NODE_GAVE_IN
from rt_robot_os.tools.bench.cases.mirror.load_subjects import STEP_NS
from rt_robot_os.tools.bench.cases.mirror.load_subjects import TRIES
from rt_robot_os.tools.bench.cases.mirror.turns import STRETCH_NS
from rt_robot_os.tools.bench.result import Column
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.result import Target
from rt_robot_os.tools.bench.stats import percentile

_SUBJECTS = f'{__package__}.load_subjects'
_RATE_HZ = 200
_GATHER_MS = 5.0
_TOPICS = (1, 50)
_DELAYS_MS = (0.0, 20.0)
LIMIT_US = 3.0
_RAMPS = ((1, 'node', 0.0), (50, 'node', 0.0), (50, 'waiting', 20.0), (1, '', 0.0), (50, '', 0.0))
_PAIRS = 6
_WARMUP_NS = 1000 * NS_PER_MS
# Where the ramp of a saturation ends unless a process saturates before, tries included.
_HIGHEST_HZ = 600_000.0

_COST_COLUMNS = (
    Column('core', 'core', 'us', 'CPU time of a sample'),
    Column('core', 'core range', 'us', 'CPU time of a sample', spread=True),
    Column('node', 'node', 'us', 'CPU time of a sample'),
    Column('node', 'node range', 'us', 'CPU time of a sample', spread=True),
    Column('dropped', 'dropped', '', 'samples'))
_COST_NOTES = (
    'Imus (324 B) of 200 Hz from a core to a node with the mirrors of a robot, on the other CPUs;',
    'no subscriber in DDS. Stretches of 0.25 s: the core publishes on the mirrored topics',
    'and on as many others, in turns. The difference of the CPU time of the process, by sample.',
    'Core: the link, its wake-ups and what its jobs do to the caches, but not publishing. Node:',
    'reading, stamping, rclpy and all threads of DDS. delay_ms: what the mirrors allow. Floor:',
    'rclpy alone gives the same bytes to 50 publishers in turn, without stamp and link.')
_SATURATION_COLUMNS = (
    Column('rate', 'all topics', '1000/s', 'samples'),
    Column('rate', 'range', '1000/s', 'samples', spread=True),
    Column('core', 'core gave in', '%', 'repeats'),
    Column('node', 'client gave in', '%', 'repeats'))
_SATURATION_NOTES = (
    'The same, but more and more samples a second, a third more every 0.3 s, in bursts of a',
    'millisecond through rings of 1024, until more than 0.1 % of a step are dropped, three times',
    'in a row; the rate before that. The client gave in: its socket was full. The core: it was',
    'not, and samples were overwritten before they were sent. Neither: the time was over first.')


def plan(options: BenchOptions) -> Sequence[Run]:
    """Return the runs."""
    measure_ns = (1 if options.quick else _PAIRS) * 2 * STRETCH_NS
    start_s = common.START_PEER_S + common.START_S + _WARMUP_NS / NS_PER_S

    def cost(topics: int, delay_ms: float) -> Run:
        return Run(_cost_key(topics, delay_ms), _label(topics, delay_ms), f'{_SUBJECTS}:core', {
            'topics': topics, 'rate_hz': _RATE_HZ, 'delay_ms': delay_ms, 'gather_ms': _GATHER_MS,
            'warmup_ns': _WARMUP_NS, 'measure_ns': measure_ns}, start_s + measure_ns / NS_PER_S)

    if options.quick:
        return (cost(_TOPICS[-1], 0.0),)
    ramp_ns = (math.ceil(math.log(_HIGHEST_HZ / FIRST_HZ, GROWTH)) + TRIES) * STEP_NS
    floor = Run('raw', '  floor: rclpy alone', f'{__package__}.load_peers:raw',
                {'topics': _TOPICS[-1], 'measure_ns': options.measure_ns},
                common.START_PEER_S + options.seconds)
    return (
        *(cost(topics, delay_ms) for topics in _TOPICS for delay_ms in _DELAYS_MS), floor,
        *(Run(_saturation_key(topics, what), _label(topics, delay_ms) if what else (
            f'{topics} topic{"s" if topics > 1 else ""}, to a client that drops them'),
              f'{_SUBJECTS}:saturation', {
                  'topics': topics, 'delay_ms': delay_ms, 'sink': not what,
                  'warmup_ns': _WARMUP_NS, 'measure_ns': ramp_ns}, start_s + ramp_ns / NS_PER_S)
          for topics, what, delay_ms in _RAMPS))


def _cost_key(topics: int, delay_ms: float) -> str:
    return f'load {topics} {delay_ms:g}'


def _saturation_key(topics: int, what: str) -> str:
    return f'saturation {topics} {what or "sink"}'


def _label(topics: int, delay_ms: float) -> str:
    return f'{topics} topic{"s" if topics > 1 else ""}, delay_ms {delay_ms:g}'


def _cost(name: str) -> common.Of:
    def of(outcome: RunOutcome) -> float | None:
        value = percentile(outcome.samples[name], 0.5)
        # A difference below zero is noise, and no cost.
        return None if value is None or value <= 0 else value / NS_PER_US

    return of


_CORE, _NODE = _cost('difference_ns'), _cost('peer_difference_ns')
_RAW = common.part_of('raw_ns', 0.5)


def _gave_in(who: int) -> common.Of:
    return lambda outcome: 100.0 * (outcome.figures['gave_in'] == who)


def evaluate(outcomes: Outcomes) -> tuple[Sequence[Table], Sequence[Target]]:
    """Make the tables, and what is promised for 50 topics of 200 Hz."""
    costs = [outcomes.row(key, {
        'core': _CORE, 'node': _NODE, 'dropped': common.figure('dropped')})
        for key in outcomes.runs if key.startswith('load ')]
    if 'raw' in outcomes.runs:
        costs.append(outcomes.row('raw', {'node': _RAW}))
    ramps = [outcomes.row(key, {
        'rate': common.figure('rate_hz', 1000.0), 'core': _gave_in(CORE_GAVE_IN),
        'node': _gave_in(NODE_GAVE_IN)})
        for key in outcomes.runs if key.startswith('saturation ')]
    tables = [Table('Cost of a sample of many mirrored topics', _COST_COLUMNS, costs, _COST_NOTES)]
    if ramps:
        tables.append(Table('How many mirrored samples a second', _SATURATION_COLUMNS, ramps,
                            _SATURATION_NOTES))
    targets = []
    for delay_ms in _DELAYS_MS:
        key = _cost_key(_TOPICS[-1], delay_ms)
        if key not in outcomes.runs:
            continue  # of a first look
        more = f', delay_ms {delay_ms:g}' if delay_ms else ''
        targets += [Target(f'{who}: CPU of an Imu, 50 topics{more}', LIMIT_US,
                           outcomes.metric(key, of), 'us', why=_why(outcomes, who, key))
                    for who, of in (('core', _CORE), ('node', _NODE))]
    return tables, targets


def _why(outcomes: Outcomes, who: str, key: str) -> str:
    floor = outcomes.metric('raw', _RAW) if who == 'node' else None
    own = '' if floor is None else (
        f'rclpy alone takes {floor.median:.1f} us for the same bytes, without a stamp; ')
    alone = outcomes.metric(_cost_key(_TOPICS[-1], _DELAYS_MS[-1]), _NODE) if own else None
    if alone is not None and not key.endswith(f' {_DELAYS_MS[-1]:g}'):
        own += (f'with delay_ms {_DELAYS_MS[-1]:g}, when two samples of a topic come together and '
                f'the second finds warm caches, it is {alone.median:.1f} us; ')
    return own + common.disturbances(outcomes, key)
