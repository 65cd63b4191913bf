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

"""The settings of the alarms, and the rules that they are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.alarms.escalation import EscalationStep
from rt_robot_os.features.alarms.escalation import parse_steps
from rt_robot_os.features.alarms.rules import DEFAULT_STEPS
from rt_robot_os.features.alarms.rules import Rules
from rt_robot_os.messages.cause import check_kind
from rt_robot_os.messages.cause import Level
from rt_robot_os.messages.cause import LEVEL_WORDS

_DEFAULTS: Final = Rules()
_DAY_S: Final = 86_400.0


def _seconds(name: str, default_ns: int, text: str, minimum: float) -> Field:
    return Field(name, float, default_ns / NS_PER_S, text, 's', minimum, _DAY_S)


SETTINGS: Final = (
    Field('confirm_kinds', list, sorted(_DEFAULTS.confirm_kinds),
          'Kinds of causes that begin as a suspicion, which may be cancelled; others are raised '
          'immediately'),
    _seconds('confirm_s', _DEFAULTS.confirm_ns,
             'A suspicion that is neither confirmed nor cancelled is raised after this time', 0.0),
    _seconds('remind_s', _DEFAULTS.remind_ns,
             'An acknowledged alarm that is not resolved is raised again after this time', 1.0),
    _seconds('resolve_after_s', _DEFAULTS.resolve_after_ns,
             'An acknowledged alarm resolves itself when its causes have been clear for this time',
             0.0),
    Field('unseen_levels', list, ['technical'],
          'Alarms of these levels resolve themselves without being acknowledged, too',
          choices=('technical', 'warning')),
    _seconds('again_s', _DEFAULTS.again_ns,
             'A cause that returns sooner is flapping: it is counted, without a new notification',
             0.0),
    *(Field(f'{LEVEL_WORDS[level]}_steps', list, list(DEFAULT_STEPS[level]),
            f'Escalation of alarms of level {LEVEL_WORDS[level]}: channels and the seconds until '
            'the next step, such as "operator+screen 30 repeat 10"; the last step is repeated')
      for level in sorted(Level, reverse=True)),
    _seconds('delivery_timeout_s', _DEFAULTS.delivery_timeout_ns,
             'A notification without a delivery report after this time has failed', 0.1),
    _seconds('silence_s', _DEFAULTS.silence_most_ns,
             'The longest time for which the command silence mutes the robot', 0.0),
    Field('alarms', int, _DEFAULTS.alarms_most, 'The most open alarms', '', 4, 64),
    _seconds('journal_wait_s', 2 * NS_PER_S,
             'How long notifications wait for the journal, and all inputs at the start', 0.0),
    Field('stored_topic', str, 'alarms/stored',
          'Topic on which the journal replies; empty: there is no journal, and a restart loses '
          'all alarms'),
    Field('observed_topic', str, '',
          'Topic of pictures that were taken, such as agent/observed; empty: none'),
)


def rules_of(name: str, settings: Mapping[str, Any]) -> Rules:
    """
    Make the rules from the settings.

    :raises ConfigError: steps or kinds are wrong; it names each.
    """
    problems: list[str] = []
    steps: dict[Level, tuple[EscalationStep, ...]] = {}
    for level in Level:
        key = f'{LEVEL_WORDS[level]}_steps'
        try:
            steps[level] = parse_steps(settings[key])
        except ValueError as error:
            problems.append(f'{name}.{key}: {error}')
            continue
        if not steps[level] and level >= Level.URGENT:
            problems.append(f'{name}.{key} is empty: no one would be notified; name a channel, '
                            'such as "operator 60"')
    for kind in settings['confirm_kinds']:
        try:
            check_kind(kind)
        except ValueError as error:
            problems.append(f'{name}.confirm_kinds: {error}')
    if problems:
        raise ConfigError(problems)

    def ns(key: str) -> int:
        return round(float(settings[key]) * NS_PER_S)

    return Rules(
        steps, frozenset(settings['confirm_kinds']), ns('confirm_s'), ns('remind_s'),
        ns('resolve_after_s'),
        frozenset(Level[each.upper()] for each in settings['unseen_levels']), ns('again_s'),
        delivery_timeout_ns=ns('delivery_timeout_s'), silence_most_ns=ns('silence_s'),
        alarms_most=settings['alarms'])
