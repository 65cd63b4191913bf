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
A rule of the user: while it is true, it is the cause of an alarm.

The rule is parsed, and its topics and fields are checked, with the rest of the configuration.
:mod:`rt_robot_os.features.health.rule.evaluation` evaluates it; this module reads the topics and
reports the causes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
import math
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import REQUIRED
from rt_robot_os.base.schema import STAR
from rt_robot_os.base.schema import TopicRead
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.health.rule.evaluation import RuleState
from rt_robot_os.features.health.rule.evaluation import Transition
from rt_robot_os.features.health.rule.fields import checked
from rt_robot_os.features.health.rule.fields import error_lines
from rt_robot_os.features.health.rule.parser import read_rule
from rt_robot_os.features.health.rule.parser import RuleError
from rt_robot_os.features.health.rule.rule_set import bind_rules
from rt_robot_os.features.health.rule.rule_set import RuleSet
from rt_robot_os.features.health.rule.terms import conditions_of
from rt_robot_os.features.health.rule.terms import refs_of
from rt_robot_os.features.health.rule.terms import Silent
from rt_robot_os.kernel import Task
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import check_kind
from rt_robot_os.messages.cause import LEVELS
from rt_robot_os.modules.base import Module
from rt_robot_os.modules.cause_reports import CauseReports
from rt_robot_os.modules.cause_reports import CAUSES_OUTPUT
from rt_robot_os.modules.wake_up import WakeUp
from rt_robot_os.topics import Bus

# Largest number of rules of a section with their own lines in the diagnostics.
_LINES: Final = 16
_MOST_RULES: Final = 256
_LONGEST_S: Final = 31 * 86_400.0
_LONGEST_SUBJECT: Final = 64
_BLIND: Final = 'rate_hz is 0: silence is detected only after a message; remove rate_hz'


