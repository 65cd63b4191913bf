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
The module of alarms: raised, notified, acknowledged, escalated, resolved.

All causes come together here. The alarm table decides what follows, from the stamps of samples and
from deadlines alone, so a replay gives the same result. The journal stores each change before its
notifications leave the robot.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Mapping
from functools import partial
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.alarms.alarm_service import AlarmService
from rt_robot_os.features.alarms.alarm_service import RECORD_BYTES
from rt_robot_os.features.alarms.escalation import ROBOT
from rt_robot_os.features.alarms.listing import LIST_BYTES
from rt_robot_os.features.alarms.listing import list_text
from rt_robot_os.features.alarms.settings import rules_of
from rt_robot_os.features.alarms.settings import SETTINGS
from rt_robot_os.messages.agent import Observation
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import CAUSES_MESSAGE
from rt_robot_os.messages.cause import CAUSES_TOPIC
from rt_robot_os.messages.journal import JournalReply
from rt_robot_os.messages.notification import DeliveryReport
from rt_robot_os.messages.notification import Notification
from rt_robot_os.modules.base import Module
from rt_robot_os.topics import Bus
from rt_robot_os.topics import MAX_SUBSCRIBERS
from rt_robot_os.topics import Publisher
from rt_robot_os.topics import Subscription
from rt_robot_os.topics.ports import Input
from rt_robot_os.topics.ports import Output

_TEXT: Final = CAUSES_MESSAGE
_EVENT_BYTES: Final = 6000
_ANSWER_BYTES: Final = 2000
_SAY_BYTES: Final = 1000
# Inputs of one topic, and records, that one job handles; the next job handles the others.
_A_JOB: Final = 16
_RECORDS_A_JOB: Final = 16
_LIST_PERIOD_NS: Final = 5 * NS_PER_S
# How long a refused input stays a warning; the counters keep it.
_WARNING_NS: Final = 60 * NS_PER_S


