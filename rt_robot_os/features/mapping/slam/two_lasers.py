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

"""Two lasers on one topic: each scan is like the last but one and unlike the last."""

from __future__ import annotations

from typing import Final

import numpy as np

from rt_robot_os.features.mapping.slam.transforms import Floats

#: Number of beams that are compared, and the range to which longer ones are clipped, in m.
_BEAMS: Final = 240
_FAR_M: Final = 20.0
#: Largest deviation of a beam, in m.
_OFF_MOST_M: Final = 0.5
#: Smallest mean deviation of another laser, and largest share of it for the same one.
_UNLIKE_M: Final = 0.25
_LIKE: Final = 0.4
#: Weight of alternating scans against others, and the sum from which on two lasers are assumed,
#: until it is 0 again.
_WEIGHT: Final = 2
_SUM: Final = 12


class TwoLasers:
    """
    Monitor all scans of a topic; 15 us each, not for the real-time loop.

    :ivar are_two: whether two lasers publish them.
    """

    def __init__(self) -> None:
        self.are_two = False
        self._last: tuple[Floats, ...] = ()
        self._sum = 0

    def update(self, ranges: Floats) -> bool:
        """
        Process the next scan.

        :param ranges: shape (beams,), m; NaN: not measured, inf: no echo.
        :return: :attr:`are_two`.
        """
        beams = np.minimum(ranges[::max(1, len(ranges) // _BEAMS)], _FAR_M)
        if len(self._last) == 2 and all(len(each) == len(beams) for each in self._last):
            older, newer = self._last
            unlike = _off_m(newer, beams)
            is_turn = unlike > _UNLIKE_M and _off_m(older, beams) < _LIKE * unlike
            self._sum = min(max(0, self._sum + (_WEIGHT if is_turn else -1)), _SUM)
        else:
            self._sum = 0
        self._last = (*self._last[-1:], beams)
        self.are_two = self._sum == _SUM or (self.are_two and self._sum > 0)
        return self.are_two


def _off_m(one: Floats, other: Floats) -> float:
    off = np.abs(one - other)
    off = off[np.isfinite(off)]
    return float(np.minimum(off, _OFF_MOST_M).mean()) if len(off) else 0.0
