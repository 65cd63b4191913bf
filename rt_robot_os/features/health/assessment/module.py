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
Assessment of a person's vital signs: NEWS2, personal limits, trends, consciousness.

Only values of good quality count. An old or implausible value, or one of a sensor that is off, is
missing: it never counts as normal, and no alarm clears because a value is missing.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping
import json
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.health.assessment.limit_watch import LimitChange
from rt_robot_os.features.health.assessment.limit_watch import LimitWatch
from rt_robot_os.features.health.assessment.news2 import CONSCIOUSNESS
from rt_robot_os.features.health.assessment.news2 import OXYGEN
from rt_robot_os.features.health.assessment.news2 import Risk
from rt_robot_os.features.health.assessment.news2 import Score
from rt_robot_os.features.health.assessment.news2 import score
from rt_robot_os.features.health.assessment.news2_watch import News2Watch
from rt_robot_os.features.health.assessment.settings import AIR
from rt_robot_os.features.health.assessment.settings import limits_text
from rt_robot_os.features.health.assessment.settings import parse_limits
from rt_robot_os.features.health.assessment.settings import REPORTED
from rt_robot_os.features.health.assessment.settings import SETTINGS
from rt_robot_os.features.health.vital_signs.settings import check_rate
from rt_robot_os.features.health.vital_signs.settings import checked_person
from rt_robot_os.features.health.vital_signs.sign_watch import GOOD
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import Level
from rt_robot_os.messages.signs import Consciousness
from rt_robot_os.messages.signs import SIGNS
from rt_robot_os.modules.base import Module
from rt_robot_os.modules.cause_reports import CauseReports
from rt_robot_os.modules.cause_reports import CAUSES_OUTPUT
from rt_robot_os.modules.wake_up import WakeUp
from rt_robot_os.topics.ports import Input
from rt_robot_os.topics.ports import Output

_STRING: Final = 'std_msgs/msg/String'
_DETAILS_BYTES: Final = 3000
# Period of publishing an unchanged score, for clients that connect later.
_AGAIN_NS: Final = 10 * NS_PER_S
_INCOMPLETE: Final = -1
#: Port, and the last part of its topic's name.
_TOPICS: Final = {'signs': 'signs', 'news2': 'news2', 'details': 'news2_details'}
_WORDS: Final = {
    Consciousness.ALERT: 'is alert', Consciousness.CONFUSION: 'is newly confused',
    Consciousness.VOICE: 'reacts only to a voice', Consciousness.PAIN: 'reacts only to pain',
    Consciousness.UNRESPONSIVE: 'does not react'}
_DIAGNOSTIC_LEVEL: Final = {Risk.LOW: 0, Risk.LOW_MEDIUM: 1, Risk.MEDIUM: 1, Risk.HIGH: 2}
_NOT_KNOWN: Final = 3


