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

"""The filter that needs nothing installed: Mahony's, in plain floats (``estimate.py``)."""

from __future__ import annotations

from typing import ClassVar

from rt_robot_os.modules.attitude.base import AttitudeFilter
from rt_robot_os.modules.attitude.base import Tuning
from rt_robot_os.modules.attitude.estimate import MahonyEstimate
from rt_robot_os.motion.quaternion import Quaternion
from rt_robot_os.motion.quaternion import Vector


class MahonyFilter(AttitudeFilter):
    """Mahony's complementary filter, changed as said in ``estimate.py``."""

    name: ClassVar[str] = 'mahony'

    def __init__(self, tuning: Tuning) -> None:
        super().__init__(tuning)
        self._estimate = MahonyEstimate(tuning)
        self.bias_stddev = self._estimate.bias_stddev

    def update(self, rate: Vector, acceleration: Vector | None, field: Vector | None,
               dt_s: float) -> Quaternion:
        """Take a sample; see the base class."""
        estimate = self._estimate
        self.attitude = attitude = estimate.update(rate, acceleration, field, dt_s)
        self.bias = estimate.bias
        self.bias_stddev = estimate.bias_stddev
        self.aligned = estimate.aligned
        self.heading_known = estimate.heading_known
        self.at_rest = estimate.at_rest
        self.acceleration_rejected = estimate.acceleration_rejected
        self.field_rejected = estimate.field_rejected
        return attitude

    def restart(self) -> None:
        """Find up and north anew; see the base class."""
        self._estimate.restart()
        self.aligned = False

    def tune(self, tuning: Tuning) -> None:
        """Change the tuning."""
        self.tuning = tuning
        self._estimate.tune(tuning)
