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


"""Many features together on the real clock: invariants of any interleaving."""

from __future__ import annotations

import os

from kernel_tools import balance
from kernel_tools import MS
from kernel_tools import US
import pytest

from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import MonotonicClock
from rt_robot_os.kernel import TraceLog
from rt_robot_os.topics import Bus

pytest.importorskip('std_msgs', reason='the ROS 2 message packages are not installed')

DURATION_NS = 400 * MS
TIMED = 20


class Storm:
    """Timed tasks that publish and write to a pipe, subscribers that check what they get."""

    def __init__(self) -> None:
        self.kernel = Kernel(MonotonicClock())
        self.bus = Bus(self.kernel)
        self.reading, self.writing = os.pipe()
        os.set_blocking(self.writing, False)
        self.came = 0
        for number in range(3):
            self.bus.declare(f't{number}', 'std_msgs/msg/Int64', depth=8)
            for priority in (15, 45, 75):
                self.add_subscriber(number, priority + number)
        for number in range(TIMED):
            self.add_timed(number)
        reader = self.kernel.add_task('reader', self.read, priority=60)
        self.kernel.add_interrupt(self.reading, reader)

    def add_timed(self, number: int) -> None:
        publisher = self.bus.publisher(f't{number % 3}')
        topic = publisher.topic

        def job() -> None:
            publisher.msg.data = publisher.msg.data + 1
            publisher.publish()
            if number % 4 == 0:
                os.write(self.writing, b'x')
            self.kernel.clock.spend(number * 3 * US)
            assert topic.head

        self.kernel.add_task(f'timed {number}', job, priority=5 + 4 * number,
                             rate_hz=200.0 + 37 * number, phase_ns=number * 100 * US)

    def add_subscriber(self, number: int, priority: int) -> None:
        def job() -> None:
            before = subscription.seq
            while subscription.take():
                assert subscription.seq > before
                before = subscription.seq

        name = f'subscriber of t{number}, {priority}'
        task = self.kernel.add_task(name, job, priority=priority)
        subscription = self.bus.subscribe(f't{number}', name, task=task)

    def read(self) -> None:
        try:
            while True:
                self.came += len(os.read(self.reading, 1000))
        except BlockingIOError:
            pass

    def close(self) -> None:
        os.close(self.reading)
        os.close(self.writing)


@pytest.fixture(scope='module')
def storm() -> tuple[Storm, TraceLog]:
    made = Storm()
    log = TraceLog(capacity=1_000_000)
    made.kernel.trace = log
    made.kernel.run(DURATION_NS)
    made.close()
    return made, log


def test_a_job_is_only_interrupted_by_higher_ones_that_end_before_it_goes_on(
        storm: tuple[Storm, TraceLog]) -> None:
    kernel, events = storm[0].kernel, storm[1].events()
    assert any(event.depth for event in events), 'no task was interrupted'
    stack: list[str] = []
    for event in events:
        if event.kind == 'start':
            assert event.depth == len(stack)
            if stack:
                assert kernel.task(event.task).priority > kernel.task(stack[-1]).priority
            stack.append(event.task)
        else:
            assert stack.pop() == event.task
    assert not stack
    assert [e.at_ns for e in events] == sorted(e.at_ns for e in events)


def test_every_release_is_accounted_for(storm: tuple[Storm, TraceLog]) -> None:
    kernel = storm[0].kernel
    assert not kernel.failures, kernel.failures[0]
    assert not any(map(balance, kernel.tasks))
    for number in range(TIMED):
        task = kernel.task(f'timed {number}')
        grid = -(-(DURATION_NS - task.spec.phase_ns) // task.period_ns)
        assert task.releases == grid, 'each point of the grid is released, once'
        assert sum(task.execution.counts) == sum(task.latency.counts) == task.runs


def test_every_sample_is_accounted_for(storm: tuple[Storm, TraceLog]) -> None:
    bus = storm[0].bus
    published = sum(bus.kernel.task(f'timed {n}').runs for n in range(TIMED))
    assert sum(topic.head for topic in bus.topics) == published
    for topic in bus.topics:
        for reader in topic.statistics().subscribers:
            # The run may have ended before the last ones were read.
            assert topic.head - topic.depth <= reader.reads + reader.lost <= topic.head


def test_the_work_of_all_jobs_is_not_more_than_the_time_that_passed(
        storm: tuple[Storm, TraceLog]) -> None:
    kernel = storm[0].kernel
    assert all(task.execution_total_ns >= 0 for task in kernel.tasks)
    assert sum(task.execution_total_ns for task in kernel.tasks) <= kernel.statistics().elapsed_ns
