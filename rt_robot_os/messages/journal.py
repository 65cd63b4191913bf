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
"""Records of alarms for the journal, and what the journal replies: JSON on two topics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated
from typing import Any
from typing import Final

from rt_robot_os.messages.codec import Codec
from rt_robot_os.messages.fields import compact
from rt_robot_os.messages.fields import Flag
from rt_robot_os.messages.fields import Objects
from rt_robot_os.messages.fields import OneObject
from rt_robot_os.messages.fields import parse_object
from rt_robot_os.messages.fields import Text
from rt_robot_os.messages.fields import Whole


@dataclass(frozen=True, slots=True)
class JournalRecord:
    """
    A change of one alarm, which the journal stores before notifications are sent.

    :ivar seq: number of the record.
    :ivar t_ns: when, on the clock of the core that published it.
    :ivar alarm: identifier of the alarm.
    :ivar number: the highest number that an alarm has had so far.
    :ivar event_seq: the highest number of an event so far.
    :ivar events: what happened, as in ``alarms/events``; none when there is no room for them.
    :ivar state: the whole alarm; null when it has ended.
    :ivar lasting: of an alarm that has ended, the causes that are still active.
    """

    seq: Annotated[int, Whole()]
    t_ns: Annotated[int, Whole(-(1 << 63), unit='ns')]
    alarm: Annotated[str, Text(200, 1)]
    number: Annotated[int, Whole()]
    event_seq: Annotated[int, Whole()]
    events: Annotated[tuple[Mapping[str, Any], ...], Objects()] = ()
    state: Annotated[Mapping[str, Any] | None, OneObject()] = None
    lasting: Annotated[tuple[Mapping[str, Any], ...] | None, Objects()] = None

    def to_dict(self) -> dict[str, Any]:
        """Return it as a JSON object."""
        found: dict[str, Any] = {
            'seq': self.seq, 't_ns': self.t_ns, 'alarm': self.alarm, 'number': self.number,
            'event_seq': self.event_seq, 'events': list(self.events), 'state': self.state}
        if self.lasting is not None:
            found['lasting'] = list(self.lasting)
        return found

    def to_json(self) -> str:
        """Return it as JSON."""
        return compact(self.to_dict())

    @classmethod
    def from_dict(cls, found: Mapping[str, Any]) -> JournalRecord:
        """
        Read what :meth:`to_dict` gave; unknown keys are ignored.

        :raises ValueError: with the field, its value and what it must be.
        """
        return JOURNAL_RECORD.read(found)

    @classmethod
    def from_json(cls, text: str) -> JournalRecord:
        """
        Read what :meth:`to_json` gave; unknown keys are ignored.

        :raises ValueError: with the field, its value and what it must be.
        """
        return JOURNAL_RECORD.read(parse_object(text, '{"seq": 1, "alarm": "7", ...}'))


@dataclass(frozen=True, slots=True)
class JournalReply:
    """
    What the journal reports: one of the fields, and ``age_ns`` with ``record``.

    :ivar record: a record of before the restart.
    :ivar age_ns: of that record.
    :ivar restored: number of records that came back: there are no more.
    :ivar stored: records up to this number are on the disk.
    :ivar resend: records found no room: send all again that are not stored.
    :ivar low: why the room on the disk is low; empty: it no longer is.
    :ivar fault: why nothing can be stored.
    """

    record: Annotated[Mapping[str, Any] | None, OneObject()] = None
    age_ns: Annotated[int, Whole(-(1 << 63), unit='ns')] = 0
    restored: Annotated[int | None, Whole()] = None
    stored: Annotated[int | None, Whole()] = None
    resend: Annotated[bool, Flag()] = False
    low: Annotated[str | None, Text(32_000)] = None
    fault: Annotated[str | None, Text(32_000)] = None

    def to_dict(self) -> dict[str, Any]:
        """Return it as a JSON object."""
        if self.record is not None:
            return {'record': dict(self.record), 'age_ns': self.age_ns}
        for name in ('restored', 'stored', 'low', 'fault'):
            value = getattr(self, name)
            if value is not None:
                return {name: value}
        return {'resend': self.resend}

    def to_json(self) -> str:
        """Return it as JSON."""
        return compact(self.to_dict())

    @classmethod
    def from_dict(cls, found: Mapping[str, Any]) -> JournalReply:
        """
        Read a reply; unknown keys are ignored.

        :raises ValueError: it has none of the fields, or a wrong value.
        """
        if not _REPLIES & found.keys():
            raise ValueError(f'{str(found)[:60]!r} is not a reply of the journal: it must have '
                             'one of ' + ', '.join(sorted(_REPLIES)))
        return JOURNAL_REPLY.read(found)

    @classmethod
    def from_json(cls, text: str) -> JournalReply:
        """
        Read a reply; unknown keys are ignored.

        :raises ValueError: it has none of the fields, or a wrong value.
        """
        return cls.from_dict(parse_object(text, '{"stored": 7}'))


_REPLIES: Final = frozenset({'record', 'restored', 'stored', 'resend', 'low', 'fault'})
JOURNAL_RECORD: Final = Codec(JournalRecord, missing={'number': 0, 'event_seq': 0})
JOURNAL_REPLY: Final = Codec(JournalReply)
