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
An alarm: its causes, its state, the progress of its escalation, and all of it as JSON.

All times are in ns of the core's clock; 0 is none. In a record of the journal they are of the core
that wrote it; :meth:`Alarm.shift` moves them to the clock of the core that reads it. Fields are
named as their keys in the journal.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field
from dataclasses import fields
import math
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.messages.alarm_event import AlarmEvent
from rt_robot_os.messages.alarm_event import KINDS_MOST
from rt_robot_os.messages.alarm_state import AlarmState
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import Level
from rt_robot_os.messages.cause import LEVEL_WORDS
from rt_robot_os.messages.cause import LEVELS

#: Pictures that one alarm keeps.
PICTURES_MOST: Final = 4
REASON_TEXT: Final = 80
TEST: Final = 'test'


@dataclass
class Reason:
    """
    One kind of cause of an alarm.

    :ivar count: how often it began.
    :ivar since_ns: when it began last.
    :ivar heard_ns: when it was published last.
    :ivar over_ns: when it cleared; 0 while it is active.
    """

    kind: str
    level: Level
    active: bool = True
    count: int = 1
    since_ns: int = 0
    heard_ns: int = 0
    over_ns: int = 0
    text: str = ''
    source: str = ''

    @classmethod
    def of(cls, cause: Cause, t_ns: int) -> Reason:
        """Make it from the first cause of its kind."""
        return cls(cause.kind, cause.level, True, 1, t_ns, t_ns, 0, cause.text[:REASON_TEXT],
                   cause.source)

    def update(self, cause: Cause, t_ns: int, again_ns: int) -> tuple[bool, bool | None]:
        """
        Update it with another cause of its kind.

        :param again_ns: a cause that returns or gets worse sooner is flapping.
        :return: whether it has begun again; and whether that or a worse level is to be notified,
            False when it is flapping, None when it is only still active.
        """
        # Published by a person, without a source, it begins each time.
        began = not self.active or not cause.source
        rises = cause.level > self.level
        since_ns = self.over_ns or (self.since_ns if rises else self.heard_ns)
        if began:
            self.count += 1
        if began or cause.level != self.level:
            self.since_ns, self.active, self.over_ns = t_ns, True, 0
        self.heard_ns, self.text = t_ns, cause.text[:REASON_TEXT] or self.text
        self.level, self.source = cause.level, cause.source
        return began, t_ns - since_ns >= again_ns if began or rises else None


@dataclass
class Delivery:
    """
    A notification that was made.

    :ivar key: identifies it; the same when it is sent again after a restart.
    :ivar due_ns: without a report until then it has failed; 0 when it is decided.
    :ivar ok: the reported result; None before a report.
    :ivar again: it was sent before a restart, too.
    """

    key: str
    channel: str
    step: int
    due_ns: int = 0
    ok: bool | None = None
    again: bool = False


