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
The only table of codes: the LOINC code of each sign, and its unit in UCUM.

A sign without a matching code in LOINC has a code from a code system of this package. Units are
written as in UCUM, which is case-sensitive.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final
from typing import NamedTuple

LOINC: Final = 'http://loinc.org'
UCUM: Final = 'http://unitsofmeasure.org'
#: Code system of the signs that LOINC has no code for.
LOCAL: Final = 'https://rt-robot-os.example.org/fhir/CodeSystem/sign'


class SignCode(NamedTuple):
    """
    The code of a sign.

    :ivar system: the code system.
    :ivar code: the code.
    :ivar title: its meaning.
    :ivar unit: as shown to people.
    :ivar ucum: the unit in UCUM; '' when the value has no unit.
    :ivar profile: the vital signs profile that it must follow, as the last part of its URL; '' for
        none.
    :ivar more: a second LOINC code for the same sign.
    """

    system: str
    code: str
    title: str
    unit: str
    ucum: str
    profile: str = ''
    more: tuple[str, ...] = ()


#: Signs as vital_signs names them, further values of wearables, and the score.
CODES: Final[Mapping[str, SignCode]] = MappingProxyType({
    'pulse_per_min': SignCode(LOINC, '8867-4', 'Heart rate', '1/min', '/min', 'heartrate'),
    'respiration_per_min': SignCode(LOINC, '9279-1', 'Respiratory rate', '1/min', '/min',
                                    'resprate'),
    'spo2_percent': SignCode(LOINC, '2708-6', 'Oxygen saturation in Arterial blood', '%', '%',
                             'oxygensat', ('59408-5',)),
    'body_temperature': SignCode(LOINC, '8310-5', 'Body temperature', '°C', 'Cel', 'bodytemp'),
    'systolic_mmhg': SignCode(LOINC, '8480-6', 'Systolic blood pressure', 'mmHg', 'mm[Hg]'),
    'diastolic_mmhg': SignCode(LOINC, '8462-4', 'Diastolic blood pressure', 'mmHg', 'mm[Hg]'),
    'oxygen_l_per_min': SignCode(LOINC, '3151-8', 'Inhaled oxygen flow rate', 'l/min', 'L/min'),
    'news2': SignCode(LOINC, '88330-6', 'National early warning score', '', '{score}'),
    'consciousness': SignCode(LOCAL, 'consciousness', 'Consciousness: 0 alert, 1 new confusion, '
                              '2 voice, 3 pain, 4 unresponsive', '', '{code}'),
})
#: A blood pressure is exported as the two components of this panel.
PRESSURE: Final = SignCode(LOINC, '85354-9', 'Blood pressure panel with all children optional',
                           'mmHg', 'mm[Hg]', 'bp')
SYSTOLIC: Final = 'systolic_mmhg'
DIASTOLIC: Final = 'diastolic_mmhg'


def code_of(sign: str) -> SignCode:
    """Return the code of a sign; one of the local system when LOINC has none."""
    return CODES.get(sign) or SignCode(LOCAL, sign, sign.replace('_', ' '), '', '1')


def unit_of(sign: str) -> str:
    """Return the unit of a sign as shown to people; '' when it has none or is unknown."""
    return code_of(sign).unit