class Assessment(Module):
    """Score the vital signs of one person, and report causes of alarms."""

    signs = Input('', wake=True, message=_STRING)
    news2 = Output('', 'std_msgs/msg/Int16')
    details = Output('', _STRING, tail=_DETAILS_BYTES)
    causes = CAUSES_OUTPUT

    SETTINGS = SETTINGS

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Read the limits.

        :raises ConfigError: a limit cannot be parsed.
        """
        super().__init__(name, settings)
        self._person = checked_person(name, settings)
        self._limits = LimitWatch(parse_limits(name, settings))
        self._limits_text = limits_text(settings['limits'])
        self._watch = News2Watch(round(settings['news2_for_s'] * NS_PER_S),
                                 round(settings['news2_clear_s'] * NS_PER_S))
        self._score = score({}, settings['spo2_scale'])
        self._values: dict[str, float] = {}
        self._silent_ns = round(settings['silent_s'] * NS_PER_S)
        self._received_ns = self._time_ns = 0
        self._published_ns = -_AGAIN_NS
        self._published: Score | None = None
        self._is_silent = False
        self._refused = self._scores = 0

    def topic_of(self, attribute: str) -> str:
        """Return the topic of a port; by default it contains the person's name."""
        given = super().topic_of(attribute)
        if given or attribute not in _TOPICS:
            return given
        return f'health/{self._person}/{_TOPICS[attribute]}'

    # ---- life --------------------------------------------------------------------------------

    def configure(self) -> None:
        """
        Prepare; the timeout of the vital signs starts here.

        :raises ConfigError: the module has no rate, so no timeout would release it.
        """
        check_rate(self.name, self.period_ns)
        self._reports = CauseReports(self.causes, self.name)
        self._wake_up = WakeUp(self.kernel, self.task)
        self._received_ns = self._time_ns = self.signs.topic.kernel.now_ns()

    def step(self) -> None:
        """Process new messages and deadlines."""
        now_ns = self.signs.topic.kernel.now_ns()
        while self.signs.take():
            stamp_ns = max(min(self.signs.stamp_ns, now_ns), self._time_ns)
            values = self._good_values(self.signs.msg.data)
            if values is None:
                self._refused += 1
                continue
            self._advance(stamp_ns - 1)
            self._received_ns = stamp_ns
            self._receive(values, stamp_ns)
        self._advance(now_ns)
        self._publish()
        self._reports.refresh(now_ns)
        self._wake_up.no_later_than(min(self._due_ns(), self._reports.due_ns))

    def statistics(self) -> Mapping[str, Any]:
        """Return the score and counters."""
        missing = ' '.join(self._score.missing)
        return {'person': self._person,
                'news2': _INCOMPLETE if self._score.total is None else self._score.total,
                'at_least': self._score.at_least, 'missing': missing, 'scores': self._scores,
                'refused': self._refused, **self._reports.statistics(),
                'warning': f'{self._refused} messages on {self.signs.topic.name} could not be read'
                if self._refused else ''}

    # ---- work --------------------------------------------------------------------------------

    def _good_values(self, text: str) -> dict[str, float] | None:
        """Return the values of good quality; None if the message cannot be parsed."""
        found: dict[str, float] = {}
        try:
            for status in json.loads(text)['status']:
                sign = SIGNS.get(str(status['name']).rpartition('/')[2])
                if sign is not None and status['values']['quality'] == GOOD:
                    value = float(status['values']['value'])
                    if sign.is_plausible(value):
                        found[sign.name] = value
        except (ValueError, KeyError, TypeError, RecursionError):
            return None
        oxygen = self.settings['oxygen']
        if oxygen != REPORTED:
            found[OXYGEN] = 0.0 if oxygen == AIR else max(found.get(OXYGEN, 0.0), 1.0)
        return found

    def _due_ns(self) -> float:
        due_ns = min(self._limits.due_ns, self._watch.due_ns)
        return due_ns if self._is_silent else min(due_ns, self._received_ns + self._silent_ns)

    def _subject(self) -> str:
        return f'vital signs of {self._person}'

    def _advance(self, until_ns: int) -> None:
        """Process the deadlines until a time, in order."""
        while (due_ns := self._due_ns()) <= until_ns:
            self._time_ns = stamp_ns = int(due_ns)
            self._report_limits(self._limits.advance(stamp_ns))
            for changed_ns, level in self._watch.advance(stamp_ns):
                self._report_score(level, changed_ns)
            if not self._is_silent and stamp_ns >= self._received_ns + self._silent_ns:
                self._is_silent = True
                self._reports.report(Cause(
                    'monitor_silent', self._subject(), Level.TECHNICAL,
                    text=f'no vital signs of {self._person} arrive'), stamp_ns)
                self._assess({}, stamp_ns)

    def _receive(self, values: dict[str, float], stamp_ns: int) -> None:
        self._time_ns = stamp_ns
        self._is_silent = False
        self._reports.end('monitor_silent', self._subject(), stamp_ns,
                          f'vital signs of {self._person} arrive again')
        self._assess(values, stamp_ns)

    def _assess(self, values: dict[str, float], stamp_ns: int) -> None:
        for name in SIGNS:
            self._report_limits(self._limits.put(name, values.get(name), stamp_ns))
        self._report_consciousness(values.get(CONSCIOUSNESS), stamp_ns)
        if values != self._values or not self._scores:
            self._score = score(values, self.settings['spo2_scale'])
            self._scores += 1
        self._values = values
        self._watch.put(self._score, stamp_ns)
        if self._watch.level is not None:
            self._report_score(self._watch.level, stamp_ns)

    def _report_limits(self, findings: Iterable[LimitChange]) -> None:
        for each in findings:
            if each.level is None:
                self._reports.end(each.kind, self._person, each.stamp_ns)
            else:
                self._reports.report(Cause(each.kind, self._person, each.level, text=(
                    f'{self._person}: {each.text}'), value=each.value), each.stamp_ns)

    def _report_score(self, level: Level | None, stamp_ns: int) -> None:
        if not self.settings['news2']:
            return
        if level is None:
            self._reports.end('news2', self._person, stamp_ns,
                              score_text(self._person, self._score))
        else:
            self._reports.report(Cause(
                'news2', self._person, level, text=score_text(
                    self._person, self._score, self._watch.held),
                value=float(self._score.at_least)), stamp_ns)

    def _report_consciousness(self, value: float | None, stamp_ns: int) -> None:
        if value is None:
            return
        mind = Consciousness(int(value))
        level = Level.CRITICAL if mind >= Consciousness.VOICE else Level.URGENT
        self._reports.report(Cause(
            'consciousness', self._person, level, mind is not Consciousness.ALERT,
            f'{self._person} {_WORDS[mind]}', value=value), stamp_ns)

    def _publish(self) -> None:
        if self._score == self._published and (
                self._time_ns - self._published_ns < _AGAIN_NS):
            return
        self._published, self._published_ns = self._score, self._time_ns
        total = self._score.total
        self.news2.msg.data = _INCOMPLETE if total is None else total
        self.news2.publish(self._time_ns)
        self.details.msg.data = details_text(self._person, self._score, self._limits_text)
        self.details.publish(self._time_ns)


