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


"""What jobs of a scenario can do: a method for each operation, of its name."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from contextlib import suppress
import os
from typing import Any

from differential_clock import ScenarioClock
from differential_scenario import Operation
from differential_scenario import Program

from rt_robot_os.kernel import any_of
from rt_robot_os.kernel import Event
from rt_robot_os.kernel import FailurePolicy
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import OneShot
from rt_robot_os.kernel import Resource
from rt_robot_os.kernel import Task
from rt_robot_os.kernel import TaskAborted
from rt_robot_os.kernel import Ticks
from rt_robot_os.kernel import Until
from rt_robot_os.kernel import Wait
from rt_robot_os.topics import Bus
from rt_robot_os.topics import Publisher
from rt_robot_os.topics import Subscription
from rt_robot_os.topics import Topic


class StrangeError(Exception):
    """An exception whose text is code of its author, who was careless."""

    def __str__(self) -> str:
        raise ValueError('no text')


class Finaliser:
    """An object that raises when it is dropped."""

    def __del__(self) -> None:
        raise ValueError('the finaliser failed')


ERRORS: tuple[type[BaseException], ...] = (
    ValueError, StrangeError, RecursionError, KeyboardInterrupt, SystemExit, GeneratorExit)


class Operations:
    """The things of a scenario, and what can be done with them."""

    clock: ScenarioClock
    kernel: Kernel
    bus: Bus

    def __init__(self) -> None:
        self.tasks: list[Task] = []
        self.timers: list[OneShot] = []
        self.events: list[Event] = []
        self.resources: list[Resource] = []
        self.topics: list[Topic] = []
        self.publishers: list[list[Publisher]] = []  # of each task: of each topic
        self.readers: list[Subscription] = []
        self.pipes: list[tuple[int, int]] = []
        self.ticks: dict[tuple[int, int], Ticks] = {}
        self.jobs: Counter[int] = Counter()
        self.idled = 0
        self.values = 0

    def note(self, *what: Any) -> None:
        """Add to the timeline."""
        raise NotImplementedError

    def nth(self, things: list[Any], number: int) -> Any:
        """Find a thing, whatever the number."""
        return things[number % len(things)]

    def perform(self, who: int, program: Iterable[Operation]) -> None:
        """
        Do one operation after the other, and note what comes of each.

        :param who: number of the task; -1 for the idle hook.
        """
        for operation in program:
            self.perform_one(who, operation)

    def perform_one(self, who: int, operation: Operation) -> None:
        self.clock.reads = 0
        name, *arguments = operation
        try:
            result = getattr(self, f'do_{name}')(who, *arguments)
        except BaseException as error:
            kind = type(error)
            told = '' if kind is StrangeError else str(error).partition('\n')[0]
            self.note('raised', who, name, kind.__name__, told)
            raise
        if result is not NotImplemented:
            self.note('did', who, name, result)

    async def perform_async(self, who: int, operation: Operation) -> None:
        name, *arguments = operation
        if name == 'wait':
            await self.wait_for(who, arguments[0])
        elif name == 'wait_inside':
            if self.resources:
                with self.nth(self.resources, arguments[0]):
                    await self.wait_for(who, arguments[1])
        elif name == 'wait_wrongly':
            await _Wrong()
        elif name == 'wait_finally':
            try:
                await self.wait_for(who, arguments[0])
            finally:
                self.perform(who, arguments[1])
        else:
            self.perform_one(who, operation)

    async def wait_for(self, who: int, waits: Program) -> None:
        made = [wait for wait in (self.make_wait(who, *each) for each in waits) if wait]
        if not made:
            return
        self.note('waits', who)
        got = await (made[0] if len(made) == 1 else any_of(*made))
        self.note('waited', who, got.seq if isinstance(got, Subscription) else got)

    def make_wait(self, who: int, kind: str, number: int) -> Wait | None:
        if kind == 'sleep':
            return self.kernel.sleep(number)
        if kind == 'until':
            return Until(self.kernel.start_ns + number)
        if kind == 'tick':
            key = who, number
            if key not in self.ticks:
                self.ticks[key] = self.kernel.every(1e9 / max(number, 10_000))
            return self.ticks[key].next()
        if kind == 'event' and self.events:
            wait: Wait = self.nth(self.events, number).wait()
            return wait
        if kind == 'sample' and self.readers:
            sample: Wait = self.nth(self.readers, number).next()
            return sample
        return None

    # ---- time --------------------------------------------------------------------------------

    def do_spend(self, who: int, duration_ns: int) -> Any:
        self.clock.spend(duration_ns)
        return NotImplemented

    def do_stall(self, who: int, duration_ns: int) -> None:
        self.clock.stall(duration_ns)

    def do_steal(self, who: int, duration_ns: int) -> None:
        self.clock.steal(duration_ns)

    def do_stop_process(self, who: int, duration_ns: int) -> None:
        self.clock.stop_process(duration_ns)

    # ---- other tasks -------------------------------------------------------------------------

    def do_release(self, who: int, task: int) -> None:
        self.kernel.release(self.nth(self.tasks, task))

    def do_hold(self, who: int, task: int, policy: str) -> None:
        self.kernel.hold(self.nth(self.tasks, task), FailurePolicy[policy], 'held')

    def do_rearm(self, who: int, task: int) -> None:
        self.nth(self.tasks, task).rearm()

    def do_set_rate(self, who: int, task: int, period_ns: int) -> Any:
        try:
            self.nth(self.tasks, task).set_rate_hz(1e9 / period_ns)
        except Exception as error:
            return str(error)
        return None

    def do_reset_statistics(self, who: int, task: int) -> None:
        self.nth(self.tasks, task).reset_statistics()

    def do_account(self, who: int, task: int) -> Any:
        task = self.nth(self.tasks, task)
        task.account()
        return [task.releases, task.runs, task.missed, task.coalesced, task.pending, task.state]

    def do_statistics(self, who: int) -> Any:
        return self.kernel.statistics()

    def do_dump(self, who: int) -> Any:
        return self.kernel.black_box_dump('now')

    def do_mark(self, who: int) -> None:
        self.kernel.black_box.mark(self.kernel.now_ns(), 'mark')

    def do_observe(self, who: int) -> None:
        self.kernel.add_observer(lambda record: self.note('observed later', record))

    # ---- the kernel --------------------------------------------------------------------------

    def do_stop(self, who: int) -> None:
        self.kernel.stop(f'stopped by {who}')

    def do_break(self, who: int) -> None:
        self.clock.press_break()

    def do_settle(self, who: int) -> None:
        self.kernel.settle()

    def do_lock(self, who: int, program: Program) -> None:
        before = self.kernel.lock()
        try:
            self.perform(who, program)
        finally:
            self.kernel.unlock(before)

    def do_add_task(self, who: int) -> Any:
        try:
            self.kernel.add_task('late', lambda: None, priority=1)
        except Exception as error:
            return str(error)
        return None

    # ---- what jobs are made of ---------------------------------------------------------------

    def do_raise(self, who: int, kind: int) -> None:
        raise ERRORS[kind % len(ERRORS)]('as it was told')

    def do_drop(self, who: int) -> None:
        Finaliser()

    def do_swallow(self, who: int, program: Program) -> None:
        with suppress(BaseException):
            self.perform(who, program)

    def do_abort_self(self, who: int) -> None:
        raise TaskAborted('nobody', 0, 0, 'raised by its own code')

    def do_finally(self, who: int, program: Program, after: Program) -> None:
        try:
            self.perform(who, program)
        finally:
            self.perform(who, after)

    # ---- resources, timers, events -----------------------------------------------------------

    def do_within(self, who: int, resource: int, program: Program) -> None:
        if self.resources:
            with self.nth(self.resources, resource):
                self.perform(who, program)

    def do_enter(self, who: int, resource: int) -> None:
        if self.resources:
            self.nth(self.resources, resource).__enter__()

    def do_leave(self, who: int, resource: int) -> None:
        if self.resources:
            self.nth(self.resources, resource).__exit__(None, None, None)

    def do_start_timer(self, who: int, timer: int, delay_ns: int) -> Any:
        if self.timers:
            self.nth(self.timers, timer).start(delay_ns)
            return self.nth(self.timers, timer).started
        return None

    def do_cancel_timer(self, who: int, timer: int) -> Any:
        if self.timers:
            self.nth(self.timers, timer).cancel()
            return self.nth(self.timers, timer).started
        return None

    def do_set_event(self, who: int, event: int) -> None:
        if self.events:
            self.nth(self.events, event).set()

    def do_clear_event(self, who: int, event: int) -> None:
        if self.events:
            self.nth(self.events, event).clear()

    # ---- topics ------------------------------------------------------------------------------

    def fill(self, publisher: Publisher) -> None:
        self.values += 1
        kind = publisher.topic.layout.type_name
        if kind.endswith('Int64'):
            publisher.msg.data = self.values
        elif kind.endswith('String'):
            publisher.msg.data = str(self.values) * (self.values % 9)
        else:
            publisher.msg.data = bytes([self.values % 256]) * (self.values % 7)

    def do_publish(self, who: int, topic: int, stamp_ns: int) -> Any:
        if not self.topics:
            return NotImplemented
        publisher = self.nth(self.publishers[who], topic)
        self.fill(publisher)
        publisher.publish(stamp_ns)
        return publisher.published

    def do_publish_cdr(self, who: int, topic: int, stamp_ns: int) -> Any:
        if not self.topics:
            return NotImplemented
        publisher = self.nth(self.publishers[who], topic)
        self.fill(publisher)
        layout = publisher.topic.layout
        octets = memoryview(publisher.buffer)
        publisher.publish_cdr(bytes(octets[:layout.length(octets)]), stamp_ns)
        return publisher.published

    def do_publish_nonsense(self, who: int, topic: int) -> Any:
        if not self.topics:
            return NotImplemented
        try:
            self.nth(self.publishers[who], topic).publish_cdr(b'nonsense')
        except Exception as error:
            return str(error)
        return None

    def read(self, reader: int, method: str) -> Any:
        if not self.readers:
            return NotImplemented
        found = self.nth(self.readers, reader)
        return (getattr(found, method)(), found.seq, found.lost, found.skipped, found.stamp_ns)

    def do_take(self, who: int, reader: int) -> Any:
        return self.read(reader, 'take')

    def do_latest(self, who: int, reader: int) -> Any:
        return self.read(reader, 'latest')

    def do_put_back(self, who: int, reader: int) -> Any:
        if self.readers and self.nth(self.readers, reader).reads:
            return self.read(reader, 'put_back')
        return None

    def do_rewind(self, who: int, reader: int) -> Any:
        return self.read(reader, 'rewind')

    def do_skip(self, who: int, reader: int, newest: bool) -> Any:
        if not self.readers:
            return NotImplemented
        return self.nth(self.readers, reader).skip(newest)

    def do_unsubscribe(self, who: int, reader: int) -> None:
        if self.readers:
            self.bus.unsubscribe(self.nth(self.readers, reader))

    def do_stop_releasing(self, who: int, task: int) -> None:
        self.bus.stop_releasing(self.nth(self.tasks, task))

    # ---- interrupts --------------------------------------------------------------------------

    def do_write(self, who: int, pipe: int, signals: bool) -> None:
        if self.pipes:
            with suppress(BlockingIOError):
                os.write(self.nth(self.pipes, pipe)[1], b'x')
            if signals:
                self.clock.interrupt()

    def do_drain(self, who: int, pipe: int) -> Any:
        if not self.pipes:
            return NotImplemented
        with suppress(BlockingIOError):
            return len(os.read(self.nth(self.pipes, pipe)[0], 100))
        return 0

    def do_remove_interrupt(self, who: int, pipe: int) -> None:
        if self.pipes:
            self.kernel.remove_interrupt(self.nth(self.pipes, pipe)[0])

    def do_add_interrupt(self, who: int, pipe: int, task: int, separation_ns: int) -> None:
        if self.pipes:
            self.kernel.add_interrupt(self.nth(self.pipes, pipe)[0], self.nth(self.tasks, task),
                                      separation_ns=separation_ns, name='pipe again')


class _Wrong:
    """Something that no kernel knows how to wait for."""

    def __await__(self) -> Any:
        yield 'nonsense'

    def __repr__(self) -> str:
        return 'nonsense'
