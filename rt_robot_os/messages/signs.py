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
The vital signs of a person: their units, what can be true, and for how long a value says anything.

A monitor whose sensor is off writes 0. That is no value: nobody has a pulse of 0 because a finger
clip fell off.
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
    """How a person reacts: ACVPU, as a nurse finds it."""

    ALERT = 0
    #: Confusion that is new.
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
    :ivar low: less is no value.
    :ivar high: more is no value.
    :ivar stale_s: age from which a value says nothing any more.
    :ivar has_off: 0 means that the sensor is off, not a value.
    :ivar is_continuous: a sensor that is worn says it all the time, so that silence means that it
        is off; the others come now and then.
    :ivar jump: a change by more than it, within seconds, has to be confirmed by what follows; 0:
        any change may be true.
    :ivar apart: two sensors that are further apart than it contradict each other; 0: two may.
    :ivar whole: values are codes, whole numbers.
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
        """Return whether that is how a sensor says that it measures nothing; a NaN does too."""
        return value != value or (self.has_off and value == 0.0)

    def is_plausible(self, value: float) -> bool:
        """Return whether a person can have that; a NaN never is. Safe in the loop."""
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
    Return the name of a sign as it is.

    :raises ValueError: there is none of that name.
    """
    if name not in SIGNS:
        # Most write a part of it: pulse, temp, spo2.
        close = ([each for each in SIGNS if len(name) > 1 and name.lower() in each]
                 or get_close_matches(name, SIGNS, 1))
        hint = (f'did you mean {" or ".join(close[:2])}?' if close
                else f'there are {", ".join(SIGNS)}')
        raise ValueError(f'{name[:40]!r} is no sign: {hint}')
    return name
