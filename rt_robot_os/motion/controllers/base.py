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
The interface of a tracking law: one step from a pose and a reference to a velocity.

Laws are written for continuous time, and a command holds for a period. So the gains mean what they
mean in continuous time, and each law uses those of a held command that have the same poles:
:class:`HeldGains`. At 50 Hz they are nearly equal, at 300 ms they are a third smaller.
"""

from __future__ import annotations

from abc import ABC
from abc import abstractmethod
import math
from typing import ClassVar
from typing import Final

from rt_robot_os.motion.angles import wrapped
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.reference import PathReference
from rt_robot_os.motion.reference import Target

Velocity = tuple[float, float]

# Below it both kinds of gains agree to the last digits that matter.
_SHORT: Final = 1e-4


class Controller(ABC):
    """
    A tracking law with its gains.

    :cvar NAME: by which it is chosen.
    :cvar Gains: a dataclass of its settings.
    :cvar TIMED: it follows the reference in time; else it follows the path, at a speed of its own.
    :ivar error: of the last step: how far the reference is ahead of the robot and to the left of
        it in m, and how far its heading is to the left in rad.
    """

    NAME: ClassVar[str]
    Gains: ClassVar[type]
    TIMED: ClassVar[bool] = True

    def __init__(self) -> None:
        self.error = (0.0, 0.0, 0.0)

    def restart(self) -> None:
        """Reset the state: another reference follows."""
        self.error = (0.0, 0.0, 0.0)

    @abstractmethod
    def step(self, pose: Pose, reference: PathReference, period_s: float,
             velocity: Velocity | None = None) -> Velocity:
        """
        Return the velocity for the period that begins now; safe in the real-time loop.

        It is not limited yet: see :mod:`rt_robot_os.motion.velocity_limits`. The reference is
        advanced by the period.

        :param pose: where the robot is when the command takes effect.
        :param velocity: linear and angular velocity of the robot as measured, in m/s and rad/s;
            None when that is not known.
        """


def error_of(pose: Pose, target: Target) -> tuple[float, float, float]:
    """Return a target in the frame of the robot: ahead and left in m, turned left in rad."""
    x, y, yaw = pose
    dx, dy = target.x_m - x, target.y_m - y
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return (cosine * dx + sine * dy, cosine * dy - sine * dx, wrapped(target.heading_rad - yaw))


class HeldGains:
    """
    How much smaller gains have to be when a command holds for a period.

    Seen from a path the robot is a double integrator: the turning rate changes the heading, and
    that, with the speed, the distance from the path. A law with the characteristic polynomial
    ``s^2 + d s + n^2`` has the poles ``s``; a held command gives that chain the poles
    ``exp(s T)`` with two gains for which there is a closed form. So it is stable with each period.
    """

    def __init__(self) -> None:
        self._of = (0.0, 0.0, 0.0)
        self._factors = (1.0, 1.0)

    def across(self, square: float, damping: float, period_s: float) -> tuple[float, float]:
        """
        Return the factors of the gains on the distance from the path and on the heading.

        :param square: n^2 in 1/s^2.
        :param damping: d in 1/s.
        """
        if (square, damping, period_s) == self._of:
            return self._factors
        self._of = (square, damping, period_s)
        half = damping * period_s / 2
        under = square * period_s * period_s - half * half
        if square * period_s * period_s < _SHORT * _SHORT or half < _SHORT:
            self._factors = (1.0, 1.0)
            return self._factors
        shrunk = math.exp(-half)
        root = math.sqrt(abs(under))
        total = 2 * shrunk * (math.cos(root) if under >= 0.0 else math.cosh(root))
        product = shrunk * shrunk
        self._factors = ((1.0 + product - total) / (square * period_s * period_s),
                         (3.0 - product - total) / (4.0 * half))
        return self._factors


def held(gain: float, period_s: float) -> float:
    """Return the gain in 1/s of a held command that does what a gain does in continuous time."""
    product = gain * period_s
    return gain if product < _SHORT else (1.0 - math.exp(-product)) / period_s
