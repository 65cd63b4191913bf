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
The desk: a book, and what sees to it that nothing is told before it is kept.

Each change of an alarm is a record, numbered, that goes to the journal. Notifications wait until
the journal has theirs, or for a set time at most: an alarm that cannot be written down is told all
the same. After a restart the journal gives back what it has, and the desk goes on with it; until
then, and for that same time at most, causes and commands wait.

The desk does no input or output and never asks for the time. A crash is to make a new desk, and to
give it what a journal kept of the records of the old one.
"""

from __future__ import annotations

from collections import Counter
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.alarms.alarm import Alarm
from rt_robot_os.features.alarms.alarm import AlarmChange
from rt_robot_os.features.alarms.alarm_table import AlarmTable
from rt_robot_os.features.alarms.command_handler import execute
from rt_robot_os.features.alarms.escalation import ROBOT
from rt_robot_os.features.alarms.rules import Rules
from rt_robot_os.features.alarms.wording import sentence_of
from rt_robot_os.messages.alarm_event import AlarmEvent
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import Level
from rt_robot_os.messages.cause import LEVEL_WORDS
from rt_robot_os.messages.command_answer import CommandAnswer
from rt_robot_os.messages.journal import JournalRecord
from rt_robot_os.messages.journal import JournalReply
from rt_robot_os.messages.notification import Notification

#: The journal keeps nothing, or will keep nothing soon.
JOURNAL_FAULT: Final = 'journal_fault'
JOURNAL_SPACE: Final = 'journal_space'
#: The longest record, in bytes.
RECORD_BYTES: Final = 32_000
#: A machine that is busy while it starts may take that much longer to read a journal than anything
#: waits for it. Only then is it an alarm of its own: people are not called for a slow start.
START_ALARM_NS: Final = 20 * NS_PER_S
_WAITING_MOST: Final = 64
_UNSTORED_MOST: Final = 256
_HELD_MOST: Final = 256
_FILE_MOST: Final = 200


class HeldNotification(NamedTuple):
    """A notification that waits for the journal to have its record."""

    seq: int
    until_ns: int
    notification: Notification


class AlarmService:
    """
    A book and its journal.

    :param rules: of the book.
    :param journal: there is one; else everything is told at once and a restart forgets it.
    :param wait_ns: how long anything waits for the journal.
    :ivar book: the alarms.
    :ivar counters: of records and notifications.
    :ivar warning: what is wrong with the journal; empty when nothing is.
    """

    def __init__(self, rules: Rules = Rules(), *, journal: bool = True,
                 wait_ns: int = 2 * NS_PER_S) -> None:
        self.book = AlarmTable(rules)
        self.counters: Counter[str] = Counter()
        self.warning = ''
        self._wait_ns = wait_ns
        self._has_journal = journal
        # Whether it need not be waited for any more, and whether it has given back what it keeps.
        self._restored = not journal
        self._has_read = False
        self._start_until_ns = self._began_ns = 0
        self._alarm_ns = 0  # when a journal that has given nothing back yet is an alarm
        self._started = False
        self._waiting: deque[tuple[int, Callable[[int], None]]] = deque()
        # Records of before a restart, each with the shift to this clock in ns.
        self._found: dict[str, tuple[JournalRecord, int]] = {}
        self._seq = self._stored_seq = 0
        self._faulty = False
        self._patience_ns = 0  # while it is faulty: until then it is waited for
        self._unstored: deque[tuple[int, str, str]] = deque()
        self._held: deque[HeldNotification] = deque()
        self._events: list[AlarmEvent] = []
        self._records: list[str] = []
        self._notifications: list[Notification] = []
        self._answers: list[CommandAnswer] = []
        self.book.unsaved = not journal

    # ---- what comes in -----------------------------------------------------------------------

    def start(self, t_ns: int) -> None:
        """Begin: from now on the journal has its time to give back what it keeps."""
        self._started = True
        self.book.begin_life(t_ns)
        self._start_until_ns = t_ns + self._wait_ns

    def take_cause(self, cause: Cause, t_ns: int) -> None:
        """Take a cause."""
        if self._waits(partial(self.take_cause, cause), t_ns):
            return
        self.advance(t_ns)
        self.book.take_cause(cause, t_ns)
        self._settle(t_ns)

    def take_command(self, text: str, t_ns: int) -> None:
        """Carry out a command; there is an answer to each."""
        if self._waits(partial(self.take_command, text), t_ns):
            return
        self.advance(t_ns)
        self._answers.append(execute(self.book, text, t_ns))
        self._settle(t_ns)

    def take_report(self, key: str, ok: bool, text: str, t_ns: int) -> None:
        """Take what a channel says of a notification."""
        if self._waits(partial(self.take_report, key, ok, text), t_ns):
            return
        self.advance(t_ns)
        self.book.take_report(key, ok, text, t_ns)
        self._settle(t_ns)

    def take_picture(self, alarm: str, file: str, t_ns: int) -> None:
        """Take what the robot has seen; a picture of an alarm that is not open is counted."""
        if self._waits(partial(self.take_picture, alarm, file), t_ns):
            return
        self.advance(t_ns)
        if alarm not in self.book.alarms:
            self.counters['pictures_without_alarm'] += 1
        self.book.add_picture(alarm, file[:_FILE_MOST])
        self._settle(t_ns)

    def handle_journal(self, reply: JournalReply, t_ns: int) -> None:
        """
        Handle a reply of the journal.

        :raises ValueError: a record of before is not valid.
        """
        if reply.record is not None:
            self._take_record(JournalRecord.from_dict(reply.record), reply.age_ns, t_ns)
        elif reply.restored is not None:
            self._go_on(t_ns)
        elif reply.stored is not None:
            self._take_seq(reply.stored, t_ns)
        elif reply.resend:
            self._records = self.unstored()
        elif reply.low is not None:
            self._tell(JOURNAL_SPACE, reply.low[:160], t_ns)
        elif reply.fault is not None:
            self._fault(reply.fault[:160], t_ns, self._wait_ns)

    def advance(self, now_ns: int) -> None:
        """Do what was due until now, each thing at its own time."""
        if self._started and not self._restored and now_ns >= self._start_until_ns:
            at_ns, self._restored = self._start_until_ns, True
            self.book.unsaved = True
            self._note_fault(self._not_restored(), at_ns, 0)
            self._alarm_ns = self._start_until_ns + START_ALARM_NS
            self._take_waiting(at_ns)
        if self._alarm_ns and now_ns >= self._alarm_ns:
            at_ns, self._alarm_ns = self._alarm_ns, 0
            self._tell(JOURNAL_FAULT, self._not_restored(), at_ns)
        while (due_ns := self.book.next_ns()) and due_ns <= now_ns:
            self._give_up_waiting(due_ns)
            self.book.advance(due_ns)
            self._settle(due_ns)
        self._give_up_waiting(now_ns)

    @property
    def next_ns(self) -> int:
        """Return when :meth:`advance` has something to do; 0 never."""
        starts = self._started and not self._restored
        return min(filter(None, (
            self.book.next_ns(), self._held[0].until_ns if self._held else 0,
            self._start_until_ns if starts else 0, self._alarm_ns)), default=0)

    # ---- what comes out ----------------------------------------------------------------------

    def take_events(self) -> list[AlarmEvent]:
        """Return the events since the last call."""
        found, self._events = self._events, []
        return found

    def take_records(self) -> list[str]:
        """Return the records for the journal since the last call, as JSON."""
        found, self._records = self._records, []
        return found

    def take_notifications(self) -> list[Notification]:
        """Return the notifications that may be sent, since the last call."""
        found, self._notifications = self._notifications, []
        return found

    def take_answers(self) -> list[CommandAnswer]:
        """Return the answers to commands since the last call."""
        found, self._answers = self._answers, []
        return found

    def unstored(self) -> list[str]:
        """Return the records that the journal has not acknowledged, to be sent again."""
        return [text for _, _, text in self._unstored]

    def statistics(self) -> dict[str, Any]:
        """Return the counters, and what waits."""
        return {**self.book.summary(), **self.counters, 'unstored': len(self._unstored),
                'held': len(self._held)}

    # ---- the journal -------------------------------------------------------------------------

    def _waits(self, take: Callable[[int], None], t_ns: int) -> bool:
        """Put aside what comes before the journal has given back what it keeps."""
        if self._restored or (self._started and t_ns >= self._start_until_ns):
            return False
        if len(self._waiting) >= _WAITING_MOST:
            self.counters['dropped_at_start'] += 1
        else:
            self._waiting.append((t_ns, take))
        return True

    def _take_waiting(self, t_ns: int) -> None:
        waiting, self._waiting = self._waiting, deque()
        for at_ns, take in waiting:
            take(max(at_ns, t_ns))

    def _settle(self, t_ns: int) -> None:
        """Make records of all changes, and let the notifications wait for theirs."""
        for change in self.book.take_changes():
            self._events += change.events
            self._keep(change, t_ns)
            for delivery in change.sends:
                self._hold(change.alarm, delivery.key, t_ns)

    def _keep(self, change: AlarmChange, t_ns: int) -> None:
        if not self._has_journal:
            return
        self._seq += 1
        alarm = change.alarm
        is_open = alarm.state.is_open
        record = JournalRecord(
            self._seq, t_ns, alarm.id, self.book.number, self.book.event_seq,
            tuple(each.to_dict() for each in change.events),
            alarm.as_dict() if is_open else None,
            None if is_open else tuple(self.book.lasting.of(alarm)))
        text = record.to_json()
        if len(text.encode()) > RECORD_BYTES:
            text = replace(record, events=()).to_json()
            self.counters['shortened_records'] += 1
        self._records.append(text)
        self._unstored.append((self._seq, alarm.id, text))
        if len(self._unstored) > _UNSTORED_MOST:
            self._drop_record()

    def _drop_record(self) -> None:
        """Drop the oldest record that a later one of the same alarm makes up for."""
        last = {alarm: seq for seq, alarm, _ in self._unstored}
        dropped = next((each for each in self._unstored if last[each[1]] != each[0]),
                       self._unstored[0])
        self._unstored.remove(dropped)
        self.counters['dropped_records'] += 1

    def _hold(self, alarm: Alarm, key: str, t_ns: int) -> None:
        delivery = alarm.deliveries.get(key)
        if delivery is None:
            return
        notification = Notification(
            key, delivery.channel, alarm.id, delivery.step, LEVEL_WORDS[alarm.level],
            alarm.subject, sentence_of(alarm), alarm.kinds, alarm.node, alarm.x, alarm.y,
            tuple(alarm.pictures), delivery.again)
        given_up = self._faulty and t_ns >= self._patience_ns
        # The robot's voice is heard here and now; nobody hears it twice after a restart.
        if not self._has_journal or given_up or delivery.channel == ROBOT:
            self._notifications.append(notification)
            return
        if len(self._held) >= _HELD_MOST:
            self._notifications.append(self._held.popleft().notification)
        until_ns = max(t_ns, self._began_ns) + self._wait_ns
        if self._faulty:
            until_ns = min(until_ns, self._patience_ns)
        self._held.append(HeldNotification(self._seq, until_ns, notification))

    def _release(self, held: HeldNotification) -> None:
        """Let a notification go, if it is not out of date by now."""
        alarm = self.book.alarms.get(held.notification.alarm)
        if alarm is None or held.notification.key not in alarm.deliveries or (
                not alarm.deliveries[held.notification.key].due_ns):
            self.counters['withdrawn'] += 1
            return
        self._notifications.append(held.notification)

    def _take_seq(self, seq: int, t_ns: int) -> None:
        self._stored_seq = max(self._stored_seq, seq)
        while self._unstored and self._unstored[0][0] <= seq:
            self._unstored.popleft()
            self.counters['records_stored'] += 1
        while self._held and self._held[0].seq <= seq:
            self._release(self._held.popleft())
        if self._faulty and not self._unstored:
            self._faulty, self.warning = False, ''
            self._tell(JOURNAL_FAULT, '', t_ns)

    def _give_up_waiting(self, now_ns: int) -> None:
        until_ns = self._held[0].until_ns if self._held else now_ns + 1
        if until_ns > now_ns:
            return
        while self._held:
            self._release(self._held.popleft())
        if not self._faulty:
            self._fault(f'it has stored nothing for {self._wait_ns / NS_PER_S:g} s', until_ns, 0)

    def _fault(self, text: str, t_ns: int, patience_ns: int) -> None:
        """
        Go on without the journal until it stores records again.

        :param patience_ns: nobody is told for so long: a core that was killed before the journal
            is there again would forget what was told.
        """
        self._note_fault(text, t_ns, patience_ns)
        self._alarm_ns = 0
        self._tell(JOURNAL_FAULT, text or 'it does not say why', t_ns)

    def _note_fault(self, text: str, t_ns: int, patience_ns: int) -> None:
        self.warning = f'the journal does not keep alarms: {text}; after a restart those that ' \
                       'are open now may be missing'
        if not self._faulty:
            self._faulty, self._patience_ns = True, t_ns + patience_ns
            self.counters['journal_faults'] += 1
            self._held = deque(each._replace(until_ns=min(each.until_ns, self._patience_ns))
                               for each in self._held)

    def _not_restored(self) -> str:
        return f'it has given nothing back in {self._wait_ns / NS_PER_S:g} s'

    def _tell(self, kind: str, text: str, t_ns: int) -> None:
        """Tell what is wrong with the journal; without a text that it is so no longer."""
        self.book.take_cause(Cause(kind, 'journal', Level.TECHNICAL, bool(text), text, 'alarms'),
                             t_ns)
        self._settle(t_ns)

    # ---- after a restart ---------------------------------------------------------------------

    def _take_record(self, record: JournalRecord, age_ns: int, t_ns: int) -> None:
        """Take a record of before a restart; the newest of each alarm counts."""
        if self._has_read:
            return  # the journal was opened again: its records are known
        self.book.number = max(self.book.number, record.number)
        self.book.event_seq = max(self.book.event_seq, record.event_seq)
        self._seq = max(self._seq, record.seq)
        if record.alarm in self._found and self._found[record.alarm][0].seq >= record.seq:
            return
        self._found[record.alarm] = record, t_ns - max(0, age_ns) - record.t_ns

    def _go_on(self, t_ns: int) -> None:
        """Go on with what was read; what the journal does not have yet is sent once more."""
        if not self._has_read:
            self._has_read = True
            self._alarm_ns = 0
            self.book.begin_life(t_ns)
            late, self._restored = self._restored, True
            self.book.unsaved = False
            self._renumber()
            self._began_ns = t_ns
            self.book.restore(self._read_alarms(t_ns), t_ns)
            self._settle(t_ns)
            if not self._faulty:
                self._tell(JOURNAL_FAULT, '', t_ns)  # that of before is over
            self.advance(t_ns)
            if not late:
                self._take_waiting(t_ns)
        self._records = self.unstored()

    def _read_alarms(self, t_ns: int) -> list[Alarm]:
        found, self._found = self._found, {}
        alarms = []
        for record, shift_ns in sorted(found.values(), key=lambda each: each[0].seq):
            try:
                if record.state is None:
                    self.book.lasting.restore(record.lasting or (), shift_ns, t_ns)
                    continue
                alarm = Alarm.from_dict(record.state)
                alarm.shift(shift_ns)
                if alarm.state.is_open and alarm.id not in self.book.alarms:
                    alarms.append(alarm)
            except (ValueError, KeyError, TypeError):
                self.counters['unreadable_records'] += 1
        return alarms

    def _renumber(self) -> None:
        """Give numbers to records that were made before anybody knew which ones are taken."""
        for place, (_, alarm, text) in enumerate(self._unstored):
            self._seq += 1
            self._unstored[place] = self._seq, alarm, replace(
                JournalRecord.from_json(text), seq=self._seq).to_json()
