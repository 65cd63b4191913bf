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


"""Logical execution time: when others see something depends on the clock, not on the load."""

from __future__ import annotations

import pytest

from rt_robot_os.base.errors import TaskError
from rt_robot_os.base.errors import TopicError
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import Task
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.topics import Bus
from rt_robot_os.topics import Publisher
from rt_robot_os.topics import Subscription

pytest.importorskip('std_msgs.msg', reason='needs the ROS 2 message packages')

US, MS = 1_000, 1_000_000


class Chain:
    """A sensor at 1 kHz, a controller at 100 Hz with logical execution time, an observer."""

    def __init__(self, work_us: int = 1000, load_us: int = 0, logical: bool = True,
                 **declared: object) -> None:
        self.kernel = Kernel(VirtualClock())
        self.bus = Bus(self.kernel)
        self.bus.declare('in', 'std_msgs/msg/Int64', depth=32)
        self.bus.declare('out', 'std_msgs/msg/Int64', depth=8)
        self.work_us, self.load_us = work_us, load_us
        self.seen: list[tuple[int, int]] = []
        self.read: list[list[int]] = []
        self.sensor_task = self.kernel.add_task('sensor', self.sense, priority=90, rate_hz=1000.0)
        self.task = self.kernel.add_task('control', self.control, priority=50, rate_hz=100.0,
                                         logical=logical, **declared)
        self.kernel.add_task('load', self.load, priority=70, rate_hz=100.0)
        self.observer = self.kernel.add_task('observer', self.observe, priority=95)
        self.sensor = self.bus.publisher('in')
        self.input: Subscription
        if logical:
            self.input = self.bus.subscribe_logically('in', self.task)
        else:
            self.input = self.bus.subscribe('in', 'control')
        self.output: Publisher = self.bus.publisher('out', self.task)
        self.watch = self.bus.subscribe('out', 'observer', task=self.observer)

    def sense(self) -> None:
        self.sensor.msg.data = self.kernel.now_ns() // MS
        self.sensor.publish()

    def load(self) -> None:
        self.kernel.clock.spend(self.load_us * US)

    def control(self) -> None:
        self.kernel.clock.spend(self.work_us * US)
        taken = []
        while self.input.take():
            taken.append(self.input.msg.data)
        self.read.append(taken)
        self.output.msg.data = taken[-1] if taken else -1
        self.output.publish()

    def observe(self) -> None:
        while self.watch.take():
            self.seen.append((self.kernel.now_ns(), self.watch.msg.data))


@pytest.mark.parametrize('load_us', [0, 2000, 5000])
def test_reads_and_writes_are_the_same_under_any_load_that_fits(load_us: int) -> None:
    chain = Chain(load_us=load_us)
    chain.kernel.run(58 * MS)
    # At 0 nothing was published yet: inputs are fixed before the sensor of that instant runs.
    assert chain.read == [[], *(list(range(n, n + 10)) for n in range(0, 50, 10))]
    assert chain.seen == [(n * MS, n - 11 if n > 10 else -1) for n in range(10, 60, 10)]
    assert chain.task.deadline_missed == 0 and chain.input.lost == 0


def test_without_it_they_depend_on_the_load() -> None:
    idle, loaded = Chain(logical=False), Chain(logical=False, load_us=5000)
    idle.kernel.run(58 * MS)
    loaded.kernel.run(58 * MS)
    assert idle.seen != loaded.seen


def test_a_deadline_before_the_end_of_the_period_publishes_then() -> None:
    chain = Chain(deadline_ns=4 * MS)
    chain.kernel.run(25 * MS)
    assert [at for at, _ in chain.seen] == [4 * MS, 14 * MS, 24 * MS]
    assert chain.watch.stamp_ns == 24 * MS


def test_what_a_late_job_wrote_is_not_published_and_counted() -> None:
    chain = Chain(deadline_ns=4 * MS)
    normal = chain.control

    def control() -> None:
        chain.work_us = 5000 if chain.task.runs == 1 else 1000
        normal()

    chain.task.body = control
    chain.kernel.run(45 * MS)
    assert [at for at, _ in chain.seen] == [4 * MS, 24 * MS, 34 * MS, 44 * MS]
    assert [value for _, value in chain.seen] == [-1, 19, 29, 39]
    assert chain.task.deadline_missed == 1
    assert chain.task.logical is not None and chain.task.logical.late == 1
    assert chain.output.discarded == 1  # type: ignore[attr-defined]


def test_a_job_longer_than_its_period_misses_releases_and_keeps_the_grid() -> None:
    chain = Chain(work_us=15_000)
    chain.kernel.run(75 * MS)
    assert chain.seen == []
    task = chain.task
    assert (task.releases, task.runs, task.missed) == (8, 4, 4)
    assert task.overruns == 4


def test_more_messages_than_the_topic_holds_are_counted() -> None:
    chain = Chain()

    def control() -> None:
        for n in range(11):
            chain.output.msg.data = n
            chain.output.publish()

    chain.task.body = control
    chain.kernel.run(15 * MS)
    assert [value for _, value in chain.seen] == list(range(8))
    assert chain.output.discarded == 6  # type: ignore[attr-defined]  # of two jobs


def test_a_changed_rate_changes_the_grid() -> None:
    chain = Chain()
    chain.kernel.add_task('change', lambda: chain.task.set_rate_hz(200.0), priority=5,
                          rate_hz=1.0, phase_ns=31 * MS)
    chain.kernel.run(71 * MS)
    # Set at 31 ms, read with the release of 40 ms, on the grid from 50 ms on.
    assert [at // MS for at, _ in chain.seen] == [10, 20, 30, 40, 45, 55, 60, 65, 70]


def test_a_mirror_of_variable_length_and_ready_made_messages_come_out_at_the_deadline() -> None:
    kernel = Kernel(VirtualClock())
    bus = Bus(kernel)
    bus.declare('text', 'std_msgs/msg/String', tail=32)
    seen: list[tuple[int, str]] = []

    def control() -> None:
        out.msg.data = f'at {kernel.now_ns() // MS}'
        out.publish()
        raw.msg.data = 'raw'
        out.publish_cdr(bytes(raw.buffer[:raw.topic.layout.length(raw.buffer)]))

    task: Task = kernel.add_task('control', control, priority=50, rate_hz=100.0, logical=True)
    out, raw = bus.publisher('text', task), bus.publisher('text')
    observer = kernel.add_task('observer', lambda: None, priority=5)
    watch = bus.subscribe('text', 'observer', task=observer)

    def observe() -> None:
        while watch.take():
            seen.append((kernel.now_ns() // MS, watch.msg.data))

    observer.body = observe
    kernel.run(25 * MS)
    assert seen == [(10, 'at 0'), (10, 'raw'), (20, 'at 10'), (20, 'raw')]


def test_misuse_is_refused() -> None:
    kernel = Kernel(VirtualClock())
    bus = Bus(kernel)
    bus.declare('in', 'std_msgs/msg/Int64')
    plain = kernel.add_task('plain', print, priority=5, rate_hz=10.0)
    with pytest.raises(TopicError, match="task 'plain' has no logical execution time"):
        bus.subscribe_logically('in', plain)
    with pytest.raises(TaskError, match='needs an end of the interval'):
        kernel.add_task('event', print, priority=5, logical=True)
