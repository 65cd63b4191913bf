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

"""How somebody holds themselves: upright, sitting, lying, and the ways between these."""

from __future__ import annotations

from enum import Enum
import math
from typing import Final
from typing import NamedTuple


class _Shape(NamedTuple):
    """
    What a posture does to a body.

    :ivar top_m: its highest point above the floor.
    :ivar tilt_rad: from upright.
    :ivar worn_m: height of what is worn, and ...
    :ivar worn_share: ... the share that this keeps of its height on a standing person.
    :ivar base_m: of what the body lies on.
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
    A posture, and how long somebody needs to take it.

    :ivar shape: what it does to the body.
    :ivar takes_s: the time from the one before.
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
    The posture of somebody, by time.

    :ivar posture: that is taken, or is being taken.
    :ivar since_s: when that began.
    """

    def __init__(self) -> None:
        self.posture = Posture.UPRIGHT
        self.before = Posture.UPRIGHT
        self.since_s = -math.inf
        self._from = _UPRIGHT

    def take(self, posture: Posture, time_s: float) -> None:
        """Begin to take a posture; nothing changes for who has it already."""
        if posture is not self.posture:
            self._from, self.before = self.shape(time_s), self.posture
            self.posture, self.since_s = posture, time_s

    def share(self, time_s: float) -> float:
        """Return how much of the way to the posture is done, from 0 to 1."""
        since_s = time_s - self.since_s
        return 1.0 if since_s >= self.posture.takes_s else max(since_s / self.posture.takes_s, 0.0)

    def shape(self, time_s: float) -> _Shape:
        """Return the shape of the body now."""
        share = self.share(time_s)
        if share >= 1.0:
            return self.posture.shape
        return _Shape(*(a + share * (b - a) for a, b in zip(self._from, self.posture.shape)))
