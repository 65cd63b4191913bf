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


"""Distinguish gravity and the earth's magnetic field from what else a sensor measures."""

from __future__ import annotations

import math
from typing import Final

from rt_robot_os.base.units import STANDARD_GRAVITY_M_S2
from rt_robot_os.motion.quaternion import Vector

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


# A field of other length, or other dip, is not the earth's.
_LENGTH_PART: Final = 0.1
_DIP_RAD: Final = math.radians(10)
# A field that switches between both is not trusted either (hysteresis).
_UNDISTURBED_S: Final = 0.5
# A field that stays constant while the sensor is turned becomes the earth's.
_FIRST_S: Final = 5.0
_NEW_S: Final = 20.0
_FOLLOW_S: Final = 20.0
_SMOOTH_S: Final = 0.05
# After this time a wrong field may be better than none; it is trusted half.
_REJECTED_S: Final = 60.0
_DOUBTFUL: Final = 0.5
# Sensors that are not turned see any field as constant.
_MOVING_RAD_S: Final = math.radians(20)


class FieldGuard:
    """
    Judge a magnetic field by its length and its dip below the horizon.

    Both are the same everywhere around a robot, iron changes at least one. The field at the start
    counts as the earth's until another one has lasted for longer while the sensor was turned.

    :ivar length: of the field that counts as the earth's; 0 before the first sample.
    :ivar dip_rad: of the same.
    """

    __slots__ = ('length', 'dip_rad', '_now_length', '_now_dip', '_new_length', '_new_dip',
                 '_new_s', '_good_s', '_believed_s', '_rejected_s')

    def __init__(self) -> None:
        self.length = self.dip_rad = 0.0
        self._now_length = self._now_dip = 0.0
        self._new_length = self._new_dip = self._new_s = 0.0
        self._good_s = self._believed_s = self._rejected_s = 0.0

    def judge(self, length: float, dip_rad: float, turning_rad_s: float, dt_s: float) -> float:
        """
        Judge a field; safe in the real-time loop.

        :param turning_rad_s: how fast the sensor turns.
        :param dt_s: since the one before.
        :return: how far to trust it: 0 not at all, 1 it is the earth's.
        """
        if not self.length:
            self.length = self._now_length = self._new_length = length
            self.dip_rad = self._now_dip = self._new_dip = dip_rad
            self._good_s = _UNDISTURBED_S
        part = dt_s / (dt_s + _SMOOTH_S)
        self._now_length += part * (length - self._now_length)
        self._now_dip += part * (dip_rad - self._now_dip)
        if self._near(self.length, self.dip_rad):
            self._good_s += dt_s
            if self._good_s >= _UNDISTURBED_S:
                self._follow(dt_s)
                self._rejected_s = max(0.0, self._rejected_s - 2 * dt_s)
                return 0.0 if self._leaps(length, dip_rad) else 1.0
        else:
            self._good_s = 0.0
        self._consider(turning_rad_s, dt_s)
        self._rejected_s = min(_REJECTED_S, self._rejected_s + dt_s)
        return _DOUBTFUL if self._rejected_s >= _REJECTED_S else 0.0

    def _near(self, length: float, dip_rad: float) -> bool:
        return (abs(self._now_length - length) < _LENGTH_PART * length
                and abs(self._now_dip - dip_rad) < _DIP_RAD)

    def _leaps(self, length: float, dip_rad: float) -> bool:
        """Return whether a sample deviates, before the smoothed field shows it."""
        return (abs(length - self._now_length) > _LENGTH_PART * self.length
                or abs(dip_rad - self._now_dip) > _DIP_RAD)

    def _follow(self, dt_s: float) -> None:
        # A mean at first, so that one noisy sample does not remain the measure.
        self._believed_s += dt_s
        part = dt_s / (dt_s + min(self._believed_s, _FOLLOW_S))
        self.length += part * (self._now_length - self.length)
        self.dip_rad += part * (self._now_dip - self.dip_rad)
        self._new_s = 0.0

    def _consider(self, turning_rad_s: float, dt_s: float) -> None:
        if not self._near(self._new_length, self._new_dip):
            self._new_length, self._new_dip, self._new_s = self._now_length, self._now_dip, 0.0
            return
        part = dt_s / (dt_s + _FOLLOW_S)
        self._new_length += part * (self._now_length - self._new_length)
        self._new_dip += part * (self._now_dip - self._new_dip)
        if turning_rad_s >= _MOVING_RAD_S:
            self._new_s += dt_s
        if self._new_s >= (_FIRST_S if self._believed_s < _FIRST_S else _NEW_S):
            self.length, self.dip_rad = self._new_length, self._new_dip
            self._new_s = self._believed_s = 0.0
