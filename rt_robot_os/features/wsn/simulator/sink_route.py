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


"""The route of a sink that drives in a loop."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
import math
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.wsn.simulator.scenario import SinkSettings

_MOST_POINTS: Final = 10_000


class Waypoint(NamedTuple):
    """A point of the route, and the waiting time there."""

    x: float
    y: float
    stay_s: float = 0.0


def read_point(text: str) -> Waypoint:
    """
    Parse a way point such as ``3.0 1.5`` or ``3.0 1.5 stay 20``.

    :raises ValueError: it is invalid; with the remedy.
    """
    words = text.replace(',', ' ').split()
    if len(words) == 4 and words[2] == 'stay':
        del words[2]
    elif len(words) != 2:
        raise ValueError('must be x y, or x y stay SECONDS')
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        raise ValueError('must be x y, or x y stay SECONDS') from None
    if not all(abs(number) < 1e6 for number in numbers) or min([*numbers[2:], 0.0]) < 0.0:
        raise ValueError('must be numbers below 1,000,000, and the time must not be negative')
    return Waypoint(*numbers)


class SinkRoute:
    """
    A closed polygon, driven at one speed.

    :param points: at least one; after the last one it continues with the first.
    """

    def __init__(self, points: Sequence[Waypoint], speed_m_s: float, start_s: float = 0.0) -> None:
        self._points = tuple(points)
        self._speed_m_s = speed_m_s
        self._start_s = start_s
        self._leave_s: list[float] = []   # departure time from each point
        self._reach_s: list[float] = []   # arrival time at each point, from the start of a loop
        at_s = 0.0
        for index, point in enumerate(self._points):
            self._reach_s.append(at_s)
            at_s += point.stay_s
            self._leave_s.append(at_s)
            following = self._points[(index + 1) % len(self._points)]
            at_s += math.hypot(following.x - point.x, following.y - point.y) / speed_m_s
        self.round_s = at_s

    @property
    def points(self) -> Sequence[Waypoint]:
        """Return the way points."""
        return self._points

    def at_s(self, time_s: float) -> tuple[float, float]:
        """Return x and y at a time."""
        first = self._points[0]
        if time_s <= self._start_s or self.round_s <= 0.0:
            return first.x, first.y
        within = (time_s - self._start_s) % self.round_s
        index = bisect_right(self._reach_s, within) - 1
        here, there = self._points[index], self._points[(index + 1) % len(self._points)]
        driven_m = max(0.0, within - self._leave_s[index]) * self._speed_m_s
        length_m = math.hypot(there.x - here.x, there.y - here.y)
        part = min(1.0, driven_m / length_m) if length_m > 0.0 else 0.0
        return here.x + part * (there.x - here.x), here.y + part * (there.y - here.y)


def sink_route(sink: SinkSettings) -> SinkRoute:
    """
    Create the route of a sink.

    :raises ConfigError: a way point cannot be read.
    """
    points, problems = [], []
    for text in sink.way[:_MOST_POINTS]:
        try:
            points.append(read_point(text))
        except ValueError as error:
            problems.append(f'sink.way = {text!r}: {error}')
    if problems:
        raise ConfigError(problems)
    return SinkRoute(points, sink.speed_m_s, sink.start_s)
