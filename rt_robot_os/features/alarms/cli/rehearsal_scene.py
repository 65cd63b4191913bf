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
A scene of a rehearsal: one robot, forty people, and everything that can fail.

The service, the journal and the delivery log are those of the robot. Time, disk, network and
people are simulated: cores, journals, notifiers and the power fail at random moments, even in the
middle of a write; disks are full; channels are down, or deliver without a report; reports are lost
or come twice. All of it follows from the seed.
"""

from __future__ import annotations

from collections import Counter
from collections import deque
from functools import partial
import hashlib
from random import Random
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.alarms.alarm_service import AlarmService
from rt_robot_os.features.alarms.cli.rehearsal_parts import JournalProcess
from rt_robot_os.features.alarms.cli.rehearsal_parts import NotifierProcess
from rt_robot_os.features.alarms.cli.rehearsal_parts import RehearsalClock
from rt_robot_os.features.alarms.cli.rehearsal_parts import Responder
from rt_robot_os.features.alarms.cli.rehearsal_result import emergency_by_chance
from rt_robot_os.features.alarms.cli.rehearsal_result import PEOPLE
from rt_robot_os.features.alarms.cli.rehearsal_result import RehearsedEmergency
from rt_robot_os.features.alarms.escalation import ROBOT
from rt_robot_os.features.alarms.journal_store import MemoryStore
from rt_robot_os.features.alarms.rules import Rules
from rt_robot_os.messages.alarm_event import AlarmEvent
from rt_robot_os.messages.alarm_state import AlarmEventKind
from rt_robot_os.messages.alarm_state import CLOSED_STATES
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.journal import JournalReply
from rt_robot_os.messages.notification import DeliveryReport
from rt_robot_os.messages.notification import Notification

_RULES: Final = Rules(remind_ns=240 * NS_PER_S, resolve_after_ns=60 * NS_PER_S)
_REFRESH_NS: Final = 10 * NS_PER_S
_RING: Final = 64
# A scene that has not ended by then after its last emergency will not end.
_PATIENCE_NS: Final = 3 * 3600 * NS_PER_S
# What goes wrong, and how often, in seconds on average.
_EVERY_S: Final = {'core': 90.0, 'power': 300.0, 'journal': 150.0, 'notifier': 120.0,
                   'disk': 240.0, 'outage': 100.0, 'network': 200.0}


class RehearsalRun:
    """
    One robot, its people and its faults.

    :param seed: of all random numbers.
    """

    def __init__(self, seed: int, emergencies: int) -> None:
        self.random = random = Random(seed)
        self.timeline = RehearsalClock()
        self.timeline.now_ns = 1_000 * NS_PER_S
        self.went_wrong: Counter[str] = Counter()
        self.digest = hashlib.sha256()
        self.people = {name: Responder(name) for name in PEOPLE}
        self.all = {each.subject: each for each in (
            emergency_by_chance(random, number) for number in range(emergencies))}
        self.told_anew = self.forgotten = 0
        self._told: set[str] = set()  # open alarms of which a person was notified
        self._disk, self._memory = MemoryStore(), MemoryStore()
        self._service: AlarmService | None = None
        self._life = 0
        self._due_ns = 0
        self._offset_ns = 0
        self._journal: JournalProcess | None = None
        self._ring: deque[tuple[int, str]] = deque(maxlen=_RING)
        self._network_down = False
        # What is killed in the middle of a write, on each of the two disks.
        self._aimed = {True: 'journal', False: 'notifier'}
        self._notifier: NotifierProcess | None = None
        self._start_core()
        self._start_notifier()
        at_ns = 0
        for each in self.all.values():
            at_ns += round(random.expovariate(1 / 40.0) * NS_PER_S)
            self.timeline.after(at_ns, partial(self._begin, each))
        self._last_ns = self.timeline.now_ns + at_ns
        for what in _EVERY_S:
            self._plan(what)

    def run(self) -> bool:
        """Run it; return whether all emergencies have ended."""
        while not all(each.ended for each in self.all.values()):
            if self.timeline.now_ns > self._last_ns + _PATIENCE_NS or not self.timeline.step():
                return False
        return True

    def _after(self, least_s: float, most_s: float, action: Any) -> None:
        self.timeline.after(round(self.random.uniform(least_s, most_s) * NS_PER_S), action)

    # ---- what happens to people --------------------------------------------------------------

    def _begin(self, each: RehearsedEmergency) -> None:
        each.active = True
        self._publish(each)
        self.timeline.after(_REFRESH_NS, lambda: self._refresh(each))
        self.timeline.after(each.lasts_ns, lambda: self._over(each))

    def _refresh(self, each: RehearsedEmergency) -> None:
        if each.active:
            self._publish(each)
            self.timeline.after(_REFRESH_NS, lambda: self._refresh(each))

    def _publish_if_active(self, each: RehearsedEmergency) -> None:
        if each.active:
            self._publish(each)

    def _over(self, each: RehearsedEmergency) -> None:
        each.active = False
        self._publish(each)

    def _publish(self, each: RehearsedEmergency) -> None:
        service = self._service
        if service is not None:
            service.handle_cause(Cause(
                each.kind, each.subject, each.level, each.active,
                f'{each.kind} of {each.subject}', 'rehearsal'), self._core_ns())
            self._settle()

    def _see(self, person: Responder, found: Notification) -> None:
        """Show a notification to a person, who perhaps answers."""
        each = self.all.get(found.subject)
        if each is None:
            return
        each.seen = True
        if each.helper == person.name:
            self._after(2.0, 40.0, lambda: self._acknowledge(each))
        elif not each.helper and each.top:
            self._after(20.0, 60.0, lambda: self._order(f'resolve {each.subject} by x too late'))

    def _acknowledge(self, each: RehearsedEmergency) -> None:
        """Acknowledge, again and again until the robot has received it."""
        if each.acknowledged and self.random.random() < 0.5:
            self._after(10.0, 90.0, lambda: self._order(f'resolve {each.subject} by x helped'))
            return
        self._order(f'acknowledge {each.subject} by {each.helper}')
        if not each.acknowledged:
            self._after(3.0, 10.0, lambda: self._acknowledge(each))

    def _order(self, text: str) -> None:
        if self._service is not None:
            self._service.handle_command(text, self._core_ns())
            self._settle()

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
        for each in self.all.values():
            if each.active:
                self._after(0.1, 2.0, partial(self._publish_if_active, each))
        self._settle()

    def _open_journal(self) -> None:
        life = self._life

        def tell(said: dict[str, Any]) -> None:
            service = self._service
            if service is None or life != self._life:
                return
            service.handle_journal(JournalReply.from_dict(said), self._core_ns())
            self._settle()
            if 'restored' in said:
                self.forgotten += len(self._told - set(service.table.alarms))
                self._told &= set(service.table.alarms)

        self._journal = JournalProcess(self.timeline, self.random, self._disk, tell,
                                       lambda: self._hit(True))

    def _settle(self) -> None:
        """Pass on the output of the service, and schedule its next deadline."""
        service = self._service
        while service is not None:
            records, events = service.pop_records(), service.pop_events()
            sent, _ = service.pop_notifications(), service.pop_answers()
            if not (records or events or sent):
                break
            for text in records:
                if self._journal is not None:
                    self._journal.keep(text)
            for event in events:
                self._note(event)
            for each in sent:
                if each.channel == ROBOT:
                    service.handle_report(each.key, True, '', self._core_ns())
                else:
                    self._told.add(each.alarm)
                    self._notify(each.to_json())
        if service is not None and service.next_ns and service.next_ns != self._due_ns:
            self._due_ns = due_ns = service.next_ns
            self.timeline.after(due_ns - self._core_ns(), lambda: self._advance(service, due_ns))

    def _advance(self, service: AlarmService, due_ns: int) -> None:
        if service is self._service and due_ns == self._due_ns:
            self._due_ns = 0
            service.advance(self._core_ns())
            self._settle()

    def _note(self, event: AlarmEvent) -> None:
        self.digest.update(f'{self.timeline.now_ns} {event}'.encode())
        each = self.all.get(event.subject)
        if event.event in CLOSED_STATES:
            self._told.discard(event.alarm)
        if each is None:
            return
        if event.alarm not in each.ids and not each.ended:
            self.told_anew += bool(each.ids)
            each.ids.add(event.alarm)
        each.acknowledged = each.acknowledged or event.event == AlarmEventKind.ACKNOWLEDGED.value
        each.top = each.top or event.event == AlarmEventKind.TOP.value

    # ---- the way to people -------------------------------------------------------------------

    def _notify(self, text: str) -> None:
        stamp_ns = self.timeline.now_ns
        self._ring.append((stamp_ns, text))
        life = self._life

        def arrive() -> None:
            if self._notifier is not None and life == self._life:
                self._notifier.take(text, stamp_ns)
                if self.random.random() < 0.02:
                    self._notifier.take(text, stamp_ns)

        self._after(0.0002, 0.003, arrive)

    def _report(self, report: DeliveryReport) -> None:
        """Pass a report to the core: late, lost, or twice."""
        life = self._life
        lost = self._network_down and self.random.random() < 0.7
        self.went_wrong['reports_lost'] += lost
        for _ in range(0 if lost else 1 + (self.random.random() < 0.05)):
            self._after(0.0005, 0.05, lambda: self._take_report(report, life))

    def _take_report(self, report: DeliveryReport, life: int) -> None:
        if self._service is not None and life == self._life:
            self._service.handle_report(report.key, report.ok, report.text, self._core_ns())
            self._settle()

    def _start_notifier(self) -> None:
        if self._notifier is not None:
            return
        self._notifier = made = NotifierProcess(
            self.timeline, self.random, self._memory, self.people, self._report, self._see,
            lambda: self._hit(False))
        self._connect(made)

    def _connect(self, notifier: NotifierProcess) -> None:
        ring = list(self._ring)

        def connect() -> None:
            if self._notifier is notifier:
                notifier.connect(ring)

        self._after(0.05, 0.5, connect)

    # ---- what goes wrong ---------------------------------------------------------------------

    def _plan(self, what: str) -> None:
        self._after(0.0, 2 * _EVERY_S[what], lambda: self._go_wrong(what))

    def _go_wrong(self, what: str) -> None:
        self._plan(what)
        if what in ('core', 'power', 'journal', 'notifier'):
            self._strike(what)
        elif what == 'disk':
            self.went_wrong['full_disks'] += 1
            for store in (self._disk, self._memory):
                if self.random.random() < 0.7:
                    store.room = self.random.randint(0, 3_000)
            self._after(1.0, 60.0, self._free_disk)
        elif what == 'outage':
            self.went_wrong['outages'] += 1
            person = self.people[self.random.choice(PEOPLE)]
            person.down, person.hangs = self.random.choice(
                ((True, False), (False, True), (True, True)))
            self._after(2.0, 90.0, lambda: self._mend(person))
        else:
            self.went_wrong['networks_lost'] += 1
            self._network_down = True
            self._after(2.0, 60.0, self._network_up)

    def _free_disk(self) -> None:
        self._disk.room = self._memory.room = 1 << 30

    def _mend(self, person: Responder) -> None:
        person.down = person.hangs = False

    def _network_up(self) -> None:
        self._network_down = False

    def _strike(self, what: str) -> None:
        """Kill a process: now, or in the middle of one of its next writes."""
        if self.random.random() < 0.3:
            self._crash(what)
            return
        on_disk = what != 'notifier' and (what != 'power' or self.random.random() < 0.5)
        store = self._disk if on_disk else self._memory
        store.kill_at = store.calls + self.random.randint(1, 12)
        self._aimed[on_disk] = what

    def _hit(self, on_disk: bool) -> None:
        """Kill the process that was to die in the middle of a write."""
        self.went_wrong['in_a_write'] += 1
        self._crash(self._aimed[on_disk])

    def _crash(self, what: str) -> None:
        self.went_wrong[f'{what}_killed'] += 1
        if what == 'power':
            self._disk.lose_power(self.random)
            self._memory.lose_power(self.random)
            # The clock of the core restarts.
            self._offset_ns = self.timeline.now_ns - self.random.randint(1, 100) * NS_PER_S
        if what in ('notifier', 'power'):
            self._end_notifier()
        if what in ('core', 'power'):
            self._service, self._due_ns = None, 0
            self._after(0.3, 15.0, self._start_core)
        if what in ('core', 'power', 'journal') and self._journal is not None:
            self._journal.ended = True
            self._journal = None
            if what == 'journal' and self._service is not None:
                life = self._life
                self.timeline.after(NS_PER_MS, lambda: self._journal_gone(life))

    def _journal_gone(self, life: int) -> None:
        if self._service is None or life != self._life:
            return
        self._service.handle_journal(
            JournalReply(fault='its process has ended'), self._core_ns())
        self._settle()

        def reopen() -> None:
            if self._service is not None and life == self._life:
                self._open_journal()

        self._after(0.3, 1.5, reopen)

    def _end_notifier(self) -> None:
        if self._notifier is not None:
            self._notifier.ended = True
            self._notifier = None
            self._after(0.3, 20.0, self._start_notifier)
