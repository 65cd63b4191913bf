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
The table of open alarms: what causes, commands, delivery reports and time do to each.

One emergency is one alarm: all causes about one subject belong to it, except technical ones, which
make an alarm of their own. Acknowledging does not resolve, and acknowledging one alarm never
acknowledges another. The table does no input or output; all times are handed in.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.features.alarms.alarm import Alarm
from rt_robot_os.features.alarms.alarm import AlarmChange
from rt_robot_os.features.alarms.alarm import Delivery
from rt_robot_os.features.alarms.alarm import PICTURES_MOST
from rt_robot_os.features.alarms.alarm import Reason
from rt_robot_os.features.alarms.alarm import TEST
from rt_robot_os.features.alarms.escalation import Escalation
from rt_robot_os.features.alarms.rules import Rules
from rt_robot_os.features.alarms.suppression import SuppressedCauses
from rt_robot_os.messages.alarm_event import AlarmEvent
from rt_robot_os.messages.alarm_event import KINDS_MOST
from rt_robot_os.messages.alarm_state import AlarmEventKind
from rt_robot_os.messages.alarm_state import AlarmState
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import Level
from rt_robot_os.messages.cause import LEVEL_WORDS

#: The subject of an alarm about the table itself.
SELF: Final = 'alarms'
OVERFLOW: Final = Cause('alarm_overflow', SELF, Level.TECHNICAL, True,
                        'more alarms than the book holds: causes were turned away', SELF)
_TECHNICAL: Final = (False, True)


