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
Coroutines as tasks: each segment between two awaits is a job that runs to completion.

No job waits on the stack: ``await`` ends the job, and the awaited event releases the next one at
the task's priority. Only events by which the kernel can release a task can be awaited.
"""

from __future__ import annotations

from abc import ABC
from abc import abstractmethod
from collections.abc import Callable
from collections.abc import Coroutine
from collections.abc import Generator
from typing import Any

from rt_robot_os.base.errors import TaskError
from rt_robot_os.kernel.one_shot import OneShot
from rt_robot_os.kernel.releases import Releases
from rt_robot_os.kernel.task import Coroutine as TaskCoroutine
from rt_robot_os.kernel.task import Task

AsyncFunction = Callable[[], Coroutine[Any, Any, None]]


class Wait(ABC):
    """An awaitable for coroutine tasks."""

    __slots__ = ()

    @abstractmethod
    def begin(self, body: AsyncBody) -> None:
        """Have the task released when :meth:`is_ready` may have become true."""

    @abstractmethod
    def is_ready(self) -> bool:
        """Return whether the task can continue."""

    def end(self, body: AsyncBody) -> None:
        """Undo :meth:`begin`."""

    def result(self) -> Any:
        """Return the result of ``await``."""
        return None

    def __await__(self) -> Generator[Wait, Any, Any]:
        """Yield to the kernel, and return the result when it is ready."""
        return (yield self)


class Until(Wait):
    """A point in time of the kernel's clock."""

    __slots__ = ('time_ns', '_body')

    def __init__(self, time_ns: int) -> None:
        self.time_ns = time_ns
        self._body: AsyncBody | None = None

    def begin(self, body: AsyncBody) -> None:
        """Start the task's timer."""
        self._body = body
        if body.replay_gate is None:
            body.timer.start_at(self.time_ns)

    def is_ready(self) -> bool:
        """Return whether the time has come."""
        return self._body is not None and self._body.kernel.now_ns() >= self.time_ns

    def end(self, body: AsyncBody) -> None:
        """Stop the timer."""
        body.timer.cancel()


class AnyOf(Wait):
    """
    The first of several awaitables that is ready; made by :func:`any_of`.

    :param waits: the awaitables; those that are not ready first are left pending.
    """

    __slots__ = ('_waits', '_timed', '_first_ready')

    def __init__(self, waits: tuple[Wait, ...]) -> None:
        self._waits = waits
        # A task has one timer.
        timed = [each for each in waits if isinstance(each, Until)]
        self._timed = min(timed, key=_time_of) if timed else None
        self._first_ready: Wait | None = None

    def begin(self, body: AsyncBody) -> None:
        """Begin all of them; of several points in time only the earliest."""
        for each in self._waits:
            if each is self._timed or not isinstance(each, Until):
                each.begin(body)

    def is_ready(self) -> bool:
        """Return whether one of them is ready; later ones are not checked then."""
        if self._first_ready is None:
            for each in self._waits:
                if each.is_ready():
                    self._first_ready = each
                    return True
        return self._first_ready is not None

    def end(self, body: AsyncBody) -> None:
        """Undo :meth:`begin`."""
        for each in self._waits:
            if each is self._timed or not isinstance(each, Until):
                each.end(body)

    def result(self) -> Any:
        """Return the result of the one that was ready."""
        return None if self._first_ready is None else self._first_ready.result()


def any_of(*waits: Wait) -> AnyOf:
    """
    Return an awaitable that is ready when the first of several is.

    ``await`` returns the result of that one: a subscription, whose sample has been taken, or None
    for an event or a point in time. If several are ready, the one that is named first counts, and
    nothing is taken from the others.

    :raises TaskError: no awaitable was given.
    """
    if not waits:
        raise TaskError('any_of() without arguments would wait for ever: give it at least one '
                        'awaitable')
    return AnyOf(waits)


def _time_of(wait: Until) -> int:
    return wait.time_ns


class Event:
    """
    A flag that tasks can await; safe in the real-time loop.

    :param kernel: of the tasks.
    """

    __slots__ = ('_kernel', '_set', '_waiting')

    def __init__(self, kernel: Releases) -> None:
        self._kernel = kernel
        self._set = False
        self._waiting: list[Task] = []

    @property
    def is_set(self) -> bool:
        """Whether it is set."""
        return self._set

    def set(self) -> None:  # noqa: A003
        """
        Set it and release the tasks that await it, by priority.

        Tasks above the caller's priority run before this returns.
        """
        self._set = True
        kernel = self._kernel
        before = kernel.lock()
        kernel.wake(tuple(self._waiting), kernel.now_ns())  # all of them before the first runs
        kernel.unlock(before)

    def clear(self) -> None:
        """Clear it: tasks that await it from now on wait."""
        self._set = False

    def wait(self) -> Wait:
        """Return an awaitable that is ready when the event is set."""
        return _EventWait(self)


