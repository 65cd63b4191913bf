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
Detection of a sensor that is not worn: on a table it is stiller than on any person.

Breathing and small shifts of posture tilt a sensor at the waist. Of 32 recordings of people who
sat or lay still for five minutes (daily and sports activities, Altun and Barshan 2010) in none
the one-second means stayed within 5 mg; the noise of a cheap sensor stays within 3 mg.
"""

from __future__ import annotations

from typing import Final

from rt_robot_os.base.units import NS_PER_S

#: The means of a worn sensor vary by more than this, in g, within STILL_NS.
STIRS_G: Final = 0.004
STILL_NS: Final = 300 * NS_PER_S

_MEAN_NS: Final = NS_PER_S
# A longer gap restarts the time.
_GAP_NS: Final = 5 * NS_PER_S


class WearDetector:
    """
    Monitor the range of the one-second means; safe in the real-time loop.

    :ivar off: the sensor has been stiller than any person for :data:`STILL_NS`, and still is.
    """

    __slots__ = ('_begun_ns', '_count', '_first_ns', '_high', '_last_ns', '_low', '_sums', 'off')

    def __init__(self) -> None:
        self.off = False
        self._last_ns = -1
        self._restart(0)

    def _restart(self, now_ns: int) -> None:
        self._low = [float('inf')] * 3
        self._high = [float('-inf')] * 3
        self._begun_ns = now_ns
        self._start_mean(now_ns)

    def _start_mean(self, now_ns: int) -> None:
        self._sums = [0.0, 0.0, 0.0]
        self._count = 0
        self._first_ns = now_ns

    def add(self, now_ns: int, x: float, y: float, z: float) -> None:
        """Add a block of samples, in g; stamps increase."""
        if now_ns - self._last_ns > _GAP_NS:
            self.off = False
            self._restart(now_ns)
        self._last_ns = now_ns
        sums = self._sums
        sums[0] += x
        sums[1] += y
        sums[2] += z
        self._count += 1
        if now_ns - self._first_ns < _MEAN_NS:
            return
        means = [each / self._count for each in sums]
        low = [min(pair) for pair in zip(self._low, means)]
        high = [max(pair) for pair in zip(self._high, means)]
        if max(most - least for most, least in zip(high, low)) > STIRS_G:
            self.off = False
            self._restart(now_ns)
            self._low, self._high = means, list(means)
            return
        self._low, self._high = low, high
        self._start_mean(now_ns)
        if now_ns - self._begun_ns >= STILL_NS:
            self.off = True