class AlarmTable:
    """
    The open alarms.

    :param rules: delays, limits and escalations.
    :ivar alarms: the open alarms, by id.
    :ivar counters: of causes, events, commands and reports.
    :ivar silent_until_ns: the robot's voice is muted until then.
    :ivar unsaved: there is no journal, so numbers of before a restart are not known.
    """

    def __init__(self, rules: Rules = Rules()) -> None:
        self.rules = rules
        self.alarms: dict[str, Alarm] = {}
        self.counters: Counter[str] = Counter()
        self.silent_until_ns = 0
        self.suppressed = SuppressedCauses(rules)
        self.event_seq = 0
        self.number = 0
        self.unsaved = False
        # The core did not run before this time: what was due earlier is due now.
        self._floor_ns = 0
        self._escalation = Escalation(rules.steps, rules.delivery_timeout_ns, self)
        self._by_subject: dict[tuple[str, bool], Alarm] = {}
        self._changed: dict[str, tuple[Alarm, list[AlarmEvent], list[Delivery]]] = {}

    # ---- what comes out ----------------------------------------------------------------------

    def pop_changes(self) -> list[AlarmChange]:
        """Return the changes since the last call, one for each alarm."""
        changed, self._changed = self._changed, {}
        return [AlarmChange(alarm, tuple(events), tuple(sends))
                for alarm, events, sends in changed.values()]

    def begin_life(self, t_ns: int) -> None:
        """Make keys of notifications that no core before this one has made."""
        self._escalation.life = f'{t_ns // NS_PER_US:x}'

    def in_order(self) -> list[Alarm]:
        """Return the open alarms: the worst first, then the oldest."""
        return sorted(self.alarms.values(), key=Alarm.order)

    def note(self, alarm: Alarm, event: AlarmEventKind, t_ns: int, *, by: str = '', why: str = '',
             restored: bool = False) -> None:
        """Record an event."""
        t_ns = max(t_ns, self._floor_ns)
        self.event_seq += 1
        self.counters[event.value] += 1
        self._change(alarm)[1].append(AlarmEvent(
            self.event_seq, t_ns, alarm.id, event.value, alarm.state.value,
            LEVEL_WORDS[alarm.level],
            alarm.subject, alarm.kinds, alarm.text, by, why, alarm.node, alarm.x, alarm.y,
            restored))

    def send(self, alarm: Alarm, delivery: Delivery) -> None:
        """Queue a notification."""
        self._change(alarm)[2].append(delivery)

    def _change(self, alarm: Alarm) -> tuple[Alarm, list[AlarmEvent], list[Delivery]]:
        return self._changed.setdefault(alarm.id, (alarm, [], []))

    # ---- causes ------------------------------------------------------------------------------

    def handle_cause(self, cause: Cause, t_ns: int) -> None:
        """Apply a cause that is active or has cleared."""
        self.counters['causes'] += 1
        technical = cause.level is Level.TECHNICAL
        for each in _TECHNICAL:
            alarm = self._by_subject.get((cause.subject, each))
            if alarm is not None and (not cause.active or each is not technical):
                self._clear_cause(alarm, cause.kind, t_ns)
        if not cause.active:
            self.suppressed.remove(cause)
            return
        alarm = self._by_subject.get((cause.subject, technical))
        if alarm is not None:
            self.suppressed.remove(cause)
            self._add(alarm, cause, t_ns)
        elif self.suppressed.suppresses(cause, t_ns):
            self.counters['held_back'] += 1
        elif self._make_room(cause.level, t_ns):
            self._open(cause, technical, t_ns)

    def _open(self, cause: Cause, technical: bool, t_ns: int) -> Alarm:
        alarm = Alarm(self._new_id(t_ns), cause.subject, cause.level, AlarmState.RAISED, t_ns,
                      t_ns)
        alarm.reasons[cause.kind] = Reason.of(cause, t_ns)
        alarm.update_from(cause)
        self.alarms[alarm.id] = self._by_subject[cause.subject, technical] = alarm
        if not technical and cause.kind in self.rules.confirm_kinds:
            alarm.state = AlarmState.SUSPECTED
            alarm.confirm_ns = t_ns + self.rules.confirm_ns
            self.note(alarm, AlarmEventKind.SUSPECTED, t_ns, by=cause.source)
        else:
            self._raise(alarm, t_ns, by=cause.source)
        return alarm

    def _new_id(self, t_ns: int) -> str:
        """Return an id that no alarm has had, also before a restart."""
        self.number += 1
        # Without a journal the numbers of before a restart are not known.
        return f'u{t_ns // NS_PER_MS:x}-{self.number}' if self.unsaved else str(self.number)

    def _raise(self, alarm: Alarm, t_ns: int, event: AlarmEventKind = AlarmEventKind.RAISED, *,
               by: str = '', why: str = '') -> None:
        alarm.state, alarm.state_ns = AlarmState.RAISED, t_ns
        alarm.confirm_ns = alarm.remind_ns = 0
        self.silent_until_ns = 0
        self.note(alarm, event, t_ns, by=by, why=why)
        self._escalation.begin(alarm, t_ns)

    def _add(self, alarm: Alarm, cause: Cause, t_ns: int) -> None:
        """Add a cause to an open alarm; a new or worse one is notified immediately."""
        reason = alarm.reasons.get(cause.kind)
        worse = cause.level > alarm.level
        alarm.update_from(cause)
        if reason is None:
            if len(alarm.reasons) >= KINDS_MOST:
                self.counters['kinds_dropped'] += 1
            else:
                alarm.reasons[cause.kind] = Reason.of(cause, t_ns)
            alarm.over_ns = 0
            self._news(alarm, cause, worse, t_ns)
            return
        if not reason.active:
            alarm.over_ns = 0
            self._change(alarm)
        began, news = reason.update(cause, t_ns, self.rules.again_ns)
        if began:
            self.counters['folded'] += 1
        if worse or news is True:
            self._news(alarm, cause, worse, t_ns)
        elif news is False:
            self.counters['flapped'] += 1

    def _news(self, alarm: Alarm, cause: Cause, worse: bool, t_ns: int) -> None:
        alarm.level = max(alarm.level, cause.level)
        why = f'{cause.kind}: {cause.text}'[:160] if cause.text else cause.kind
        if alarm.state is AlarmState.ACKNOWLEDGED:
            self._raise(alarm, t_ns, AlarmEventKind.UNACKNOWLEDGED, by=cause.source, why=why)
            return
        self.note(alarm, AlarmEventKind.CAUSE, t_ns, by=cause.source, why=why)
        if alarm.state is AlarmState.SUSPECTED:
            if worse or cause.kind not in self.rules.confirm_kinds:
                self._raise(alarm, t_ns, by=cause.source, why=why)
        elif worse:
            self._raise(alarm, t_ns, by=cause.source, why=f'worse: {why}')
        else:
            self._escalation.repeat(alarm, t_ns)

    def _clear_cause(self, alarm: Alarm, kind: str, t_ns: int) -> None:
        reason = alarm.reasons.get(kind)
        if reason is None or not reason.active:
            return
        reason.active, reason.over_ns = False, t_ns
        self._change(alarm)
        if not any(each.active for each in alarm.reasons.values()):
            alarm.over_ns = t_ns

    def _others(self) -> list[Alarm]:
        """Return the alarms that count for the limit: all but that of the table itself."""
        return [each for each in self.in_order() if each.subject != SELF]

    def _make_room(self, level: Level, t_ns: int) -> bool:
        """Return whether another alarm may open; a worse one replaces the least severe."""
        others = self._others()
        if len(others) < self.rules.alarms_most:
            return True
        self.counters['overflowed'] += 1
        least = others[-1]
        displaces = least.level < level
        if displaces:
            self.counters['displaced'] += 1
            self.close(least, AlarmState.RESOLVED, t_ns, why='displaced by a worse one',
                       displaced=True)
        overflow = self._by_subject.get((SELF, True))
        if overflow is not None:
            self._add(overflow, OVERFLOW, t_ns)
        else:
            self._open(OVERFLOW, True, t_ns)
        return displaces

    # ---- commands and reports ----------------------------------------------------------------

    def acknowledge(self, alarm: Alarm, by: str, why: str, t_ns: int) -> None:
        """Acknowledge an alarm; an acknowledged one stays unmodified."""
        if alarm.state is AlarmState.ACKNOWLEDGED:
            return
        alarm.state, alarm.state_ns = AlarmState.ACKNOWLEDGED, t_ns
        alarm.by, alarm.why = by, why
        alarm.confirm_ns = 0
        alarm.remind_ns = t_ns + self.rules.remind_ns
        self._escalation.stop(alarm)
        self.note(alarm, AlarmEventKind.ACKNOWLEDGED, t_ns, by=by, why=why)
        if alarm.is_test:
            self.close(alarm, AlarmState.RESOLVED, t_ns, why='it was a test')

    def confirm(self, alarm: Alarm, by: str, why: str, t_ns: int) -> None:
        """Raise a suspected alarm."""
        self.note(alarm, AlarmEventKind.CONFIRMED, t_ns, by=by, why=why)
        self._raise(alarm, t_ns, by=by, why=why)

    def escalate(self, alarm: Alarm, by: str, why: str, t_ns: int) -> None:
        """Notify the next step of a raised alarm immediately."""
        self.note(alarm, AlarmEventKind.HURRIED, t_ns, by=by, why=why)
        self._escalation.escalate_now(alarm, t_ns)

    def remark(self, alarm: Alarm, by: str, text: str, t_ns: int) -> None:
        """Set the note of an alarm, such as what the robot found; the newest replaces it."""
        if text != alarm.remark:
            alarm.remark = text
            self.note(alarm, AlarmEventKind.NOTED, t_ns, by=by, why=text)

    def test(self, level: Level, by: str, why: str, t_ns: int) -> Alarm | None:
        """Open a test alarm; None when there is no room for it."""
        if not self._make_room(level, t_ns):
            return None
        alarm = self._open(Cause(TEST, TEST, level, True, f'a test by {by}: nobody is in danger'),
                           level is Level.TECHNICAL, t_ns)
        self.note(alarm, AlarmEventKind.TEST, t_ns, by=by, why=why)
        return alarm

    def silence(self, seconds: float, t_ns: int) -> float:
        """Mute the robot's voice; return for how many seconds."""
        silent_ns = min(round(seconds * NS_PER_S), self.rules.silence_most_ns)
        self.silent_until_ns = t_ns + silent_ns if silent_ns else 0
        self.counters['silenced'] += 1
        return silent_ns / NS_PER_S

    def handle_report(self, key: str, ok: bool, text: str, t_ns: int) -> None:
        """Apply the delivery report of a notification."""
        self.counters['reports'] += 1
        alarm = self.alarms.get(key.partition('.')[0])
        delivery = alarm.deliveries.get(key) if alarm is not None else None
        if alarm is None or delivery is None:
            self.counters['late_reports'] += 1
            return
        self._escalation.report(alarm, delivery, ok, text, t_ns)

    def add_picture(self, target: str, file: str) -> None:
        """Add a picture to the next notification."""
        alarm = self.alarms.get(target)
        if alarm is not None and file and file not in alarm.pictures:
            alarm.pictures = [*alarm.pictures, file][-PICTURES_MOST:]
            self._change(alarm)

    # ---- time --------------------------------------------------------------------------------

    def next_ns(self) -> int:
        """Return when :meth:`advance` has something to do; 0 never."""
        return min((due for each in self.alarms.values() if (due := self.due_ns(each))),
                   default=0)

    def advance(self, now_ns: int) -> None:
        """Do everything that was due until now, in order, each at its own time."""
        while True:
            due = [(due, *each.order(), each) for each in self.alarms.values()
                   if (due := self.due_ns(each)) and due <= now_ns]
            if not due:
                return
            due_ns, *_, alarm = min(due)
            self._execute_due(alarm, due_ns)

    def due_ns(self, alarm: Alarm) -> int:
        """Return when an alarm has something to do; 0 never."""
        found = [each for each in (
            alarm.confirm_ns, alarm.remind_ns, self._ends_ns(alarm),
            self._escalation.due_ns(alarm)) if each]
        return min(found, default=0)

    def _ends_ns(self, alarm: Alarm) -> int:
        """Return when an alarm whose causes have cleared resolves itself; 0 never."""
        if not alarm.over_ns:
            return 0
        if alarm.state is AlarmState.ACKNOWLEDGED:
            return max(alarm.over_ns, alarm.state_ns) + self.rules.resolve_after_ns
        if alarm.state is AlarmState.RAISED and alarm.level in self.rules.unseen_levels:
            return alarm.over_ns + self.rules.resolve_after_ns
        return 0

    def _execute_due(self, alarm: Alarm, t_ns: int) -> None:
        if alarm.confirm_ns and alarm.confirm_ns <= t_ns:
            self._raise(alarm, t_ns, why='nobody confirmed or cancelled it in time')
        elif (ends_ns := self._ends_ns(alarm)) and ends_ns <= t_ns:
            self.close(alarm, AlarmState.RESOLVED, t_ns, why='its causes have been over for '
                       f'{self.rules.resolve_after_ns / NS_PER_S:g} s')
        elif alarm.remind_ns and alarm.remind_ns <= t_ns:
            minutes = (t_ns - alarm.state_ns) / (60 * NS_PER_S)
            self._raise(alarm, t_ns, AlarmEventKind.UNACKNOWLEDGED, why=(
                f'{alarm.by} acknowledged it {minutes:.0f} min ago, and it is not resolved'))
        elif alarm.is_test and alarm.top and alarm.repeat_ns and alarm.repeat_ns <= t_ns:
            self.close(alarm, AlarmState.RESOLVED, t_ns, why='the test has come to its top')
        else:
            self._escalation.advance(alarm, t_ns)

    def close(self, alarm: Alarm, state: AlarmState, t_ns: int, *, by: str = '', why: str = '',
              displaced: bool = False) -> None:
        """End an alarm as resolved or cancelled."""
        self._escalation.stop(alarm)
        alarm.state, alarm.state_ns, alarm.why = state, t_ns, why
        alarm.confirm_ns = alarm.remind_ns = 0
        if not displaced:
            self.suppressed.add(alarm, t_ns)
        del self.alarms[alarm.id]
        self._by_subject = {key: each for key, each in self._by_subject.items()
                            if each is not alarm}
        self.note(alarm, AlarmEventKind(state.value), t_ns, by=by, why=why)
        overflow = self._by_subject.get((SELF, True))
        if overflow is not None and len(self._others()) < self.rules.alarms_most:
            self._clear_cause(overflow, OVERFLOW.kind, t_ns)

    # ---- after a restart ---------------------------------------------------------------------

    def restore(self, alarms: Iterable[Alarm], t_ns: int) -> None:
        """
        Continue with the alarms of before a restart, with times of this clock.

        The next :meth:`advance` does what has become due meanwhile.
        """
        self._floor_ns = self._escalation.floor_ns = t_ns
        for alarm in alarms:
            self.counters['restored'] += 1
            present = self._by_subject.get((alarm.subject, alarm.technical))
            self.alarms[alarm.id] = alarm
            if present is not None:
                self._merge(alarm, present, t_ns)
                continue
            self._by_subject[alarm.subject, alarm.technical] = alarm
            for reason in alarm.reasons.values():
                reason.heard_ns = t_ns
            by = alarm.by if alarm.state is AlarmState.ACKNOWLEDGED else ''
            self.note(alarm, AlarmEventKind(alarm.state.value), t_ns, by=by, why='after a restart',
                      restored=True)
            if alarm.state is AlarmState.RAISED:
                self._escalation.resume(alarm, t_ns)

    def _merge(self, old: Alarm, present: Alarm, t_ns: int) -> None:
        """Merge an alarm of before a restart into a newer one about the same subject."""
        for kind, reason in old.reasons.items():
            if len(present.reasons) < KINDS_MOST:
                present.reasons.setdefault(kind, reason)
        worse = old.level > present.level
        present.level = max(present.level, old.level)
        present.opened_ns = min(present.opened_ns, old.opened_ns)
        if any(each.active for each in present.reasons.values()):
            present.over_ns = 0
        for reason in old.reasons.values():
            reason.active = False  # it belongs to the other alarm now
        self.close(old, AlarmState.RESOLVED, t_ns, why=f'goes on as {present.id}')
        if worse:
            self._raise(present, t_ns, why=f'worse: {old.id} goes on in it')
        else:
            self.note(present, AlarmEventKind.CAUSE, t_ns, why=f'{old.id} goes on in it')

    def summary(self) -> dict[str, Any]:
        """Return the number of alarms in each state, and the counters."""
        states = Counter(each.state.value for each in self.alarms.values())
        return {**{each.value: states[each.value] for each in AlarmState if each.is_open},
                **self.counters}
