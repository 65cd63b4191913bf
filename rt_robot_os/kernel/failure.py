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


"""Failures of jobs, and their description, whatever code an exception runs meanwhile."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
import sys
from types import TracebackType

from rt_robot_os.base.units import NS_PER_US

_CALLS_MAXIMUM = 8
_TEXT_MAXIMUM = 1000
# The original attribute, which the class of an exception may have overridden.
_context = BaseException.__dict__['__context__']


class TaskAborted(BaseException):
    """
    The job has used up its budget, or still runs while the kernel stops.

    It is raised in the job at its next preemption point. It is not an :class:`Exception`, so
    ``except Exception`` does not catch it, as with KeyboardInterrupt. A job may clean up in
    ``finally``; one that continues to compute is aborted again, and its task is stopped.

    :param reason: when it is not the budget.
    :ivar used_ns: computing time of the job until then, without preemption.
    """

    def __init__(self, task: str, used_ns: int, budget_ns: int, reason: str = '') -> None:
        self.used_ns = used_ns
        text = reason or (f'used {used_ns // NS_PER_US} us of its budget of '
                          f'{budget_ns // NS_PER_US} us')
        super().__init__(f'task {task!r} {text}')


@dataclass(frozen=True)
class FailureReport:
    """
    An exception that was contained, or another reason to apply a failure policy.

    :ivar task: its origin.
    :ivar error: type and message.
    :ivar trace: the innermost calls, most recent last: file, line, function.
    """

    task: str
    at_ns: int
    error: str
    trace: tuple[tuple[str, int, str], ...]

    @property
    def details(self) -> str:
        """Return the error and its calls, one line per call."""
        return self.error + ''.join(
            f'\n  {path}:{line} in {name}' for path, line, name in self.trace)

    def __str__(self) -> str:
        return f'task {self.task!r}: {self.details}'


def describe(task: str, at_ns: int, error: BaseException, *,
             outermost: bool = False) -> FailureReport:
    """
    Make the report of an exception that a job raised.

    It reads no source files, which would be I/O in the loop. It does not trust the exception,
    whose ``__str__`` is code of the task's author: that may raise, or never end. The caller bounds
    its time by a :class:`~rt_robot_os.kernel.TaskAborted`.

    :param outermost: include the outermost call, which usually is the dispatcher's own.
    """
    # The original attributes, which the author's class may have overridden.
    name: str = type.__dict__['__name__'].__get__(type(error))
    try:
        text = str.__str__(str(error))
    except TaskAborted:
        text = '(its text is not available: __str__ took too long)'
    except BaseException as second:
        text = f"(its text is not available: {type.__dict__['__name__'].__get__(type(second))})"
    length = str.__len__(text)
    text = str.__getitem__(text, slice(0, _TEXT_MAXIMUM))
    if length > _TEXT_MAXIMUM:
        text = f'{text}... ({length} characters)'
    traceback: TracebackType | None = BaseException.__dict__['__traceback__'].__get__(error)
    if traceback is not None and not outermost:
        traceback = traceback.tb_next
    calls = _innermost_calls(traceback)
    return FailureReport(task, at_ns, f'{name}: {text}' if text else name, calls)


def drop_context() -> None:
    """
    Remove the ``__context__`` of the exception that is being handled.

    Raising an exception searches that chain natively. In a job that recurses in its ``except``
    clauses it has thousands of links: 0.2 ms for each exception, also in jobs above it.
    """
    handled = sys.exc_info()[1]
    if handled is not None:
        _context.__set__(handled, None)


def _innermost_calls(traceback: TracebackType | None) -> tuple[tuple[str, int, str], ...]:
    calls: deque[tuple[str, int, str]] = deque(maxlen=_CALLS_MAXIMUM)
    while traceback is not None:
        code = traceback.tb_frame.f_code
        calls.append((code.co_filename, traceback.tb_lineno, code.co_name))
        traceback = traceback.tb_next
    return tuple(calls)
