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
Detect a laser that reports its maximum range instead of no echo: REP 117 requires +inf.

A LaserScan has the maximum range in ``range_max``; in a log it must be detected. A wall is not at
a constant distance from a moving robot, with nothing farther away and nothing just in front of it.
A reported maximum range is.
"""

from __future__ import annotations

from collections.abc import Iterable
import math
from typing import Any
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.features.mapping.slam.scan import Scan
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.features.mapping.slam.tuning import MapperTuning

_BIN_M: Final = 0.01
_SLACK_M: Final = 1e-3
#: Distance between two scans that are counted.
_APART_M: Final = 0.2
#: Smallest number of counted scans, and the number that is enough.
_PLACES_LEAST: Final = 10
_PLACES_MOST: Final = 2000
#: The maximum range is reported with this spread,
_SPREAD_M: Final = 0.03
#: by this share of the ranges at least,
_SHARE: Final = 0.01
#: in this share of the scans;
_SCANS_SHARE: Final = 0.2
#: of all ranges, this share may be longer: single wrong readings.
_LONGER_SHARE: Final = 0.001
#: In front of it, within this distance,
_FRONT_M: Final = 0.25
#: lie fewer ranges than this share of those at the maximum range.
_FRONT_SHARE: Final = 0.5


def echo_ranges(ranges: npt.NDArray[Any], range_min_m: float, range_max_m: float) -> Floats:
    """
    Return the ranges of a LaserScan: +inf is no echo, NaN no measurement.

    :param ranges: in m. From ``range_max_m`` on there is no echo.
    :param range_max_m: at most ``range_min_m`` for a driver that does not set it.
    """
    found = np.array(ranges, np.float64)
    found[found < range_min_m] = math.nan
    if range_max_m > range_min_m:
        found[found > range_max_m - _SLACK_M] = math.inf
    return found


class MaxRangeDetector:
    """
    A histogram of ranges, from scans that are some distance apart.

    :param range_max_m: mapping ignores ranges from here on; they count as longer.
    :ivar is_sure: enough scans were counted.
    """

    def __init__(self, range_max_m: float) -> None:
        bins = math.ceil(range_max_m / _BIN_M) + 1
        self.is_sure = False
        self._range_max_m = range_max_m
        self._counts: npt.NDArray[np.int64] = np.zeros(bins, np.int64)
        self._scans: npt.NDArray[np.int64] = np.zeros(bins, np.int64)
        self._places = 0
        self._last: Floats | None = None

    def add(self, scan: Scan) -> None:
        """Count the ranges of a scan, if the robot has moved since the last one."""
        if self.is_sure or (self._last is not None and math.dist(
                scan.odometry[:2], self._last[:2]) < _APART_M):
            return
        self._last = scan.odometry
        ranges = np.asarray(scan.ranges, np.float64)
        usable = np.minimum(ranges[np.isfinite(ranges) & (ranges > 0.0)], self._range_max_m)
        # A 32-bit float may be up to a micrometre below the intended number.
        bins = ((usable + 1e-6) / _BIN_M).astype(np.int64)
        self._counts += np.bincount(bins, minlength=len(self._counts))
        self._scans[np.unique(bins)] += 1
        self._places += 1
        self.is_sure = self._places >= _PLACES_MOST

    def found_m(self) -> float | None:
        """Return the reported maximum range, in m; None: there is none."""
        total = int(self._counts.sum())
        if self._places < _PLACES_LEAST or not total:
            return None
        below = np.concatenate(((0,), np.cumsum(self._counts)))
        wide, front = round(_SPREAD_M / _BIN_M), round(_FRONT_M / _BIN_M)
        # The last bin has the ranges that are longer than mapping uses.
        for top in range(len(self._counts) - 1, front + wide, -1):
            if total - below[top] > _LONGER_SHARE * total:
                return None
            first = top - wide
            reach = below[top] - below[first]
            if reach >= _SHARE * total and self._counts[top - 1] and (
                    below[first] - below[first - front] <= _FRONT_SHARE * reach) and (
                    self._scans[first:top].max() >= _SCANS_SHARE * self._places):
                return (first + int(np.flatnonzero(self._counts[first:top])[0])) * _BIN_M
        return None


def reported_max_range(scans: Iterable[Scan], range_max_m: float = MapperTuning.range_max_m
                       ) -> float | None:
    """
    Return the maximum range that the laser of a log reports instead of no echo, in m.

    :param range_max_m: a longer one makes no difference to mapping, and is not searched for.
    :return: None: the laser does not report it as a range.
    """
    reach = MaxRangeDetector(range_max_m)
    for scan in scans:
        reach.add(scan)
        if reach.is_sure:
            break
    return reach.found_m()
