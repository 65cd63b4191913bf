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

"""Notice a laser that reports its reach where it has no echo: that is no wall."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.slam.transforms import Floats

_BIN_M: Final = 0.01
#: So much of all ranges within so much of the longest one is no accident.
_SHARE: Final = 0.02
_NEAR_M: Final = 0.05


class Reach:
    """
    How often each range occurs.

    :param range_max_m: what is longer is left out by mapping anyway.
    """

    def __init__(self, range_max_m: float) -> None:
        self._range_max_m = range_max_m
        self._counts: npt.NDArray[np.int64] = np.zeros(int(range_max_m / _BIN_M) + 1, np.int64)

    def add(self, ranges: Floats) -> None:
        """Count the ranges of a scan, in m."""
        usable = ranges[(ranges > 0.0) & (ranges < self._range_max_m)]
        self._counts += np.bincount((usable / _BIN_M).astype(np.int64),
                                    minlength=len(self._counts))

    def problem(self) -> str:
        """Return a sentence about ranges that are probably no echo; empty: there are none."""
        found = np.flatnonzero(self._counts)
        if not len(found):
            return ''
        longest = int(found[-1])
        first = max(0, longest - round(_NEAR_M / _BIN_M))
        share = self._counts[first:].sum() / self._counts.sum()
        if share < _SHARE:
            return ''
        return (f'{share:.0%} of the ranges are {longest * _BIN_M:.2f} m, the longest one: if the '
                'laser reports its reach where it has no echo, these are mapped as walls; give '
                f'--range-max {first * _BIN_M - _NEAR_M:.2f}')
