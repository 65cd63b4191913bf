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
The fixture of alarm scenarios: one robot, forty people, and everything that can fail.

The service of alarms, the journal and the delivery log of the notifier are those of the robot.
Time, disks, networks and recipients are simulated. All of it follows from the seed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from functools import partial
import hashlib
from random import Random
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.alarms.alarm_service import AlarmService
from rt_robot_os.features.alarms.escalation import ROBOT
from rt_robot_os.features.alarms.journal_store import MemoryStore
from rt_robot_os.features.alarms.rules import Rules
from rt_robot_os.features.alarms.scenarios.emergencies import InjectedEmergency
from rt_robot_os.features.alarms.scenarios.emergencies import random_emergency
from rt_robot_os.features.alarms.scenarios.emergencies import RECIPIENTS
from rt_robot_os.features.alarms.scenarios.faults import AlarmFaults
from rt_robot_os.features.alarms.scenarios.journal_process import JournalProcess
from rt_robot_os.features.alarms.scenarios.notifier_process import NotifierProcess
from rt_robot_os.features.alarms.scenarios.notifier_process import Recipient
from rt_robot_os.messages.alarm_event import AlarmEvent
from rt_robot_os.messages.alarm_state import AlarmEventKind
from rt_robot_os.messages.alarm_state import CLOSED_STATES
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.journal import JournalReply
from rt_robot_os.messages.notification import DeliveryReport
from rt_robot_os.messages.notification import Notification
from rt_robot_os.sim.scenarios.timeline import Action
from rt_robot_os.sim.scenarios.timeline import seconds
from rt_robot_os.sim.scenarios.timeline import VirtualTimeline

_RULES: Final = Rules(remind_ns=240 * NS_PER_S, resolve_after_ns=60 * NS_PER_S)
_START_NS: Final = 1_000 * NS_PER_S
_REFRESH_NS: Final = 10 * NS_PER_S
_RING: Final = 64
# A scenario that has not settled this long after its last emergency never will.
_PATIENCE_NS: Final = 3 * 3600 * NS_PER_S


