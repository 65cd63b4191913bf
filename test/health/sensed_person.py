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

"""A person of tests, with sensors that say what a test wants, and what is told of her."""

from __future__ import annotations

from collections.abc import Callable
from heapq import heappop
from heapq import heappush
from itertools import count
import json
from typing import Any

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.health.assessment import Assessment
from rt_robot_os.features.health.vital_signs import VitalSigns
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import CAUSES_TOPIC
from rt_robot_os.testing.module_bench import ModuleBench
from rt_robot_os.topics import Publisher

FLOAT = 'std_msgs/msg/Float64'
TEMPERATURE = 'sensor_msgs/msg/Temperature'


class Heard:
    """Everything that was published on a topic: moments in s, and the number or text."""

    def __init__(self, bench: ModuleBench, topic: str, field: str = 'data') -> None:
        self.all: list[tuple[float, Any]] = []
        self._field = field
        task = bench.kernel.add_task(f'hear {topic}', self._take, priority=1)
        self._read = bench.bus.subscribe(topic, 'test', task=task)

    def _take(self) -> None:
        while self._read.take():
            self.all.append((self._read.stamp_ns / NS_PER_S, getattr(self._read.msg, self._field)))
        assert not self._read.lost


class Person:
    """Anna, with sensors that say what a test wants."""

    def __init__(self, bench: ModuleBench, *sources: str, **changes: Any) -> None:
        self.bench = bench
        self._count = count()
        self._plan: list[tuple[float, int, Callable[[], None]]] = []
        bench.kernel.add_task('sensors', self._feed, priority=98, rate_hz=2.0)
        self.sensors: dict[str, Publisher] = {}
        for text in sources:
            topic = text.split(' as ')[0].split()[-1].split('.')[0]
            if topic not in self.sensors:
                self.sensors[topic] = bench.topic(
                    topic, TEMPERATURE if 'temperature' in topic else FLOAT,
                    {'header.frame_id': 'x'} if 'temperature' in topic else None)
        self.module = bench.add(VitalSigns, 'signs_of_anna', rate_hz=1.0, person='anna',
                                sources=list(sources), **changes)
        self.assessment: Assessment | None = None
        self.signs = Heard(bench, 'health/anna/signs')
        self.causes = Heard(bench, CAUSES_TOPIC)

    def assess(self, **changes: Any) -> Assessment:
        """Have her signs assessed, at once unless the test says otherwise."""
        self.assessment = self.bench.add(Assessment, 'assessment_of_anna', person='anna',
                                         priority=30, rate_hz=1.0, **changes)
        self.news2 = Heard(self.bench, 'health/anna/news2')
        self.details = Heard(self.bench, 'health/anna/news2_details')
        return self.assessment

    def watch(self, sign: str) -> Heard:
        return Heard(self.bench, f'health/anna/{sign}',
                     'temperature' if sign == 'body_temperature' else 'data')

    def says(self, time_s: float, topic: str, value: float) -> None:
        """Let a sensor say something, at whole seconds or halves."""
        heappush(self._plan, (time_s, next(self._count), self.sender(topic, value)))

    def _feed(self) -> None:
        while self._plan and self._plan[0][0] * NS_PER_S <= self.bench.kernel.now_ns():
            heappop(self._plan)[2]()

    def sender(self, topic: str, value: float) -> Callable[[], None]:
        def send() -> None:
            publisher = self.sensors[topic]
            if 'temperature' in topic:
                publisher.msg.temperature = value
            else:
                publisher.msg.data = value
            publisher.publish()
        return send

    def told(self) -> list[tuple[float, Cause]]:
        """Return the causes that were told, without those that were told again."""
        found: list[tuple[float, Cause]] = []
        active: dict[tuple[str, str], Any] = {}
        for time_s, text in self.causes.all:
            cause = Cause.from_json(text)
            key = cause.kind, cause.subject
            if (cause.level if cause.active else None) != active.get(key):
                found.append((time_s, cause))
                active[key] = cause.level if cause.active else None
        return found

    def qualities(self, sign: str) -> list[tuple[float, str, str, str]]:
        """Return when the quality, the value or the source of a sign was another."""
        found: list[tuple[float, str, str, str]] = []
        for time_s, text in self.signs.all:
            status = {each['name']: each for each in json.loads(text)['status']}
            values = status[f'anna/{sign}']['values']
            state = values['quality'], values['value'], values['source']
            if not found or found[-1][1:] != state:
                found.append((time_s, *state))
        return found


def every_second(person: Person, topic: str, first_s: int, last_s: int, value: float) -> None:
    for time_s in range(first_s, last_s):
        person.says(time_s, topic, value)