def score_text(person: str, found: Score, held: Mapping[str, int] | None = None) -> str:
    """
    Return a score as a sentence.

    :param held: points that count in an active alarm, those of signs that are missing now too.
    """
    number = str(found.total) if found.complete else f'at least {found.at_least}'
    points = ', '.join(f'{SIGNS[name].title} {points}' for name, points in found.scores.items()
                       if points)
    text = f'{person}: NEWS2 {number}' + (f' ({points})' if points else '')
    if found.missing:
        text += f'; missing: {", ".join(SIGNS[name].title for name in found.missing)}'
    before = ', '.join(f'{SIGNS[name].title} {points}' for name, points in (held or {}).items()
                       if points and name in found.missing)
    return f'{text}; before that: {before}' if before else text


def details_text(person: str, found: Score, limits: str = '') -> str:
    """
    Return a score as a DiagnosticArray in JSON; safe in the real-time loop.

    :param limits: of the person, from :func:`limits_text`.
    """
    values = {'total': '' if found.total is None else str(found.total),
              'complete': str(found.complete).lower(), 'missing': ' '.join(found.missing),
              'at_least': str(found.at_least), 'spo2_scale': str(found.scale),
              'risk': found.risk.title if found.risk is not None else '',
              'response': found.response, 'frequency': found.frequency, 'limits': limits,
              **{f'{name}_score': str(points) for name, points in found.scores.items()}}
    level = _DIAGNOSTIC_LEVEL[found.least_risk]
    return json.dumps({'status': [{
        'level': level if found.complete or level else _NOT_KNOWN, 'name': f'{person}/news2',
        'message': score_text(person, found), 'hardware_id': '', 'values': values}]},
        separators=(',', ':'))