class AlarmFixture:
    """
    One robot and what happens around it.

    :param seed: of everything that is random.
    :param emergencies: how many.
    :ivar disk: of the journal.
    :ivar memory: the disk of the notifier.
    :ivar renumbered: emergencies with another alarm number after a crash.
    :ivar forgotten: alarms that were notified, and that a later core did not know.
    :ivar digest: of all events.
    """

    def __init__(self, seed: int, emergencies: int) -> None:
        self.random = random = Random(seed)
        self.timeline = VirtualTimeline(_START_NS)
        self.digest = hashlib.sha256()
        self.recipients: Mapping[str, Recipient] = {
            name: Recipient(name) for name in RECIPIENTS}
        self.emergencies = {each.subject: each for each in (
            random_emergency(random, number) for number in range(emergencies))}
        self.renumbered = self.forgotten = 0
        self._notified: set[str] = set()  # open alarms
        self.disk, self.memory = MemoryStore(), MemoryStore()
        self._service: AlarmService | None = None
        self._life = 0
        self._due_ns = 0
        self._offset_ns = 0
        self._journal: JournalProcess | None = None
        self._notifier: NotifierProcess | None = None
        self._ring: deque[tuple[int, str]] = deque(maxlen=_RING)
        self.faults = AlarmFaults(self)
        self._start_core()
        self._start_notifier()
        at_ns = 0
        for each in self.emergencies.values():
            at_ns += seconds(random.expovariate(1 / 40.0))
            self.timeline.after(at_ns, partial(self._begin, each))
        self._last_ns = self.timeline.now_ns + at_ns
        self.faults.begin()

    @property
    def elapsed_ns(self) -> int:
        """Return the virtual time that has passed."""
        return self.timeline.now_ns - _START_NS

    def run(self) -> bool:
        """Run until all emergencies are settled; return False when one never is."""
        while not all(each.settled for each in self.emergencies.values()):
            if self.timeline.now_ns > self._last_ns + _PATIENCE_NS or not self.timeline.step():
                return False
        return True

    def after(self, least_s: float, most_s: float, action: Action) -> None:
        """Run an action after a random delay."""
        self.timeline.after(seconds(self.random.uniform(least_s, most_s)), action)

    # ---- people ------------------------------------------------------------------------------

    def _begin(self, each: InjectedEmergency) -> None:
        each.active = True
        self._publish(each)
        self.timeline.after(_REFRESH_NS, lambda: self._refresh(each))
        self.timeline.after(each.lasts_ns, lambda: self._clear(each))

    def _refresh(self, each: InjectedEmergency) -> None:
        if each.active:
            self._publish(each)
            self.timeline.after(_REFRESH_NS, lambda: self._refresh(each))

    def _publish_if_active(self, each: InjectedEmergency) -> None:
        if each.active:
            self._publish(each)

    def _clear(self, each: InjectedEmergency) -> None:
        each.active = False
        self._publish(each)

    def _publish(self, each: InjectedEmergency) -> None:
        service = self._service
        if service is not None:
            cause = Cause(each.kind, each.subject, each.level, each.active,
                          f'{each.kind} of {each.subject}', 'rehearsal')
            service.handle_cause(cause, self._core_ns())
            self._hand_on()

    def _see(self, recipient: Recipient, found: Notification) -> None:
        """Let a recipient see a notification, and perhaps respond."""
        each = self.emergencies.get(found.subject)
        if each is None:
            return
        each.seen = True
        if each.helper == recipient.name:
            self.after(2.0, 40.0, lambda: self._acknowledge(each))
        elif not each.helper and each.exhausted:
            self.after(20.0, 60.0, lambda: self._command(
                f'resolve {each.subject} by x too late'))

    def _acknowledge(self, each: InjectedEmergency) -> None:
        """Acknowledge, again and again until the robot has received it."""
        if each.acknowledged and self.random.random() < 0.5:
            self.after(10.0, 90.0, lambda: self._command(f'resolve {each.subject} by x helped'))
            return
        self._command(f'acknowledge {each.subject} by {each.helper}')
        if not each.acknowledged:
            self.after(3.0, 10.0, lambda: self._acknowledge(each))

    def _command(self, text: str) -> None:
        if self._service is not None:
            self._service.handle_command(text, self._core_ns())
            self._hand_on()

    # ---- the core ----------------------------------------------------------------------------

    def _core_ns(self) -> int:
        return self.timeline.now_ns - self._offset_ns

    def _start_core(self) -> None:
        if self._service is not None:
            return
        self._life += 1
        self._service = service = AlarmService(_RULES)
        self._ring.clear()
        service.start(self._core_ns())
        self._open_journal()
        if self._notifier is not None:
            self._connect(self._notifier)
        for each in self.emergencies.values():
            if each.active:
                self.after(0.1, 2.0, partial(self._publish_if_active, each))
        self._hand_on()

    def _open_journal(self) -> None:
        life = self._life

        def answer(content: dict[str, Any]) -> None:
            service = self._service
            if service is None or life != self._life:
                return
            service.handle_journal(JournalReply.from_dict(content), self._core_ns())
            self._hand_on()
            if 'restored' in content:
                self.forgotten += len(self._notified - set(service.table.alarms))
                self._notified &= set(service.table.alarms)

        self._journal = JournalProcess(self.timeline, self.random, self.disk, answer,
                                       lambda: self.faults.kill_in_write(True))

    def _hand_on(self) -> None:
        """Hand on what the service sends, and return when more is due."""
        service = self._service
        while service is not None:
            records, events = service.pop_records(), service.pop_events()
            sent, _ = service.pop_notifications(), service.pop_answers()
            if not (records or events or sent):
                break
            for text in records:
                if self._journal is not None:
                    self._journal.write(text)
            for event in events:
                self._record(event)
            for each in sent:
                if each.channel == ROBOT:
                    service.handle_report(each.key, True, '', self._core_ns())
                else:
                    self._notified.add(each.alarm)
                    self._notify(each.to_json())
        if service is not None and service.next_ns and service.next_ns != self._due_ns:
            self._due_ns = due_ns = service.next_ns
            self.timeline.after(due_ns - self._core_ns(), lambda: self._advance(service, due_ns))

    def _advance(self, service: AlarmService, due_ns: int) -> None:
        if service is self._service and due_ns == self._due_ns:
            self._due_ns = 0
            service.advance(self._core_ns())
            self._hand_on()

    def _record(self, event: AlarmEvent) -> None:
        self.digest.update(f'{self.timeline.now_ns} {event}'.encode())
        each = self.emergencies.get(event.subject)
        if event.event in CLOSED_STATES:
            self._notified.discard(event.alarm)
        if each is None:
            return
        if event.alarm not in each.ids and not each.settled:
            self.renumbered += bool(each.ids)
            each.ids.add(event.alarm)
        each.acknowledged = each.acknowledged or event.event == AlarmEventKind.ACKNOWLEDGED.value
        each.exhausted = each.exhausted or event.event == AlarmEventKind.TOP.value

    # ---- delivery ----------------------------------------------------------------------------

    def _notify(self, text: str) -> None:
        stamp_ns = self.timeline.now_ns
        self._ring.append((stamp_ns, text))
        life = self._life

        def arrive() -> None:
            if self._notifier is not None and life == self._life:
                self._notifier.receive(text, stamp_ns)
                if self.random.random() < 0.02:
                    self._notifier.receive(text, stamp_ns)

        self.after(0.0002, 0.003, arrive)

    def _report(self, report: DeliveryReport) -> None:
        """Bring a report to the core: late, never, or twice."""
        life = self._life
        for _ in range(0 if self.faults.loses_report() else 1 + (self.random.random() < 0.05)):
            self.after(0.0005, 0.05, lambda: self._take_report(report, life))

    def _take_report(self, report: DeliveryReport, life: int) -> None:
        if self._service is not None and life == self._life:
            self._service.handle_report(report.key, report.ok, report.text, self._core_ns())
            self._hand_on()

    def _start_notifier(self) -> None:
        if self._notifier is not None:
            return
        self._notifier = made = NotifierProcess(
            self.timeline, self.random, self.memory, self.recipients, self._report, self._see,
            lambda: self.faults.kill_in_write(False))
        self._connect(made)

    def _connect(self, notifier: NotifierProcess) -> None:
        ring = list(self._ring)

        def connect() -> None:
            if self._notifier is notifier:
                notifier.connect(ring)

        self.after(0.05, 0.5, connect)

    # ---- what faults end ---------------------------------------------------------------------

    def lose_power(self) -> None:
        """Lose what was not synced; the clock of the core restarts."""
        self.disk.lose_power(self.random)
        self.memory.lose_power(self.random)
        self._offset_ns = self.timeline.now_ns - self.random.randint(1, 100) * NS_PER_S

    def end_notifier(self) -> None:
        """End the notifier; another one starts later."""
        if self._notifier is not None:
            self._notifier.ended = True
            self._notifier = None
            self.after(0.3, 20.0, self._start_notifier)

    def end_core(self) -> None:
        """End the core; another one starts later."""
        self._service, self._due_ns = None, 0
        self.after(0.3, 15.0, self._start_core)

    def end_journal(self, reopen: bool) -> None:
        """
        End the process that writes the journal.

        :param reopen: the core goes on, and starts another one.
        """
        if self._journal is None:
            return
        self._journal.ended = True
        self._journal = None
        if reopen and self._service is not None:
            life = self._life
            self.timeline.after(seconds(1e-3), lambda: self._journal_ended(life))

    def _journal_ended(self, life: int) -> None:
        if self._service is None or life != self._life:
            return
        self._service.handle_journal(
            JournalReply(fault='its process has ended'), self._core_ns())
        self._hand_on()

        def reopen() -> None:
            if self._service is not None and life == self._life:
                self._open_journal()

        self.after(0.3, 1.5, reopen)
