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

"""Settings of the module assessment, and their parsers."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field
from rt_robot_os.features.health.assessment.limits import Limit
from rt_robot_os.features.health.assessment.limits import LIMIT_FORM
from rt_robot_os.features.health.assessment.limits import parse_limit
from rt_robot_os.features.health.assessment.limits import TREND_FORM
from rt_robot_os.features.health.assessment.limits import TrendLimit
from rt_robot_os.features.health.assessment.news2 import SCALES
from rt_robot_os.features.health.vital_signs.settings import PERSON

#: Of one person, at most.
MOST_LIMITS: Final = 64
#: Characters of the published limits; limits that do not fit are left out.
SHOWN_CHARACTERS: Final = 1000
AIR: Final = 'air'
OXYGEN: Final = 'oxygen'
REPORTED: Final = 'reported'

SETTINGS: Final = (
    PERSON,
    Field('spo2_scale', int, 1, 'SpO2 scale: 2 only for patients with hypercapnic respiratory '
          'failure, by the decision of a clinician', choices=SCALES),
    Field('oxygen', str, REPORTED, 'What the person breathes: as the vital signs report it, or '
          'always the same, by prescription', choices=(REPORTED, AIR, OXYGEN)),
    Field('news2', bool, True, 'Whether a high score is a cause of an alarm'),
    Field('news2_for_s', float, 60.0, 'Time for which the score must be high before the cause '
          'starts', 's', 0.0, 3600.0),
    Field('news2_clear_s', float, 120.0, 'Time for which it must be lower before the cause ends',
          's', 0.0, 86_400.0),
    Field('limits', list, [], f'Personal limits and trends: {LIMIT_FORM}, or {TREND_FORM}; '
          'the default level is warning'),
    Field('signs_topic', str, '', 'The vital signs; empty: health/PERSON/signs'),
    Field('news2_topic', str, '', 'Topic of the score, -1 while it is incomplete; empty: '
          'health/PERSON/news2'),
    Field('details_topic', str, '', 'Topic of the points of each parameter; empty: '
          'health/PERSON/news2_details'),
    Field('silent_s', float, 10.0, 'Timeout of the vital signs: without a message for this time '
          'all values count as missing, and a cause is reported', 's', 2.0, 600.0),
)


def parse_limits(name: str, settings: Mapping[str, Any]) -> list[Limit | TrendLimit]:
    """
    Parse the limits.

    :param name: of the module, for errors.
    :raises ConfigError: with every problem.
    """
    found, problems = [], []
    for text in settings['limits']:
        try:
            found.append(parse_limit(text))
        except ValueError as error:
            problems.append(f'{name}.limits: {text[:80]!r}: {error}')
    if len(found) > MOST_LIMITS:
        problems.append(f'{name}.limits: {len(found)} limits: at most {MOST_LIMITS}')
    if problems:
        raise ConfigError(problems)
    return found


def limits_text(texts: Sequence[str]) -> str:
    """Return limits for display, separated by semicolons; the last ones may be left out."""
    found = ''
    for text in texts:
        more = f'{found}; {text}' if found else text
        if len(more) > SHOWN_CHARACTERS:
            break
        found = more
    return found
