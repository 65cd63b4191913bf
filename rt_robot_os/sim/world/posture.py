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

"""The posture of a person: upright, sitting, lying, and the transitions between them."""

from __future__ import annotations

from enum import Enum
import math
from typing import Final
from typing import NamedTuple


class _Shape(NamedTuple):
    """
    The geometry of a body in a posture.

    :ivar top_m: its highest point above the floor.
    :ivar tilt_rad: from upright.
    :ivar worn_m: height of a worn device, and ...
    :ivar worn_share: ... the remaining share of its height on a standing person.
    :ivar base_m: height of the surface below the body.
    """

    top_m: float
    tilt_rad: float
    worn_m: float
    worn_share: float
    base_m: float


PERSON_HEIGHT_M: Final = 1.75
_UPRIGHT: Final = _Shape(PERSON_HEIGHT_M, 0.0, 0.0, 1.0, 0.0)
_LYING: Final = _Shape(0.28, math.pi / 2, 0.1, 0.0, 0.0)


class Posture(Enum):
    """
    A posture, and the duration of the transition to it.

    :ivar shape: geometry of the body.
    :ivar takes_s: duration of the transition to it.
    """

    UPRIGHT = _UPRIGHT, 0.0
    RISING = _UPRIGHT, 3.0
    FALLEN = _LYING, 0.8
    SITTING = _Shape(1.25, 0.0, 0.0, 0.65, 0.0), 1.5
    # On a bed.
    ASLEEP = _Shape(0.75, math.pi / 2, 0.6, 0.0, 0.45), 4.0

    def __init__(self, shape: _Shape, takes_s: float) -> None:
        self.shape = shape
        self.takes_s = takes_s


class Stance:
    """
    The posture of a person over time.

    :ivar posture: the current one, or the target of the transition.
    :ivar since_s: beginning of the transition.
    """

    def __init__(self) -> None:
        self.posture = Posture.UPRIGHT
        self.before = Posture.UPRIGHT
        self.since_s = -math.inf
        self._from = _UPRIGHT

    def assume(self, posture: Posture, time_s: float) -> None:
        """Start the transition to a posture; nothing changes if it is the current one."""
        if posture is not self.posture:
            self._from, self.before = self.shape(time_s), self.posture
            self.posture, self.since_s = posture, time_s

    def share(self, time_s: float) -> float:
        """Return the completed share of the transition, from 0 to 1."""
        since_s = time_s - self.since_s
        return 1.0 if since_s >= self.posture.takes_s else max(since_s / self.posture.takes_s, 0.0)

    def shape(self, time_s: float) -> _Shape:
        """Return the current geometry of the body."""
        share = self.share(time_s)
        if share >= 1.0:
            return self.posture.shape
        return _Shape(*(a + share * (b - a) for a, b in zip(self._from, self.posture.shape)))
