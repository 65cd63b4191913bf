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


"""Technical causes of a sensor network: sink, silent nodes, batteries."""

from __future__ import annotations

import math

import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.alarms.watch import Watch
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import Level
from rt_robot_os.messages.network_rows import names_label
from rt_robot_os.messages.network_rows import NodeRow
from rt_robot_os.messages.network_rows import NodeState
from rt_robot_os.messages.network_rows import WIDTH
from rt_robot_os.testing.fakes import settings_of
from rt_robot_os.testing.module_bench import ModuleBench
from rt_robot_os.topics import Subscription

S = 10**9
GOOD, SILENT, UNHEARD = NodeState.GOOD, NodeState.SILENT, NodeState.UNHEARD


def row(number: int, state: NodeState = GOOD, volts: float = 2.9, age_s: float = 1.0) -> NodeRow:
    return NodeRow(number, 1, 1, 1, 0, 0, 1, 1, state, volts, 100, 1, 1, 10, 0, 0, 0, age_s)


class Rows:
    """The rows of a network model, once a second."""

    def __init__(self, bench: ModuleBench) -> None:
        self.bench = bench
        bench.bus.declare(
            'wsn/nodes', 'std_msgs/msg/Float64MultiArray',
            {'layout.dim': [{'label': names_label({1: 'hall', 2: 'bed'})}]}, tail=WIDTH * 8)
        self.out = bench.bus.publisher('wsn/nodes')

    def at(self, begin_s: int, end_s: int, *rows: NodeRow, sink_age_s: float = 1.0) -> None:
        for second in range(begin_s, end_s):
            age_s = sink_age_s if sink_age_s < 2.0 else sink_age_s + second - begin_s
            data = [each for one in (row(0, NodeState.SINK, math.nan, age_s), *rows)
                    for each in one]

            def publish(data: list[float] = data) -> None:
                self.out.msg.data = data
                self.out.publish()
            self.bench.at(float(second), publish)


def told(read: Subscription) -> list[tuple[float, str, str, bool]]:
    found, active = [], set()
    while read.take():
        cause = Cause.from_json(read.msg.data)
        key = cause.kind, cause.subject
        assert cause.level is Level.TECHNICAL
        if cause.active != (key in active):
            (active.add if cause.active else active.discard)(key)
            found.append((read.stamp_ns / S, *key, cause.active))
    return found


def test_a_node_that_is_silent_for_long_enough_is_told_and_over_when_it_is_back() -> None:
    with ModuleBench() as bench:
        rows = Rows(bench)
        bench.add(Watch, rate_hz=1.0, node_silent_s=20.0)
        read = bench.watch('alarms/causes')
        rows.at(1, 10, row(1), row(2))
        rows.at(10, 25, row(1), row(2, SILENT))     # not long enough
        rows.at(25, 30, row(1), row(2))
        rows.at(30, 60, row(1), row(2, SILENT))
        rows.at(60, 70, row(1), row(2))             # a single packet, and silent again
        rows.at(70, 80, row(1), row(2, SILENT))
        rows.at(80, 120, row(1), row(2))
        bench.run(125.0)
        assert told(read) == [(50.0, 'node_silent', 'bed', True),
                              (110.0, 'node_silent', 'bed', False)]


def test_a_silent_sink_is_one_cause_and_not_one_for_each_node() -> None:
    with ModuleBench() as bench:
        rows = Rows(bench)
        module = bench.add(Watch, rate_hz=1.0, node_silent_s=100.0)
        read = bench.watch('alarms/causes')
        rows.at(1, 10, row(1), row(2))
        rows.at(10, 250, row(1, SILENT), row(2, SILENT), sink_age_s=2.0)
        bench.run(251.0)
        assert told(read) == [(68.0, 'sink_silent', 'sink', True)]
        assert module.statistics()['wrong'] == 'sink_silent sink'


def test_a_sink_that_was_never_heard_is_silent_too() -> None:
    with ModuleBench() as bench:
        rows = Rows(bench)
        bench.add(Watch, rate_hz=1.0)
        read = bench.watch('alarms/causes')
        rows.at(1, 70, row(1, UNHEARD, math.nan, math.nan), sink_age_s=math.nan)
        bench.run(70.0)
        assert told(read) == [(61.0, 'sink_silent', 'sink', True)]


def test_a_surveyed_node_that_never_came_is_told_after_longer() -> None:
    with ModuleBench() as bench:
        rows = Rows(bench)
        bench.add(Watch, rate_hz=1.0, node_silent_s=10.0, unheard_s=50.0, ignored=['bed'])
        read = bench.watch('alarms/causes')
        rows.at(1, 60, row(1, UNHEARD, math.nan, math.nan), row(2, SILENT))
        bench.run(60.0)
        assert told(read) == [(51.0, 'node_silent', 'hall', True)]


def test_a_battery_is_low_until_it_is_a_new_one() -> None:
    with ModuleBench() as bench:
        rows = Rows(bench)
        bench.add(Watch, rate_hz=1.0, battery_s=10.0)
        read = bench.watch('alarms/causes')
        rows.at(1, 5, row(1, volts=2.1))            # it sends a lot, and recovers
        rows.at(5, 10, row(1, volts=2.3))
        rows.at(10, 30, row(1, volts=2.1))
        rows.at(30, 60, row(1, volts=2.4))
        rows.at(60, 100, row(1, volts=math.nan))    # nothing is known
        rows.at(100, 140, row(1, volts=3.0))
        bench.run(141.0)
        assert told(read) == [(20.0, 'node_battery', 'hall', True),
                              (130.0, 'node_battery', 'hall', False)]


def test_limits_of_the_battery_that_contradict_each_other_are_refused() -> None:
    with pytest.raises(ConfigError, match='must be at least battery_v, 2.2'):
        Watch('watch', settings_of(Watch, battery_clear_v=2.0))
