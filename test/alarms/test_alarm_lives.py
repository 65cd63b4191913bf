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

"""Lives of alarms, made up at random, against a simple model; over restarts."""

from __future__ import annotations

from collections import defaultdict
import json
from typing import Any

from alarm_model import ACKNOWLEDGED
from alarm_model import Model
from alarm_model import RAISED
from alarm_model import SUSPECTED
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import initialize
from hypothesis.stateful import invariant
from hypothesis.stateful import precondition
from hypothesis.stateful import rule
from hypothesis.stateful import RuleBasedStateMachine

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.alarms.alarm_service import AlarmService
from rt_robot_os.features.alarms.escalation import parse_steps
from rt_robot_os.features.alarms.rules import Rules
from rt_robot_os.messages.alarm_event import AlarmEvent
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import Level
from rt_robot_os.messages.journal import JournalReply

STEPS = {
    Level.CRITICAL: parse_steps(['robot 0', 'operator 30 repeat 10', 'family+screen 60']),
    Level.URGENT: parse_steps(['operator 60', 'family 90']),
    Level.WARNING: parse_steps(['operator 600']),
    Level.TECHNICAL: parse_steps([])}
RULES = Rules(STEPS, frozenset({'fall', 'still'}))
SUBJECTS = st.sampled_from(['anna', 'bert', 'kitchen'])
KINDS = st.sampled_from(['fall', 'still', 'help', 'news2', 'sensor_off'])
#: What may follow what, in the events of one alarm; '' is the beginning.
NEXT = {
    '': {'suspected', 'raised'},
    'suspected': {'raised', 'acknowledged', 'resolved', 'cancelled'},
    'raised': {'raised', 'acknowledged', 'resolved'},
    'acknowledged': {'raised', 'resolved'},
    'resolved': set(), 'cancelled': set()}


