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
Position estimate of a node without a survey, from its links to nodes with known positions.

The quality of a link gives a rough distance: the path loss of rooms, with several dB of walls and
furniture. The estimate starts at the centroid, weighted by quality, and minimizes the squares of
the errors of the logarithmic distances. A factor common to all distances is estimated as well,
which removes the influence of the transmit power and the building. Bounded; safe in the real-time
loop at a low rate.
"""

from __future__ import annotations

from collections.abc import Hashable
from collections.abc import Sequence
from itertools import pairwise
import math
from typing import Final
from typing import NamedTuple

#: Largest number of links of one node; the least recent is removed first.
MOST_LINKS: Final = 32
# Mean LQI of received frames by signal to noise ratio in dB, measured with the CC2420.
_LQI: Final = (79.0, 84.0, 89.0, 94.0, 97.0, 100.0, 103.0, 104.0, 105.5, 106.6, 107.3)
_SNR_DB: Final = (2.0, 3.0, 5.0, 7.0, 8.0, 10.0, 11.0, 12.0, 14.0, 17.0, 30.0)
# LQI for links without a quality: a distance of one or two rooms.
_HEARD_LQI: Final = 105.0
_WORST_LQI: Final = 80.0
# Transmissions per packet, and the corresponding LQI.
_ETX: Final = ((1.0, 105.0), (1.5, 91.0), (2.0, 88.0), (5.0, 82.0))
# Indoors: 0 dBm sent, 46 dB lost in the first metre, noise at -96 dBm; the unknown
# walls make the exponent larger than that of a room.
_SNR_AT_1_M_DB: Final = 50.0
_EXPONENT: Final = 3.5
# The quality of one frame gives the distance within a factor of about two.
_LOG_STDDEV: Final = 1.0
# Standard deviation of the common factor: a factor of three.
_FACTOR_STDDEV: Final = 1.1
_NEAREST_M: Final = 0.3
# More links than this improve the estimate only a little.
_INDEPENDENT: Final = 4.0
_ROUNDS: Final = 12


class PositionLink(NamedTuple):
    """
    A link to a node at a known position.

    :ivar x: of the other end, in m, as is y.
    :ivar distance_m: derived from its quality.
    """

    x: float
    y: float
    distance_m: float


class PositionEstimate(NamedTuple):
    """
    An estimate of a position.

    :ivar x: in m, as is y.
    :ivar stddev_m: its standard deviation.
    """

    x: float
    y: float
    stddev_m: float


def distance_of_lqi(lqi: float) -> float:
    """Return the distance in m that corresponds to an LQI indoors."""
    if lqi <= _LQI[0]:
        snr = _SNR_DB[0]
    elif lqi >= _LQI[-1]:
        snr = _SNR_DB[-1]
    else:
        place = next(index for index, each in enumerate(_LQI) if lqi < each)
        part = (lqi - _LQI[place - 1]) / (_LQI[place] - _LQI[place - 1])
        snr = _SNR_DB[place - 1] + part * (_SNR_DB[place] - _SNR_DB[place - 1])
    return float(10.0 ** ((_SNR_AT_1_M_DB - snr) / (10.0 * _EXPONENT)))


def lqi_of_link_cost(cost: int) -> float:
    """Return the LQI to which MultiHopLQI gives this link cost; it saturates at 110."""
    return float(min(110.0, max(50.0, 130.0 - (64.0 * max(cost, 0)) ** (1.0 / 3.0))))


def lqi_of_etx(transmissions: float) -> float:
    """Return the LQI of links with this number of transmissions per packet (CTP's ETX)."""
    for (low, high_lqi), (high, low_lqi) in pairwise(_ETX):
        if transmissions <= high:
            return high_lqi + (low_lqi - high_lqi) * max(0.0, transmissions - low) / (high - low)
    return _ETX[-1][1]


def lqi_of_beacon_share(share: float) -> float:
    """Return the LQI of links that deliver this share of beacons."""
    return _WORST_LQI + (_HEARD_LQI - _WORST_LQI) * max(0.0, min(share, 1.0))


def estimate(links: Sequence[PositionLink]) -> PositionEstimate | None:
    """
    Estimate the position of a node.

    :return: None without links.
    """
    if not links:
        return None
    weights = [1.0 / each.distance_m ** 2 for each in links]
    total = sum(weights)
    x = sum(w * each.x for w, each in zip(weights, links)) / total
    y = sum(w * each.y for w, each in zip(weights, links)) / total
    spread = math.sqrt(sum(
        w * ((each.x - x) ** 2 + (each.y - y) ** 2) for w, each in zip(weights, links)) / total)
    reach = sum(w * each.distance_m for w, each in zip(weights, links)) / total
    if len(links) < 3 or spread < _NEAREST_M:
        return PositionEstimate(x, y, max(spread, reach, _NEAREST_M))
    return _fitted(links, x, y, spread)


def _fitted(links: Sequence[PositionLink], x: float, y: float, spread: float) -> PositionEstimate:
    """Fit the position and the common factor of the distances, starting at the centroid."""
    from_x, from_y, factor = x, y, 0.0
    held = 1.0 / (2.0 * spread) ** 2  # a weak prior at the centroid
    weight = 1.0 / _LOG_STDDEV ** 2
    xx = yy = held
    xy = residuals = 0.0
    for _ in range(_ROUNDS):
        xx, yy, ff = held, held, 1.0 / _FACTOR_STDDEV ** 2
        xy = xf = yf = residuals = 0.0
        gx, gy, gf = held * (from_x - x), held * (from_y - y), -ff * factor
        for each in links:
            dx, dy = x - each.x, y - each.y
            square = max(dx * dx + dy * dy, _NEAREST_M ** 2)
            error = 0.5 * math.log(square) - math.log(each.distance_m) - factor
            ax, ay = dx / square, dy / square
            xx += weight * ax * ax
            xy += weight * ax * ay
            yy += weight * ay * ay
            xf -= weight * ax
            yf -= weight * ay
            ff += weight
            gx -= weight * ax * error
            gy -= weight * ay * error
            gf += weight * error
            residuals += weight * error * error
        # Eliminate the factor, so that two unknowns remain.
        xx, xy, yy = xx - xf * xf / ff, xy - xf * yf / ff, yy - yf * yf / ff
        gx, gy = gx - xf * gf / ff, gy - yf * gf / ff
        determinant = xx * yy - xy * xy
        step_x, step_y = (yy * gx - xy * gy) / determinant, (xx * gy - xy * gx) / determinant
        length = math.hypot(step_x, step_y)
        scale = min(1.0, spread / length) if length > 0.0 else 1.0
        x, y = x + scale * step_x, y + scale * step_y
        factor += (gf - xf * step_x - yf * step_y) / ff * scale
        if length < 0.01:
            break
    if not math.hypot(x - from_x, y - from_y) <= 3.0 * spread:
        # No convergence: use the centroid.
        return PositionEstimate(from_x, from_y, 2.0 * spread)
    # Neighbouring links pass through the same walls.
    worse = max(1.0, math.sqrt(residuals / len(links))) * max(
        1.0, math.sqrt(len(links) / _INDEPENDENT))
    return _resolve_mirror(links, PositionEstimate(x, y, worse * math.sqrt(
        (xx + yy) / (xx * yy - xy * xy))))


def _resolve_mirror(links: Sequence[PositionLink], found: PositionEstimate) -> PositionEstimate:
    """Project onto the line when all known positions lie on one: both sides fit equally."""
    count = len(links)
    x, y = sum(each.x for each in links) / count, sum(each.y for each in links) / count
    xx = sum((each.x - x) ** 2 for each in links) / count
    yy = sum((each.y - y) ** 2 for each in links) / count
    xy = sum((each.x - x) * (each.y - y) for each in links) / count
    direction = 0.5 * math.atan2(2.0 * xy, xx - yy)
    across_x, across_y = -math.sin(direction), math.cos(direction)
    beside = (found.x - x) * across_x + (found.y - y) * across_y
    width = math.sqrt(max(0.0, xx * across_x ** 2 + 2.0 * xy * across_x * across_y
                          + yy * across_y ** 2))
    if 2.0 * width >= abs(beside):
        return found
    return PositionEstimate(found.x - beside * across_x, found.y - beside * across_y,
                            math.hypot(found.stddev_m, beside))


class LinkLog:
    """
    The links of one node by their other end, each with its mean quality.

    :ivar age_ns: age up to which a link is used, for wearable nodes; 0 for no limit.
    """

    __slots__ = ('age_ns', '_links', '_noted')

    def __init__(self) -> None:
        self.age_ns = 0
        self._links: dict[Hashable, PositionLink] = {}
        self._noted: dict[Hashable, int] = {}

    def note(self, other: Hashable, x: float, y: float, now_ns: int, lqi: float | None = None
             ) -> None:
        """
        Note a link between the node and a known position.

        :param lqi: None where only the existence of the link is known.
        """
        before = self._links.pop(other, None)
        noted_ns = self._noted.pop(other, now_ns)
        self._noted[other] = now_ns
        distance_m = distance_of_lqi(_HEARD_LQI if lqi is None else lqi)
        if before is not None and self._counts(noted_ns, now_ns):
            if lqi is None:
                distance_m = before.distance_m
            # A mean of logarithms, since one frame is inaccurate.
            distance_m = math.exp(math.log(before.distance_m) + (
                math.log(distance_m) - math.log(before.distance_m)) / 8)
        elif len(self._links) >= MOST_LINKS:
            oldest = next(iter(self._links))
            del self._links[oldest], self._noted[oldest]
        self._links[other] = PositionLink(x, y, distance_m)

    def __len__(self) -> int:
        return len(self._links)

    def place(self, now_ns: int) -> PositionEstimate | None:
        """Return the estimated position; None while unknown."""
        return estimate([link for other, link in self._links.items()
                         if self._counts(self._noted[other], now_ns)])

    def _counts(self, noted_ns: int, now_ns: int) -> bool:
        return not self.age_ns or now_ns - noted_ns <= self.age_ns
