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


"""
An ordinary day in a home with sensors, as samples: people who sleep, cook, sit and go out.

There is no emergency. Sensors are noisy, nodes drop out and reboot, the sink is silent for
minutes, readings are NaN: what assesses people and rooms must not alarm. The same seed gives the
same day; the time of day is that of the samples, from midnight.
"""

from __future__ import annotations

import bisect
from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Sequence
import heapq
import math
import random
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.messages.network_rows import names_label
from rt_robot_os.messages.network_rows import NodeRow
from rt_robot_os.messages.network_rows import NodeState
from rt_robot_os.messages.network_rows import WIDTH
from rt_robot_os.messages.quantities import quantity
from rt_robot_os.testing.module_bench import ModuleBench
from rt_robot_os.topics import Publisher

ROOMS: Final = ('hall 0 0 4 4', 'kitchen 4 0 8 4', 'living 8 0 14 4', 'bath 0 5 4 9',
                'sleeping 4 5 9 9', 'study 9 5 14 9')
#: Who lives there, and in which room they are in bed.
PEOPLE: Final = {'anna': 'sleeping', 'bob': 'study'}
#: Where a person who goes out is seen last.
DOOR: Final = 'hall'
NODES_TOPIC: Final = 'wsn/nodes'
_HOUR_S: Final = 3600.0
_OUT: Final = ''
_FIXED: Final = ('temperature', 'battery', 'presence')
_WORN: Final = ('acceleration_g', 'nearest_node', 'pulse_per_min', 'spo2_percent', 'alarm',
                'battery')
_MORE: Final = {'kitchen': ('smoke', 'water'), 'bath': ('water',), 'living': ('smoke',)}
_SILENT_PERIODS: Final = 10


class Sample(NamedTuple):
    """
    A reading, or the rows of the network.

    :ivar time_s: of the day.
    :ivar topic: where it is published.
    :ivar value: a number, or all numbers of the rows.
    """

    time_s: float
    topic: str
    value: float | tuple[float, ...]


class _Person:
    """Where a person is and whether they move, drawn for the whole day."""

    def __init__(self, bed: str, chance: random.Random) -> None:
        #: (from, room, moves so many times an hour)
        self.stays: list[tuple[float, str, float]] = []
        rise_s = chance.uniform(6.5, 8.0) * _HOUR_S
        night_s = chance.uniform(21.5, 23.0) * _HOUR_S
        self._sleep(0.0, rise_s, bed, chance)
        time_s, rooms = rise_s, [room.split()[0] for room in ROOMS]
        out_s = chance.uniform(10.0, 15.0) * _HOUR_S
        gone = False
        while time_s < night_s:
            if not gone and time_s > out_s:
                gone = True
                self.stays += [(time_s, DOOR, 200.0), (time_s + 120.0, _OUT, 0.0)]
                time_s += chance.uniform(0.5, 2.5) * _HOUR_S
                self.stays.append((time_s, DOOR, 200.0))
                time_s += 180.0
            room = chance.choice(rooms)
            self.stays.append((time_s, room, chance.choice((20.0, 60.0, 200.0))))
            time_s += chance.uniform(3.0, 30.0 if room in ('bath', 'hall') else 80.0) * 60.0
        self._sleep(night_s, 24 * _HOUR_S, bed, chance)
        self.stays.sort()
        self._chance = chance
        self._moves_s = 0.0

    def _sleep(self, begin_s: float, end_s: float, bed: str, chance: random.Random) -> None:
        self.stays.append((begin_s, bed, 3.0))
        time_s = begin_s + chance.uniform(1.0, 4.0) * _HOUR_S
        while time_s < end_s - 1200.0:
            self.stays += [(time_s, 'bath', 200.0), (time_s + 300.0, bed, 3.0)]
            time_s += chance.uniform(2.0, 4.0) * _HOUR_S

    def at(self, time_s: float) -> tuple[str, float]:
        """Return the room, empty for outside, and how often an hour the person moves."""
        place = bisect.bisect_right(self.stays, (time_s, 'zzz', 0.0)) - 1
        return self.stays[max(0, place)][1:]

    def moves(self, time_s: float) -> bool:
        """Return whether the person moves at that moment; times must not decrease."""
        _, rate = self.at(time_s)
        if not rate or time_s < self._moves_s:
            return False
        self._moves_s = time_s + self._chance.expovariate(rate / _HOUR_S)
        return True


