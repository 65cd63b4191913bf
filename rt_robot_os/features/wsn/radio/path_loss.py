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

"""Path loss by distance, walls, shadowing, and fading over time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import exp
from math import hypot
from math import sqrt
from random import Random
from typing import Final

import numpy as np
import numpy.typing as npt

#: ``walls(x1, y1, x2, y2)`` in m: the loss in dB by obstacles between two positions.
Walls = Callable[[float, float, float, float], float]

_NEAREST_M: Final = 0.1
_NS_PER_S: Final = 1e9


@dataclass(frozen=True)
class PathLoss:
    """
    Log-distance path loss.

    :ivar one_metre_db: at 1 m.
    :ivar exponent: 2 in free space, 2.2 to 3 at home.
    :ivar shadowing_db: standard deviation of the constant offset of a link, in both directions.
    :ivar asymmetry_db: standard deviation of the difference of both directions.
    :ivar fading_db: standard deviation of the change over time, in both directions.
    :ivar fading_s: time constant of that change.
    :ivar walls: see ``Walls``.
    """

    one_metre_db: float = 43.0
    exponent: float = 2.6
    shadowing_db: float = 4.0
    asymmetry_db: float = 1.5
    fading_db: float = 0.0
    fading_s: float = 5.0
    walls: Walls | None = None

    def without_walls_db(self, away_m: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Return the loss over distances, without walls and random parts."""
        return self.one_metre_db + 10 * self.exponent * np.log10(np.maximum(away_m, _NEAREST_M))

    def range_m(self, budget_db: float) -> float:
        """
        Return the largest length of a link with this loss, shadowing included.

        Three standard deviations of shadowing and asymmetry; links beyond do not exist.
        """
        random_db = 3 * hypot(self.shadowing_db, self.asymmetry_db / sqrt(2))
        return float(10 ** ((budget_db + random_db - self.one_metre_db) / (10 * self.exponent)))

    def shadowing(self, random: Random) -> tuple[float, float]:
        """Draw the constant offsets of both directions of a link, in dB."""
        both = random.gauss(0, self.shadowing_db) if self.shadowing_db else 0.0
        half = random.gauss(0, self.asymmetry_db) / 2 if self.asymmetry_db else 0.0
        return both + half, both - half


class Fading:
    """
    Fading of each pair of nodes: a mean-reverting random walk.

    A value is generated on demand, from the last one of the pair and the time since.
    """

    __slots__ = ('_spread_db', '_time_ns', '_still_ns', '_random', '_pairs')

    def __init__(self, spread_db: float, time_s: float, random: Random) -> None:
        """:param time_s: time constant."""
        self._spread_db = spread_db
        self._time_ns = time_s * _NS_PER_S
        self._still_ns = self._time_ns / 64
        self._random = random
        self._pairs: dict[int, tuple[int, float]] = {}

    def at(self, first: int, second: int, now_ns: int) -> float:
        """Return the fading in dB between two nodes now, the same in both directions."""
        pair = first << 32 | second if first < second else second << 32 | first
        before = self._pairs.get(pair)
        if before is None:
            value = self._random.gauss(0, self._spread_db)
        else:
            since = now_ns - before[0]
            if since < self._still_ns:
                return before[1]
            kept = exp(-since / self._time_ns)
            value = kept * before[1] + sqrt(1 - kept * kept) * self._random.gauss(
                0, self._spread_db)
        self._pairs[pair] = (now_ns, value)
        return value

    def forget(self, node: int) -> None:
        """Remove the values of a node."""
        for pair in [pair for pair in self._pairs if node in (pair >> 32, pair & 0xFFFFFFFF)]:
            del self._pairs[pair]
