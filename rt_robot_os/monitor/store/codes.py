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
The one table of codes: what a sign of ours is called in LOINC, and its unit in UCUM.

What has no code of its own in LOINC, or one that says something else, has one of a code system of
this package. Units are written as UCUM does, case and all.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final
from typing import NamedTuple

LOINC: Final = 'http://loinc.org'
UCUM: Final = 'http://unitsofmeasure.org'
#: Of what has no code elsewhere.
LOCAL: Final = 'https://rt-robot-os.example.org/fhir/CodeSystem/sign'


class SignCode(NamedTuple):
    """
    How a sign is coded.

    :ivar system: whose code it is.
    :ivar code: the code.
    :ivar title: what it means.
    :ivar unit: for people.
    :ivar ucum: the unit for machines; '' when the value has none.
    :ivar profile: the vital signs profile that it must follow, the last part of its URL; '': none.
    :ivar more: another code of LOINC for the same.
    """

    system: str
    code: str
    title: str
    unit: str
    ucum: str
    profile: str = ''
    more: tuple[str, ...] = ()


#: Signs as vital_signs names them, what wearables measure besides, and the score.
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
#: A pressure is told as the two components of this panel.
PRESSURE: Final = SignCode(LOINC, '85354-9', 'Blood pressure panel with all children optional',
                           'mmHg', 'mm[Hg]', 'bp')
SYSTOLIC: Final = 'systolic_mmhg'
DIASTOLIC: Final = 'diastolic_mmhg'


def code_of(sign: str) -> SignCode:
    """Return the code of a sign, of the local system when it has none elsewhere."""
    return CODES.get(sign) or SignCode(LOCAL, sign, sign.replace('_', ' '), '', '1')


def unit_of(sign: str) -> str:
    """Return the unit of a sign, for people; '' when it has none or nobody knows."""
    return code_of(sign).unit
