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
from rt_robot_os.bench.workers.turns import STRETCH_NS
from rt_robot_os.units import NS_PER_MS
from rt_robot_os.units import NS_PER_S
from rt_robot_os.units import NS_PER_US

_RATE_HZ = 2000
_WARMUP_NS = 600 * NS_PER_MS
_START_S = 1.5
_LIMIT_US = 5.0
_CORE = 'rt_robot_os.bench.workers.mirror'
_NODE = 'rt_robot_os.bench.peers.mirror:node'

_COLUMNS = (
    Column('p50', 'p50', 'us', 'CPU time'),
    Column('p50', 'p50 range', 'us', 'CPU time', spread=True),
    Column('p10', 'p10', 'us', 'CPU time'), Column('p90', 'p90', 'us', 'CPU time'))
_NOTES = (
    'One Imu (324 B). Core: 2 kHz, stretches of 0.25 s with and without, CPU time of the process;',
    'the difference is what mirroring costs, the dispatch of the link included. The client sleeps',
    'between two samples, on another CPU: sending wakes it. Bare socket: only that send, from a',
    'kernel task. Node: CPU time of the publishing thread, blocks of 100.')
_ROWS = (
    ('core', 'difference_ns', 'core: mirror to a client of the link'),
    ('floor', 'difference_ns', '  of which: a bare socket that wakes'),
    ('core', 'without_ns', '  beside: publish without mirror, job'),
    ('node 0', 'carry_ns', 'node: stamp and publish raw'),
    ('node 0', 'build_ns', 'rclpy: build and publish an Imu'),
    ('node 1', 'carry_ns', 'node: raw, a subscriber listens'),
    ('node 1', 'build_ns', 'rclpy: build, a subscriber listens'),
)


def _plan(options: Options) -> Sequence[Run]:
    seconds = _START_S + _WARMUP_NS / NS_PER_S + options.seconds
    # Room for one pair of stretches after the first, which is never counted.
    measure_ns = max(round(options.seconds * NS_PER_S), 5 * STRETCH_NS)
    arguments = {'rate_hz': _RATE_HZ, 'warmup_ns': _WARMUP_NS, 'measure_ns': measure_ns}
    return (
        Run('core', 'core with a mirror', f'{_CORE}:core', arguments, seconds),
        Run('floor', 'bare socket', f'{_CORE}:floor', arguments, seconds),
        *(Run(f'node {count}', f'node, {count} subscribers', _NODE,
              {**arguments, 'subscribers': count}, seconds + count) for count in (0, 1)),
    )


def _cost(name: str, part: float) -> Callable[[Outcome], float | None]:
    def of(outcome: Outcome) -> float | None:
        value = percentile(outcome.samples[name], part)
        return None if value is None else value / NS_PER_US

    return of


def _evaluate(options: Options, outcomes: Outcomes) -> CaseResult:
    rows = [outcomes.row(key, {column: _cost(name, part) for column, part in (
        ('p10', 0.1), ('p50', 0.5), ('p90', 0.9))}, label) for key, name, label in _ROWS]
    aims = (
        Aim('core: CPU time to mirror an Imu', _LIMIT_US,
            outcomes.metric('core', _cost('difference_ns', 0.5)), 'us'),
        Aim('node: CPU time to publish a mirrored Imu', _LIMIT_US,
            outcomes.metric('node 0', _cost('carry_ns', 0.5)), 'us'),
    )
    return CaseResult(CASE.name, CASE.title, (Table('', _COLUMNS, rows, _NOTES),), aims)


CASE = Case('mirror', 'CPU time in core and node for one mirrored Imu', _plan, _evaluate)