class QuietDay:
    """
    The samples of a day.

    :param seed: of all that is drawn.
    :param period_s: between two packets of a node.
    :param hours: its length.
    """

    def __init__(self, seed: int, period_s: float = 30.0, hours: float = 24.0) -> None:
        self._chance = random.Random(f'quiet day {seed}')
        self.period_s = period_s
        self.hours = hours
        rooms = [room.split() for room in ROOMS]
        #: Texts of the survey, as settings of modules take them.
        self.survey = tuple(
            f'{name} {(float(x0) + float(x1)) / 2} {(float(y0) + float(y1)) / 2} 2 id {number} '
            + ' '.join((*_FIXED, *_MORE.get(name, ())))
            for number, (name, x0, y0, x1, y1) in enumerate(rooms, 1)) + tuple(
            f'{person}_wrist 1 1 1 id {number} on {person} {" ".join(_WORN)}'
            for number, person in enumerate(PEOPLE, len(rooms) + 1))
        self._numbers = {text.split()[0]: int(text.split(' id ')[1].split()[0])
                         for text in self.survey}
        self._people = {name: _Person(bed, random.Random(self._chance.random()))
                        for name, bed in PEOPLE.items()}
        self._heard: dict[str, float] = {}
        self._silence = self._silences()

    @property
    def label(self) -> str:
        """Return the names of the nodes as the label of the rows."""
        return names_label({number: name for name, number in self._numbers.items()})

    def topics(self) -> dict[str, tuple[str, str]]:
        """Return type and field of each topic of a reading."""
        found = {}
        for text in self.survey:
            name, words = text.split()[0], text.split()
            for each in words[words.index('id') + 2:]:
                if each not in ('on', *PEOPLE):
                    kind = quantity(each)
                    found[f'wsn/{name}/{each}'] = kind.message, kind.field
        return found

    def samples(self) -> Iterator[Sample]:
        """Yield the samples in the order of time."""
        draw = self._chance
        waiting = [(draw.uniform(0.0, self.period_s), name) for name in self._numbers]
        waiting.append((self.period_s, NODES_TOPIC))
        heapq.heapify(waiting)
        while waiting[0][0] < self.hours * _HOUR_S:
            time_s, name = heapq.heappop(waiting)
            heapq.heappush(waiting, (time_s + self.period_s * draw.uniform(0.95, 1.05), name))
            if name == NODES_TOPIC:
                yield Sample(time_s, name, tuple(self._rows(time_s)))
            # One packet in twenty is lost.
            elif draw.random() > 0.05 and self._in_reach(name, time_s) and not any(
                    begin_s <= time_s < end_s for begin_s, end_s in self._silence[name]):
                self._heard[name] = time_s
                for what, value in self._readings(name, time_s):
                    yield Sample(time_s, f'wsn/{name}/{what}', value)

    # ---- losses -----------------------------------------------------------------------------

    def _in_reach(self, name: str, time_s: float) -> bool:
        person = self._people.get(name.removesuffix('_wrist'))
        return person is None or person.at(time_s)[0] != _OUT

    def _silences(self) -> dict[str, list[tuple[float, float]]]:
        draw, end_s = self._chance, self.hours * _HOUR_S

        def some(count: int, shortest_s: float, longest_s: float) -> list[tuple[float, float]]:
            begins = [draw.uniform(0.0, end_s) for _ in range(count)]
            return [(begin, begin + draw.uniform(shortest_s, longest_s)) for begin in begins]

        sink = some(2, 30.0, 400.0)
        return {name: [*sink, *some(3, 20.0, 1800.0), *some(2, 5.0, 30.0)]
                for name in self._numbers}

    def _rows(self, time_s: float) -> Iterator[float]:
        latest_s = max(self._heard.values(), default=math.nan)
        yield from self._row(0, NodeState.SINK, math.nan, time_s - latest_s)
        for name, number in self._numbers.items():
            heard_s = self._heard.get(name)
            age_s = math.nan if heard_s is None else time_s - heard_s
            state = NodeState.UNHEARD if heard_s is None else NodeState.SILENT if (
                age_s > _SILENT_PERIODS * self.period_s) else NodeState.GOOD
            yield from self._row(number, state, self._volts(number, time_s), age_s)

    @staticmethod
    def _row(number: int, state: NodeState, volts: float, age_s: float) -> NodeRow:
        return NodeRow(number, 1.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, state, volts, 100.0, 0.95, 0.95,
                       1.0, 0.0, 0.0, 0.0, age_s)

    # ---- readings ----------------------------------------------------------------------------

    def _volts(self, number: int, time_s: float) -> float:
        return 3.0 - 0.05 * number - 0.01 * time_s / _HOUR_S / 24.0

    def _readings(self, name: str, time_s: float) -> Iterator[tuple[str, float]]:
        draw = self._chance
        volts = self._volts(self._numbers[name], time_s) + draw.gauss(0.0, 0.01)
        yield 'battery', volts - (0.5 if draw.random() < 0.002 else 0.0)
        person = name.removesuffix('_wrist')
        if person in PEOPLE:
            yield from self._worn(person, time_s)
        else:
            yield from self._fixed(name, time_s)

    def _worn(self, person: str, time_s: float) -> Iterator[tuple[str, float]]:
        draw = self._chance
        room, moves = self._people[person].at(time_s)[0], self._people[person].moves(time_s)
        yield 'acceleration_g', 1.0 + draw.gauss(0.0, 0.3 if moves else 0.01)
        near = room if draw.random() > 0.15 else draw.choice(ROOMS).split()[0]
        yield 'nearest_node', float(self._numbers[near])
        yield 'alarm', 0.0
        # A sensor that slips gives NaN, for one sample.
        loose = draw.random() < 0.01
        pulse = 64.0 + 8.0 * moves + draw.gauss(0.0, 2.0)
        yield 'pulse_per_min', math.nan if loose else pulse
        yield 'spo2_percent', math.nan if loose else min(99.0, 97.0 + draw.gauss(0.0, 0.5))

    def _fixed(self, name: str, time_s: float) -> Iterator[tuple[str, float]]:
        draw, hour = self._chance, time_s / _HOUR_S
        degrees = 21.0 + 1.5 * math.sin((hour - 9.0) / 24.0 * 2.0 * math.pi)
        if name == 'kitchen':  # cooking at noon and in the evening
            degrees += 6.0 * sum(math.exp(-((hour - at) / 0.5) ** 2) for at in (12.3, 18.5))
        yield 'temperature', degrees + draw.gauss(0.0, 0.15)
        moving = False
        for each in self._people.values():
            room, rate = each.at(time_s)
            moving |= room == name and draw.random() < rate / 200.0
        yield 'presence', float(moving)
        for what in _MORE.get(name, ()):
            yield what, max(0.0, draw.gauss(0.0, 0.05))


