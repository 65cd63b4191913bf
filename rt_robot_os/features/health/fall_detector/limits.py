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
Settings of the fall detection: limits from physics and from publications.

Two limits make a ramp: a feature scores 0 up to the first, 1 from the second on, and a fraction
in between. So a fall with a soft impact and a clear change of posture is detected like one with a
hard impact that ends half upright, and no limit is a sharp threshold.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.schema import Field


class FallLimits(NamedTuple):
    """
    The limits, in g, degrees, m/s and s; :data:`FALL_FIELDS` describes each.

    Speed: a fall reaches 1.3 m/s and more (Bourke 2010), sitting down at most about 1 m/s. The
    impact absorbs the speed of the descent, on a soft floor as on a hard one, so both have the
    same limits. Posture: sitting tilts the trunk by 30 to 60 degrees, lying by 60 and more.
    """

    impact_from_g: float = 1.5
    stop_from_m_s: float = 0.5
    stop_full_m_s: float = 1.5
    posture_from_deg: float = 30.0
    posture_full_deg: float = 70.0
    posture_least_deg: float = 40.0
    upright_deg: float = 40.0
    descent_from_m_s: float = 0.5
    descent_full_m_s: float = 1.5
    descent_weight: float = 0.5
    evidence: float = 1.6
    before_from_s: float = 2.5
    before_until_s: float = 0.8
    settle_s: float = 0.3
    after_s: float = 1.0
    decide_within_s: float = 4.5
    restless_g: float = 0.2
    turning_deg: float = 30.0
    recovery_deg: float = 35.0
    recovery_s: float = 3.0
    block_s: float = 0.02

    @property
    def most_evidence(self) -> float:
        """Return the largest possible score."""
        return 2.0 + self.descent_weight


_DEFAULTS: Final = FallLimits._field_defaults


def _limit(name: str, text: str, unit: str, minimum: float, maximum: float) -> Field:
    return Field(name, float, _DEFAULTS[name], text, unit, minimum, maximum)


#: The settings of a module that detects falls.
FALL_FIELDS: Final = (
    _limit('impact_from_g', 'specific force from which a peak may be the impact of a fall', 'g',
           1.1, 8.0),
    _limit('stop_from_m_s', 'speed absorbed by the impact from which it scores', 'm/s', 0.0, 5.0),
    _limit('stop_full_m_s', 'absorbed speed from which the impact scores 1', 'm/s', 0.1, 10.0),
    _limit('posture_from_deg', 'angle between the postures before and after from which it scores',
           'deg', 0.0, 170.0),
    _limit('posture_full_deg', 'angle from which the change of posture scores 1', 'deg', 1.0,
           180.0),
    _limit('posture_least_deg', 'least change of posture of a fall, whatever the impact', 'deg',
           0.0, 180.0),
    _limit('upright_deg', 'a person who ends within this angle of upright has not fallen; applies '
           'as soon as the upright direction is known from steps', 'deg', 0.0, 90.0),
    _limit('descent_from_m_s', 'downward speed before the impact from which it scores', 'm/s',
           0.0, 5.0),
    _limit('descent_full_m_s', 'downward speed from which the descent scores fully', 'm/s', 0.1,
           10.0),
    _limit('descent_weight', 'score of a full descent; impact and posture score at most 1 each',
           '', 0.0, 2.0),
    _limit('evidence', 'least sum of the scores of impact, posture and descent that is a fall', '',
           0.1, 4.0),
    _limit('before_from_s', 'start of the interval of the posture before, before the impact', 's',
           0.5, 10.0),
    _limit('before_until_s', 'end of the interval of the posture before, before the impact', 's',
           0.2, 5.0),
    _limit('settle_s', 'least time from the impact to the interval of the posture after', 's',
           0.0, 3.0),
    _limit('after_s', 'length of the interval of the posture after', 's', 0.3, 3.0),
    _limit('decide_within_s', 'longest time from the impact to the decision', 's', 1.0, 30.0),
    _limit('restless_g', 'largest standard deviation of the force of a person at rest', 'g', 0.02,
           2.0),
    _limit('turning_deg', 'largest turn of a person at rest', 'deg', 5.0, 180.0),
    _limit('recovery_deg', 'a person back within this angle of the posture before may have got '
           'up', 'deg', 5.0, 90.0),
    _limit('recovery_s', 'time for which they must be so, and move, to have got up', 's', 0.5,
           60.0),
    _limit('block_s', 'duration of the blocks over which samples are averaged: a rate above '
           '1/block_s changes only the noise', 's', 0.005, 0.05),
)


def limits_problem(limits: FallLimits) -> str:
    """Return which limits are inconsistent, and the remedy; empty if none are."""
    for low, high in (('stop_from_m_s', 'stop_full_m_s'),
                      ('posture_from_deg', 'posture_full_deg'),
                      ('descent_from_m_s', 'descent_full_m_s'),
                      ('before_until_s', 'before_from_s')):
        if getattr(limits, low) >= getattr(limits, high):
            return (f'{low} {getattr(limits, low):g} must be below {high} '
                    f'{getattr(limits, high):g}')
    needed_s = limits.settle_s + limits.after_s
    if limits.decide_within_s < needed_s:
        return (f'decide_within_s {limits.decide_within_s:g} is less than settle_s + after_s '
                f'{needed_s:g}: no fall could be detected in time')
    if limits.evidence > limits.most_evidence:
        return (f'evidence {limits.evidence:g} is above the largest possible score '
                f'{limits.most_evidence:g}: no fall could be detected')
    return ''


def limits_from_settings(settings: Mapping[str, Any]) -> FallLimits:
    """Return the limits of the settings of a module."""
    return FallLimits(**{name: settings[name] for name in FallLimits._fields})
