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
What a scenario is made of, as plain data: two processes run the same one and tell what they saw.

Whatever stands in a scenario is valid: numbers that name a task, a topic, a timer ... are taken
modulo how many there are, and what cannot be done because there is none of them is left out. So
a failing scenario can be made smaller by leaving out anything of it.

An operation is a tuple, its name first; ``differential_runner`` has a method of that name for
each. A program is a tuple of operations: what a job does.
"""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import fields
from dataclasses import is_dataclass
from typing import Any

Operation = tuple[Any, ...]
Program = tuple[Operation, ...]


@dataclass(frozen=True)
class TaskData:
    """
    A task; ``programs`` are those of its jobs, in turn.

    :ivar is_async: it is written as a coroutine, which goes through its programs once.
    """

    priority: int = 1
    period_ns: int = 0
    phase_ns: int = 0
    deadline_ns: int = 0
    budget_ns: int = 0
    on_budget: str = 'WARN'
    overrun: str = 'SKIP'
    catch_up: int = 1
    overrun_limit: int = 0
    overrun_leak: int = 100
    failure: str = 'CONTINUE'
    restart_ns: int = 100_000
    restart_maximum_ns: int = 1_000_000
    logical: bool = False
    is_async: bool = False
    resources: tuple[int, ...] = ()
    after: tuple[int, ...] = ()
    on_restart: Program | None = None
    on_safe_state: Program | None = None
    programs: tuple[Program, ...] = ((),)


@dataclass(frozen=True)
class TopicData:
    """
    A topic.

    :ivar kind: of its messages: ``fixed``, ``tail`` (of different lengths) or ``large``.
    """

    kind: str = 'fixed'
    depth: int = 1


@dataclass(frozen=True)
class ReaderData:
    """A subscription of a task; with ``wakes`` publications release it."""

    topic: int = 0
    task: int = 0
    wakes: bool = False
    initial: bool = False
    newest: bool = False


@dataclass(frozen=True)
class TriggerData:
    """
    What releases a task by publications.

    :ivar every: of the first topic each so-many-th one; 0: one of each topic.
    """

    task: int = 0
    every: int = 1
    topics: tuple[int, ...] = (0,)


@dataclass(frozen=True)
class PipeData:
    """A source of interrupts."""

    task: int = 0
    separation_ns: int = 0


@dataclass(frozen=True)
class KernelData:
    """
    How the kernel is made.

    :ivar trace: whether a hook gets each start and end; ``trace_fails_at`` one raises, 0: none.
    :ivar observers: with which record each of them raises; 0: never.
    :ivar idle: what ``on_idle`` does, if there is one.
    """

    spin_ns: int = 0
    records: int = 2048
    stop_grace_ns: int | None = None
    trace: bool = True
    trace_fails_at: int = 0
    observers: tuple[int, ...] = ()
    idle: Program | None = None


@dataclass(frozen=True)
class ClockData:
    """
    How the virtual clock behaves.

    :ivar wake_ns: what it says that a timer interrupt costs.
    :ivar arm_ns: time that passes while a timer is set.
    :ivar late_ns: how late the thread goes on after waiting.
    :ivar signal: handlers are called as those of a signal.
    """

    start_ns: int = 0
    wake_ns: int = 0
    arm_ns: int = 0
    late_ns: int = 0
    signal: bool = False


@dataclass(frozen=True)
class Scenario:
    """
    All that a run depends on.

    :ivar runs: how long the kernel runs each time; None: until a job stops it.
    """

    tasks: tuple[TaskData, ...]
    runs: tuple[int | None, ...] = (10_000_000,)
    resources: int = 0
    timers: tuple[int, ...] = ()
    events: int = 0
    topics: tuple[TopicData, ...] = ()
    readers: tuple[ReaderData, ...] = ()
    triggers: tuple[TriggerData, ...] = ()
    pipes: tuple[PipeData, ...] = ()
    kernel: KernelData = KernelData()
    clock: ClockData = ClockData()


def text_of(value: Any, indent: str = '') -> str:
    """Write a scenario as Python source, without what is as by default."""
    if is_dataclass(value) and not isinstance(value, type):
        inner = indent + '    '
        given = [f'{inner}{field.name}={text_of(getattr(value, field.name), inner)},\n'
                 for field in fields(value) if getattr(value, field.name) != field.default]
        return f'{type(value).__name__}(' + (
            '\n' + ''.join(given) + indent if given else '') + ')'
    if isinstance(value, tuple) and any(map(is_dataclass, value)):
        inner = indent + '    '
        return '(\n' + ''.join(f'{inner}{text_of(each, inner)},\n' for each in value) + (
            indent + ')')
    return repr(value)
