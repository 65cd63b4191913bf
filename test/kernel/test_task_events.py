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


"""Tasks that are released by others and by publications."""

from __future__ import annotations

from kernel_tools import balance
from kernel_tools import MS
from kernel_tools import names
from kernel_tools import US
import pytest

from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import TraceLog
from rt_robot_os.topics import Bus

pytest.importorskip('std_msgs', reason='the ROS 2 message packages are not installed')

FLOAT = 'std_msgs/msg/Float64'


def test_events_that_find_the_task_waiting_are_served_by_one_job(kernel: Kernel) -> None:
    def job() -> None:
        for _ in range(5):
            kernel.release(low)

    low = kernel.add_task('low', lambda: None, priority=10)
    kernel.add_task('task', job, priority=50, rate_hz=100.0)
    kernel.run(30 * MS)
    assert (low.releases, low.runs, low.coalesced) == (15, 3, 12)
    assert balance(low) == 0


def test_events_that_find_the_task_running_make_it_run_once_more(
        kernel: Kernel, log: TraceLog) -> None:
    def job() -> None:
        if not task.runs:
            kernel.clock.spend(MS)
            for _ in range(3):
                kernel.release(task)
            kernel.clock.spend(MS)

    task = kernel.add_task('task', job, priority=50, rate_hz=10.0)
    kernel.run(10 * MS)
    assert names(log) == ['task', 'task']
    assert (task.releases, task.runs, task.coalesced) == (4, 2, 2)
    assert task.latency.maximum_ns == MS, 'from the event, not from the end of the job before'


def test_a_task_released_while_it_runs_keeps_its_place_among_equals(
        kernel: Kernel, log: TraceLog) -> None:
    def job() -> None:
        if not task.runs:
            kernel.release(task)
            kernel.clock.spend(10 * US)
            kernel.release(equal)

    task = kernel.add_task('task', job, priority=50, rate_hz=10.0)
    equal = kernel.add_task('equal', lambda: None, priority=50)
    kernel.run(10 * MS)
    assert names(log) == ['task', 'task', 'equal']


def test_a_period_that_ends_while_an_event_is_waiting_is_missed(kernel: Kernel) -> None:
    def job() -> None:
        if not task.runs:
            kernel.release(task)
            kernel.clock.spend(15 * MS)

    task = kernel.add_task('task', job, priority=50, rate_hz=100.0)
    kernel.run(30 * MS)
    # At 0 ms by time, at 15 ms by the event; at 10 ms missed; at 20 ms by time.
    assert (task.releases, task.runs, task.missed, task.coalesced) == (4, 3, 1, 0)


@pytest.mark.parametrize(('priority', 'before'), [(80, True), (50, False), (20, False)])
def test_a_released_task_runs_before_release_returns_only_if_it_is_higher(
        kernel: Kernel, priority: int, before: bool) -> None:
    ran: list[bool] = []

    def job() -> None:
        kernel.release(other)
        ran.append(other.runs == 1)

    other = kernel.add_task('other', lambda: None, priority=priority)
    kernel.add_task('task', job, priority=50, rate_hz=10.0)
    kernel.run(MS)
    assert ran == [before]
    assert other.runs == 1


@pytest.mark.parametrize(('priority', 'before'), [(80, True), (50, False), (20, False)])
def test_a_subscriber_has_the_message_before_publish_returns_only_if_it_is_higher(
        kernel: Kernel, priority: int, before: bool) -> None:
    bus = Bus(kernel)
    bus.declare('value', FLOAT)
    publisher = bus.publisher('value')
    received: list[float] = []
    seen: list[list[float]] = []

    def subscriber_job() -> None:
        while subscription.take():
            received.append(subscription.msg.data)

    def publisher_job() -> None:
        for value in (1.0, 2.0):
            publisher.msg.data = value
            publisher.publish()
            seen.append(received.copy())

    task = kernel.add_task('subscriber', subscriber_job, priority=priority)
    subscription = bus.subscribe('value', 'subscriber', task=task)
    kernel.add_task('publisher', publisher_job, priority=50, rate_hz=10.0)
    kernel.run(MS)
    assert seen == ([[1.0], [1.0, 2.0]] if before else [[], []])
    assert received == [1.0, 2.0]
    assert (task.runs, task.coalesced) == ((2, 0) if before else (1, 1))


def test_one_publication_wakes_all_subscribed_tasks_by_priority(
        kernel: Kernel, log: TraceLog) -> None:
    bus = Bus(kernel)
    bus.declare('value', FLOAT)
    for name, priority in (('c', 60), ('a', 80), ('b', 70), ('e', 20), ('d', 50)):
        task = kernel.add_task(name, lambda: None, priority=priority)
        bus.subscribe('value', name, task=task)
        bus.subscribe('value', f'{name} again', task=task)
    publisher = bus.publisher('value')
    kernel.add_task('publisher', publisher.publish, priority=50, rate_hz=10.0)
    kernel.run(MS)
    assert names(log) == ['publisher', 'a', 'b', 'c', 'd', 'e']
    assert all(t.releases == 1 for t in kernel.tasks), 'two subscriptions, but one publication'


def test_a_subscription_that_is_gone_wakes_its_task_no_more(kernel: Kernel) -> None:
    bus = Bus(kernel)
    bus.declare('value', FLOAT)
    task = kernel.add_task('subscriber', lambda: None, priority=80)
    first = bus.subscribe('value', 'first', task=task)
    second = bus.subscribe('value', 'second', task=task)
    publisher = bus.publisher('value')
    runs: list[int] = []

    def job() -> None:
        for gone in (None, first, second):
            if gone is not None:
                bus.unsubscribe(gone)
            publisher.publish()
            runs.append(task.runs)

    kernel.add_task('publisher', job, priority=50, rate_hz=10.0)
    kernel.run(MS)
    assert runs == [1, 2, 2]


def test_publishing_and_releasing_while_the_kernel_does_not_run_releases_no_task(
        kernel: Kernel) -> None:
    bus = Bus(kernel)
    bus.declare('value', FLOAT)
    task = kernel.add_task('subscriber', lambda: None, priority=80)
    subscription = bus.subscribe('value', 'subscriber', task=task)
    bus.publisher('value').publish()
    kernel.release(task)
    kernel.run(MS)
    assert (task.releases, task.runs) == (0, 0)
    assert subscription.take(), 'the sample is there nevertheless'


def test_the_idle_hook_is_preempted_by_any_task_and_its_errors_are_contained(
        kernel: Kernel, log: TraceLog) -> None:
    slacks: list[int] = []

    def idle(slack_ns: int) -> None:
        slacks.append(slack_ns)
        if low.runs < 2:
            before = low.runs
            kernel.clock.spend(25 * MS)
            seen.append(low.runs - before)
            kernel.release(low)
            seen.append(low.runs - before)
            raise ValueError('in the hook')

    seen: list[int] = []
    kernel.on_idle = idle
    kernel.add_task('top', lambda: None, priority=99, rate_hz=1.0)
    kernel.add_task('high', lambda: None, priority=90, rate_hz=100.0, phase_ns=5 * MS)
    low = kernel.add_task('low', lambda: None, priority=1, rate_hz=100.0, phase_ns=5 * MS)
    kernel.run(35 * MS)
    # After top ran at 0: at 5 and 15 ms within the hook, 25 ms at its end, then by release().
    assert slacks[0] == 5 * MS
    assert seen == [3, 4]
    assert names(log) == ['top'] + ['high', 'low'] * 3 + ['low']
    assert [(f.task, f.error) for f in kernel.failures] == [('idle', 'ValueError: in the hook')]