@dataclass
class Alarm:
    """
    One alarm.

    :ivar id: identifier, which people use in commands.
    :ivar level: the worst so far; it never decreases.
    :ivar state_ns: since when it is in its state.
    :ivar confirm_ns: when a suspicion is raised.
    :ivar by: the person who acknowledged it.
    :ivar why: the reason of the last change by a command.
    :ivar remark: a note, for the notifications that follow.
    :ivar over_ns: since when all causes are clear; 0 while one is active.
    :ivar round: how often its escalation began.
    :ivar step: of the escalation; -1 before the first.
    :ivar sent: how often the channels of this step were notified.
    :ivar next_ns: when the next step comes.
    :ivar repeat_ns: when this step repeats.
    :ivar top: the last step has been reached in this round.
    :ivar reasons: its causes, by kind, in the order in which they came.
    :ivar deliveries: the notifications of this round, by key.
    """

    id: str  # noqa: A003
    subject: str
    level: Level
    state: AlarmState
    opened_ns: int
    state_ns: int
    confirm_ns: int = 0
    text: str = ''
    node: str = ''
    x: float = math.nan
    y: float = math.nan
    by: str = ''
    why: str = ''
    remark: str = ''
    over_ns: int = 0
    remind_ns: int = 0
    round: int = 0  # noqa: A003
    step: int = -1
    sent: int = 0
    next_ns: int = 0
    repeat_ns: int = 0
    top: bool = False
    reasons: dict[str, Reason] = field(default_factory=dict)
    deliveries: dict[str, Delivery] = field(default_factory=dict)
    pictures: list[str] = field(default_factory=list)

    @property
    def technical(self) -> bool:
        """Return whether it is about a fault of the system."""
        return self.level is Level.TECHNICAL

    @property
    def is_test(self) -> bool:
        """Return whether it is a test and nothing else."""
        return set(self.reasons) == {TEST}

    @property
    def kinds(self) -> tuple[str, ...]:
        """Return the kinds of its causes, the first one first."""
        return tuple(self.reasons)

    def order(self) -> tuple[int, int, str]:
        """Return the sort key of alarms: the worst first, then the oldest."""
        return -self.level, self.opened_ns, self.id

    def update_from(self, cause: Cause) -> None:
        """Update text and position, unless the cause is less severe than those so far."""
        worst = max((each.level for each in self.reasons.values()), default=cause.level)
        if cause.level >= worst or not self.text:
            self.text = cause.text or self.text
        if cause.node:
            self.node = cause.node
        if math.isfinite(cause.x) and math.isfinite(cause.y):
            self.x, self.y = cause.x, cause.y

    def shift(self, by_ns: int) -> None:
        """Move all its times."""
        for each in (self, *self.reasons.values(), *self.deliveries.values()):
            for name in _TIMES[type(each)]:
                if getattr(each, name):
                    # 0 is none, whatever clock it is.
                    setattr(each, name, getattr(each, name) + by_ns or 1)

    def as_dict(self) -> dict[str, Any]:
        """Return it as a JSON object."""
        return _finite({
            **{name: getattr(self, name) for name in _PLAIN[Alarm]},
            'level': LEVEL_WORDS[self.level], 'state': self.state.value,
            'reasons': [_plain(each) for each in self.reasons.values()],
            'deliveries': [_plain(each) for each in self.deliveries.values()],
            'pictures': self.pictures})

    @classmethod
    def from_dict(cls, found: Mapping[str, Any]) -> Alarm:
        """
        Read what :meth:`as_dict` gave.

        :raises ValueError: it is not an alarm.
        """
        try:
            made = cls(str(found['id']), str(found['subject']), LEVELS[found['level']],
                       AlarmState(found['state']), int(found['opened_ns']), int(found['state_ns']))
            _set(made, found)
            for each in found['reasons'][:KINDS_MOST]:
                reason = Reason(str(each['kind']), LEVELS[each['level']])
                _set(reason, each)
                made.reasons[reason.kind] = reason
            for each in found['deliveries']:
                delivery = Delivery(str(each['key']), str(each['channel']), int(each['step']))
                _set(delivery, each)
                made.deliveries[delivery.key] = delivery
            made.pictures = [str(each) for each in found['pictures'][:PICTURES_MOST]]
        except (KeyError, TypeError, AttributeError) as error:
            raise ValueError(f'not an alarm: {type(error).__name__} {error}') from error
        if not made.reasons:
            raise ValueError(f'alarm {made.id} has no cause')
        return made


class AlarmChange(NamedTuple):
    """
    A change of one alarm, to be stored before its notifications are sent.

    :ivar alarm: after the change.
    :ivar events: in order; there may be none.
    :ivar sends: notifications to be sent.
    """

    alarm: Alarm
    events: tuple[AlarmEvent, ...]
    sends: tuple[Delivery, ...]


_KINDS: Final = {'str': str, 'int': int, 'bool': bool, 'float': float}
# Fields of each class that are plain values, and those of them that are times.
_PLAIN: Final[dict[type, tuple[str, ...]]] = {
    cls: tuple(each.name for each in fields(cls) if each.type in _KINDS or each.name == 'ok')
    for cls in (Alarm, Reason, Delivery)}
_TIMES: Final[dict[type, tuple[str, ...]]] = {
    cls: tuple(name for name in names if name.endswith('_ns')) for cls, names in _PLAIN.items()}
_TYPES: Final[dict[type, dict[str, type]]] = {
    cls: {each.name: _KINDS[str(each.type)] for each in fields(cls) if each.type in _KINDS}
    for cls in (Alarm, Reason, Delivery)}


def _plain(each: Reason | Delivery) -> dict[str, Any]:
    found = {name: getattr(each, name) for name in _PLAIN[type(each)]}
    if isinstance(each, Reason):
        found['level'] = LEVEL_WORDS[each.level]
    return found


def _set(made: Alarm | Reason | Delivery, found: Mapping[str, Any]) -> None:
    """Set the plain values that are of the right type."""
    for name, kind in _TYPES[type(made)].items():
        value = found.get(name)
        if isinstance(value, bool) is (kind is bool) and isinstance(
                value, (int, float) if kind is float else kind):
            setattr(made, name, kind(value))
    if isinstance(made, Delivery) and isinstance(found.get('ok'), bool):
        made.ok = found['ok']


def _finite(found: dict[str, Any]) -> dict[str, Any]:
    """Leave out numbers that are not known."""
    return {name: value for name, value in found.items()
            if not (isinstance(value, float) and not math.isfinite(value))}
