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


"""Detect when a sensor is at rest, and what its gyroscope reads then."""

from __future__ import annotations

from typing import Final

from rt_robot_os.features.navigation.attitude.base import FilterTuning
from rt_robot_os.motion.quaternion import Vector

_SMOOTH_S: Final = 0.5
_REST_S: Final = 1.5


class RestDetector:
    """
    Compare the readings of a sensor with their average over the last half second.

    A sensor that turns steadily, slower than the largest bias allowed, looks as if at rest.

    :ivar resting: the deviations have been small for 1.5 s.
    :ivar rate: average angular velocity in rad/s.
    """

    __slots__ = ('resting', 'rate', '_force', '_still_s', '_age_s', '_rate_limit', '_force_limit',
                 '_bias_limit')

    def __init__(self, tuning: FilterTuning) -> None:
        self.tune(tuning)
        self.restart()

    def tune(self, tuning: FilterTuning) -> None:
        """Change the limits."""
        self._rate_limit = tuning.rest_rate_rad_s ** 2
        self._force_limit = tuning.rest_acceleration_m_s2 ** 2
        self._bias_limit = tuning.bias_maximum_rad_s

    def restart(self) -> None:
        """Forget the average."""
        self.resting = False
        self.rate: Vector = (0.0, 0.0, 0.0)
        self._force: Vector = (0.0, 0.0, 0.0)
        self._still_s = self._age_s = 0.0

    def update(self, rate: Vector, force: Vector, dt_s: float) -> bool:
        """
        Process a sample; safe in the real-time loop.

        :return: :attr:`resting`.
        """
        # A plain mean until there is half a second of it.
        self._age_s = age_s = min(self._age_s + dt_s, _SMOOTH_S)
        part = dt_s / age_s
        x, y, z = self.rate
        a, b, c = self._force
        dx, dy, dz = rate[0] - x, rate[1] - y, rate[2] - z
        da, db, dc = force[0] - a, force[1] - b, force[2] - c
        self.rate = x, y, z = x + part * dx, y + part * dy, z + part * dz
        self._force = a + part * da, b + part * db, c + part * dc
        limit = self._bias_limit
        if (dx * dx + dy * dy + dz * dz < self._rate_limit
                and da * da + db * db + dc * dc < self._force_limit
                and -limit <= x <= limit and -limit <= y <= limit and -limit <= z <= limit):
            self._still_s += dt_s
            self.resting = self._still_s >= _REST_S
        else:
            self._still_s = 0.0
            self.resting = False
        return self.resting
