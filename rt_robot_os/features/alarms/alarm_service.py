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
An alarm table with its journal: no notification is sent before its change is stored.

Each change of an alarm is a numbered record for the journal (write-ahead logging). Notifications
wait until the journal has stored their record, or for a set time at most: an alarm that cannot be
stored is notified all the same. After a restart the journal returns its records and the service
continues with them; until then, and for that same time at most, causes and commands are deferred.

The service does no input or output; all times are handed in. A crash is tested by making a new
service and giving it the records that a journal kept of the old one.
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

#: Causes: the journal stores nothing, or will store nothing soon.
JOURNAL_FAULT: Final = 'journal_fault'
JOURNAL_SPACE: Final = 'journal_space'
#: The longest record, in bytes.
RECORD_BYTES: Final = 32_000
#: A busy machine may need this long to read a journal at the start. Only after it a journal that
#: returns nothing is an alarm: a slow start is not.
START_ALARM_NS: Final = 20 * NS_PER_S
_WAITING_MOST: Final = 64
_UNSTORED_MOST: Final = 256
_HELD_MOST: Final = 256
_FILE_MOST: Final = 200


class HeldNotification(NamedTuple):
    """A notification that waits until the journal has stored its record."""

    seq: int
    until_ns: int
    notification: Notification


class AlarmService:
    """
    An alarm table and its journal.

    :param rules: of the table.
    :param journal: there is a journal; else notifications are sent immediately, and a restart
        loses all alarms.
    :param wait_ns: how long anything waits for the journal.
    :ivar table: the alarms.
    :ivar counters: of records and notifications.
    :ivar warning: what is wrong with the journal; empty when it works.
    """

    def __init__(self, rules: Rules = Rules(), *, journal: bool = True,
                 wait_ns: int = 2 * NS_PER_S) -> None:
        self.table = AlarmTable(rules)
        self.counters: Counter[str] = Counter()
        self.warning = ''
        self._wait_ns = wait_ns
        self._has_journal = journal
        # Whether nothing is deferred any more, and whether the journal has returned its records.
        self._restored = not journal
        self._has_read = False
        self._start_until_ns = self._began_ns = 0
        self._alarm_ns = 0  # when a journal that has returned nothing is an alarm
        self._started = False
        self._deferred: deque[tuple[int, Callable[[int], None]]] = deque()
        # Records of before a restart, each with the shift to this clock in ns.
        self._found: dict[str, tuple[JournalRecord, int]] = {}
        self._seq = self._stored_seq = 0
        self._faulty = False
        self._patience_ns = 0  # notifications wait until then for a faulty journal
        self._unstored: deque[tuple[int, str, str]] = deque()
        self._held: deque[HeldNotification] = deque()
        self._events: list[AlarmEvent] = []
        self._records: list[str] = []
        self._notifications: list[Notification] = []
        self._answers: list[CommandAnswer] = []
        self.table.unsaved = not journal

    # ---- what comes in -----------------------------------------------------------------------

    def start(self, t_ns: int) -> None:
        """Start: from now on the journal has its time to return its records."""
        self._started = True
        self.table.begin_life(t_ns)
        self._start_until_ns = t_ns + self._wait_ns

    def handle_cause(self, cause: Cause, t_ns: int) -> None:
        """Handle a cause."""
        if self._defers(partial(self.handle_cause, cause), t_ns):
            return
        self.advance(t_ns)
        self.table.handle_cause(cause, t_ns)
        self._settle(t_ns)

    def handle_command(self, text: str, t_ns: int) -> None:
        """Execute a command; each has an answer."""
        if self._defers(partial(self.handle_command, text), t_ns):
            return
        self.advance(t_ns)
        self._answers.append(execute(self.table, text, t_ns))
        self._settle(t_ns)

    def handle_report(self, key: str, ok: bool, text: str, t_ns: int) -> None:
        """Handle the delivery report of a notification."""
        if self._defers(partial(self.handle_report, key, ok, text), t_ns):
            return
        self.advance(t_ns)
        self.table.handle_report(key, ok, text, t_ns)
        self._settle(t_ns)

    def handle_picture(self, alarm: str, file: str, t_ns: int) -> None:
        """Add a picture to its alarm; one of an alarm that is not open is counted."""
        if self._defers(partial(self.handle_picture, alarm, file), t_ns):
            return
        self.advance(t_ns)
        if alarm not in self.table.alarms:
            self.counters['pictures_without_alarm'] += 1
        self.table.add_picture(alarm, file[:_FILE_MOST])
        self._settle(t_ns)

    def handle_journal(self, reply: JournalReply, t_ns: int) -> None:
        """
        Handle a reply of the journal.

        :raises ValueError: a record of before is not valid.
        """
        if reply.record is not None:
            self._take_record(JournalRecord.from_dict(reply.record), reply.age_ns, t_ns)
        elif reply.restored is not None:
            self._resume(t_ns)
        elif reply.stored is not None:
            self._confirm_stored(reply.stored, t_ns)
        elif reply.resend:
            self._records = self.unstored()
        elif reply.low is not None:
            self._report_journal(JOURNAL_SPACE, reply.low[:160], t_ns)
        elif reply.fault is not None:
            self._fault(reply.fault[:160], t_ns, self._wait_ns)

    def advance(self, now_ns: int) -> None:
        """Do everything that was due until now, each at its own time."""
        if self._started and not self._restored and now_ns >= self._start_until_ns:
            at_ns, self._restored = self._start_until_ns, True
            self.table.unsaved = True
            self._note_fault(self._not_restored(), at_ns, 0)
            self._alarm_ns = self._start_until_ns + START_ALARM_NS
            self._handle_deferred(at_ns)
        if self._alarm_ns and now_ns >= self._alarm_ns:
            at_ns, self._alarm_ns = self._alarm_ns, 0
            self._report_journal(JOURNAL_FAULT, self._not_restored(), at_ns)
        while (due_ns := self.table.next_ns()) and due_ns <= now_ns:
            self._give_up_waiting(due_ns)
            self.table.advance(due_ns)
            self._settle(due_ns)
        self._give_up_waiting(now_ns)

    @property
    def next_ns(self) -> int:
        """Return when :meth:`advance` has something to do; 0 never."""
        starts = self._started and not self._restored
        return min(filter(None, (
            self.table.next_ns(), self._held[0].until_ns if self._held else 0,
            self._start_until_ns if starts else 0, self._alarm_ns)), default=0)

    # ---- what comes out ----------------------------------------------------------------------

    def pop_events(self) -> list[AlarmEvent]:
        """Return the events since the last call."""
        found, self._events = self._events, []
        return found

    def pop_records(self) -> list[str]:
        """Return the records for the journal since the last call, as JSON."""
        found, self._records = self._records, []
        return found

    def pop_notifications(self) -> list[Notification]:
        """Return the notifications that may be sent, since the last call."""
        found, self._notifications = self._notifications, []
        return found

    def pop_answers(self) -> list[CommandAnswer]:
        """Return the answers to commands since the last call."""
        found, self._answers = self._answers, []
        return found

    def unstored(self) -> list[str]:
        """Return the records that the journal has not acknowledged, to be sent again."""
        return [text for _, _, text in self._unstored]

    def statistics(self) -> dict[str, Any]:
        """Return the counters, and how much waits."""
        return {**self.table.summary(), **self.counters, 'unstored': len(self._unstored),
                'held': len(self._held)}

    # ---- the journal -------------------------------------------------------------------------

    def _defers(self, take: Callable[[int], None], t_ns: int) -> bool:
        """Defer an input until the journal has returned its records; return whether it is."""
        if self._restored or (self._started and t_ns >= self._start_until_ns):
            return False
        if len(self._deferred) >= _WAITING_MOST:
            self.counters['dropped_at_start'] += 1
        else:
            self._deferred.append((t_ns, take))
        return True

    def _handle_deferred(self, t_ns: int) -> None:
        waiting, self._deferred = self._deferred, deque()
        for at_ns, take in waiting:
            take(max(at_ns, t_ns))

    def _settle(self, t_ns: int) -> None:
        """Make records of all changes, and hold the notifications until these are stored."""
        for change in self.table.pop_changes():
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
            self._seq, t_ns, alarm.id, self.table.number, self.table.event_seq,
            tuple(each.to_dict() for each in change.events),
            alarm.as_dict() if is_open else None,
            None if is_open else tuple(self.table.suppressed.of(alarm)))
        text = record.to_json()
        if len(text.encode()) > RECORD_BYTES:
            text = replace(record, events=()).to_json()
            self.counters['shortened_records'] += 1
        self._records.append(text)
        self._unstored.append((self._seq, alarm.id, text))
        if len(self._unstored) > _UNSTORED_MOST:
            self._drop_record()

    def _drop_record(self) -> None:
        """Drop the oldest record that a later one of the same alarm replaces."""
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
        # The robot speaks immediately; a restart does not repeat it.
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
        """Send a notification, unless it is out of date by now."""
        alarm = self.table.alarms.get(held.notification.alarm)
        if alarm is None or held.notification.key not in alarm.deliveries or (
                not alarm.deliveries[held.notification.key].due_ns):
            self.counters['withdrawn'] += 1
            return
        self._notifications.append(held.notification)

    def _confirm_stored(self, seq: int, t_ns: int) -> None:
        self._stored_seq = max(self._stored_seq, seq)
        while self._unstored and self._unstored[0][0] <= seq:
            self._unstored.popleft()
            self.counters['records_stored'] += 1
        while self._held and self._held[0].seq <= seq:
            self._release(self._held.popleft())
        if self._faulty and not self._unstored:
            self._faulty, self.warning = False, ''
            self._report_journal(JOURNAL_FAULT, '', t_ns)

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
        Continue without the journal until it stores records again.

        :param patience_ns: how long notifications still wait: a core that is killed before the
            journal is back would not know that they were sent.
        """
        self._note_fault(text, t_ns, patience_ns)
        self._alarm_ns = 0
        self._report_journal(JOURNAL_FAULT, text or 'it does not say why', t_ns)

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

    def _report_journal(self, kind: str, text: str, t_ns: int) -> None:
        """Raise a cause about the journal; without a text clear it."""
        self.table.handle_cause(
            Cause(kind, 'journal', Level.TECHNICAL, bool(text), text, 'alarms'), t_ns)
        self._settle(t_ns)

    # ---- after a restart ---------------------------------------------------------------------

    def _take_record(self, record: JournalRecord, age_ns: int, t_ns: int) -> None:
        """Take a record of before a restart; the newest of each alarm counts."""
        if self._has_read:
            return  # the journal was opened again: its records are known
        self.table.number = max(self.table.number, record.number)
        self.table.event_seq = max(self.table.event_seq, record.event_seq)
        self._seq = max(self._seq, record.seq)
        if record.alarm in self._found and self._found[record.alarm][0].seq >= record.seq:
            return
        self._found[record.alarm] = record, t_ns - max(0, age_ns) - record.t_ns

    def _resume(self, t_ns: int) -> None:
        """Continue with the records of before; send again what is not stored yet."""
        if not self._has_read:
            self._has_read = True
            self._alarm_ns = 0
            self.table.begin_life(t_ns)
            late, self._restored = self._restored, True
            self.table.unsaved = False
            self._renumber()
            self._began_ns = t_ns
            self.table.restore(self._read_alarms(t_ns), t_ns)
            self._settle(t_ns)
            if not self._faulty:
                self._report_journal(JOURNAL_FAULT, '', t_ns)  # it works again
            self.advance(t_ns)
            if not late:
                self._handle_deferred(t_ns)
        self._records = self.unstored()

    def _read_alarms(self, t_ns: int) -> list[Alarm]:
        found, self._found = self._found, {}
        alarms = []
        for record, shift_ns in sorted(found.values(), key=lambda each: each[0].seq):
            try:
                if record.state is None:
                    self.table.suppressed.restore(record.lasting or (), shift_ns, t_ns)
                    continue
                alarm = Alarm.from_dict(record.state)
                alarm.shift(shift_ns)
                if alarm.state.is_open and alarm.id not in self.table.alarms:
                    alarms.append(alarm)
            except (ValueError, KeyError, TypeError):
                self.counters['unreadable_records'] += 1
        return alarms

    def _renumber(self) -> None:
        """Renumber records that were made before the numbers in use were known."""
        for place, (_, alarm, text) in enumerate(self._unstored):
            self._seq += 1
            self._unstored[place] = self._seq, alarm, replace(
                JournalRecord.from_json(text), seq=self._seq).to_json()