class _EventWait(Wait):

    __slots__ = ('_event',)

    def __init__(self, event: Event) -> None:
        self._event = event

    def begin(self, body: AsyncBody) -> None:
        if body.replay_gate is None:
            self._event._waiting.append(body.task)

    def is_ready(self) -> bool:
        return self._event.is_set

    def end(self, body: AsyncBody) -> None:
        if body.task in self._event._waiting:
            self._event._waiting.remove(body.task)


class AsyncBody(TaskCoroutine):
    """
    The function of a coroutine task.

    :param function: returns a new coroutine for each start.
    """

    __slots__ = ('kernel', 'task', 'timer', '_function', '_coroutine', '_wait')

    task: Task
    timer: OneShot

    def __init__(self, kernel: Releases, function: AsyncFunction) -> None:
        super().__init__()
        self.kernel = kernel
        self._function = function
        self._coroutine: Coroutine[Any, Any, None] | None = None
        self._wait: Wait | None = None

    def bind(self, task: Task) -> None:
        """Set the task that it belongs to."""
        self.task = task
        self.timer = OneShot(self.kernel, task)

    def start(self) -> None:
        """Start, or restart after a failure, and run the first segment."""
        self.close()
        self.finished = False
        self._coroutine = self._function()
        self._run(None)

    def segment(self) -> None:
        """Continue if the awaited event is ready; this is the function of the task."""
        wait = self._wait
        if self._coroutine is None:
            if not self.finished:
                self.start()
        elif wait is not None and self._may_resume(wait):
            wait.end(self)
            self._wait = None
            self._run(wait.result())

    def close(self) -> None:
        """Drop the coroutine; its ``finally`` clauses run."""
        wait, self._wait = self._wait, None
        if wait is not None:
            wait.end(self)
        coroutine, self._coroutine = self._coroutine, None
        if coroutine is not None:
            coroutine.close()

    def _run(self, value: Any) -> None:
        coroutine = self._coroutine
        try:
            while coroutine is not None:
                awaited = coroutine.send(value)
                problem = self._problem(awaited)
                if problem is not None:
                    awaited = coroutine.throw(problem)
                    problem = self._problem(awaited)
                    if problem is not None:
                        raise problem
                awaited.begin(self)
                if not self._may_resume(awaited):
                    self._wait = awaited
                    return
                awaited.end(self)
                value = awaited.result()
        except StopIteration:
            self._coroutine = None
            self.finished = True
        except BaseException:
            self._coroutine = None
            if coroutine is not None:
                coroutine.close()
            raise

    def _may_resume(self, wait: Wait) -> bool:
        ready = wait.is_ready() if self.replay_gate is None else self.replay_gate(wait.is_ready)
        if ready and self.on_resume is not None:
            self.on_resume()
        return ready

    def _problem(self, awaited: Any) -> TaskError | None:
        if not isinstance(awaited, Wait):
            return TaskError(
                f'task {self.task.name!r} awaited {awaited!r}: only events that release tasks can '
                'be awaited: subscription.next(), kernel.sleep(ns), ticks of kernel.every(hz), '
                'event.wait(). asyncio needs a separate process')
        if self.task.inside:
            return TaskError(f'task {self.task.name!r} awaits inside a resource: no task could '
                             'enter it meanwhile; leave it before')
        return None


class Ticks:
    """
    An absolute grid of times without drift: ``await ticks.next()``.

    Points that are already past are skipped and counted.

    :ivar missed: grid points that had passed when they were awaited.
    """

    __slots__ = ('period_ns', 'missed', '_kernel', '_next_ns')

    def __init__(self, kernel: Releases, period_ns: int) -> None:
        self.period_ns = period_ns
        self.missed = 0
        self._kernel = kernel
        self._next_ns = kernel.now_ns()

    def next(self) -> Wait:  # noqa: A003
        """Return an awaitable that is ready at the next point of the grid."""
        now_ns = self._kernel.now_ns()
        self._next_ns += self.period_ns
        if self._next_ns < now_ns:
            missed = (now_ns - self._next_ns) // self.period_ns + 1
            self.missed += missed
            self._next_ns += missed * self.period_ns
        return Until(self._next_ns)
