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
What the detection of falls can be set to: limits from physics and from what was published.

Two limits make a ramp: at the first what is measured says nothing, from the second on it says all
that it can, in between it is a part. So a fall with a soft impact and a clear change of posture is
found like one with a hard impact that ends half upright, and no limit is a knife's edge.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.schema import Field


class FallLimits(NamedTuple):
    """
    The limits, in g, degrees, m/s and s; :data:`FALL_FIELDS` says of each what it is.

    Speed: a fall reaches 1.3 m/s and more (Bourke 2010), sitting down hardly 1 m/s; what was
    gained on the way down the floor takes away again, a soft one as much as a hard one, so both
    have the same limits. Posture: a chair tilts the trunk by 30 to 60 degrees, a floor by 60 and
    more.
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
        """Return the evidence of a fall that could not be clearer."""
        return 2.0 + self.descent_weight


_DEFAULTS: Final = FallLimits._field_defaults


def _limit(name: str, text: str, unit: str, minimum: float, maximum: float) -> Field:
    return Field(name, float, _DEFAULTS[name], text, unit, minimum, maximum)


#: The settings of whoever detects falls.
FALL_FIELDS: Final = (
    _limit('impact_from_g', 'what is felt at a blow: from here on it may be the impact of a fall',
           'g', 1.1, 8.0),
    _limit('stop_from_m_s', 'speed that the impact takes away: from here on it counts', 'm/s', 0.0,
           5.0),
    _limit('stop_full_m_s', 'from here on the impact counts fully, as 1', 'm/s', 0.1, 10.0),
    _limit('posture_from_deg', 'turn of the body between before and after: from here on it counts',
           'deg', 0.0, 170.0),
    _limit('posture_full_deg', 'from here on the turn counts fully, as 1', 'deg', 1.0, 180.0),
    _limit('posture_least_deg', 'who has turned less has not fallen, whatever the impact',
           'deg', 0.0, 180.0),
    _limit('upright_deg', 'a person who ends within this of upright has not fallen; applies as '
           'soon as steps have shown which way is up', 'deg', 0.0, 90.0),
    _limit('descent_from_m_s', 'speed downwards before the impact: from here on it counts',
           'm/s', 0.0, 5.0),
    _limit('descent_full_m_s', 'from here on the descent counts fully', 'm/s', 0.1, 10.0),
    _limit('descent_weight', 'what a full descent counts; impact and posture count 1 each', '',
           0.0, 2.0),
    _limit('evidence', 'sum of impact, posture and descent from which it is a fall', '', 0.1, 4.0),
    _limit('before_from_s', 'the posture before is the mean from so long before the impact', 's',
           0.5, 10.0),
    _limit('before_until_s', 'until so long before it', 's', 0.2, 5.0),
    _limit('settle_s', 'the posture after is looked at from so long after the impact on', 's',
           0.0, 3.0),
    _limit('after_s', 'as the mean of such a time', 's', 0.3, 3.0),
    _limit('decide_within_s', 'so long after the impact it is decided at the latest', 's', 1.0,
           30.0),
    _limit('restless_g', 'who moves more than that (standard deviation) does not lie yet', 'g',
           0.02, 2.0),
    _limit('turning_deg', 'who turns more than that while the posture is looked at neither', 'deg',
           5.0, 180.0),
    _limit('recovery_deg', 'who is back within this of the posture before may have got up', 'deg',
           5.0, 90.0),
    _limit('recovery_s', 'and has, after being so and moving for such a time', 's', 0.5, 60.0),
    _limit('block_s', 'samples of such a time count as one, their mean: a rate above 1/block_s '
           'changes nothing but the noise', 's', 0.005, 0.05),
)


def problem_of(limits: FallLimits) -> str:
    """Return what does not fit together, and what would; empty when all does."""
    for low, high in (('stop_from_m_s', 'stop_full_m_s'),
                      ('posture_from_deg', 'posture_full_deg'),
                      ('descent_from_m_s', 'descent_full_m_s'),
                      ('before_until_s', 'before_from_s')):
        if getattr(limits, low) >= getattr(limits, high):
            return (f'{low} {getattr(limits, low):g} is not below {high} '
                    f'{getattr(limits, high):g}: make it so')
    needed_s = limits.settle_s + limits.after_s
    if limits.decide_within_s < needed_s:
        return (f'decide_within_s {limits.decide_within_s:g} is less than settle_s + after_s '
                f'{needed_s:g}: no posture could be seen in time')
    if limits.evidence > limits.most_evidence:
        return (f'evidence {limits.evidence:g} is more than there can be '
                f'({limits.most_evidence:g}): no fall could be found')
    return ''


def limits_of(settings: Mapping[str, Any]) -> FallLimits:
    """Take the limits out of the settings of a module."""
    return FallLimits(**{name: settings[name] for name in FallLimits._fields})
