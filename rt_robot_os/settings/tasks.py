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


"""Find contradictions in the declarations of tasks, within a task and between tasks."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
from typing import Any
from typing import Final

from rt_robot_os.base.schema import PartTopics
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.base.units import period_from_rate
from rt_robot_os.kernel.clock import NEVER_NS
from rt_robot_os.kernel.spec import BudgetPolicy
from rt_robot_os.kernel.spec import contradictions as kernel_rules
from rt_robot_os.kernel.spec import DeclarationRule
from rt_robot_os.kernel.spec import FailurePolicy
from rt_robot_os.kernel.spec import OverrunPolicy
from rt_robot_os.settings.model import RobotSettings
from rt_robot_os.settings.model import SLOWEST_HZ
from rt_robot_os.settings.model import TaskSettings
from rt_robot_os.settings.names import is_token
from rt_robot_os.settings.names import TOKEN_RULE
from rt_robot_os.settings.parts import PartSection
from rt_robot_os.settings.parts import task_of
from rt_robot_os.settings.problems import Names
from rt_robot_os.settings.problems import Problems
from rt_robot_os.settings.sections import Section

SHORTEST_TIMEOUT_S = 0.1

# The kernel's rules in terms of the file: the key that is reported, and the remedy.
RULE_TEXTS: Final[Mapping[DeclarationRule, tuple[str, str]]] = {
    DeclarationRule.BUDGET_ABOVE_PERIOD: (
        'budget_us', 'is above {period}: a job loses its next release before it is aborted: '
        'make it smaller'),
    DeclarationRule.BUDGET_ABOVE_DEADLINE: (
        'deadline_us', 'is below budget_us, {task.budget_us:g} (us): a job may miss it within its '
        'budget: make the budget smaller'),
    DeclarationRule.DEADLINE_ABOVE_PERIOD: (
        'deadline_us', 'is above {period}: with overrun: {task.overrun} such a job loses its next '
        'release: make it smaller, or choose overrun: catch_up'),
    DeclarationRule.OVERRUN_WITHOUT_RATE: (
        'overrun', 'needs a rate_hz: a task that its inputs release never overruns'),
    DeclarationRule.LIMIT_WITHOUT_RATE: (
        'overrun_limit', 'needs a rate_hz: a task that its inputs release never overruns'),
    DeclarationRule.LIMIT_WITH_STOP: (
        'overrun_limit', 'is never reached: overrun: stop ends the task with its first overrun: '
        'choose another policy or delete the limit'),
    DeclarationRule.LIMIT_WITHOUT_POLICY: (
        'overrun_limit', 'has no effect with failure: continue: choose restart, stop or '
        'safe_state'),
    DeclarationRule.ABORT_WITHOUT_BUDGET: (
        'on_budget', 'has no budget: set budget_us or delete it'),
    DeclarationRule.RESTART_SHRINKS: (
        'restart_max_s', 'must be at least restart_s, {task.restart_s:g} (s)'),
    DeclarationRule.LOGICAL_WITHOUT_END: (
        'logical_execution', 'needs a rate_hz: without one there are no instants for inputs and '
        'outputs'),
    DeclarationRule.NO_SAFE_STATE: (
        'failure', '{kind!r} has no method safe_state(): choose restart or stop, or add one'),
    DeclarationRule.ABORT_WITHOUT_PREEMPTION: (
        'on_budget', 'core.dispatcher ({where}) is cooperative: no job can be aborted: choose '
        'warn, or dispatcher: preemptive'),
}

Uses = Mapping[str, 'PartTopics | None']


def kernel_keywords(task: TaskSettings) -> dict[str, Any]:
    """Return the settings of a task as keywords of ``Kernel.add_task``; without resources."""
    return {
        'phase_ns': round(task.phase_us * NS_PER_US),
        'deadline_ns': round(task.deadline_us * NS_PER_US),
        'budget_ns': round(task.budget_us * NS_PER_US),
        'on_budget': BudgetPolicy(task.on_budget),
        'overrun': OverrunPolicy(task.overrun), 'catch_up': task.catch_up,
        'overrun_limit': task.overrun_limit, 'overrun_leak': task.overrun_leak,
        'failure': FailurePolicy(task.failure),
        'restart_ns': round(task.restart_s * NS_PER_S),
        'restart_maximum_ns': round(task.restart_max_s * NS_PER_S),
        'critical': task.critical, 'logical': task.logical_execution}


def without_watchdog(robot: RobotSettings) -> str:
    """Return a warning about critical tasks without a watchdog; empty if there are none."""
    names = [each.name for each in robot.devices if each.task.critical]
    names += [each.name for each in robot.modules if each.task.critical]
    if not names or robot.watchdog.timeout_s:
        return ''
    return (f'critical: true of {", ".join(map(repr, names))} has no effect: watchdog.timeout_s '
            'is 0, so no watchdog runs; set it, for instance to 2.0 with action: exit')


def contradictions(
    rate_hz: float | None, task: TaskSettings, *, cooperative: str = '', never_safe: str = '',
) -> Iterator[tuple[str, str]]:
    """
    Yield the problems of one declaration, as (key, remedy).

    :param rate_hz: 0 when only events release the task; None if unknown.
    :param cooperative: the place where the cooperative dispatcher was chosen; empty without it.
    :param never_safe: type of the part, when its class has no ``safe_state()``.
    """
    period_ns = NEVER_NS  # contradicts nothing
    if rate_hz is not None:
        period_ns = period_from_rate(rate_hz) if rate_hz else 0
    keywords = kernel_keywords(task)
    rules = dict.fromkeys(kernel_rules(period_ns=period_ns, preemptive=not cooperative,
                                       can_be_safe=not never_safe, **keywords))
    if not period_ns and task.logical_execution:
        # A deadline is not enough in the settings.
        rules[DeclarationRule.LOGICAL_WITHOUT_END] = None
    if DeclarationRule.LIMIT_WITH_STOP in rules:
        rules.pop(DeclarationRule.LIMIT_WITHOUT_POLICY, None)  # one remedy for one key
    period = '' if rate_hz is None else (
        f'the period, {period_ns / NS_PER_US:g} us at {rate_hz:g} Hz')
    for rule in rules:
        key, remedy = RULE_TEXTS[rule]
        yield key, remedy.format(task=task, period=period, where=cooperative, kind=never_safe)
    yield from _beyond_the_kernel(period_ns, task, keywords)


def _beyond_the_kernel(
    period_ns: int, task: TaskSettings, keywords: Mapping[str, Any],
) -> Iterator[tuple[str, str]]:
    """Find settings that the kernel accepts although they have no effect."""
    if keywords['budget_ns'] and task.on_budget == 'abort' and (
            round(task.execution_us * NS_PER_US) > keywords['budget_ns']):
        yield 'execution_us', (f'is above budget_us, {task.budget_us:g} (us): such a job is '
                               'aborted: make the budget larger')
    if not period_ns and task.phase_us:
        yield 'phase_us', 'needs a rate_hz: without one only its inputs release the task'
    if not period_ns and task.critical and not keywords['deadline_ns']:
        yield 'critical', ('needs a deadline_us without a rate_hz: otherwise the task is never '
                           'late')
    if period_ns and task.logical_execution and task.overrun != 'skip':
        yield 'overrun', ('must be skip with logical_execution: an output that is not ready at '
                          'its deadline is not published')
    if period_ns and task.logical_execution and task.overrun_limit:
        yield 'overrun_limit', 'is never reached with logical_execution: delete it'
    if task.catch_up != TaskSettings().catch_up and task.overrun != 'catch_up':
        yield 'catch_up', f'is used with overrun: catch_up only, not {task.overrun}: delete it'


def check_tasks(
    devices: Sequence[PartSection], modules: Sequence[PartSection], uses: Uses, core: Section,
    watchdog: Section, problems: Problems,
) -> None:
    """
    Find every contradiction among the tasks of a robot.

    :param uses: the topics of each part, by its name; None where they are unknown.
    """
    parts = [*devices, *modules]
    cooperative = ''
    if core.values.get('dispatcher') == 'cooperative':
        cooperative = str(core.where('dispatcher'))
    for part in parts:
        _check_rate(part, uses.get(part.name), problems)
        rate_hz = part.section.values.get('rate_hz')
        never_safe = part.kind is not None and not part.kind.has_safe_state
        for key, remedy in contradictions(
                rate_hz, task_of(part), cooperative=cooperative,
                never_safe=part.section.values['type'] if never_safe else ''):
            _reject(part.section, key, remedy, problems)
        _check_interrupt(part, problems)
        if _is_woken(uses.get(part.name)) and rate_hz and (
                task_of(part).logical_execution):
            _reject(part.section, 'logical_execution', 'one of its inputs wakes it, between the '
                    'instants at which inputs are read: let it read without wake', problems)
    _check_resources(parts, problems)
    # A device publishes what it reads from its port, whatever releases it: it closes no cycle.
    _check_cycles(modules, uses, problems)
    _check_watchdog(watchdog, parts, problems)


def _reject(section: Section, key: str, remedy: str, problems: Problems) -> None:
    if key in section.values:  # otherwise the value itself is wrong, and was reported
        problems.value(section.where(key), f'{section.name}.{key}', section.values[key], remedy)


def _check_rate(part: PartSection, uses: PartTopics | None, problems: Problems) -> None:
    rate_hz = part.section.values.get('rate_hz')
    if rate_hz is None or part.kind is None:
        return
    wrong = ''
    if part.kind.is_coroutine:
        wrong = ('has no effect on a coroutine run(), which awaits its releases: delete it, or '
                 'await kernel.every(hz).next()' if rate_hz else '')
    elif 0.0 < rate_hz < SLOWEST_HZ:
        wrong = f'must be at least {SLOWEST_HZ:g} (Hz), or 0 when only its inputs release it'
    elif not rate_hz and uses is not None and not _is_woken(uses):
        wrong = 'none of its inputs releases the task (wake): give it a rate'
    if wrong:
        part.section.reject('rate_hz', wrong, problems)


def _is_woken(uses: PartTopics | None) -> bool:
    return uses is not None and any(each.wake for each in uses.read)


def _check_interrupt(part: PartSection, problems: Problems) -> None:
    if part.section.values.get('read') == 'interrupt' and task_of(part).logical_execution:
        _reject(part.section, 'logical_execution', 'with read: interrupt its samples are '
                'published as they arrive, not at the deadline: choose read: poll', problems)


def _check_resources(parts: Sequence[PartSection], problems: Problems) -> None:
    """Find invalid and misspelt names; a resource of a single task is allowed."""
    users: dict[str, list[PartSection]] = {}
    for part in parts:
        names = part.section.values.get('resources', ())
        for name in dict.fromkeys(names):
            users.setdefault(name, []).append(part)
        wrong = next((name for name in names if not is_token(name)), None)
        if wrong is not None:
            _reject(part.section, 'resources', f'{wrong!r}: a name must be {TOKEN_RULE}', problems)
        elif len(set(names)) < len(names):
            _reject(part.section, 'resources', 'a name is twice in this list: delete one',
                    problems)
    known, places = Names(users), {name: place for place, name in enumerate(users)}
    for name, (first, *others) in users.items():
        if others or not is_token(name):
            continue
        guess = known.nearest(name, but=name)
        # Of two similar names that are used once each, the later one is reported.
        if guess is not None and (len(users[guess]) > 1 or places[guess] < places[name]):
            other = users[guess][0]
            _reject(first.section, 'resources', f'only {first.name} names {name!r}, so it has no '
                    f'effect: did you mean {guess!r}, as in {other.name}?', problems)


def _check_cycles(parts: Sequence[PartSection], uses: Uses, problems: Problems) -> None:
    """Find modules that release each other in a cycle: they would never stop running."""
    readers: dict[str, list[str]] = {}
    for part in parts:
        for read in (uses.get(part.name) or PartTopics()).read:
            # Not a reader that waits for several publications, or also for other topics.
            if read.wake is True or read.wake == 1:
                readers.setdefault(read.topic, []).append(part.name)
    followers: dict[str, dict[str, str]] = {part.name: {} for part in parts}
    for part in parts:
        for spec in (uses.get(part.name) or PartTopics()).published:
            for reader in readers.get(spec.topic, ()):
                followers[part.name].setdefault(reader, spec.topic)
    _remove_acyclic(followers)
    reported: set[str] = set()
    for part in parts:
        name = part.name
        cycle = () if name in reported or name not in followers else _cycle(name, followers)
        if cycle:
            reported.update(cycle)
            text = ''.join(f'{at} -> topic {followers[at][then]} -> '
                           for at, then in zip(cycle, (*cycle[1:], name)))
            problems.add(part.section.origin, f'{name}: these modules release each other '
                         f'endlessly: {text}{name}. Let one of them read without wake, at its '
                         'rate')


def _remove_acyclic(followers: dict[str, dict[str, str]]) -> None:
    """Remove modules that release no remaining module, repeatedly: they are in no cycle."""
    releasing: dict[str, list[str]] = {}
    for name, then in followers.items():
        for other in then:
            releasing.setdefault(other, []).append(name)
    waiting = [name for name, then in followers.items() if not then]
    while waiting:
        name = waiting.pop()
        del followers[name]
        for other in releasing.get(name, ()):
            del followers[other][name]
            if not followers[other]:
                waiting.append(other)


def _cycle(start: str, followers: Mapping[str, Mapping[str, str]]) -> tuple[str, ...]:
    """Return the shortest path from a module back to itself; empty if there is none."""
    came_from: dict[str, str] = {}
    waiting = deque([start])
    while waiting:
        at = waiting.popleft()
        for then in followers[at]:
            if then == start:
                path = [at]
                while path[-1] != start:
                    path.append(came_from[path[-1]])
                return tuple(reversed(path))
            if then not in came_from:
                came_from[then] = at
                waiting.append(then)
    return ()


def _check_watchdog(watchdog: Section, parts: Sequence[PartSection], problems: Problems) -> None:
    timeout_s = watchdog.values.get('timeout_s')
    if timeout_s is None:
        return
    if 0.0 < timeout_s < SHORTEST_TIMEOUT_S:
        watchdog.reject('timeout_s', f'must be at least {SHORTEST_TIMEOUT_S:g} (s), or 0 for no '
                        'watchdog', problems)
        return
    if not timeout_s and watchdog.values.get('device'):
        _reject(watchdog, 'device', 'is not fed while watchdog.timeout_s is 0: set a time-out',
                problems)
    if timeout_s and watchdog.values.get('action') == 'safe_state' and not any(
            part.kind is None or part.kind.has_safe_state for part in parts):
        _reject(watchdog, 'action', 'no device and no module of this robot has a safe_state(): '
                'choose log or exit', problems)
