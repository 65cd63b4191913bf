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
Upright direction of a worn sensor, learned from steps.

A person lying down does not take eight steps in eight seconds. So the mean force of a walk, a run
or a series of jumps points upwards for a standing wearer, whatever the mounting of the sensor.
"""

from __future__ import annotations

from collections import deque
import math
from typing import Final

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.health.fall_detector.motion_history import angle_deg
from rt_robot_os.features.health.fall_detector.motion_history import MotionHistory
from rt_robot_os.features.health.fall_detector.motion_history import Vector

_STEP_G: Final = 1.12
_STEP_NS: Final = 250 * NS_PER_MS
_STEPS: Final = 8
_STEPS_WITHIN_NS: Final = 8 * NS_PER_S
# Largest sway of the trunk during a walk.
_STEADY_DEG: Final = 25.0
# A larger angle between the means of two walks: the mounting has changed.
_REMOUNTED_DEG: Final = 45.0
# Largest deviation of the mean of a walk from 1 g.
_OFF_G: Final = 0.2
# Weight of a new walk in the learned direction.
_NEWER: Final = 0.25


class StepCounter:
    """
    Detect a walk: eight peaks in eight seconds, at least a quarter of a second apart.

    Safe in the real-time loop.
    """

    __slots__ = ('_above', '_steps')

    def __init__(self) -> None:
        self._above = False
        self._steps: deque[int] = deque(maxlen=_STEPS)

    def add(self, now_ns: int, size_g: float) -> None:
        """Add a block of samples with the given mean magnitude."""
        if size_g >= _STEP_G and not self._above and (
                not self._steps or now_ns - self._steps[-1] >= _STEP_NS):
            self._steps.append(now_ns)
        self._above = size_g >= _STEP_G

    @property
    def walk_from_ns(self) -> int | None:
        """Return when the last eight steps started; None if they are not a walk."""
        steps = self._steps
        if len(steps) < _STEPS or steps[-1] - steps[0] > _STEPS_WITHIN_NS:
            return None
        return steps[0]

    def clear(self) -> None:
        """Forget the steps."""
        self._steps.clear()


class UprightDirection:
    """
    Learn the direction of the force that the sensor measures while its wearer is upright.

    A walk with another direction replaces it when the next walk confirms that: the mounting of the
    sensor has changed. Safe in the real-time loop.

    :ivar known: a unit vector in the axes of the sensor; None before the first walk.
    """

    __slots__ = ('_candidate', '_counter', 'known')

    def __init__(self) -> None:
        self._counter = StepCounter()
        self.forget()

    def forget(self) -> None:
        """Forget the direction: the mounting of the sensor may have changed."""
        self.known: Vector | None = None
        self._candidate: Vector | None = None
        self._counter.clear()

    def tilt_deg(self, force: Vector) -> float:
        """Return the angle between a force and upright; NaN while upright is unknown."""
        return math.nan if self.known is None else angle_deg(force, self.known)

    def add(self, history: MotionHistory, now_ns: int, size_g: float) -> None:
        """Add a block of samples that was just added to the history."""
        counter = self._counter
        counter.add(now_ns, size_g)
        from_ns = counter.walk_from_ns
        if from_ns is None:
            return
        counter.clear()
        walk = history.span(from_ns, now_ns)
        if walk is None or walk.turning_deg > _STEADY_DEG or abs(
                math.hypot(*walk.mean) - 1.0) > _OFF_G:
            return
        mean = _unit(walk.mean)
        if self.known is None:
            self.known = mean
        elif angle_deg(mean, self.known) <= _REMOUNTED_DEG:
            self.known = _unit((
                self.known[0] + _NEWER * (mean[0] - self.known[0]),
                self.known[1] + _NEWER * (mean[1] - self.known[1]),
                self.known[2] + _NEWER * (mean[2] - self.known[2])))
            self._candidate = None
        elif self._candidate is not None and angle_deg(
                mean, self._candidate) <= _STEADY_DEG:
            self.known, self._candidate = mean, None
        else:
            self._candidate = mean


def _unit(force: Vector) -> Vector:
    size = math.hypot(*force)
    return force[0] / size, force[1] / size, force[2] / size
