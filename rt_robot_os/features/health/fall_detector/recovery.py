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

"""Detection that a fallen person has got up: upright again and moving, or walking."""

from __future__ import annotations

from typing import Final

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.health.fall_detector.limits import FallLimits
from rt_robot_os.features.health.fall_detector.motion_history import angle_deg
from rt_robot_os.features.health.fall_detector.motion_history import MotionHistory
from rt_robot_os.features.health.fall_detector.motion_history import Vector
from rt_robot_os.features.health.fall_detector.upright import StepCounter

# Least range of motion: a sensor that was taken off and put upright moves less.
_MOVES_G: Final = 0.12
# Breathing stays below this.
_STIRS_G: Final = 0.04
_EVALUATE_EVERY_NS: Final = 200 * NS_PER_MS


class Recovery:
    """
    Monitor a person lying after a fall.

    :param limits: of the detector.
    :param before: specific force before the fall.
    :param lying: specific force after the fall.
    :param now_ns: time of the detection.
    :ivar moved_ns: time of the last movement.
    """

    def __init__(self, limits: FallLimits, before: Vector, lying: Vector, now_ns: int) -> None:
        self._limits = limits
        self._before = before
        self._lying = lying
        self.moved_ns = now_ns
        self._upright_ns = -1
        self._evaluated_ns = 0
        self._steps = StepCounter()

    def add(self, history: MotionHistory, now_ns: int, size: float) -> bool:
        """
        Add a block.

        :param size: magnitude of the specific force, in g.
        :return: whether the person has got up.
        """
        self._steps.add(now_ns, size)
        if now_ns - self._evaluated_ns < _EVALUATE_EVERY_NS:
            return False
        self._evaluated_ns = now_ns
        now = history.span(now_ns - round(self._limits.after_s * NS_PER_S), now_ns)
        if now is None:
            return False
        if now.spread_g > _STIRS_G:
            self.moved_ns = now_ns
        return self._upright(history, now_ns, now.mean) or self._walks(now.mean)

    def _upright(self, history: MotionHistory, now_ns: int, mean: Vector) -> bool:
        if angle_deg(mean, self._before) > self._limits.recovery_deg:
            self._upright_ns = -1
            return False
        if self._upright_ns < 0:
            self._upright_ns = now_ns
        return (now_ns - self._upright_ns >= round(self._limits.recovery_s * NS_PER_S)
                and history.range_g(self._upright_ns) >= _MOVES_G)

    def _walks(self, mean: Vector) -> bool:
        # Also detects a person who fell out of bed, and was not upright before.
        return (self._steps.walk_from_ns is not None
                and angle_deg(mean, self._lying) >= self._limits.posture_least_deg)
