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
"""Messages of the agent: its changes of state, observations it orders, and their results."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
import json
import math
from typing import Annotated
from typing import Any
from typing import Final

from rt_robot_os.messages.codec import Codec
from rt_robot_os.messages.fields import Choice
from rt_robot_os.messages.fields import compact
from rt_robot_os.messages.fields import OneOf
from rt_robot_os.messages.fields import parse_object
from rt_robot_os.messages.fields import Real
from rt_robot_os.messages.fields import Text
from rt_robot_os.messages.fields import Whole

#: The longest span before or after an order.
SPAN_MOST_S: Final = 60.0
_ALARM: Final = Text(64)


class AgentState(Enum):
    """What the agent does; the value is its name in messages."""

    #: No emergency.
    IDLE = 'idle'
    #: It asks a person whether they are well, and drives there meanwhile.
    CONFIRM = 'confirm'
    #: It drives to the emergency.
    APPROACH = 'approach'
    #: It has arrived; cameras and microphone record.
    OBSERVE = 'observe'
    #: It reports what it found.
    REPORT = 'report'
    #: It stays with the person until help arrives.
    STAY = 'stay'
    #: It drives back.
    RETURN = 'return'
    #: It could not reach the emergency.
    GIVE_UP = 'give_up'
    #: The emergency stop is set.
    HELD = 'held'
    #: An operator drives.
    OPERATOR = 'operator'


AGENT_STATES: Final = {each.value: each for each in AgentState}


@dataclass(frozen=True, slots=True)
class AgentTransition:
    """
    A change of the agent's state.

    :ivar source: the state before; key ``from``.
    :ivar target: the state after; key ``to``.
    :ivar cause: the event, and why it happened.
    :ivar alarm: the alarm that is served; empty without.
    :ivar t_ns: when, on the clock of the core that published it.
    """

    source: Annotated[AgentState, Choice(AGENT_STATES)]
    target: Annotated[AgentState, Choice(AGENT_STATES)]
    cause: Annotated[str, Text(200)]
    alarm: Annotated[str, Text(200)]
    t_ns: Annotated[int, Whole(-(1 << 63), unit='ns')]

    def to_dict(self) -> dict[str, Any]:
        """Return it as a JSON object."""
        return {'from': self.source.value, 'to': self.target.value, 'cause': self.cause,
                'alarm': self.alarm, 't_ns': self.t_ns}

    def to_json(self) -> str:
        """Return it as JSON; safe in the real-time loop."""
        return compact(self.to_dict())

    @classmethod
    def from_dict(cls, found: Mapping[str, Any]) -> AgentTransition:
        """
        Read what :meth:`to_dict` gave; unknown keys are ignored.

        :raises ValueError: with the field, its value and what it must be.
        """
        return TRANSITION.read(found)

    @classmethod
    def from_json(cls, text: str) -> AgentTransition:
        """
        Read what :meth:`to_json` gave; unknown keys are ignored.

        :raises ValueError: with the field, its value and what it must be.
        """
        return TRANSITION.read(parse_object(text, '{"from": "idle", "to": "approach", ...}'))


class ObservationKind(Enum):
    """What an observation records."""

    PICTURE = 'picture'
    CLIP = 'clip'
    SOUND = 'sound'


OBSERVATION_KINDS: Final = {each.value: each for each in ObservationKind}


@dataclass(frozen=True, slots=True)
class ObservationOrder:
    """
    An order to record with all cameras, or with the microphone.

    :ivar order: what to record.
    :ivar alarm: the alarm that it is for.
    :ivar subject: the person, room or device concerned.
    :ivar before_s: seconds before the order.
    :ivar after_s: seconds after it.
    """

    order: Annotated[ObservationKind, Choice(OBSERVATION_KINDS)]
    alarm: Annotated[str, _ALARM] = ''
    subject: Annotated[str, _ALARM] = ''
    before_s: Annotated[float, Real(0.0, SPAN_MOST_S, 's')] = 0.0
    after_s: Annotated[float, Real(0.0, SPAN_MOST_S, 's')] = 0.0

    def to_dict(self) -> dict[str, Any]:
        """Return it as a JSON object."""
        return {'order': self.order.value, 'alarm': self.alarm, 'subject': self.subject,
                'before_s': self.before_s, 'after_s': self.after_s}

    def to_json(self) -> str:
        """Return it as JSON; safe in the real-time loop."""
        return compact(self.to_dict())

    @classmethod
    def from_dict(cls, found: Mapping[str, Any]) -> ObservationOrder:
        """
        Read what :meth:`to_dict` gave; unknown keys are ignored.

        :raises ValueError: with the field, its value and what it must be.
        """
        return ORDER.read({**found, **{
            key: str(found[key])[:_ALARM.most] for key in ('alarm', 'subject') if key in found}})

    @classmethod
    def from_json(cls, text: str) -> ObservationOrder:
        """
        Read what :meth:`to_json` gave; unknown keys are ignored.

        :raises ValueError: with the field, its value and what it must be.
        """
        return cls.from_dict(parse_object(text, '{"order": "picture", "alarm": "7"}'))


@dataclass(frozen=True, slots=True)
class Observation:
    """
    What became of an order to record; a camera may add fields of its own.

    :ivar alarm: the alarm that it was for; missing when the order was not valid.
    :ivar subject: the person, room or device concerned.
    :ivar kind: what was recorded.
    :ivar text: about it, for people.
    :ivar t_ns: the end of what was recorded, on the clock of the core that published it.
    :ivar level_db: mean level of sound; left out without a microphone.
    :ivar loudest_db: highest level of sound.
    :ivar problem: why nothing was recorded; left out when it was.
    :ivar file: with the picture or clip; left out without.
    """

    alarm: Annotated[str, Text(200)]
    subject: Annotated[str, Text(200)]
    kind: Annotated[str, OneOf(tuple(OBSERVATION_KINDS))]
    text: Annotated[str, Text(500)] = ''
    t_ns: Annotated[int, Whole(unit='ns')] = 0
    level_db: Annotated[float, Real(unit='dB')] = math.nan
    loudest_db: Annotated[float, Real(unit='dB')] = math.nan
    problem: Annotated[str, Text(500)] = ''
    file: Annotated[str, Text(500)] = ''

    def to_dict(self) -> dict[str, Any]:
        """Return it as a JSON object; what is empty or not known is left out."""
        found: dict[str, Any] = {each.key: getattr(self, each.key) for each in OBSERVATION.fields}
        return {key: value for key, value in found.items()
                if value and not (isinstance(value, float) and not math.isfinite(value))
                or key in ('level_db', 'loudest_db') and math.isfinite(value)}

    def to_json(self) -> str:
        """Return it as JSON."""
        return json.dumps(self.to_dict(), separators=(',', ':'))

    @classmethod
    def from_dict(cls, found: Mapping[str, Any]) -> Observation:
        """Read a result; unknown keys are ignored, a wrong value counts as missing."""
        return OBSERVATION.read(found)

    @classmethod
    def from_json(cls, text: str) -> Observation:
        """
        Read a result; unknown keys are ignored, a wrong value counts as missing.

        :raises ValueError: it is not a JSON object.
        """
        return OBSERVATION.read(parse_object(text, '{"alarm": "7", "kind": "picture", ...}'))


TRANSITION: Final = Codec(AgentTransition, keys={'source': 'from', 'target': 'to'})
ORDER: Final = Codec(ObservationOrder)
OBSERVATION: Final = Codec(Observation, repairs=True, missing={
    'alarm': '', 'subject': '', 'kind': ''})