class RuleModule(Module):
    """Report a cause while a rule is true; released by its topics and its deadlines."""

    # The first release must not need a message, so that a topic without any is detected.
    RATE_HZ = 1.0

    causes = CAUSES_OUTPUT

    SETTINGS = (
        Field('when', str, REQUIRED, "The rule: 'wsn/kitchen/smoke.data > 0.5 for 3 s'; see the "
              'page on rules'),
        Field('kind', str, REQUIRED, 'Kind of the cause: smoke, water_leak, a word of lower case '
              'letters, digits and _'),
        Field('subject', str, REQUIRED, 'Subject of the cause: a person, a room, a device; '
              f'{STAR}: the name that the {STAR} in the rule stands for, one cause each'),
        Field('level', str, 'warning', 'Level of the cause', choices=tuple(LEVELS)),
        Field('text', str, '', 'Text for people; {name} is the name that the star stands for, '
              '{value} the number of the first field of the rule. Empty: kind and subject'),
        Field('node', str, '', 'The sensor node of the cause, so that a robot finds the place; '
              f'{STAR}: the name that the star stands for'),
        Field('position_m', list, [], 'Position in the map, x and y, if no node has it; '
              'empty: unknown', 'm', -1e6, 1e6, item=float),
        Field('clear_s', float, 0.0, 'Time for which the rule must be false before the cause '
              'ends', 's', 0.0, _LONGEST_S),
        Field('stale_s', float, 0.0, 'Age at which a value becomes unknown: the cause then stays '
              'as it is, and durations restart. 0: a value holds until the next', 's', 0.0,
              _LONGEST_S),
    )

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Parse the rule.

        :raises ConfigError: it is not valid, or a setting does not fit it.
        """
        super().__init__(name, settings)
        self._text = ' '.join(settings['when'].split())
        try:
            self._rule = read_rule(self._text)
        except RuleError as error:
            raise ConfigError(error_lines(f'{name}.when', error)) from None
        self._starred = any(STAR in ref.topic for ref in refs_of(self._rule))
        problems = _problems(name, settings, self._starred)
        if problems:
            raise ConfigError(problems)
        self._level = LEVELS[settings['level']]
        self._watched: RuleSet | None = None
        self._reports: CauseReports | None = None
        self._wake_up = WakeUp(None, None)
        self._started = False
        self._began = 0
        self._since_ns: dict[str, int] = {}

    # ---- ports -------------------------------------------------------------------------------

    def reads(self) -> tuple[TopicRead, ...]:
        """Return the topics of the rule, each with a check of its fields."""
        return tuple(TopicRead(ref.topic, wake=True, key='when',
                               check=checked(f'{self.name}.when', self._text, self._rule, ref))
                     for ref in refs_of(self._rule))

    def bind(self, bus: Bus, task: Task) -> None:
        """
        Connect the topics.

        :raises ConfigError: a topic or a field does not exist.
        """
        super().bind(bus, task)
        layouts = {topic.name: topic.layout for topic in bus.topics}
        rules = bind_rules(f'{self.name}.when', self._text, self._rule, layouts)
        if len(rules) > _MOST_RULES:
            raise ConfigError([f'{self.name}.when: {STAR} stands for {len(rules)} names, at most '
                               f'{_MOST_RULES}: write several rules'])
        clear_ns, stale_ns = (round(self.settings[key] * NS_PER_S) for key in (
            'clear_s', 'stale_s'))
        self._watched = RuleSet(
            {name: RuleState(rule, stale_ns, clear_ns) for name, rule in rules.items()},
            lambda topic: bus.subscribe(topic, self.name, task=task))

    # ---- life --------------------------------------------------------------------------------

    def configure(self) -> None:
        """Prepare."""
        self._reports = CauseReports(self.causes, self.name, _MOST_RULES)
        self._wake_up = WakeUp(self.kernel, self.task)

    def step(self) -> None:
        """Process new samples and deadlines, and report transitions."""
        watched, reports = self._watched, self._reports
        if watched is None or reports is None:
            return
        now_ns = self.causes.topic.kernel.now_ns()
        if not self._started:
            self._started = True
            watched.start(self.job_ns)
        for name, transition in watched.step(now_ns):
            self._report(name, transition, reports, watched)
        reports.refresh(now_ns)
        self._wake_up.no_later_than(min(watched.due_ns(), reports.due_ns))

    def statistics(self) -> Mapping[str, Any]:
        """Return the parsed rule and its state."""
        watched, reports = self._watched, self._reports
        if watched is None or reports is None:
            return {}
        lines = {}
        for name, state in list(watched.states.items())[:_LINES]:
            values = ', '.join(f'{ref} {_value_text(value)}' for ref, value in zip(
                state.refs, state.last_values()) if ref.path)
            key = f'state_{name}' if name else 'state'
            lines[key] = ': '.join(filter(None, (_state_text(state), values)))
        active = [name for name, state in watched.states.items() if state.active]
        blind = not self.period_ns and any(
            isinstance(each, Silent) for each in conditions_of(self._rule))
        return {'warning': _BLIND if blind else '', 'rule': str(self._rule),
                'active': len(active), 'began': self._began, 'no_values': watched.no_values,
                'samples_lost': watched.lost, **reports.statistics(), **lines}

    # ---- work --------------------------------------------------------------------------------

    def _report(self, name: str, transition: Transition, reports: CauseReports,
                watched: RuleSet) -> None:
        each = self.settings['subject'] == STAR
        if transition.active:
            self._began += 1
            self._since_ns[name] = transition.time_ns
        else:
            self._since_ns.pop(name, None)
        if not each and self._since_ns:
            # One cause for all of them: it names the one that has been true for longest.
            first = min(self._since_ns, key=lambda one: (self._since_ns[one], one))
            reports.report(self._cause(first, watched.states[first]), transition.time_ns)
        else:
            cause = self._cause(name, watched.states[name])
            reports.report(replace(cause, active=transition.active), transition.time_ns)

    def _cause(self, name: str, state: RuleState) -> Cause:
        s, value = self.settings, state.value()
        subject = name if s['subject'] == STAR else s['subject']
        text = s['text'] or f'{s["kind"].replace("_", " ")}: {subject}'
        text = text.replace('{name}', name).replace(
            '{value}', '?' if math.isnan(value) else f'{value:.4g}')
        x, y = s['position_m'] or (math.nan, math.nan)
        return Cause(s['kind'], subject, self._level, text=text,
                     node=name if s['node'] == STAR else s['node'], x=x, y=y, value=value)


def _problems(name: str, settings: Mapping[str, Any], starred: bool) -> list[str]:
    """Return the problems of the settings other than the rule."""
    problems = []
    try:
        check_kind(settings['kind'])
    except ValueError as error:
        problems.append(f'{name}.kind: {error}')
    if not settings['subject'].strip() or len(settings['subject']) > _LONGEST_SUBJECT:
        problems.append(f'{name}.subject must have 1 to {_LONGEST_SUBJECT} characters')
    problems += [f'{name}.{key} is {STAR}, but the rule has none: write a name'
                 for key in ('subject', 'node') if settings[key] == STAR and not starred]
    if not starred and '{name}' in settings['text']:
        problems.append(f'{name}.text has {{name}}, but the rule has no {STAR}')
    if len(settings['position_m']) not in (0, 2):
        problems.append(f'{name}.position_m must be x and y, such as [3.0, 1.5], or empty')
    return problems


def _value_text(value: float | str | None) -> str:
    if value is None:
        return 'no message'
    return repr(value[:40]) if isinstance(value, str) else f'{value:.6g}'


def _state_text(state: RuleState) -> str:
    if state.active and not state.known:
        return 'true, inputs stale'
    return {True: 'true', False: 'false', None: 'unknown'}[state.known]
