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

"""Turn in place to a location: immediately, smoothly, without overshoot."""

from __future__ import annotations

import math
from typing import Final

from rt_robot_os.motion.angles import wrapped
from rt_robot_os.motion.differential import Pose

# Gain on the error in rad: it decays in half a second.
_GAIN: Final = 2.0


class Turn:
    """
    The turning rates of one turn after the other; safe in the real-time loop.

    :param fastest_rad_s: the highest rate.
    :param acceleration_rad_s2: by which the rate changes.
    :param tolerance_rad: it is aligned when the error is below this.
    :ivar rate_rad_s: commanded now.
    """

    def __init__(self, fastest_rad_s: float, acceleration_rad_s2: float, tolerance_rad: float
                 ) -> None:
        self.fastest_rad_s = fastest_rad_s
        self.acceleration_rad_s2 = acceleration_rad_s2
        self.tolerance_rad = tolerance_rad
        self.rate_rad_s = 0.0

    def towards(self, pose: Pose, x: float, y: float, camera_rad: float, period_s: float
                ) -> tuple[float, bool]:
        """
        Return the rate for the next period, and whether the robot is aligned and stands.

        :param camera_rad: direction of the camera, from the front of the robot.
        """
        if math.hypot(x - pose[0], y - pose[1]) < 1e-3:
            return self.rest(period_s)
        error = wrapped(math.atan2(y - pose[1], x - pose[0]) - camera_rad - pose[2])
        if abs(error) < self.tolerance_rad:
            return self.rest(period_s)
        # As fast as it can still brake to a standstill at the target.
        most = min(self.fastest_rad_s, _GAIN * abs(error),
                   math.sqrt(2.0 * self.acceleration_rad_s2 * abs(error)))
        return self._step(math.copysign(most, error), period_s), False

    def rest(self, period_s: float) -> tuple[float, bool]:
        """Return the rate for the next period towards a standstill, and whether it stands."""
        was = self.rate_rad_s
        rate = self._step(0.0, period_s)
        return rate, rate == 0.0 == was

    def stop(self) -> None:
        """Start from a standstill."""
        self.rate_rad_s = 0.0

    def _step(self, wanted: float, period_s: float) -> float:
        most = self.acceleration_rad_s2 * period_s
        self.rate_rad_s += max(-most, min(most, wanted - self.rate_rad_s))
        return self.rate_rad_s
