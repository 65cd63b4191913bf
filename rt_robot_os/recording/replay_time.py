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
The time in a replay, which advances as in the real run.

A job starts and publishes at its recorded times, and is preempted again in between. Numbers and
times come from the recorded schedule of the core.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import Task
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.linux.timer import REPEAT_NS
from rt_robot_os.topics import Bus
from rt_robot_os.topics import Publisher
from rt_robot_os.topics import Subscription

# A task that a publication releases starts slightly earlier than in the real run.
_EARLY_NS: Final = NS_PER_MS


class ReplayClock(VirtualClock):
    """A virtual clock on which a job can wait for a time."""

    def pass_until(self, at_ns: int) -> None:
        """Advance to a time; jobs that become due preempt the caller, and also take time."""
        while self._now_ns < at_ns:
            first_ns = min(self._timer_ns, self._spare_ns)
            self._now_ns = max(self._now_ns, min(at_ns, first_ns))
            if self._expire_timers(self._now_ns + REPEAT_NS) and self._on_tick is not None:
                self._on_tick()


class Schedule:
    """The recorded times of jobs and publications of replayed tasks."""

    def __init__(self, clock: ReplayClock) -> None:
        self._clock = clock
        self.jobs: dict[str, deque[tuple[int, int]]] = {}
        # By topic and task: several tasks may publish on a topic.
        self.moments: dict[tuple[str, str], deque[int]] = {}
        self.numbers: dict[tuple[str, int], int] = {}
        self.by_task: dict[str, deque[int]] = {}
        # Tasks that have read a sample since their job started, or since they published.
        self.fed: set[str] = set()
        # The times at which coroutines continued, by task.
        self._went_on: dict[str, deque[int]] = {}

    def of_coroutine(self, task: str) -> Callable[[Callable[[], bool]], bool]:
        """Add a coroutine; return the function that decides whether it continues."""
        self._went_on[task] = deque()
        return lambda over: self._goes_on(task, over)

    def add_going_on(self, task: str, at_ns: int) -> None:
        """Add a time at which a coroutine continued; in order of time."""
        if task in self._went_on:
            self._went_on[task].append(at_ns)

    def _goes_on(self, task: str, over: Callable[[], bool]) -> bool:
        """Evaluate what a coroutine awaits at the time at which the real run did."""
        moments, now_ns = self._went_on[task], self._clock.now_ns()
        while moments and moments[0] < now_ns:
            moments.popleft()
        if moments and moments[0] <= self._job_end(task, now_ns):
            self._clock.pass_until(moments.popleft())
            return over()
        # Earlier releases did not record it. A job that published again must have continued.
        return over() or self._pass_to_publication(task) and over()

    def add_job(self, task: str, start_ns: int, end_ns: int) -> None:
        """Add a job; in order of their starts."""
        self.jobs.setdefault(task, deque()).append((start_ns, end_ns))

    def add_publication(self, task: str, topic: str, number: int, at_ns: int) -> None:
        """Add a publication; in order of time."""
        self.moments.setdefault((topic, task), deque()).append(at_ns)
        self.by_task.setdefault(task, deque()).append(at_ns)
        self.numbers[topic, at_ns] = number

    def _job_end(self, task: str, now_ns: int) -> int:
        """Return the recorded end of a task's current job; -1 if there was no such job."""
        jobs = self.jobs.get(task)
        while jobs and jobs[0][1] < now_ns:
            jobs.popleft()
        return jobs[0][1] if jobs and jobs[0][0] <= now_ns + _EARLY_NS else -1

    def wait_for(self, topic: str, task: str) -> None:
        """Advance to the recorded time of this publication."""
        self.fed.discard(task)
        now_ns = self._clock.now_ns()
        moments = self.moments.get((topic, task))
        while moments and moments[0] < now_ns:
            moments.popleft()
        if moments and moments[0] <= self._job_end(task, now_ns):
            self._clock.pass_until(moments.popleft())

    def wait_for_more(self, task: str) -> bool:
        """
        Advance to the next recorded publication of a job that finds nothing to read.

        Since it published, it had read a sample: a task of higher priority had preempted it.

        :return: whether time has passed.
        """
        # A coroutine evaluates everything it awaits, in order, after time has passed.
        return (task not in self.fed and task not in self._went_on
                and self._pass_to_publication(task))

    def _pass_to_publication(self, task: str) -> bool:
        """
        Advance to the next publication of the recorded job, if it made one more.

        :return: whether it did.
        """
        now_ns = self._clock.now_ns()
        moments = self.by_task.get(task)
        while moments and moments[0] <= now_ns:
            moments.popleft()
        if not moments or moments[0] > self._job_end(task, now_ns):
            return False
        self._clock.pass_until(moments.popleft())
        return True


class ReplayPublisher(Publisher):
    """A publisher that publishes at the recorded time."""

    __slots__ = ('_schedule', '_task')

    def __init__(self, topic: Any, schedule: Schedule, task: str) -> None:
        super().__init__(topic)
        self._schedule = schedule
        self._task = task

    def publish(self, stamp_ns: int = 0) -> None:
        """Publish the message at its recorded time."""
        self._schedule.wait_for(self.topic.name, self._task)
        super().publish(stamp_ns)

    def send(self, data: memoryview, stamp_ns: int = 0) -> None:
        """Publish CDR at its recorded time."""
        self._schedule.wait_for(self.topic.name, self._task)
        super().send(data, stamp_ns)


class ReplaySubscription(Subscription):
    """A subscription of a task that may have been preempted before it read."""

    __slots__ = ('schedule',)

    schedule: Schedule

    def take(self) -> bool:
        """Copy the oldest unread sample, also one that came while the real job was preempted."""
        schedule, name = self.schedule, self.name
        if super().take() or (schedule.wait_for_more(name) and super().take()):
            schedule.fed.add(name)
            return True
        return False

    def latest(self) -> bool:
        """Copy the newest sample."""
        behind = self.topic.head - self.next_seq - 1
        if behind > 0:
            self.skipped += behind
            self.next_seq += behind
        return super().take()


class ReplayBus(Bus):
    """
    A bus whose tasks publish at the recorded times.

    :ivar made: topic and task of each publisher.
    """

    def __init__(self, kernel: Kernel, schedule: Schedule) -> None:
        super().__init__(kernel)
        self.made: list[tuple[str, str]] = []
        self._schedule = schedule

    def publisher(self, name: str, task: Task | None = None) -> Publisher:
        """Make a publisher."""
        if task is not None:
            self.made.append((name, task.name))
        if task is None or task.logical is not None:
            return super().publisher(name, task)
        return ReplayPublisher(self.topic(name), self._schedule, task.name)

    def subscribe(self, name: str, subscriber: str, *, initial: bool = False,
                  task: Task | None = None, buffer: memoryview | None = None,
                  newest: bool = False, counted: bool = True) -> Subscription:
        """Make a subscription."""
        if newest or buffer is not None or not counted:
            return super().subscribe(name, subscriber, initial=initial, task=task, buffer=buffer,
                                     newest=newest, counted=counted)
        subscription = ReplaySubscription(
            self._topic_with_capacity(name, subscriber), subscriber, initial=initial, task=task)
        subscription.schedule = self._schedule
        return self._add(subscription, task)
