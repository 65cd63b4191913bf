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


"""Distinguish gravity from other accelerations that last."""

from __future__ import annotations

import math
from typing import Final

from rt_robot_os.modules.attitude.quaternion import Vector
from rt_robot_os.units import STANDARD_GRAVITY_M_S2

_PER_G: Final = 1 / STANDARD_GRAVITY_M_S2
# An average whose length differs by more is not gravity, for a limited time: such an acceleration
# ends, whereas the error of a wrong gain would last for ever.
_TOLERANCE: Final = 0.1
_LONGEST_S: Final = 10.0
_NO_DIRECTION: Final = 0.1


class GravityGuard:
    """
    Average the acceleration in the world's axes and judge its length.

    Judging single samples would reject more of what points to one side than of what points to the
    other, and so spoil the average. In the average vibration and jolts cancel out, and what is
    left besides gravity is an acceleration that lasts.

    :ivar average: in g, in the world's axes.
    :ivar length: of it.
    :ivar rejected: it is not gravity.
    """

    __slots__ = ('average', 'length', 'rejected', '_strange_s')

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Begin with gravity as it should be."""
        self.average: Vector = (0.0, 0.0, 1.0)
        self.length = 1.0
        self.rejected = False
        self._strange_s = 0.0

    def update(self, acceleration: Vector, part: float, dt_s: float) -> bool:
        """
        Take a sample; safe in the real-time loop.

        :param acceleration: m/s^2, in the world's axes.
        :param part: how much of it goes into the average.
        :return: :attr:`rejected`.
        """
        a, b, c = acceleration
        x, y, z = self.average
        x, y, z = (x + part * (a * _PER_G - x), y + part * (b * _PER_G - y),
                   z + part * (c * _PER_G - z))
        self.average = x, y, z
        self.length = length = math.sqrt(x * x + y * y + z * z)
        if abs(length - 1) < _TOLERANCE:
            self._strange_s = 0.0
            self.rejected = False
        else:
            self._strange_s += dt_s
            self.rejected = self._strange_s < _LONGEST_S or length < _NO_DIRECTION
        return self.rejected
