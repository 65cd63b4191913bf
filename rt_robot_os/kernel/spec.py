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


"""The declaration of a task, and its validation: ranges and contradictions."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any
from typing import Final

from rt_robot_os.base.errors import TaskError
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import period_from_rate

PRIORITY_MINIMUM: Final = 1
PRIORITY_MAXIMUM: Final = 99
BACKLOG_MAXIMUM = 1000
RATE_MINIMUM_HZ = 1e-6
RATE_MAXIMUM_HZ = 100_000.0
OVERRUN_LIMIT_MAXIMUM = 1_000_000


class OverrunPolicy(Enum):
    """What happens to a release while the previous job is unfinished."""

    SKIP = 'skip'          # missed; the task stays on its grid
    REPHASE = 'rephase'    # served when that job has ended; the grid restarts there
    CATCH_UP = 'catch_up'  # served later, a limited number waits; the task stays on its grid
    STOP = 'stop'          # the task is stopped


_QUEUEING = (OverrunPolicy.CATCH_UP, OverrunPolicy.REPHASE)


class BudgetPolicy(Enum):
    """What happens to a job that computes for longer than its budget."""

    WARN = 'warn'    # it is counted
    ABORT = 'abort'  # TaskAborted is raised in it


class FailurePolicy(Enum):
    """What happens to a task after a failure, an abort, or too many overruns."""

    CONTINUE = 'continue'      # nothing: the next release makes the next job
    RESTART = 'restart'        # it restarts after a pause that grows with each failure
    STOP = 'stop'              # it is not released any more
    SAFE_STATE = 'safe_state'  # its on_safe_state runs once, then it is not released any more


class TaskState(Enum):
    """Whether releases make jobs. ``Task.rearm`` returns to ACTIVE from any other state."""

    ACTIVE = 'active'
    BACKOFF = 'backoff'  # paused before an automatic restart
    SAFE = 'safe'        # in its safe state
    STOPPED = 'stopped'


class DeclarationRule(Enum):
    """Declarations that contradict each other; the value is the message."""

    BUDGET_ABOVE_PERIOD = (
        'budget_ns {budget_ns} is above the period of {period_ns} ns: the job would overrun '
        'before it is aborted; lower the budget or the rate')
    BUDGET_ABOVE_DEADLINE = (
        'budget_ns {budget_ns} is above the deadline of {deadline_ns} ns: the job would be late '
        'before it is aborted; lower the budget')
    DEADLINE_ABOVE_PERIOD = (
        'deadline_ns {deadline_ns} is above the period of {period_ns} ns, but overrun '
        '{overrun.value} does not serve late releases; shorten it or choose overrun catch_up')
    OVERRUN_WITHOUT_RATE = (
        'overrun {overrun.value} is for periodic tasks; this one is released by events: leave it '
        'out or give it a rate')
    LIMIT_WITHOUT_RATE = (
        'overrun_limit {overrun_limit} has no effect without a rate; leave it out')
    LIMIT_WITH_STOP = (
        'overrun_limit {overrun_limit} has no effect with overrun stop; leave it out')
    LIMIT_WITHOUT_POLICY = (
        'overrun_limit {overrun_limit} applies the failure policy, which is continue; choose '
        'restart, stop or safe_state')
    ABORT_WITHOUT_BUDGET = 'on_budget abort needs a budget; set budget_ns'
    RESTART_SHRINKS = (
        'restart_maximum_ns {restart_maximum_ns} is below restart_ns {restart_ns}; the pause only '
        'grows')
    LOGICAL_WITHOUT_END = (
        'logical execution time needs an end of the interval; set a rate or deadline_ns')
    NO_SAFE_STATE = (
        'failure safe_state needs on_safe_state, which establishes the safe state; give it, or '
        'choose failure stop')
    ABORT_WITHOUT_PREEMPTION = (
        'on_budget abort needs a preemptive kernel; this clock has no signals. Choose on_budget '
        'warn')


@dataclass(frozen=True)
class TaskSpec:
    """
    The declaration of a task; see :func:`contradictions` for invalid combinations.

    :ivar name: unique in its kernel.
    :ivar priority: 1..99, higher runs first.
    :ivar period_ns: releases lie on the grid ``start + phase_ns + n * period_ns``; 0 means that
        only events release it (a publication, an interrupt, a timer, another task).
    :ivar phase_ns: offset of the grid, 0 or more.
    :ivar deadline_ns: from a release to the end of its job; 0 means the period.
    :ivar budget_ns: computing time of a job without preemption; 0 means no limit.
    :ivar on_budget: what happens to a job that exceeds it.
    :ivar overrun: what happens to a release that finds the last job unfinished.
    :ivar catch_up: maximum number of waiting releases, with that overrun policy.
    :ivar overrun_limit: a leaky bucket: each overrun adds one, ``overrun_leak`` jobs without an
        overrun remove one; above the limit the failure policy is applied. 0 means never.
    :ivar failure: what happens after an exception, an abort, or too many overruns.
    :ivar restart_ns: pause before the first restart; doubled each time, up to
        ``restart_maximum_ns``; reset after that time without a failure.
    :ivar critical: the watchdog monitors it.
    :ivar logical: logical execution time: inputs at the release, outputs at the deadline.
    """

    name: str
    priority: int
    period_ns: int = 0
    phase_ns: int = 0
    deadline_ns: int = 0
    budget_ns: int = 0
    on_budget: BudgetPolicy = BudgetPolicy.WARN
    overrun: OverrunPolicy = OverrunPolicy.SKIP
    catch_up: int = 1
    overrun_limit: int = 0
    overrun_leak: int = 100
    failure: FailurePolicy = FailurePolicy.CONTINUE
    restart_ns: int = 100 * NS_PER_MS
    restart_maximum_ns: int = 10 * NS_PER_S
    critical: bool = False
    logical: bool = False

    def __post_init__(self) -> None:
        raise_problems(self, _out_of_range(self) or broken_rules(self))


def checked_period_ns(name: str, rate_hz: Any) -> int:
    """
    Convert a task's rate to its period.

    :raises TaskError: the rate is not a number from 1e-6 Hz (11 days) to 100 kHz.
    """
    if isinstance(rate_hz, bool) or not isinstance(rate_hz, int | float) or not (
            RATE_MINIMUM_HZ <= rate_hz <= RATE_MAXIMUM_HZ):
        raise TaskError(f'task {name!r}: rate_hz {rate_hz!r} must be above 0 ({RATE_MINIMUM_HZ:g} '
                        f'or more) and at most {RATE_MAXIMUM_HZ:g} Hz')
    return period_from_rate(rate_hz)


def broken_rules(spec: TaskSpec, *, preemptive: bool = True,
                 can_be_safe: bool = True) -> list[str]:
    """Return the messages of the rules that a declaration violates."""
    declared = vars(spec)
    return [rule.value.format(**declared) for rule in contradictions(
        **declared, preemptive=preemptive, can_be_safe=can_be_safe)]


def raise_problems(spec: TaskSpec, found: Sequence[str]) -> None:
    """
    Raise an error if problems were found.

    :raises TaskError: with all of them.
    """
    if found:
        raise TaskError('\n'.join(f'task {spec.name!r}: {problem}' for problem in found))


def _out_of_range(spec: TaskSpec) -> list[str]:
    found = []
    priority = spec.priority
    if isinstance(priority, bool) or not isinstance(priority, int) or not (
            PRIORITY_MINIMUM <= priority <= PRIORITY_MAXIMUM):
        found.append(f'priority {priority!r} must be an integer from {PRIORITY_MINIMUM} to '
                     f'{PRIORITY_MAXIMUM}; the higher runs first')
    for key in ('period_ns', 'phase_ns', 'deadline_ns', 'budget_ns', 'restart_ns',
                'restart_maximum_ns'):
        value = getattr(spec, key)
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            found.append(f'{key} {value!r} must be an integer of nanoseconds, 0 or more')
    for key, low, high in (('catch_up', 1, BACKLOG_MAXIMUM),
                           ('overrun_limit', 0, OVERRUN_LIMIT_MAXIMUM),
                           ('overrun_leak', 1, 1_000_000_000)):
        value = getattr(spec, key)
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            found.append(f'{key} {value!r} must be an integer from {low} to {high}')
    for key, kind in (('overrun', OverrunPolicy), ('on_budget', BudgetPolicy),
                      ('failure', FailurePolicy)):
        value = getattr(spec, key)
        if not isinstance(value, kind):
            choices = ', '.join(f'{kind.__name__}.{each.name}' for each in kind)
            found.append(f'{key} {value!r} must be one of {choices}')
    return found


def contradictions(
    *, period_ns: int, deadline_ns: int, budget_ns: int, on_budget: BudgetPolicy,
    overrun: OverrunPolicy, overrun_limit: int, failure: FailurePolicy, restart_ns: int,
    restart_maximum_ns: int, logical: bool, preemptive: bool = True, can_be_safe: bool = True,
    **_others: object,
) -> Iterator[DeclarationRule]:
    """
    Find the rules that a declaration violates; its keywords are those of :class:`TaskSpec`.

    :param preemptive: the kernel's clock interrupts running jobs.
    :param can_be_safe: the task has an ``on_safe_state``.
    """
    aborts = on_budget is BudgetPolicy.ABORT
    yield from _of_budget(aborts, budget_ns, period_ns, deadline_ns)
    yield from _of_overrun(overrun, overrun_limit, failure, period_ns, deadline_ns)
    if aborts and not budget_ns:
        yield DeclarationRule.ABORT_WITHOUT_BUDGET
    if restart_maximum_ns < restart_ns:
        yield DeclarationRule.RESTART_SHRINKS
    if logical and not (deadline_ns or period_ns):
        yield DeclarationRule.LOGICAL_WITHOUT_END
    if failure is FailurePolicy.SAFE_STATE and not can_be_safe:
        yield DeclarationRule.NO_SAFE_STATE
    if aborts and not preemptive:
        yield DeclarationRule.ABORT_WITHOUT_PREEMPTION


def _of_budget(aborts: bool, budget_ns: int, period_ns: int, deadline_ns: int
               ) -> Iterator[DeclarationRule]:
    if aborts and period_ns and budget_ns > period_ns:
        yield DeclarationRule.BUDGET_ABOVE_PERIOD
    if aborts and deadline_ns and budget_ns > deadline_ns:
        yield DeclarationRule.BUDGET_ABOVE_DEADLINE


def _of_overrun(overrun: OverrunPolicy, overrun_limit: int, failure: FailurePolicy,
                period_ns: int, deadline_ns: int) -> Iterator[DeclarationRule]:
    if period_ns and deadline_ns > period_ns and overrun not in _QUEUEING:
        yield DeclarationRule.DEADLINE_ABOVE_PERIOD
    if not period_ns and overrun is not OverrunPolicy.SKIP:
        yield DeclarationRule.OVERRUN_WITHOUT_RATE
    if not overrun_limit:
        return
    if not period_ns:
        yield DeclarationRule.LIMIT_WITHOUT_RATE
    if overrun is OverrunPolicy.STOP:
        yield DeclarationRule.LIMIT_WITH_STOP
    if failure is FailurePolicy.CONTINUE:
        yield DeclarationRule.LIMIT_WITHOUT_POLICY
