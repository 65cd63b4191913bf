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
The vital signs of a person in the world, equal for all sensors.

Each sign varies slowly about its usual value. It is a function of only the time, so that its value
does not depend on how often it is read.
"""

from __future__ import annotations

from collections.abc import Mapping
import math
from random import Random
from typing import Final
from typing import NamedTuple


class _Sign(NamedTuple):
    """
    A vital sign.

    :ivar mean: the usual value of an adult at rest.
    :ivar spread: its standard deviation.
    :ivar shock: increase by a shock.
    :ivar most: its upper limit.
    """

    mean: float
    spread: float
    shock: float = 0.0
    most: float = math.inf


#: By the names of :mod:`rt_robot_os.messages.quantities`.
SIGNS: Final[Mapping[str, _Sign]] = {
    'pulse_per_min': _Sign(72.0, 3.0, 30.0),
    'respiration_per_min': _Sign(15.0, 1.0, 6.0),
    'spo2_percent': _Sign(97.5, 0.5, 0.0, 100.0),
    'systolic_mmhg': _Sign(124.0, 4.0, 18.0),
    'diastolic_mmhg': _Sign(78.0, 3.0, 8.0),
    'body_temperature': _Sign(36.8, 0.1),
    'consciousness': _Sign(0.0, 0.0),
    'oxygen_l_per_min': _Sign(0.0, 0.0),
}

# The periods of its variation; their common multiple is very long.
_PERIODS_S: Final = (97.0, 211.0, 461.0)
# The effect of a shock rises quickly and decays slowly.
_RISE_S: Final = 4.0
_FALL_S: Final = 150.0


class SimulatedVitals:
    """
    The vital signs of one person.

    :param name: of the person; determines the variation, with the seed.
    """

    def __init__(self, name: str, seed: int) -> None:
        chance = Random(f'{seed} vitals {name}')
        self._phases = {sign: tuple(chance.random() for _ in _PERIODS_S) for sign in SIGNS}
        self._set: dict[str, float] = {}
        self._shock_s = -math.inf

    def value(self, sign: str, time_s: float) -> float:
        """
        Return a sign, in its unit.

        :param sign: one of ``SIGNS``.
        """
        told = self._set.get(sign)
        if told is not None:
            return told
        usual = SIGNS[sign]
        wave = sum(math.sin(math.tau * (time_s / period_s + phase))
                   for period_s, phase in zip(_PERIODS_S, self._phases[sign]))
        # Each wave has a mean square of a half.
        away = wave * math.sqrt(2.0 / len(_PERIODS_S))
        return min(usual.mean + usual.spread * away + usual.shock * self._fright(time_s),
                   usual.most)

    def set(self, sign: str, value: float) -> None:  # noqa: A003
        """Fix the value of a sign from now on; 0 is that of a monitor without its sensor."""
        self._set[sign] = value

    def clear(self, sign: str) -> None:
        """Return a sign to its usual value."""
        self._set.pop(sign, None)

    def frighten(self, time_s: float) -> None:
        """Start the effect of a shock, such as a fall or a call for help."""
        self._shock_s = time_s

    def _fright(self, time_s: float) -> float:
        since_s = time_s - self._shock_s
        if not 0.0 <= since_s < 20 * _FALL_S:
            return 0.0
        return (1.0 - math.exp(-since_s / _RISE_S)) * math.exp(-since_s / _FALL_S)
