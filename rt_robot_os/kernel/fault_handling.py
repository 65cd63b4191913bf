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


"""The policies for overruns, exceeded budgets, missed deadlines and failures."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
import functools
from typing import Final

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.kernel.black_box import BLOCKED
from rt_robot_os.kernel.black_box import FAILED
from rt_robot_os.kernel.black_box import MISS
from rt_robot_os.kernel.black_box import OVERRUN
from rt_robot_os.kernel.core import BLOCKED_NS
from rt_robot_os.kernel.core import KernelCore
from rt_robot_os.kernel.core import LATE_NS
from rt_robot_os.kernel.failure import FailureReport
from rt_robot_os.kernel.interference import blame
from rt_robot_os.kernel.interference import RECORDS_MAXIMUM
from rt_robot_os.kernel.resource import Resource
from rt_robot_os.kernel.spec import FailurePolicy
from rt_robot_os.kernel.spec import OverrunPolicy
from rt_robot_os.kernel.spec import TaskState
from rt_robot_os.kernel.task import Task

_SUSPECTS_EVERY_NS: Final = 10 * NS_PER_MS
# A job that waits in system calls instead of computing is aborted after this many budgets.
WAITING_LIMITS: Final = 20


class FaultHandling:
    """
    The policies for overruns, budgets, deadlines and failures. All methods are called locked.

    :param kernel: of the tasks.
    :param resources: of the kernel, by name.
    """

    __slots__ = ('_kernel', '_resources', '_suspects_ns', '_ended')

    def __init__(self, kernel: KernelCore, resources: Mapping[str, Resource]) -> None:
        self._kernel = kernel
        self._resources = resources
        self._suspects_ns = 0
        # The last job with steal time that was found at its end: task, start, steal time.
        self._ended: tuple[Task | None, int, int] = (None, 0, 0)

    # ---- overruns ----------------------------------------------------------------------------

    def account_missed_releases(self, task: Task, due_ns: int, now_ns: int) -> int:
        """
        Account for the points of a task's grid that passed while its job waited or ran.

        :param due_ns: the first of them.
        :return: the next release; 0 when the grid restarts at the end of that job.
        """
        kernel = self._kernel
        period_ns = task.period_ns
        unserved = (min(now_ns, kernel.end_ns - 1) - due_ns) // period_ns + 1
        if unserved <= 0:
            return due_ns
        task.releases += unserved
        next_ns = due_ns + unserved * period_ns
        if task.held:
            task.missed += unserved
            return next_ns
        task.overruns += unserved
        kernel.record((OVERRUN, task, due_ns, unserved))
        if task.spec.overrun_limit:
            self._fill_bucket(task, unserved, now_ns)
        policy = task.spec.overrun
        if policy is OverrunPolicy.CATCH_UP:
            kept = min(unserved, task.spec.catch_up - len(task.backlog))
            task.backlog.extend(due_ns + n * period_ns for n in range(kept))
            task.missed += unserved - kept
            task.follow_up = True
        elif policy is OverrunPolicy.REPHASE:
            task.missed += unserved - 1
            task.rephasing = True
            task.follow_up = True
            return 0
        else:
            task.missed += unserved
            if policy is OverrunPolicy.STOP:
                self.request_policy(task, FailurePolicy.STOP, f'{unserved} releases found the '
                                    'previous job unfinished (overrun: stop)', now_ns)
        return next_ns

    def account(self, task: Task, now_ns: int) -> None:
        """Update the counters of a task before they are read or reset."""
        kernel = self._kernel
        now_ns = min(now_ns, kernel.end_ns - 1)
        if kernel.release_due(task.priority, now_ns) and task.priority > kernel.level:
            kernel.pending = True
        if task.next_ns and task.next_ns <= now_ns:
            next_ns = self.account_missed_releases(task, task.next_ns, now_ns)
            task.next_ns, task.next_period_ns = next_ns, task.period_ns

    def _fill_bucket(self, task: Task, overruns: int, now_ns: int) -> None:
        spec = task.spec
        leaked = max(0, task.runs - task.bucket_runs) // spec.overrun_leak
        task.bucket = max(0, task.bucket - leaked) + overruns
        task.bucket_runs = task.runs
        if task.bucket > spec.overrun_limit:
            reason = (f'{task.bucket} overruns; one is subtracted per {spec.overrun_leak} jobs '
                      f'without an overrun (overrun_limit: {spec.overrun_limit})')
            self.request_policy(task, spec.failure, reason, now_ns)
            task.bucket = 0

    # ---- limits ------------------------------------------------------------------------------

    def long_execution(self, task: Task, execution_ns: int) -> int:
        """
        Check a job that computed for longer than any before, or than its budget.

        :return: its computing time without steal time.
        """
        kernel = self._kernel
        now_ns = kernel.now_ns()
        if task.aborts:
            gap_ns = execution_ns - task.waited_ns - (
                kernel.clock.computed_ns() - task.computed_ns)
            taken_ns = self.attribute_gap(task, now_ns, gap_ns) if gap_ns > LATE_NS else 0
        else:
            taken_ns = self.steal_time_of(task, now_ns, execution_ns)
        if taken_ns:
            self._ended = (task, task.start_ns, taken_ns)
            task.execution_total_ns -= taken_ns
            execution_ns -= taken_ns
        longest_ns = task.execution_maximum_ns = max(task.execution_maximum_ns, execution_ns)
        task.execution_limit_ns = min(longest_ns, task.budget_ns)
        task.budget_exceeded += execution_ns - task.waited_ns > task.budget_ns
        return execution_ns

    def long_response(self, task: Task, release_ns: int, end_ns: int) -> None:
        """Check a job with the longest response time so far, or one above the deadline."""
        response_ns = end_ns - release_ns
        longest_ns = task.response_maximum_ns = max(task.response_maximum_ns, response_ns)
        task.response_limit_ns = min(longest_ns, task.deadline_ns)
        if response_ns > task.deadline_ns:
            self._record_miss(task, release_ns, end_ns)

    def _record_miss(self, task: Task, release_ns: int, end_ns: int) -> None:
        """Record that a job ended after its deadline."""
        kernel = self._kernel
        late_ns = end_ns - release_ns - task.deadline_ns
        task.deadline_missed += 1
        if end_ns - self._suspects_ns >= _SUSPECTS_EVERY_NS:  # must not add to an overload
            self._suspects_ns = end_ns
            task.suspects = blame(
                kernel.black_box.latest(RECORDS_MAXIMUM), task, release_ns, end_ns)
        task.miss = (task.runs, release_ns, late_ns)
        kernel.record((MISS, task, end_ns, late_ns))

    # ---- blocking ----------------------------------------------------------------------------

    def charge_blocking(self, task: Task, level: int, at_ns: int, late_ns: int) -> int:
        """
        Charge a late interrupt to the job that ran; the tasks it released are ready by now.

        :param at_ns: when the job could be interrupted again, or when it had ended.
        :return: the job's steal time that was not known before.
        """
        kernel = self._kernel
        taken_ns = 0
        if late_ns > LATE_NS:
            own_ns = at_ns - task.start_ns - kernel.stolen_ns
            taken_ns = self.steal_time_of(task, at_ns, own_ns)
            known = self._ended
            late_ns = min(late_ns, own_ns) - taken_ns
            if known[0] is task and known[1] == task.start_ns:  # found at the end of the job
                late_ns -= known[2]
        if late_ns > task.blocked_maximum_ns:
            task.blocked_maximum_ns = late_ns
        if late_ns > BLOCKED_NS and kernel.ready_above(level):
            kernel.record((BLOCKED, task, at_ns, late_ns))
        return taken_ns

    def steal_time_of(self, task: Task, now_ns: int, window_ns: int) -> int:
        """
        Return the steal time in the computing time of a job that seems long.

        :param window_ns: that time, up to now, without the steal time that is known.
        """
        if window_ns <= LATE_NS:
            return 0
        kernel = self._kernel
        taken_ns = kernel.steal_time.attribute(now_ns, window_ns)
        if taken_ns > NS_PER_MS:
            kernel.black_box.mark(now_ns, f'Linux took the CPU from {task.name} for '
                                          f'{taken_ns / NS_PER_MS:.1f} ms')
        return taken_ns

    def attribute_gap(self, task: Task, now_ns: int, gap_ns: int) -> int:
        """
        Attribute time in which a job with ``on_budget: abort`` did not compute.

        Steal time is subtracted from its time. The rest is waiting of its own, which does not
        count towards its budget, up to a limit. After the first TaskAborted it counts.

        :param gap_ns: that time, without the part that is known.
        :return: the steal time in it.
        """
        taken_ns = self.steal_time_of(task, now_ns, gap_ns)
        gap_ns -= taken_ns
        if gap_ns > LATE_NS and not (task.grace_used or task.containing):
            waited_ns = min(gap_ns, WAITING_LIMITS * task.budget_ns - task.waited_ns)
            task.waited_ns += waited_ns
            if waited_ns > NS_PER_MS:
                self._kernel.black_box.mark(
                    now_ns, f'{task.name} waited for {waited_ns / NS_PER_MS:.1f} ms, in a system '
                            'call or for the host')
        return taken_ns

    # ---- failures ----------------------------------------------------------------------------

    def after_job(self, task: Task, failure: FailureReport | None, outcome: int,
                  now_ns: int) -> None:
        """
        Apply the policies after a job that failed, was aborted, or has a follow-up.

        :param outcome: of the job, as in its record.
        """
        kernel = self._kernel
        task.failures += outcome == FAILED
        task.limit_ns, task.containing, task.grace_used = 0, False, False
        policy, task.requested_policy = task.requested_policy, None
        inside, task.inside = task.inside, 0
        task.follow_up = bool(task.successors)
        if failure is not None:
            kernel.note_failure(failure)
            policy = policy or task.spec.failure
        if inside:
            for resource in self._resources.values():
                resource.abandon(task)
            kernel.note_failure(FailureReport(
                task.name, now_ns, 'a job ended inside a resource; use it with `with`', ()))
        if task.aborts_raised:
            task.aborted += outcome != FAILED
            policy = self._after_aborts(task, policy, now_ns)
        task.abort_pending = False  # an abort would be too late
        if task.held:  # its safe state has run
            self.withdraw(task)
            task.pending = True
        elif policy is not None and policy is not FailurePolicy.CONTINUE:
            self._apply(task, policy, now_ns)
        if task.rephasing:
            self._rephase(task, now_ns)
        elif task.backlog and not task.pending:
            kernel.release_due(task.priority, now_ns)  # earlier releases go first
            kernel.enqueue(task, task.backlog.popleft(), task.period_ns)
            task.follow_up = True
        kernel.wake(task.successors, now_ns)
        kernel.rearm_sources(task)

    def _after_aborts(self, task: Task, policy: FailurePolicy | None,
                      now_ns: int) -> FailurePolicy | None:
        """Return the policy for an aborted task: stop it if one abort did not end the job."""
        delivered, task.aborts_raised = task.aborts_raised, 0
        if delivered == 1:
            return policy or task.spec.failure
        self._kernel.note_failure(FailureReport(
            task.name, now_ns, f'continued after TaskAborted, {delivered} times; stopped: '
            'clean up in `finally` and never catch BaseException', ()))
        return FailurePolicy.STOP

    def _rephase(self, task: Task, now_ns: int) -> None:
        kernel = self._kernel
        task.rephasing = False
        if task.pending:  # held, or released by an event as well
            task.missed += 1
        else:
            kernel.release_due(task.priority, now_ns)
            kernel.enqueue(task, now_ns, task.period_ns)
        task.next_ns = 0
        kernel.add_timer(task, now_ns + task.period_ns, task.period_ns)

    def withdraw(self, task: Task) -> None:
        """Drop the waiting jobs of a task and count them as missed."""
        task.missed += len(task.backlog)
        task.backlog.clear()
        self._kernel.withdraw(task)

    def request_policy(self, task: Task, policy: FailurePolicy, reason: str, now_ns: int) -> None:
        """Apply a policy for a reason other than an exception, when the job has ended."""
        self._kernel.note_failure(FailureReport(task.name, now_ns, reason, ()))
        task.requested_policy = policy
        if task.busy or (task.pending and not task.held):
            task.follow_up = True
        else:
            task.requested_policy = None
            self._apply(task, policy, now_ns)

    def _apply(self, task: Task, policy: FailurePolicy, now_ns: int) -> None:
        """Hold a task that has no running job."""
        kernel = self._kernel
        self.withdraw(task)
        if policy is FailurePolicy.SAFE_STATE:
            if task.on_safe_state is not None:
                self._run_next(task, task.on_safe_state, now_ns)
            task.state = TaskState.SAFE
        elif policy is FailurePolicy.RESTART:
            task.state = TaskState.BACKOFF
            spec = task.spec
            if now_ns - task.resume_ns > spec.restart_maximum_ns:
                task.restart_ns = spec.restart_ns
            task.resume_ns = now_ns + task.restart_ns
            kernel.schedule(task.resume_ns,
                            functools.partial(self._end_backoff, task, task.resume_ns),
                            task.priority)
            task.restart_ns = min(2 * task.restart_ns, spec.restart_maximum_ns)
        else:
            task.state = TaskState.STOPPED
        task.pending = True

    def _end_backoff(self, task: Task, resume_ns: int, now_ns: int) -> None:
        if task.state is TaskState.BACKOFF and task.resume_ns == resume_ns:
            self.resume(task, now_ns)

    def resume(self, task: Task, now_ns: int) -> None:
        """Let a held task make jobs again."""
        kernel = self._kernel
        if not task.held:
            return
        if task.next_ns and not task.busy:
            kernel.return_timer(task, now_ns)
        self.withdraw(task)
        task.state = TaskState.ACTIVE
        kernel.rearm_sources(task)
        if task.on_restart is not None:
            self._run_next(task, task.on_restart, now_ns)

    def _run_next(self, task: Task, function: Callable[[], object], now_ns: int) -> None:
        """Have the next job of a task call another function."""
        def job() -> None:
            task.function = task.body
            function()

        task.function = job
        self._kernel.wake((task,), now_ns)
        if function is task.on_safe_state:
            task.follow_up = True
