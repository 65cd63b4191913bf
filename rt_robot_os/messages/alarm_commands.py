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
Commands about alarms, as text in a ``std_msgs/msg/String``.

::

    acknowledge ID by NAME [why]       acknowledge all by NAME
    resolve ID by NAME [reason]
    cancel ID by NAME [why]            cancel all by NAME    suspected alarms only
    confirm ID by NAME [why]
    escalate ID by NAME [why]          notifies the next step immediately
    note ID by NAME text               is part of the notifications that follow
    test [LEVEL] by NAME
    silence [SECONDS] by NAME          mutes the robot's voice

``ID`` is the number of an alarm, or its subject where that has one alarm only.
"""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Annotated
from typing import Final

from rt_robot_os.messages.cause import Level
from rt_robot_os.messages.cause import LEVEL_WORDS
from rt_robot_os.messages.cause import LEVELS
from rt_robot_os.messages.codec import Codec
from rt_robot_os.messages.fields import Choice
from rt_robot_os.messages.fields import OneOf
from rt_robot_os.messages.fields import Real
from rt_robot_os.messages.fields import Text

ALL: Final = 'all'
ACKNOWLEDGE, RESOLVE, CANCEL, CONFIRM, ESCALATE, NOTE, TEST, SILENCE = VERBS = (
    'acknowledge', 'resolve', 'cancel', 'confirm', 'escalate', 'note', 'test', 'silence')
_LONGEST: Final = 400
_LONGEST_NAME: Final = 64
_LONGEST_WHY: Final = 120
_SILENCE_S: Final = 60.0
_SILENCE_MOST_S: Final = 86_400.0


@dataclass(frozen=True, slots=True)
class AlarmCommand:
    """
    A command about an alarm, or about all.

    :ivar verb: what to do.
    :ivar target: identifier or subject of the alarm, or ``all``; empty for a test and a silence.
    :ivar by: the person, or the robot's module, that gives the command.
    :ivar why: the reason, or the text of a note.
    :ivar level: of a test.
    :ivar seconds: duration of a silence.
    """

    verb: Annotated[str, OneOf(VERBS)]
    target: Annotated[str, Text(_LONGEST)]
    by: Annotated[str, Text(_LONGEST_NAME, 1)]
    why: Annotated[str, Text(_LONGEST_WHY)] = ''
    level: Annotated[Level, Choice(LEVELS)] = Level.TECHNICAL
    seconds: Annotated[float, Real(0.0, _SILENCE_MOST_S, 's')] = 0.0

    def to_text(self) -> str:
        """Return it as text."""
        about = self.target
        if self.verb == TEST:
            about = LEVEL_WORDS[self.level]
        elif self.verb == SILENCE:
            about = repr(self.seconds)
        return ' '.join(filter(None, (self.verb, about, 'by', self.by, self.why)))


def parse_command(text: str) -> AlarmCommand:
    """
    Parse a command.

    :raises ValueError: with what is wrong, and an example.
    """
    if len(text) > _LONGEST:
        raise ValueError(f'a command of {len(text)} letters: at most {_LONGEST}')
    words = text.split()
    if not words or words[0] not in VERBS:
        raise ValueError(f'{text[:60]!r} is no command: write one of {", ".join(VERBS)}, such as '
                         '"acknowledge 7 by mary"')
    verb = words[0]
    at = next((place for place, word in enumerate(words) if place and word == 'by'), 0)
    if not at or at + 1 >= len(words):
        raise ValueError(f'{text[:60]!r} does not say who: write "{verb} ... by NAME"')
    about, by, why = words[1:at], words[at + 1], ' '.join(words[at + 2:])
    if len(by) > _LONGEST_NAME:
        raise ValueError(f'{by[:20]!r}... is too long for a name: at most {_LONGEST_NAME} letters')
    if verb == TEST:
        return AlarmCommand(verb, '', by, why[:_LONGEST_WHY], level=_level(about))
    if verb == SILENCE:
        return AlarmCommand(verb, '', by, why[:_LONGEST_WHY], seconds=_seconds(about))
    if not about:
        raise ValueError(f'{text[:60]!r} does not say which alarm: write "{verb} ID by {by}"')
    target = ' '.join(about).removeprefix('#')
    if target == ALL and verb not in (ACKNOWLEDGE, CANCEL):
        raise ValueError(f'{verb} takes one alarm at a time: write "{verb} ID by {by}"')
    return AlarmCommand(verb, target, by, why[:_LONGEST_WHY])


def _level(about: list[str]) -> Level:
    if not about:
        return Level.TECHNICAL
    if len(about) > 1 or about[0] not in LEVELS:
        raise ValueError(f'{" ".join(about)[:40]!r} is no level: it must be one of '
                         f'{", ".join(LEVELS)}')
    return LEVELS[about[0]]


def _seconds(about: list[str]) -> float:
    if not about:
        return _SILENCE_S
    try:
        seconds = float(about[0])
    except ValueError:
        seconds = math.nan
    if len(about) > 1 or not 0 <= seconds <= _SILENCE_MOST_S:
        raise ValueError(f'{" ".join(about)[:40]!r} is no number of seconds from 0 to 86400')
    return seconds


CODEC: Final = Codec(AlarmCommand)