class Lives(RuleBasedStateMachine):
    """A service, what it told, and the model."""

    def __init__(self) -> None:
        super().__init__()
        self.now = 1000 * NS_PER_S
        self.model = Model(RULES)
        # From the time of the model to the clock of the service, which begins anew with a restart.
        self.offset = 0
        self.records: list[tuple[str, int]] = []
        self.events: dict[str, list[AlarmEvent]] = defaultdict(list)
        self.told: dict[str, str] = {}  # key -> '' or what was reported
        self.last_event = 0
        self.service = self._begin()

    @property
    def clock(self) -> int:
        return self.now - self.offset

    def _begin(self) -> AlarmService:
        service = AlarmService(RULES)
        service.start(self.clock)
        for text, offset in self.records:
            record: dict[str, Any] = json.loads(text)
            age_ns = self.now - record['t_ns'] - offset
            service.handle_journal(JournalReply(record, age_ns), self.clock)
        service.handle_journal(JournalReply(restored=len(self.records)), self.clock)
        return service

    def _hear(self, resent: bool = False) -> None:
        for record in self.service.pop_records():
            self.records.append((record, self.offset))
            self.service.handle_journal(JournalReply(stored=json.loads(record)['seq']), self.clock)
        for event in self.service.pop_events():
            assert event.seq > self.last_event
            self.last_event = event.seq
            history = self.events[event.alarm]
            before = history[-1].state if history else ''
            if event.restored:
                assert event.state == before
            elif event.state != before:
                assert event.state in NEXT[before], (before, event)
            history.append(event)
        for each in self.service.pop_notifications():
            assert each.key not in self.told or (resent and not self.told[each.key]), (
                'told twice', each)
            self.told.setdefault(each.key, '')
            alarm = self.service.table.alarms[each.alarm]
            assert alarm.state.value == RAISED

    # ---- what happens ------------------------------------------------------------------------

    @rule(subject=SUBJECTS, kind=KINDS, level=st.sampled_from(Level), active=st.booleans())
    def cause(self, subject: str, kind: str, level: Level, active: bool) -> None:
        self.service.handle_cause(
            Cause(kind, subject, level, active, 'text', 'module'), self.clock)
        self.model.cause(subject, kind, level, active, self.now)
        self._hear()

    @rule(seconds=st.sampled_from([1, 7, 15, 31, 65, 200, 1000]))
    def wait(self, seconds: int) -> None:
        self._wait(seconds)
        self.model.wait(self.now)

    def _wait(self, seconds: int) -> None:
        until = self.now + seconds * NS_PER_S
        while (due := self.service.next_ns) and due + self.offset <= until:
            self.now = due + self.offset
            self.service.advance(due)
            self._hear()
        self.now = until

    @precondition(lambda self: self.model.alarms)
    @rule(data=st.data(), verb=st.sampled_from(['acknowledge', 'resolve', 'cancel', 'confirm']))
    def command(self, data: st.DataObject, verb: str) -> None:
        key = data.draw(st.sampled_from(sorted(self.model.alarms)))
        (alarm,) = [each for each in self.service.table.alarms.values()
                    if (each.subject, each.technical) == key]
        others = {each.id: each.state for each in self.service.table.alarms.values()
                  if each is not alarm}
        suspected = self.model.alarms[key].state == SUSPECTED
        self.service.handle_command(f'{verb} {alarm.id} by mary', self.clock)
        (answer,) = self.service.pop_answers()
        if verb == 'acknowledge':
            self.model.acknowledge(key, self.now)
        elif verb == 'resolve' or (verb == 'cancel' and suspected):
            self.model.close(key, self.now)
        elif suspected:
            self.model.confirm(key, self.now)
        assert answer.ok == (suspected or verb in ('acknowledge', 'resolve'))
        assert others == {each.id: each.state for each in self.service.table.alarms.values()
                          if each is not alarm}
        self._hear()

    @precondition(lambda self: '' in self.told.values())
    @rule(data=st.data(), ok=st.booleans())
    def report(self, data: st.DataObject, ok: bool) -> None:
        key = data.draw(st.sampled_from([key for key, said in self.told.items() if not said]))
        self.told[key] = str(ok)
        self.service.handle_report(key, ok, '', self.clock)
        self._hear()

    @rule(seconds=st.sampled_from([0, 5, 100, 2000]))
    def restart(self, seconds: int) -> None:
        self.now += seconds * NS_PER_S
        # As if the machine had been switched off and on.
        self.offset = self.now - 30 * NS_PER_S - 7  # so that no time is 0, which is none
        self.service = self._begin()
        self.model.restart(self.now)
        self._hear(resent=True)

    # ---- what is always so -------------------------------------------------------------------

    @initialize()
    def listen(self) -> None:
        self._hear()

    @invariant()
    def the_same_as_the_model(self) -> None:
        table = {(each.subject, each.technical): (
            each.state.value, each.level, set(each.reasons),
            {kind for kind, reason in each.reasons.items() if reason.active})
            for each in self.service.table.alarms.values()}
        assert table == {key: (
            each.state, each.level, set(each.kinds),
            {kind for kind, one in each.kinds.items() if one.active})
            for key, each in self.model.alarms.items()}

    @invariant()
    def nothing_is_forgotten(self) -> None:
        for alarm in self.service.table.alarms.values():
            if STEPS[alarm.level]:
                assert self.service.table.due_ns(alarm) > self.clock
            if alarm.state.value == ACKNOWLEDGED:
                assert not alarm.next_ns and not alarm.repeat_ns

    def teardown(self) -> None:
        """Leave everything alone: all that is open comes to its top, and nobody is forgotten."""
        self._wait(3000)
        for alarm in self.service.table.alarms.values():
            assert alarm.state.value == RAISED
            assert alarm.top or not STEPS[alarm.level]


TestLives = Lives.TestCase
TestLives.settings = settings(max_examples=60, stateful_step_count=30, deadline=None)
