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

"""Is a set of tasks schedulable: utilisation, blocking and response times, task by task."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping
from collections.abc import Sequence
from fractions import Fraction
import math

from rt_robot_os.tools.plan.blocking import blocking_of
from rt_robot_os.tools.plan.response import busy_period_ns
from rt_robot_os.tools.plan.response import Load
from rt_robot_os.tools.plan.response import merged
from rt_robot_os.tools.plan.response import NoBoundError
from rt_robot_os.tools.plan.response import response_from_arrival_ns
from rt_robot_os.tools.plan.response import response_ns
from rt_robot_os.tools.plan.result import Analysis
from rt_robot_os.tools.plan.result import TaskResult
from rt_robot_os.tools.plan.result import Verdict
from rt_robot_os.tools.plan.streams import Stream
from rt_robot_os.tools.plan.streams import StreamTable
from rt_robot_os.tools.plan.task import check
from rt_robot_os.tools.plan.task import Overhead
from rt_robot_os.tools.plan.task import PlannedTask

# Chains are followed until nothing changes, or this many times.
PASSES_MAXIMUM = 200
_NEAR = 1e-9


def analyse(tasks: Sequence[PlannedTask], overhead: Overhead = Overhead()) -> Analysis:
    """
    Analyse a set of tasks.

    :raises ConfigError: a value makes no sense; the error lists all of them.
    """
    check(tasks, overhead)
    return _Analyser(tasks, overhead).run()


def judge(tasks: Sequence[PlannedTask], overhead: Overhead = Overhead()) -> Analysis:
    """
    Analyse as :func:`analyse` does, but compute no bounds that no verdict depends on.

    For searches that analyse many variants; the values must be checked already.
    """
    return _Analyser(tasks, overhead, needed=True).run()


def fits(tasks: Sequence[PlannedTask], overhead: Overhead = Overhead()) -> bool:
    """Return whether nothing fails in what :func:`judge` finds; the first failure is enough."""
    return not _Analyser(tasks, overhead, needed=True, first=True).run().failed


def busy_until_ns(tasks: Sequence[PlannedTask], overhead: Overhead, task: PlannedTask) -> int:
    """
    Bound the time for which tasks of a priority and above are busy without a pause.

    :param task: one of the tasks, of that priority; it has a bound itself.
    :raises NoBoundError: it does not end in reasonable time.
    """
    found = _Analyser(tasks, overhead)
    found.run()
    return found.busy_ns(task)


class _Analyser:
    """One set of tasks, and the loads that it makes at each priority."""

    def __init__(self, tasks: Sequence[PlannedTask], overhead: Overhead,
                 needed: bool = False, first: bool = False) -> None:
        self._tasks = sorted(tasks, key=lambda task: -task.priority)
        self._overhead = overhead
        table = StreamTable(tasks)
        self._streams: Mapping[str, tuple[Stream, ...]] = table.streams
        self._problems = table.problems
        self._all = [s for task in self._tasks for s in self._streams[task.name]]
        self._unknown = {task.name: self._why_unknown(task) for task in self._tasks}
        self._boundless: set[str] = set()
        self._releasing = {parent for s in self._all for parent in s.parents}
        self._needed = needed
        self._first = first
        self._found: dict[str, TaskResult] = {}

    def run(self) -> Analysis:
        """Iterate until no chain changes any more: jitters only ever grow."""
        before: list[int] = []
        for _ in range(PASSES_MAXIMUM):
            self._found = self._judge_all()
            if len(self._found) < len(self._tasks):
                break
            boundless = {r.task.name for r in self._found.values() if r.response_ns is None}
            after = [s.chain_ns for s in self._all if s.parents or s in self._releasing]
            if after == before and boundless == self._boundless or not after:
                break
            before, self._boundless = after, boundless
        else:
            self._give_up()
        ticks = math.fsum(cost / period for period, _, cost in self._tick_loads())
        jobs = math.fsum(self._overhead.job_ns / s.period_ns for s in self._all)
        work, service = (math.fsum(
            (s.task.execution_ns or 0) / s.period_ns for s in self._all if s.task.judged is judged)
            for judged in (True, False))
        return Analysis(
            tuple(self._found.values()), work + jobs + ticks, service, jobs + ticks)

    def busy_ns(self, task: PlannedTask) -> int:
        """
        Return the longest busy period of a priority, once the chains are known.

        Tasks below it run in it only while they block. So what they release, and what that
        releases in turn, was released when it began, and each task once, however many did it.
        """
        p = task.priority
        blocking_ns = blocking_of(task, self._tasks).length_ns
        above = [(s, s.chains(p)) for s in self._all if s.task.priority >= p]
        chains = {chain for _, found in above for chain in found}
        loads = self._tick_loads() + self._loads([s for s, found in above if not found], p)
        cost_of = {t.name: (t.execution_ns or 0) + self._overhead.job_ns for t in self._tasks}
        # What blocks may release once more.
        times = 2 if blocking_ns else 1
        chained_ns = sum(cost_of[chain[-1]] for chain in chains)
        return busy_period_ns(blocking_ns + times * chained_ns, loads)

    # ---- loads -------------------------------------------------------------------------------

    def _loads(self, streams: Iterable[Stream], level: int) -> list[Load]:
        """Return the loads of streams as a level sees them, with the present chains."""
        known: dict[Stream, int] = {}
        job_ns = self._overhead.job_ns
        return [(s.period_ns, s.jitter_at(level, known), (s.task.execution_ns or 0) + job_ns)
                for s in streams]

    def _tick_loads(self) -> list[Load]:
        cost_ns = self._overhead.tick_ns
        if not cost_ns:
            return []
        # What a logical task publishes at its deadline takes a timer as well.
        return [(s.period_ns, s.jitter_ns, cost_ns) for s in self._all if s.ticks] + [
            (s.period_ns, s.late_ns, cost_ns) for s in self._all if s.task.logical]

    def _why_unknown(self, task: PlannedTask) -> str:
        if task.name in self._problems:
            return self._problems[task.name]
        return '' if task.execution_ns else 'its execution time is not known'

    def _judge_all(self) -> dict[str, TaskResult]:
        """Judge all tasks, or up to the first that fails: later passes only make it later."""
        found: dict[str, TaskResult] = {}
        for task in self._tasks:
            found[task.name] = self._judge(task)
            if self._first and found[task.name].verdict.bad and task.judged:
                break
        return found

    # ---- a task ------------------------------------------------------------------------------

    def _judge(self, task: PlannedTask) -> TaskResult:
        streams = self._streams[task.name]
        blocking = blocking_of(task, self._tasks)
        unknown = self._unknown[task.name] or self._obstacle(task) or blocking.unknown
        known = task.execution_ns is not None and task.name not in self._problems
        utilisation = math.fsum(
            (task.execution_ns or 0) / s.period_ns for s in streams) if known else None
        jitter_ns = max((s.late_ns for s in streams), default=0)
        if unknown:
            return TaskResult(task, Verdict.UNKNOWN, utilisation, None, blocking, jitter_ns,
                              reason=unknown)
        level = self._level(task)
        facts = (utilisation, level, blocking, jitter_ns)
        if level > 1:
            return TaskResult(task, Verdict.OVERLOAD, *facts, reason=(
                f'the tasks of its priority and above want {level:.1%} of the processor'))
        if self._needed and not task.limit_ns and self._releasing.isdisjoint(streams):
            return TaskResult(task, Verdict.FREE, *facts)
        try:
            response, timed, chain = self._bounds(task, blocking.length_ns)
        except NoBoundError as error:
            return TaskResult(task, Verdict.UNBOUNDED, *facts, reason=str(error))
        verdict, reason = self._verdict(task, response, timed)
        return TaskResult(task, verdict, *facts, response_ns=response,
                          chain_ns=chain if task.events else None, reason=reason)

    def _obstacle(self, task: PlannedTask) -> str:
        """Name what may hold a task up for an unknown time."""
        for other in self._tasks:
            if other.priority < task.priority:
                break
            if other is not task and self._unknown[other.name]:
                return f'it may wait for {other.name!r}: {self._unknown[other.name]}'
            # Of a task that others release, how late it comes matters to those below.
            for parent in (p for s in self._streams[other.name] for p in s.parents):
                if parent.task.name in self._boundless:
                    subject = ('it is' if other is task
                               else f'it may wait for {other.name!r}, which is')
                    return f'{subject} released by {parent.task.name!r}, and that has no bound'
        return ''

    def _level(self, task: PlannedTask) -> float:
        """Return the part of the processor of all of a priority and above; exact about 1."""
        streams = [s for s in self._all if s.task.priority >= task.priority]
        costs = self._loads(streams, task.priority) + self._tick_loads()
        level = math.fsum(cost / period for period, _, cost in costs)
        if abs(level - 1) < _NEAR:
            exact = sum((Fraction(cost, period) for period, _, cost in costs), Fraction(0))
            return 1.0 if exact == 1 else level if (level > 1) is (exact > 1) else (
                math.nextafter(1.0, 2.0 if exact > 1 else 0.0))
        return level

    def _bounds(self, task: PlannedTask, blocking_ns: int) -> tuple[int, int, int]:
        """Bound a response from the release, from the timer's alone, and of the whole chain."""
        p = task.priority
        higher = merged(self._tick_loads() + self._loads(
            (s for s in self._all if s.task.priority > p), p))
        level = [s for s in self._all if s.task.priority == p]
        busy_ns = busy_period_ns(blocking_ns, higher + self._loads(level, p))
        response = timed = chain = 0
        for own in self._streams[task.name]:
            load, = self._loads((own,), p)
            equal = self._loads((s for s in level if s is not own), p)
            if own.timer:
                longest = response_ns(blocking_ns, load, equal, higher, busy_ns)
                if task.backlog and equal and longest > task.period_ns:
                    # A kept release goes to the end of the queue only when the job before has
                    # ended, so that any equal may come first.
                    longest = response_ns(blocking_ns, load, (), higher + equal, busy_ns)
                timed = own.chain_ns = longest
            else:
                longest = response_from_arrival_ns(blocking_ns, load, equal, higher, busy_ns)
                own.chain_ns = longest + own.late_ns
                if own.inside(p):
                    # Equals may come until it is ready itself.
                    later = [(t, j + own.late_ns, c) for t, j, c in equal]
                    own.chain_ns = min(own.chain_ns, response_ns(
                        blocking_ns, load, later, higher, busy_ns))
            response = max(response, longest)
            if task.logical:
                own.chain_ns = max(own.chain_ns, own.late_ns + task.limit_ns)
            chain = max(chain, own.chain_ns)
        return response, timed, chain

    def _verdict(self, task: PlannedTask, response: int, timed: int) -> tuple[Verdict, str]:
        limit_ns = task.limit_ns
        if not limit_ns:
            return Verdict.FREE, ''
        if response > limit_ns:
            return Verdict.LATE, 'it may end after its deadline'
        waiting = -(-timed // task.period_ns) - 1 if task.period_ns else 0
        if waiting > task.backlog:
            kept = (f'catch_up keeps {task.backlog}' if task.backlog
                    else 'its overrun policy keeps none')
            return Verdict.SKIPPED, (
                f'{waiting} release{"s" if waiting > 1 else ""} may come before a job has ended, '
                f'and {kept}')
        return Verdict.OK, ''

    def _give_up(self) -> None:
        """Keep only what no chain can touch: the levels above all chains."""
        highest = max(s.task.priority for s in self._all if s.parents)
        for name, r in self._found.items():
            if r.task.priority <= highest and r.verdict is not Verdict.UNKNOWN:
                self._found[name] = TaskResult(
                    r.task, Verdict.UNBOUNDED, r.utilisation, r.level, r.blocking, r.jitter_ns,
                    reason='no bound was found: the chains of releases did not settle within '
                    f'{PASSES_MAXIMUM} passes')
