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
The filter of the package ``vqf``, by its authors Laidig and Seel, as an :class:`AttitudeFilter`.

It is C++ with numbers of NumPy, for samples at a fixed rate. Real samples have no fixed rate: for
each the filter makes as many steps as fit into its time, and the angular velocity is scaled such
that these steps integrate it over exactly that time. It averages accelerations but rejects none,
and needs all of them: one that is left out would be missing in its average.
"""

from __future__ import annotations

from typing import Any
from typing import ClassVar
from typing import Final

import numpy as np

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.needs import lacking
from rt_robot_os.features.navigation.attitude.base import AttitudeFilter
from rt_robot_os.features.navigation.attitude.base import FilterTuning
from rt_robot_os.motion import quaternion
from rt_robot_os.motion.quaternion import IDENTITY
from rt_robot_os.motion.quaternion import Quaternion
from rt_robot_os.motion.quaternion import Vector

# The most steps after a gap; one takes a microsecond.
_TURNS: Final = 20
# Bias and its limit are in degrees there.
_DEGREES: Final = 57.29577951308232


def no_vqf() -> str:
    """Return why this filter is unavailable and what to do; '' when it is. Nothing is imported."""
    problem = lacking("filter = 'vqf'", 'vqf')
    return f'{problem}; or choose auto or mahony' if problem else ''


class VqfFilter(AttitudeFilter):
    """
    The versatile quaternion-based filter (VQF); needs ``pip install vqf``.

    :param sample_s: usual time from sample to sample.
    :param field_s: the same of the magnetic field.
    :raises ConfigError: vqf is not installed.
    """

    name: ClassVar[str] = 'vqf'

    def __init__(self, tuning: FilterTuning, sample_s: float, field_s: float) -> None:
        super().__init__(tuning)
        problem = no_vqf()
        if problem:
            raise ConfigError([problem])
        try:
            from vqf import VQF
        except ImportError as error:
            raise ConfigError([f"filter = 'vqf' cannot be used ({error}): choose auto or mahony"
                               ]) from error
        self._sample_s, self._field_s = sample_s, field_s
        self._vqf: Any = VQF(
            sample_s, -1.0, field_s, biasClip=tuning.bias_maximum_rad_s * _DEGREES)
        self.tune(tuning)
        self._rate, self._acceleration, self._field = np.zeros(3), np.zeros(3), np.zeros(3)
        # Elements are set through these, which is much faster.
        self._rate_items: Any = self._rate.data
        self._acceleration_items: Any = self._acceleration.data
        self._field_items: Any = self._field.data
        # A turn about the vertical that comes on top of what vqf says, until it knows north.
        self._yaw: Quaternion = IDENTITY
        self._since_field_s = 0.0
        self._field_believed = False
        self._note_bias()

    def update(self, rate: Vector, acceleration: Vector | None, field: Vector | None,
               dt_s: float) -> Quaternion:
        """Process a sample; see the base class."""
        self._since_field_s += dt_s
        turns = _turns(dt_s, self._sample_s)
        scale = dt_s / (turns * self._sample_s)
        items = self._rate_items
        items[0], items[1], items[2] = (
            scale * (r - b) + b for r, b in zip(rate, self.bias))
        for _ in range(turns):
            self._vqf.updateGyr(self._rate)
        if acceleration is not None:
            # The attitude now, not at an intermediate step.
            items = self._acceleration_items
            items[0], items[1], items[2] = acceleration
            for _ in range(turns):
                self._vqf.updateAcc(self._acceleration)
            if not self.aligned:
                self._align(acceleration)
        if field is not None and self.aligned:
            self._take_field(field)
        self.at_rest = self._vqf.getRestDetected()
        self._note_bias()
        x, y, z, w = self._now()
        self.attitude = x, y, z, w
        return self.attitude

    def restart(self) -> None:
        """Find up and north again; see the base class."""
        vqf = self._vqf
        length, dip = vqf.getMagRefNorm(), vqf.getMagRefDip()
        vqf.resetState()
        if self._field_believed:
            vqf.setMagRef(length, dip)
        vqf.setBiasEstimate(np.array(self.bias), self.bias_stddev)
        self._since_field_s = 0.0
        self.aligned = self.heading_known = False

    def tune(self, tuning: FilterTuning) -> None:
        """Change the tuning; the largest bias stays what it was at first."""
        self.tuning = tuning
        vqf = self._vqf
        vqf.setTauAcc(tuning.inclination_time_s)
        vqf.setTauMag(tuning.heading_time_s)
        vqf.setMotionBiasEstEnabled(tuning.bias_in_motion)
        vqf.setRestBiasEstEnabled(tuning.bias_at_rest)
        vqf.setMagDistRejectionEnabled(tuning.field_rejection)
        vqf.setRestDetectionThresholds(
            tuning.rest_rate_rad_s * _DEGREES, tuning.rest_acceleration_m_s2)

    def _align(self, acceleration: Vector) -> None:
        """Keep the previous heading, by the shortest turn from the previous attitude."""
        turn = quaternion.from_up(quaternion.rotate(self.attitude, acceleration))
        if turn is None:
            return
        w, x, y, z = self._vqf.getQuat6D().tolist()
        _, _, c, d = quaternion.multiply(
            quaternion.multiply(turn, self.attitude), (-x, -y, -z, w))
        length = (c * c + d * d) ** 0.5
        self._yaw = (0.0, 0.0, c / length, d / length) if length > 1e-6 else IDENTITY
        self.aligned = True

    def _take_field(self, field: Vector) -> None:
        items = self._field_items
        items[0], items[1], items[2] = field
        for _ in range(_turns(self._since_field_s, self._field_s)):
            self._vqf.updateMag(self._field)
        self._since_field_s = 0.0
        self.heading_known = True
        disturbed = self._vqf.getMagDistDetected()
        # Before vqf has found a reference it calls every field disturbed, and uses it.
        self._field_believed |= not disturbed
        self.field_rejected = (
            disturbed and self._field_believed and self.tuning.field_rejection)

    def _now(self) -> Quaternion:
        if self.heading_known:
            w, x, y, z = self._vqf.getQuat9D().tolist()
            return x, y, z, w
        w, x, y, z = self._vqf.getQuat6D().tolist()
        return quaternion.multiply(self._yaw, (x, y, z, w))

    def _note_bias(self) -> None:
        bias, self.bias_stddev = self._vqf.getBiasEstimate()
        x, y, z = bias.tolist()
        self.bias = x, y, z


def _turns(time_s: float, usual_s: float) -> int:
    return 1 if time_s < 1.5 * usual_s else min(_TURNS, int(time_s / usual_s + 0.5))
