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
The vital signs of a person: units, plausible ranges, and for how long a value is valid.

A monitor whose sensor is off writes 0, which is not a value: a finger clip that fell off does not
mean a pulse of 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from enum import IntEnum
import math
from types import MappingProxyType
from typing import Final
from typing import NamedTuple

from rt_robot_os.messages.quantities import QUANTITIES


class Consciousness(IntEnum):
    """The level of consciousness (ACVPU), as a nurse assesses it."""

    ALERT = 0
    #: New confusion.
    CONFUSION = 1
    #: Reacts to a voice.
    VOICE = 2
    #: Reacts to pain.
    PAIN = 3
    UNRESPONSIVE = 4


class Sign(NamedTuple):
    """
    A vital sign.

    :ivar name: of the quantity and the last part of the topic's name.
    :ivar title: for people.
    :ivar unit: of a value.
    :ivar low: lower numbers are not values.
    :ivar high: higher numbers are not values.
    :ivar stale_s: age from which a value is stale.
    :ivar has_off: 0 means that the sensor is off, not a value.
    :ivar is_continuous: a worn sensor sends it continuously, so that no message means that it is
        off; the others are measured now and then.
    :ivar jump: a change by more than it, within seconds, has to be confirmed by what follows; 0:
        any change may be true.
    :ivar apart: two sensors that differ by more contradict each other; 0: they may differ.
    :ivar whole: values are codes, integers.
    """

    name: str
    title: str
    unit: str
    low: float
    high: float
    stale_s: float
    has_off: bool = True
    is_continuous: bool = False
    jump: float = 0.0
    apart: float = 0.0
    whole: bool = False

    def is_off(self, value: float) -> bool:
        """Return whether a number means that the sensor measures nothing; NaN does, too."""
        return value != value or (self.has_off and value == 0.0)

    def is_plausible(self, value: float) -> bool:
        """Return whether a value is plausible; NaN is not. Safe in the real-time loop."""
        return self.low <= value <= self.high and (not self.whole or value == math.floor(value))


def _sign(name: str, title: str, stale_s: float, *, has_off: bool = True,
          is_continuous: bool = False, jump: float = 0.0, apart: float = 0.0,
          whole: bool = False) -> Sign:
    quantity = QUANTITIES[name]
    unit = '' if quantity.unit == 'code' else quantity.unit
    return Sign(name, title, unit, quantity.low, quantity.high, stale_s, has_off, is_continuous,
                jump, apart, whole)


_MIN: Final = 60.0
_H: Final = 3600.0

#: Stale limits as ward monitors have them: what is measured all the time is worth two minutes, a
#: cuff's value an hour, a thermometer's until the next round.
SIGNS: Final[Mapping[str, Sign]] = MappingProxyType({each.name: each for each in (
    _sign('pulse_per_min', 'pulse', 2 * _MIN, is_continuous=True, jump=40.0, apart=20.0),
    _sign('respiration_per_min', 'respiration', 2 * _MIN, is_continuous=True, jump=15.0,
          apart=8.0),
    _sign('spo2_percent', 'SpO2', 2 * _MIN, is_continuous=True, jump=8.0, apart=5.0),
    _sign('systolic_mmhg', 'systolic pressure', _H),
    _sign('diastolic_mmhg', 'diastolic pressure', _H),
    _sign('body_temperature', 'temperature', 4 * _H, apart=2.0),
    _sign('consciousness', 'consciousness', 4 * _H, has_off=False, whole=True),
    _sign('oxygen_l_per_min', 'oxygen', 12 * _H, has_off=False),
)})


def checked_sign(name: str) -> str:
    """
    Return the name of a sign unmodified.

    :raises ValueError: there is none of that name.
    """
    if name not in SIGNS:
        # Users often write a part of it: pulse, temp, spo2.
        close = ([each for each in SIGNS if len(name) > 1 and name.lower() in each]
                 or get_close_matches(name, SIGNS, 1))
        hint = (f'did you mean {" or ".join(close[:2])}?' if close
                else f'there are {", ".join(SIGNS)}')
        raise ValueError(f'{name[:40]!r} is not a sign: {hint}')
    return name
