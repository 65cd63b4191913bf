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
"""Objects that stay in place near the expected location of a person."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
import math
from typing import Final

import numpy as np

from rt_robot_os.motion.unmapped_points import Array

Point = tuple[float, float]

_MOST: Final = 16
# Hysteresis: the present object may be this much farther away, and another one has to be better
# by this much.
_KEPT_M: Final = 1.0
_BETTER_M: Final = 0.5
# A point of a body is the mean of this many, because a single one may be noise.
_TOGETHER: Final = 3


@dataclass
class Thing:
    """
    An object that is not on the map, over time.

    :ivar x: middle of what is seen of it, in m in the map.
    :ivar y: as x.
    :ivar size_m: of what is seen of it.
    :ivar start: where the middle was at first.
    :ivar since_ns: since when it is there.
    :ivar seen_ns: when it was seen last.
    :ivar is_steady: it has been there for long enough.
    :ivar outline: its points in the last scan, in m in the map.
    """

    x: float
    y: float
    size_m: float
    start: Point
    since_ns: int
    seen_ns: int
    is_steady: bool
    outline: tuple[Array, Array]

    def nearest(self, point: Point) -> Point:
        """Return its point that is nearest to another."""
        x, y = self.outline
        away = np.hypot(x - point[0], y - point[1])
        near = np.argsort(away)[:_TOGETHER]
        return float(x[near].mean()), float(y[near].mean())


class Things:
    """
    Tracks objects from scan to scan; safe in the real-time loop.

    :param size_m: the smallest and the largest size of an object.
    :param points: the fewest points of an object.
    :param steady_m: an object that moves by less stays in place, ...
    :param steady_ns: ... if it does so for this time.
    :param lost_ns: an object that was not seen for this time is gone.
    """

    def __init__(self, size_m: Point, points: int, steady_m: float, steady_ns: int, lost_ns: int
                 ) -> None:
        self._size_m = size_m
        self._points = points
        self._steady_m = steady_m
        self._steady_ns = steady_ns
        self._lost_ns = lost_ns
        self._things: list[Thing] = []
        self._chosen: Thing | None = None

    def __len__(self) -> int:
        return len(self._things)

    def forget(self) -> None:
        """Reset."""
        self._things.clear()
        self._chosen = None

    def look(self, outlines: Iterable[tuple[Array, Array]], stamp_ns: int) -> None:
        """
        Update with one scan.

        :param outlines: the points of each thing, in m in the map.
        """
        self._things = [each for each in self._things if stamp_ns - each.seen_ns <= self._lost_ns]
        known = list(self._things)
        for outline in outlines:
            x, y = outline
            left, right, low, high = (float(each) for each in (
                x.min(), x.max(), y.min(), y.max()))
            size_m = math.hypot(right - left, high - low)
            if x.size < self._points or not self._size_m[0] <= size_m <= self._size_m[1]:
                continue
            middle = (left + right) / 2, (low + high) / 2
            thing = min(known, key=lambda each: math.dist((each.x, each.y), middle), default=None)
            if thing is not None and self._is(thing, middle):
                known.remove(thing)
                thing.x, thing.y = middle
                thing.seen_ns, thing.size_m, thing.outline = stamp_ns, size_m, outline
                thing.is_steady |= stamp_ns - thing.since_ns >= self._steady_ns
            elif len(self._things) < _MOST:
                self._things.append(Thing(*middle, size_m, middle, stamp_ns, stamp_ns,
                                          not self._steady_ns, outline))

    def _is(self, thing: Thing, middle: Point) -> bool:
        """Return whether an object is a known one; each side of a body has another middle."""
        before = (thing.x, thing.y) if thing.is_steady else thing.start
        return math.dist(before, middle) <= self._steady_m

    def best(self, place: Point, within_m: float, stamp_ns: int, others: Iterable[Point] = ()
             ) -> Thing | None:
        """
        Return the object that is most likely the person at a location; None without.

        It is the nearest one, and of those about as near the longest, because a fallen person
        lies. An object nearer to the location of another person is that person.

        :param within_m: how far from the place they may be.
        :param stamp_ns: of the scan in which it has to be seen.
        :param others: where other people are said to be.
        """
        def away_m(thing: Thing) -> float:
            return math.dist((thing.x, thing.y), place)

        def rank_m(thing: Thing) -> float:
            return away_m(thing) - thing.size_m

        elsewhere = list(others)
        likely = [each for each in self._things if each.is_steady and all(
            math.dist((each.x, each.y), other) >= away_m(each) for other in elsewhere)]
        found = min((each for each in likely if each.seen_ns == stamp_ns
                     and away_m(each) <= within_m), key=rank_m, default=None)
        kept = next((each for each in likely if each is self._chosen), None)
        if kept is not None and away_m(kept) <= within_m + _KEPT_M and (
                found is None or rank_m(found) > rank_m(kept) - _BETTER_M):
            # While it is hidden for a moment, no other object replaces it.
            return kept if kept.seen_ns == stamp_ns else None
        self._chosen = found
        return found
