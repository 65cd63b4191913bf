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
Estimate of the position of a person from several sources; no topics, no kernel.

No worn or fixed sensor measures the position exactly. Each source gives a sighting: a point, its
uncertainty and its time. The uncertainty grows with age, because people walk; the sighting with
the least uncertainty now counts.
"""

from __future__ import annotations

from collections import Counter
from collections import deque
from collections.abc import Iterable
import math
from typing import Final
from typing import NamedTuple

_NS_PER_S: Final = 1_000_000_000
#: Growth of the uncertainty: people walk, but sit most of the time.
SPREAD_M_S: Final = 0.2
#: Largest walking speed in a flat.
WALK_M_S: Final = 1.5
# Number and age of the reports of the nearest node that count; single ones are unreliable.
_VOTES: Final = 9
_VOTES_NS: Final = 120 * _NS_PER_S
# Least change of the mean that counts as a movement: reports between two nodes alternate.
_STEADY_M: Final = 1.0
# Sources that identify the person, and how long sightings that contradict them are ignored.
_PERSONAL: Final = ('ros', 'node')
_PERSONAL_NS: Final = 60 * _NS_PER_S
#: The robot sees a person, most likely this one, near the position from other sources.
SEEN: Final = 'seen'
# Age from which a sighting by the robot yields to a contradicting one of a node.
_UNSEEN_NS: Final = 2 * _NS_PER_S


class Sighting(NamedTuple):
    """
    A position of a person from one source.

    :ivar x: in the map, in m.
    :ivar y: in the map, in m.
    :ivar uncertainty_m: standard deviation at its time.
    :ivar how: the source: ``ros``, ``node`` (nearest node of a worn one), ``presence``,
        ``network``, or ``seen`` by the robot.
    :ivar node: of the sensor network; empty for none.
    :ivar stamp_ns: its time.
    """

    x: float
    y: float
    uncertainty_m: float
    how: str
    node: str
    stamp_ns: int

    def now_m(self, now_ns: int) -> float:
        """Return the uncertainty now, in m."""
        return self.uncertainty_m + SPREAD_M_S * max(0, now_ns - self.stamp_ns) / _NS_PER_S

    def distance(self, x: float, y: float) -> float:
        """Return the distance to a point, in m."""
        return math.hypot(self.x - x, self.y - y)


class Room(NamedTuple):
    """A rectangle of the map, in m."""

    name: str
    x0: float
    y0: float
    x1: float
    y1: float

    def has(self, x: float, y: float) -> bool:
        """Return whether a point is in it."""
        return self.x0 <= x <= self.x1 and self.y0 <= y <= self.y1

    @property
    def area(self) -> float:
        """Return its area, in m2."""
        return (self.x1 - self.x0) * (self.y1 - self.y0)


def room_of(text: str) -> Room:
    """
    Parse a room: ``kitchen 0 0 3.5 4``.

    :raises ValueError: it is not valid.
    """
    name, *numbers = text.split() or ['']
    try:
        x0, y0, x1, y1 = (float(each) for each in numbers)
    except ValueError:
        x0 = y0 = x1 = y1 = math.nan
    if not (name.isidentifier() and x0 < x1 and y0 < y1 and math.isfinite((x1 - x0) * (y1 - y0))):
        raise ValueError(f'{text[:60]!r} is not a room: write a name and two corners in m, the '
                         'lower left one first: kitchen 0 0 3.5 4')
    return Room(name, x0, y0, x1, y1)


class Rooms:
    """The rooms of a flat; of nested ones, such as a bed, the smallest counts."""

    def __init__(self, rooms: Iterable[Room]) -> None:
        self._rooms = sorted(rooms, key=lambda room: room.area)

    def at(self, x: float, y: float) -> str:
        """Return the name of the room at a point; empty when there is none."""
        return next((room.name for room in self._rooms if room.has(x, y)), '')


class PlaceEstimate:
    """
    Position of one person; safe in the real-time loop.

    :param timeout_ns: largest age of a sighting that counts.
    :ivar refused: number of presence sightings of other people.
    """

    __slots__ = ('refused', '_timeout_ns', '_sightings', '_votes', '_chosen', '_steady')

    def __init__(self, timeout_ns: int) -> None:
        self.refused = 0
        self._timeout_ns = timeout_ns
        self._sightings: dict[str, Sighting] = {}
        self._votes: deque[tuple[str, float, float, int]] = deque(maxlen=_VOTES)
        self._chosen = ''
        self._steady = math.nan, math.nan

    def put(self, sighting: Sighting) -> None:
        """Add a sighting; it replaces the last one of its source."""
        self._sightings[sighting.how] = sighting

    def vote(self, node: str, x: float, y: float, stamp_ns: int) -> tuple[str, float, float]:
        """
        Add a report of the nearest node, with its position.

        :return: the node with the most recent reports, and the mean position of recent reports,
            which is more accurate than any of them; it changes when the person has moved.
        """
        self._votes.append((node, x, y, stamp_ns))
        lately = [each for each in self._votes if stamp_ns - each[3] <= _VOTES_NS]
        votes = Counter(each[0] for each in lately)
        most = max(votes.values())
        if most >= 2 * votes.get(self._chosen, 0):
            self._chosen = next(
                each[0] for each in reversed(lately) if votes[each[0]] == most)
        mean = (sum(each[1] for each in lately) / len(lately),
                sum(each[2] for each in lately) / len(lately))
        if not math.dist(mean, self._steady) <= _STEADY_M:
            self._steady = mean
        return self._chosen, *self._steady

    def best(self, now_ns: int) -> Sighting | None:
        """
        Return the sighting with the least uncertainty now; None when all are too old.

        A sighting by the robot does not count when a newer one of another source contradicts it.
        """
        others, seen = self.by_nodes(now_ns), self._sightings.get(SEEN)
        if seen is None or now_ns - seen.stamp_ns > self._timeout_ns:
            return others
        if others is None:
            return seen
        if others.stamp_ns - seen.stamp_ns > _UNSEEN_NS and (
                others.distance(seen.x, seen.y) > others.uncertainty_m + seen.uncertainty_m):
            return others
        return min(seen, others, key=lambda each: each.now_m(now_ns))

    def by_nodes(self, now_ns: int) -> Sighting | None:
        """
        Return the same without sightings by the robot.

        The robot searches the person around this position. Around its own sighting it could never
        correct a wrong one.
        """
        fresh = [each for each in self._sightings.values()
                 if each.how != SEEN and now_ns - each.stamp_ns <= self._timeout_ns]
        return min(fresh, key=lambda each: (each.now_m(now_ns), each.how), default=None)

    def may_be_person(self, x: float, y: float, range_m: float, stamp_ns: int,
                      others: Iterable[Sighting]) -> bool:
        """
        Return whether a presence sensor may detect this person.

        Recent sightings that identify the person must agree. Without one no other person may be
        nearer to the sensor, and the person must be able to have walked there.

        :param range_m: range of the sensor.
        :param others: sightings of other people.
        """
        known = [each for each in self._sightings.values() if each.how in _PERSONAL
                 and stamp_ns - each.stamp_ns <= _PERSONAL_NS]
        if known:
            # A worn node receives nodes of the next room as well: half the range.
            agree = all(each.distance(x, y) <= range_m / 2 for each in known)
            self.refused += not agree
            return agree
        mine = self.by_nodes(stamp_ns)
        my_m = math.inf if mine is None else mine.distance(x, y)
        mistaken = any(other.distance(x, y) <= range_m + other.now_m(stamp_ns)
                       and other.distance(x, y) <= my_m for other in others
                       if stamp_ns - other.stamp_ns <= self._timeout_ns)
        reach_m = math.inf if mine is None else (
            range_m + 2 * mine.uncertainty_m
            + WALK_M_S * max(0, stamp_ns - mine.stamp_ns) / _NS_PER_S)
        if mistaken or my_m > reach_m:
            self.refused += 1
            return False
        return True