def play(bench: ModuleBench, day: QuietDay, samples: Sequence[Sample], begin_s: float = 0.0,
         change: Callable[[Sample], Sample] = lambda sample: sample) -> None:
    """
    Publish the samples of a day on a bench while it runs.

    Call it before the modules are added.

    :param begin_s: time of the day at the beginning: earlier samples are left out.
    :param change: replaces samples, for days that are not quiet.
    """
    publishers: dict[str, tuple[Publisher, str]] = {
        topic: (bench.topic(topic, message), field)
        for topic, (message, field) in day.topics().items()}
    bench.bus.declare(NODES_TOPIC, 'std_msgs/msg/Float64MultiArray',
                      {'layout.dim': [{'label': day.label}]}, tail=WIDTH * 32)
    publishers[NODES_TOPIC] = bench.bus.publisher(NODES_TOPIC), 'data'
    start_ns = bench.kernel.now_ns()
    left = iter([sample for sample in samples if sample.time_s >= begin_s])
    waiting = [next(left, None)]

    def publish() -> None:
        now_ns = bench.kernel.now_ns()
        while (sample := waiting[0]) is not None:
            stamp_ns = start_ns + round((sample.time_s - begin_s) * NS_PER_S)
            if stamp_ns > now_ns:
                timer.start_at(stamp_ns)
                return
            sample = change(sample)
            publisher, field = publishers[sample.topic]
            setattr(publisher.msg, field, sample.value)
            publisher.publish(stamp_ns)
            waiting[0] = next(left, None)

    timer = bench.kernel.timer(bench.kernel.add_task('quiet day', publish, priority=90))
    bench.at(0.0, publish)
