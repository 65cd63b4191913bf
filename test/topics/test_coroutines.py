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


"""Coroutines as tasks: segments are jobs; only events that release tasks can be awaited."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from collections.abc import Coroutine
from typing import Any

import pytest

from rt_robot_os.base.errors import TaskError
from rt_robot_os.kernel import any_of
from rt_robot_os.kernel import BudgetPolicy
from rt_robot_os.kernel import Event
from rt_robot_os.kernel import FailurePolicy
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import MonotonicClock
from rt_robot_os.kernel import TaskState
from rt_robot_os.kernel import TraceLog
from rt_robot_os.kernel import Until
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.topics import Bus

pytest.importorskip('std_msgs.msg', reason='needs the ROS 2 message packages')

US, MS, S = 1_000, 1_000_000, 1_000_000_000


@pytest.fixture
def kernel() -> Kernel:
    return Kernel(VirtualClock())


def test_segments_are_jobs_with_the_priority_of_the_task(kernel: Kernel) -> None:
    log = kernel.trace = TraceLog()

    async def body() -> None:
        kernel.clock.spend(2 * MS)
        await kernel.sleep(5 * MS)
        kernel.clock.spend(2 * MS)
        await kernel.sleep(5 * MS)

    task = kernel.add_async_task('async', body, priority=50)
    kernel.add_task('high', lambda: None, priority=90, rate_hz=100.0, phase_ns=8 * MS)
    low = kernel.add_task('low', lambda: kernel.clock.spend(100 * US), priority=10, rate_hz=1000.0)
    kernel.run(30 * MS)
    text = log.text()
    assert text.startswith('async start\nasync end\nlow start\nlow end\n')
    assert 'async start\n  high start\n  high end\nasync end\n' in text
    assert task.runs == 3 and low.runs > 20
    assert (task.execution.maximum_ns, task.state) == (2 * MS, TaskState.ACTIVE)


def test_ticks_stay_on_their_grid_and_count_what_passed(kernel: Kernel) -> None:
    seen: list[int] = []

    async def body() -> None:
        ticks = kernel.every(100.0)
        while len(seen) < 6:
            await ticks.next()
            seen.append(kernel.now_ns() // MS)
            kernel.clock.spend(25 * MS if len(seen) == 3 else 3 * MS)
        assert ticks.missed == 2
        kernel.stop('seen')

    kernel.add_async_task('async', body, priority=50)
    assert kernel.run(S) == 'seen'
    assert seen == [10, 20, 30, 60, 70, 80]


def test_it_awaits_samples_in_order_and_loses_none(kernel: Kernel) -> None:
    bus = Bus(kernel)
    bus.declare('x', 'std_msgs/msg/Int64', depth=8)
    publisher, reader = bus.publisher('x'), bus.subscribe('x', 'async')
    taken: list[int] = []

    async def body() -> None:
        while True:
            sample = await reader.next()
            taken.append(sample.msg.data)
            kernel.clock.spend(700 * US)

    def publish() -> None:
        for _ in range(source.runs % 3):
            publisher.msg.data += 1
            publisher.publish()

    source = kernel.add_task('source', publish, priority=90, rate_hz=1000.0)
    kernel.add_async_task('async', body, priority=50)
    kernel.run(60 * MS)
    assert taken == list(range(1, len(taken) + 1))
    assert len(taken) >= 55 and reader.lost == 0
    assert bus.topic('x').wakes == []  # what it waited for is undone


def test_it_awaits_whichever_of_several_comes_first(kernel: Kernel) -> None:
    bus = Bus(kernel)
    readers = {}
    for name in 'ab':
        bus.declare(name, 'std_msgs/msg/Int64', depth=8)
        readers[name] = bus.subscribe(name, 'async')
    event, seen = Event(kernel), []

    async def body() -> None:
        while True:
            deadline = Until(kernel.now_ns() + 10 * MS)
            later = Until(kernel.now_ns() + 90 * MS)
            source = await any_of(later, readers['a'].next(), readers['b'].next(), event.wait(),
                                  deadline)
            what = f'{source.topic.name}{source.msg.data}' if source else (
                'event' if event.is_set else 'time')
            event.clear()
            seen.append((what, kernel.now_ns() // MS))

    def publish(name: str, number: int) -> None:
        publisher = publishers[name]
        publisher.msg.data = number
        publisher.publish()

    def both() -> None:
        publish('b', 2)
        publish('b', 3)
        publish('a', 1)

    publishers = {name: bus.publisher(name) for name in 'ab'}
    for at_ms, do in ((3, lambda: publish('b', 1)), (20, both), (24, event.set)):
        kernel.add_task(f'at {at_ms}', do, priority=90, rate_hz=1.0, phase_ns=at_ms * MS)
    kernel.add_async_task('async', body, priority=50)
    kernel.run(36 * MS)
    # None is lost, and of those that wait the first that is named comes first.
    assert seen == [('b1', 3), ('time', 13), ('a1', 20), ('b2', 20), ('b3', 20), ('event', 24),
                    ('time', 34)]
    assert bus.topic('a').wakes == [] == bus.topic('b').wakes


def test_nothing_at_all_cannot_be_awaited() -> None:
    with pytest.raises(TaskError, match='would wait for ever'):
        any_of()


@pytest.mark.parametrize('setter', [50, 10])
def test_events_let_all_go_on_that_wait_the_highest_first(kernel: Kernel, setter: int) -> None:
    event, order = Event(kernel), []

    def waiter(name: str) -> Callable[[], Coroutine[Any, Any, None]]:
        async def body() -> None:
            if name == 'high':
                await kernel.sleep(MS)  # so that the lower one waits first
            await event.wait()
            order.append((name, kernel.now_ns() // MS))
            await event.wait()  # still set: continues immediately
            order.append((name, kernel.now_ns() // MS))
        return body

    kernel.add_async_task('low', waiter('low'), priority=20)
    kernel.add_async_task('high', waiter('high'), priority=80)
    kernel.add_task('setter', event.set, priority=setter, rate_hz=1.0, phase_ns=7 * MS)
    kernel.run(20 * MS)
    assert order == [('high', 7), ('high', 7), ('low', 7), ('low', 7)]
    assert event.is_set
    event.clear()
    assert not event.is_set


def test_a_coroutine_that_returned_makes_no_more_jobs(kernel: Kernel) -> None:
    async def body() -> None:
        await kernel.sleep(MS)

    task = kernel.add_async_task('async', body, priority=50)
    kernel.add_task('poke', lambda: kernel.release(task), priority=10, rate_hz=100.0)
    kernel.run(100 * MS)
    assert task.coroutine is not None and task.coroutine.finished
    assert not kernel.failures


def foreign(kernel: Kernel, what: Callable[[], Any]) -> tuple[str, list[str]]:
    caught: list[str] = []

    async def body() -> None:
        try:
            await what()
        except TaskError as error:
            caught.append(str(error))
            raise

    kernel.add_async_task('async', body, priority=50, failure=FailurePolicy.STOP)
    kernel.run(50 * MS)
    assert kernel.task('async').state is TaskState.STOPPED
    return kernel.failures[0].error, caught


def test_to_await_anything_else_is_an_error_at_that_line(kernel: Kernel) -> None:
    async def sleep() -> None:
        class Bare:
            def __await__(self) -> Any:
                yield 'something'
        await Bare()

    error, caught = foreign(kernel, sleep)
    assert ("task 'async' awaited 'something': only events that release tasks can be awaited"
            in error)
    assert len(caught) == 1


def test_asyncio_does_not_work_here_and_says_so(kernel: Kernel) -> None:
    error, _ = foreign(kernel, lambda: asyncio.sleep(0))
    assert 'awaited None: only events that release tasks can be awaited' in error
    assert 'asyncio needs a separate process' in error


def test_to_await_inside_a_resource_is_an_error(kernel: Kernel) -> None:
    arm = kernel.resource('arm')

    async def body() -> None:
        with arm:
            await kernel.sleep(MS)

    kernel.add_async_task('async', body, priority=50, resources=[arm],
                          failure=FailurePolicy.STOP)
    kernel.run(10 * MS)
    assert "task 'async' awaits inside a resource" in kernel.failures[0].error
    assert arm.holder is None


def test_a_failed_coroutine_restarts_after_the_pause(kernel: Kernel) -> None:
    starts: list[int] = []

    async def body() -> None:
        starts.append(kernel.now_ns() // MS)
        await kernel.sleep(5 * MS)
        raise ValueError('broken')

    task = kernel.add_async_task('async', body, priority=50, restart_ns=20 * MS,
                                 restart_maximum_ns=40 * MS)
    kernel.run(180 * MS)
    assert starts == [0, 25, 70, 115, 160]
    assert task.failures == 5


def test_an_abort_closes_the_coroutine_and_the_next_one_is_whole(kernel: Kernel) -> None:
    cleaned: list[int] = []

    async def body() -> None:
        try:
            await kernel.sleep(MS)
            kernel.clock.spend(S)
        finally:
            cleaned.append(kernel.now_ns() // MS)

    task = kernel.add_async_task('async', body, priority=50, restart_ns=20 * MS,
                                 budget_ns=2 * MS, on_budget=BudgetPolicy.ABORT)
    kernel.run(30 * MS)
    assert cleaned == [3, 26]
    assert task.aborted == 2


def test_what_still_waits_when_the_kernel_stops_cleans_up_and_starts_afresh(
        kernel: Kernel) -> None:
    seen: list[str] = []

    async def body() -> None:
        seen.append('begin')
        try:
            await kernel.sleep(S)
        finally:
            seen.append('end')

    kernel.add_async_task('async', body, priority=50)
    kernel.run(MS)
    kernel.run(MS)
    assert seen == ['begin', 'end'] * 2


def test_declarations_that_make_no_sense_are_refused(kernel: Kernel) -> None:
    async def body() -> None:
        pass

    with pytest.raises(TaskError, match='rate_hz is not for coroutines'):
        kernel.add_async_task('a', body, priority=50, rate_hz=10.0)
    with pytest.raises(TaskError, match='cannot continue; choose failure restart'):
        kernel.add_async_task('a', body, priority=50, failure=FailurePolicy.CONTINUE)
    with pytest.raises(TaskError, match='is not a coroutine function'):
        kernel.add_async_task('a', print, priority=50)  # type: ignore[arg-type]
    with pytest.raises(TaskError, match='add it with add_async_task'):
        kernel.add_task('a', body, priority=50)
    assert not kernel.tasks


def test_on_the_real_clock_a_coroutine_preempts_a_lower_task() -> None:
    kernel = Kernel(MonotonicClock())
    count = 0

    async def body() -> None:
        nonlocal count
        ticks = kernel.every(1000.0)
        while count < 20:
            await ticks.next()
            count += 1
        kernel.stop('done')

    def low() -> None:
        while count < 20:
            pass

    kernel.add_async_task('async', body, priority=50)
    kernel.add_task('low', low, priority=10, rate_hz=1.0)
    assert kernel.run(60 * S) == 'done'
