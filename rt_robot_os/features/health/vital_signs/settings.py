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

"""Settings of the module vital_signs, and their parsers."""

from __future__ import annotations

from collections.abc import Mapping
import re
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import REQUIRED
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.health.duration import duration_ns
from rt_robot_os.features.health.vital_signs.sensor import SensorTimeouts
from rt_robot_os.messages.signs import checked_sign
from rt_robot_os.messages.signs import SIGNS

#: Sensors of one person, at most.
MOST_SOURCES: Final = 32
_FORM: Final = ('must be TOPIC, SIGN TOPIC or SIGN TOPIC.FIELD, and perhaps "as NAME", such as '
                'wsn/wrist/pulse_per_min or "systolic_mmhg cuff/pressure.data as cuff"')
_NAME: Final = re.compile(r'[A-Za-z][A-Za-z0-9_]{0,31}', re.ASCII)
_TOPIC: Final = re.compile(r'[A-Za-z_][\w/]*', re.ASCII)

PERSON: Final = Field(
    'person', str, REQUIRED, 'Pseudonym of the person, of letters, digits and _; part of topics, '
    'logs and recordings')
SETTINGS: Final = (
    PERSON,
    Field('sources', list, REQUIRED, 'Sensors, of each sign the preferred first: TOPIC, if its '
          'last part is the sign, else SIGN TOPIC.FIELD; then "as NAME", if the name of the '
          'sensor is not the part of the topic before the last'),
    Field('stale_limits', list, [], 'Ages at which values are stale, other than the defaults: '
          'SIGN TIME, such as body_temperature 8 h'),
    Field('off_s', float, 60.0, 'Time with only off or implausible readings after which a sensor '
          'counts as off, and a cause is reported', 's', 1.0, 3600.0),
    Field('back_s', float, 10.0, 'Time with only valid readings after which it is back', 's',
          0.0, 3600.0),
)


class SensorSpec(NamedTuple):
    """
    A sensor of the setting ``sources``.

    :ivar sign: that it measures.
    :ivar topic: of its readings.
    :ivar field: of the message; empty for the default of its type.
    :ivar name: of the sensor.
    """

    sign: str
    topic: str
    field: str
    name: str


def checked_person(name: str, settings: Mapping[str, Any]) -> str:
    """
    Return the person of the settings.

    :param name: of the module, for errors.
    :raises ConfigError: it is not valid in a topic's name.
    """
    person = str(settings['person'])
    if not _NAME.fullmatch(person):
        raise ConfigError([f'{name}.person = {person[:40]!r}: must be a letter, then at most 31 '
                           'letters, digits or _, such as anna'])
    return person


def check_rate(name: str, period_ns: int) -> None:
    """
    Check that a module with timeouts is released without messages.

    :raises ConfigError: it has no rate.
    """
    if not period_ns:
        raise ConfigError([f'{name}.rate_hz is 0: the module must be released to detect that its '
                           'inputs are silent; write rate_hz: 1.0'])


def parse_sources(name: str, settings: Mapping[str, Any]) -> dict[str, list[SensorSpec]]:
    """
    Parse the sensors, by sign in the order of the table of signs.

    :param name: of the module, for errors.
    :raises ConfigError: with every problem.
    """
    found: list[SensorSpec] = []
    problems: list[str] = []
    for text in settings['sources']:
        try:
            each = _source(text)
            if any((other.sign, other.topic, other.field) == each[:3] for other in found):
                raise ValueError('it is listed twice')
            found.append(each)
        except ValueError as error:
            problems.append(f'{name}.sources: {text[:80]!r}: {error}')
    if not settings['sources']:
        problems.append(f'{name}.sources is empty: name a topic such as wsn/wrist/pulse_per_min')
    if len(found) > MOST_SOURCES:
        problems.append(f'{name}.sources: {len(found)} sensors: at most {MOST_SOURCES}')
    if problems:
        raise ConfigError(problems)
    return {sign: sensors for sign in SIGNS
            if (sensors := [each for each in found if each.sign == sign])}


def parse_timeouts(name: str, settings: Mapping[str, Any]) -> dict[str, SensorTimeouts]:
    """
    Parse the timeouts of each sign.

    :param name: of the module, for errors.
    :raises ConfigError: with every problem.
    """
    limits = {sign.name: round(sign.stale_s * NS_PER_S) for sign in SIGNS.values()}
    problems = []
    for text in settings['stale_limits']:
        sign, _, said = text.strip().partition(' ')
        try:
            limits[checked_sign(sign)] = limit_ns = duration_ns(said)
            if limit_ns < NS_PER_S:
                raise ValueError('must be at least 1 s')
        except ValueError as error:
            problems.append(f'{name}.stale_limits: {text[:80]!r}: {error}')
    if problems:
        raise ConfigError(problems)
    off_ns, back_ns = (round(settings[key] * NS_PER_S) for key in ('off_s', 'back_s'))
    return {sign: SensorTimeouts(limit_ns, off_ns, back_ns) for sign, limit_ns in limits.items()}


def _source(text: str) -> SensorSpec:
    words = text.split()
    name = ''
    if len(words) > 2 and words[-2] == 'as':
        name = words[-1]
        if not _NAME.fullmatch(name):
            raise ValueError(f'{name[:40]!r} is not a name: must have letters, digits and _')
        words = words[:-2]
    if len(words) not in (1, 2):
        raise ValueError(_FORM)
    topic, _, field = words[-1].partition('.')
    if not _TOPIC.fullmatch(topic) or (field and not re.fullmatch(r'\w+(\.\w+)*', field)):
        raise ValueError(_FORM)
    parts = topic.rstrip('/').split('/')
    sign = checked_sign(words[0] if len(words) == 2 else parts[-1])
    if parts[-1] in SIGNS and parts[-1] != sign:
        raise ValueError(f'the name of {topic} is that of the sign {parts[-1]}, not {sign}: write '
                         f'"{topic}", or rename the topic')
    return SensorSpec(sign, topic, field, name or parts[-2 if len(parts) > 1 else -1])
