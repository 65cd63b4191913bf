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
What a user sees of a job that fails or is ended, whichever build of the kernel runs.

The compiled one has no lines at which a signal's handler could run: an abort comes at a line of
interpreted code, or when a publication, a read or a resource has been left, never within one.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from rt_robot_os.base import compiled
from rt_robot_os.base.errors import TopicError
from rt_robot_os.kernel import BudgetPolicy
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import MonotonicClock
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.topics import Bus

US, MS, S = 1_000, 1_000_000, 1_000_000_000
ENOUGH = 40


def line_of(function: Callable[..., object], text: str) -> int:
    """Return the number of the line of a function that contains a text."""
    code = function.__code__
    lines = Path(__file__).read_text().splitlines()
    return next(number for number in range(code.co_firstlineno, len(lines))
                if text in lines[number - 1])


def deeper() -> None:
    raise ValueError('a fault of the user')


def failing() -> None:
    deeper()


def test_a_failure_is_told_with_the_calls_of_the_user_and_no_others() -> None:
    kernel = Kernel(VirtualClock())
    kernel.add_task('task', failing, priority=50, rate_hz=10.0)
    kernel.run(50 * MS)
    assert kernel.failures[-1].trace == (
        (__file__, line_of(failing, 'deeper()'), 'failing'),
        (__file__, line_of(deeper, 'raise'), 'deeper'))


def test_an_error_of_the_package_is_told_with_the_line_of_the_user_and_its_own() -> None:
    kernel = Kernel(VirtualClock())
    bus = Bus(kernel)
    bus.declare('number', 'std_msgs/msg/Float64')
    publisher = bus.publisher('number')

    def job() -> None:
        publisher.publish_cdr(b'nonsense')

    kernel.add_task('task', job, priority=50, rate_hz=10.0)
    kernel.run(50 * MS)
    failure = kernel.failures[-1]
    assert failure.error.startswith(TopicError.__name__)
    assert failure.trace[0] == (__file__, line_of(job, 'publish_cdr'), 'job')
    path, line, function = failure.trace[-1]
    assert path.endswith('publisher.py') and line > 0 and function == 'publish_cdr'


def test_what_a_higher_task_raises_is_not_told_of_the_publisher_below() -> None:
    kernel = Kernel(VirtualClock())
    bus = Bus(kernel)
    bus.declare('number', 'std_msgs/msg/Float64')
    publisher = bus.publisher('number')
    reader = kernel.add_task('reader', failing, priority=60)
    bus.subscribe('number', 'reader', task=reader)
    writer = kernel.add_task('writer', lambda: publisher.publish(), priority=50, rate_hz=10.0)
    kernel.run(50 * MS)
    assert [failure.task for failure in kernel.failures] == ['reader']
    assert [call[2] for call in kernel.failures[-1].trace] == ['failing', 'deeper']
    assert (reader.failures, writer.failures) == (1, 0)


class Busy:
    """A job that does nothing but publish, read and use a resource, and never ends by itself."""

    def __init__(self) -> None:
        self.kernel = Kernel(MonotonicClock())
        bus = Bus(self.kernel)
        bus.declare('number', 'std_msgs/msg/Float64')
        self.publisher = bus.publisher('number')
        self.reader = bus.subscribe('number', 'reader')
        self.arm = self.kernel.resource('arm')
        self.torn: list[tuple[int, int]] = []
        self.task = self.kernel.add_task(
            'busy', self.job, priority=50, rate_hz=500.0, resources=[self.arm], budget_ns=200 * US,
            on_budget=BudgetPolicy.ABORT)
        self.kernel.add_task('judge', self.judge, priority=40, rate_hz=500.0)

    def job(self) -> None:
        while True:
            self.publisher.publish()
            with self.arm:
                self.reader.take()

    def judge(self) -> None:
        """Look, after each abort, whether something was left half-done."""
        if self.publisher.published != self.publisher.topic.head or self.arm.holder is not None:
            self.torn.append((self.publisher.published, self.publisher.topic.head))
        if self.task.aborted >= ENOUGH:
            self.kernel.stop()
        self.task.rearm()  # a busy machine may have kept it from ending before the second abort


def test_an_abort_leaves_no_publication_and_no_resource_half_done() -> None:
    busy = Busy()
    busy.kernel.run(60 * S)
    assert busy.task.aborted >= ENOUGH
    assert busy.torn == []
    for failure in busy.kernel.failures:
        if failure.error.startswith('continued after TaskAborted'):  # see rearm() above
            continue
        assert failure.error.startswith("TaskAborted: task 'busy'")
        assert failure.trace[0][0] == __file__ and failure.trace[0][2] == 'job'
        if compiled.state().compiled:  # at the user's lines, or entering or leaving it
            path, _, function = failure.trace[-1]
            assert path == __file__ or function in ('__enter__', '__exit__')
