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

"""The assisted flat in an overload: signs of life and alarms first, in the order it declares."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from rt_robot_os.features.wsn.packets.paper import Kind
from rt_robot_os.kernel import TraceLog
from rt_robot_os.modules.registry import module_class
from rt_robot_os.settings import load
from rt_robot_os.testing.module_bench import ModuleBench
from wsn_packets import data_msg
from wsn_packets import Sink

pytest.importorskip('std_msgs', reason='ROS 2 messages are not installed')

FLAT = Path(__file__).resolve().parents[2] / 'config' / 'assisted_living.yaml'
MS = 1_000_000
# Anna's button, her pulse, and the temperature of a room, each in a class of its own.
WRIST, LIVING = 6, 1
CLASSES = ('rest', 'vital', 'alarm')
# Who looks at them, and who judges; `surroundings` and `heat` have the least to say.
MODULES = ('dangers', 'bodies', 'surroundings', 'help_anna', 'vital_anna', 'assess_anna', 'heat')
AT_S = 3.5
CAME_NS = round(AT_S * 1e9) + MS
# The packets come in the opposite order, in one job of the sink.
GOLDEN = """\
sink start
sink end
dangers start
dangers end
bodies start
bodies end
help_anna start
help_anna end
vital_anna start
vital_anna end
assess_anna start
assess_anna end
"""
LEAST = """\
surroundings start
  heat start
  heat end
surroundings end
"""


class Flat:
    """
    Modules of the shipped flat, with the priorities that it gives them.

    :ivar trace: which jobs ran.
    :ivar said: the moment of the last sample of each topic that follows from them.
    """

    def __init__(self, computing: int) -> None:
        settings = load([FLAT])
        given = {each.name: each for each in (*settings.devices, *settings.modules)}
        self.bench = ModuleBench()
        self.trace = TraceLog()
        self._sinks = {name: Sink(self.bench, f'wsn/packets/{name}') for name in CLASSES}
        for topic in ('oximeter/pulse_per_min', 'oximeter/spo2_percent'):
            self.bench.topic(topic, 'std_msgs/msg/Float64')
        for name in MODULES:
            its: Any = given[name]
            self.bench.add(module_class(its.type), name, priority=its.priority,
                           rate_hz=its.rate_hz, **its.settings)
        watched = {name: self.bench.watch(name) for name in (
            'wsn/wrist/alarm', 'wsn/wrist/pulse_per_min', 'health/anna/pulse_per_min',
            'wsn/living/temperature')}
        # Whatever else a program computes: more than there is time for, above `surroundings`.
        clock: Any = self.bench.kernel.clock
        for number in range(computing):
            self.bench.kernel.add_task(f'busy {number}', lambda: clock.spend(4 * MS),
                                       priority=given['surroundings'].priority + 1, rate_hz=20.0)
        self.bench.kernel.add_task('sink', self._come, priority=given['sink'].priority,
                                   rate_hz=0.1, phase_ns=CAME_NS)
        self.bench.kernel.trace = self.trace
        self.bench.run(AT_S + 0.4)
        self.said: dict[str, int] = {}
        for name, topic in watched.items():
            while topic.take():
                self.said[name] = topic.stamp_ns

    def _come(self) -> None:
        for name, packet in zip(CLASSES, (
                data_msg(LIVING, 1), data_msg(WRIST, 2, Kind.PULSE, 72),
                data_msg(WRIST, 3, Kind.ALARM, 1))):
            self._sinks[name].send(packet)

    def at_once(self) -> str:
        """Return the trace of the moment in which the packets came, without what was computed."""
        return ''.join(
            f'{"  " * each.depth}{each.task} {each.kind}\n' for each in self.trace.events()
            if each.at_ns == CAME_NS and not each.task.startswith('busy'))


def test_signs_of_life_pass_all_that_is_less_important_in_an_overload() -> None:
    quiet, loaded = Flat(0), Flat(25)
    assert quiet.at_once() == GOLDEN + LEAST
    # One of those that compute was interrupted: everything lies one deeper, and what is less
    # important than they are has not begun.
    assert loaded.at_once() == ''.join(f'  {line}\n' for line in GOLDEN.splitlines())
    important = {'wsn/wrist/alarm', 'wsn/wrist/pulse_per_min', 'health/anna/pulse_per_min'}
    assert quiet.said == dict.fromkeys([*important, 'wsn/living/temperature'], CAME_NS)
    assert loaded.said == dict.fromkeys(important, CAME_NS)
