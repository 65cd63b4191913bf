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


"""Check declarations before the kernel runs."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import fields
import inspect
from typing import Any

from rt_robot_os.base.errors import TaskError
from rt_robot_os.kernel.spec import broken_rules
from rt_robot_os.kernel.spec import checked_period_ns
from rt_robot_os.kernel.spec import FailurePolicy
from rt_robot_os.kernel.spec import raise_problems
from rt_robot_os.kernel.spec import TaskSpec
from rt_robot_os.kernel.task import Task

_KEYWORDS = frozenset(field.name for field in fields(TaskSpec)) - {'name', 'period_ns'}


def make_spec(name: str, function: Callable[[], object], *, priority: Any, rate_hz: Any,
              can_be_safe: bool, preemptive: bool, declared: Mapping[str, Any]) -> TaskSpec:
    """
    Build the declaration of a task.

    :param priority: unchecked; it is checked here, as is the rate.
    :param can_be_safe: it has an ``on_safe_state``.
    :param preemptive: the kernel's clock interrupts running jobs.
    :raises TaskError: with all problems found.
    """
    unknown = sorted(set(declared) - _KEYWORDS)
    if unknown:
        raise TaskError(f'task {name!r}: unknown keyword {", ".join(unknown)}; the keywords are: '
                        f'{", ".join(sorted(_KEYWORDS))}')
    if not callable(function):
        raise TaskError(f'task {name!r}: {function!r} is not callable')
    if inspect.iscoroutinefunction(function):
        raise TaskError(f'task {name!r}: {function!r} is a coroutine function; add it with '
                        'add_async_task')
    period_ns = 0 if rate_hz is None else checked_period_ns(name, rate_hz)
    spec = TaskSpec(name, priority, period_ns, **declared)
    raise_problems(spec, broken_rules(spec, preemptive=preemptive, can_be_safe=can_be_safe))
    return spec


def check_async(name: str, function: Any, declared: Mapping[str, Any]) -> Mapping[str, Any]:
    """
    Check what applies to coroutines only.

    :return: the declarations.
    :raises TaskError: the function is not a coroutine function, or a keyword is not for them.
    """
    if not inspect.iscoroutinefunction(function):
        raise TaskError(f'task {name!r}: {function!r} is not a coroutine function; write it with '
                        '`async def`, or add it with add_task')
    for key in ('rate_hz', 'logical', 'after'):
        if declared.get(key):
            raise TaskError(f'task {name!r}: {key} is not for coroutines, which await their '
                            'releases; await kernel.every(hz).next() for a rate')
    if declared.get('failure') is FailurePolicy.CONTINUE:
        raise TaskError(f'task {name!r}: a coroutine that failed cannot continue; choose failure '
                        'restart, stop or safe_state')
    return declared


def check_chains(tasks: Sequence[Task]) -> None:
    """
    Reject tasks that release each other (``after``) in a cycle: it would never end.

    :raises TaskError: naming the cycle.
    """
    finished: set[Task] = set()
    for first in tasks:
        path: list[Task] = []
        _follow_chain(first, path, finished)


def _follow_chain(task: Task, path: list[Task], finished: set[Task]) -> None:
    if task in finished:
        return
    if task in path:
        cycle = ' -> '.join(repr(t.name) for t in [*path[path.index(task):], task])
        raise TaskError(f'tasks release each other in a cycle: {cycle}; remove one from `after`')
    path.append(task)
    for successor in task.successors:
        _follow_chain(successor, path, finished)
    path.pop()
    finished.add(task)