class Alarms(Module):
    """Keep all alarms of the robot, and repeat notifications until acknowledged."""

    causes = Input(CAUSES_TOPIC, wake=True, message=CAUSES_MESSAGE)
    command = Input('alarms/command', wake=True, message=_TEXT)
    report = Input('alarms/report', wake=True, message=_TEXT)
    stored = Input('alarms/stored', wake=True, message=_TEXT)
    observed = Input('', wake=True, message=_TEXT)
    events = Output('alarms/events', _TEXT, tail=_EVENT_BYTES, depth=64, most_hz=5.0)
    list = Output('alarms/list', _TEXT, tail=LIST_BYTES, depth=4, rate_hz=0.2,  # noqa: A003
                  most_hz=1.0)
    notify = Output('alarms/notify', _TEXT, tail=_EVENT_BYTES, depth=64, most_hz=2.0)
    answer = Output('alarms/answer', _TEXT, tail=_ANSWER_BYTES, depth=64, most_hz=1.0)
    journal = Output('alarms/journal', _TEXT, tail=RECORD_BYTES, depth=32, most_hz=5.0)
    say = Output('agent/say', _TEXT, tail=_SAY_BYTES, depth=16, most_hz=1.0)

    SETTINGS = SETTINGS

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Read the rules.

        :raises ConfigError: steps or kinds are wrong.
        """
        super().__init__(name, settings)
        self._service = AlarmService(
            rules_of(name, settings), journal=bool(settings['stored_topic']),
            wait_ns=round(settings['journal_wait_s'] * NS_PER_S))
        self._counters: Counter[str] = Counter()
        self._records: list[str] = []
        self._last_ns = self._list_ns = 0
        self._refused = ''
        self._refused_ns = 0

    # ---- life --------------------------------------------------------------------------------

    def declare(self, bus: Bus, rate_hz: float, max_subscribers: int = MAX_SUBSCRIBERS) -> None:
        """
        Declare the outputs.

        :raises ConfigError: it has no rate.
        """
        if not rate_hz:
            # Not timers of its own: jobs at a rate are released in a replay as they were.
            raise ConfigError([f'{self.name}.rate_hz is missing: the rate at which deadlines are '
                               'checked; write rate_hz: 10.0'])
        super().declare(bus, rate_hz, max_subscribers)

    def connected(self, attribute: str) -> bool:
        """Return whether a port has a topic; without replies of a journal there is none."""
        if attribute == 'journal' and not self.topic_of('stored'):
            return False
        return bool(self.topic_of(attribute))

    def step(self) -> None:
        """Handle inputs in the order of their stamps, do what is due, publish the results."""
        now_ns = self.events.topic.kernel.now_ns()
        service = self._service
        if not self._last_ns:
            # A full second: the same in a replay, whose job reads the clock a little earlier.
            self._last_ns = self._list_ns = now_ns - now_ns % NS_PER_S
            service.start(self._last_ns)
        for stamp_ns, take in self._inputs(now_ns):
            self._advance(stamp_ns)
            self._last_ns = max(stamp_ns, self._last_ns)
            self._try(take, self._last_ns)
            self._publish_results()
        self._advance(now_ns)
        self._publish_records()
        if now_ns >= self._list_ns:
            self._last_ns = max(self._list_ns, self._last_ns)
            self._publish_list()

    def statistics(self) -> Mapping[str, Any]:
        """Return the number of alarms, the counters, and what is wrong."""
        now_ns = self.kernel.now_ns() if self.kernel else 0
        warnings = [self._service.warning]
        if not self.settings['stored_topic']:
            warnings.append('there is no journal: a restart forgets all alarms')
        if self._refused and now_ns - self._refused_ns < _WARNING_NS:
            warnings.append(self._refused)
        found = self._service.statistics()
        return {'warning': '; '.join(filter(None, warnings)), **found, **self._counters,
                'causes_lost': self.causes.lost, 'reports_lost': self.report.lost}

    # ---- what comes in -----------------------------------------------------------------------

    def _advance(self, until_ns: int) -> None:
        """Do what was due, each at its own time, and publish each result by itself."""
        while (due_ns := self._service.next_ns) and due_ns <= until_ns:
            self._last_ns = max(due_ns, self._last_ns)
            self._service.advance(due_ns)
            self._publish_results()

    def _inputs(self, now_ns: int) -> Iterable[tuple[int, Callable[[int], None]]]:
        """Return some of the inputs that came, in the order of their stamps."""
        found: list[tuple[int, int, Callable[[int], None]]] = []
        handlers: tuple[tuple[str, Callable[[str, int], None]], ...] = (
            ('stored', self._handle_stored), ('causes', self._handle_cause),
            ('command', self._service.handle_command), ('report', self._handle_report),
            ('observed', self._handle_observed))
        for attribute, take in handlers:
            if not self.connected(attribute):
                continue
            port: Subscription = getattr(self, attribute)
            # Only samples that are there now: in a replay, reading an empty topic lets time pass.
            for _ in range(min(_A_JOB, port.unread)):
                if not port.take():
                    break
                found.append((min(port.stamp_ns, now_ns), len(found),
                              partial(take, str(port.msg.data))))
        return [(stamp_ns, take) for stamp_ns, _, take in sorted(
            found, key=lambda each: each[:2])]

    def _try(self, take: Callable[[int], None], stamp_ns: int) -> None:
        try:
            take(stamp_ns)
        except ValueError as error:
            self._counters['refused'] += 1
            self._refused, self._refused_ns = f'refused: {error}', stamp_ns
            self.log.warn('refused: %s', str(error), throttle_s=1.0)

    def _handle_cause(self, text: str, stamp_ns: int) -> None:
        self._service.handle_cause(Cause.from_json(text), stamp_ns)

    def _handle_report(self, text: str, stamp_ns: int) -> None:
        report = DeliveryReport.from_json(text)
        self._service.handle_report(report.key, report.ok, report.text, stamp_ns)

    def _handle_stored(self, text: str, stamp_ns: int) -> None:
        self._service.handle_journal(JournalReply.from_json(text), stamp_ns)

    def _handle_observed(self, text: str, stamp_ns: int) -> None:
        found = Observation.from_json(text)
        if not found.problem:
            self._service.handle_picture(found.alarm, found.file, stamp_ns)

    # ---- what goes out -----------------------------------------------------------------------

    def _publish_results(self) -> None:
        """Publish the results of one input or deadline."""
        service, stamp_ns = self._service, self._last_ns
        self._records += service.pop_records()
        events = service.pop_events()
        for event in events:
            self._publish(self.events, event.to_json(), stamp_ns)
        for answer in service.pop_answers():
            self._publish(self.answer, answer.to_json(), stamp_ns)
        for each in service.pop_notifications():
            if each.channel == ROBOT:
                self._speak(each)
            else:
                self._publish(self.notify, each.to_json(), stamp_ns)
        if events:
            self._publish_list()

    def _speak(self, each: Notification) -> None:
        stamp_ns = self._last_ns
        silent = stamp_ns < self._service.table.silent_until_ns
        if not silent:
            self._publish(self.say, each.text, stamp_ns)
        self._service.handle_report(each.key, True, 'silenced' if silent else '', stamp_ns)
        self._publish_results()

    def _publish_records(self) -> None:
        if not self._records:
            return
        some, self._records = self._records[:_RECORDS_A_JOB], self._records[_RECORDS_A_JOB:]
        for text in some:
            self._publish(self.journal, text, self._last_ns)

    def _publish_list(self) -> None:
        stamp_ns = self._last_ns
        self._publish(self.list, list_text(self._service.table.in_order(), stamp_ns), stamp_ns)
        self._list_ns = stamp_ns + _LIST_PERIOD_NS

    def _publish(self, output: Publisher, text: str, stamp_ns: int) -> None:
        output.msg.data = text
        output.publish(stamp_ns)
