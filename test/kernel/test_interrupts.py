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


"""Descriptors that become readable release their tasks."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
import fcntl
import os
import pty
import socket
import tty

from kernel_tools import balance
from kernel_tools import CLOCKS
from kernel_tools import MS
from kernel_tools import run_program
from kernel_tools import spin_until
import pytest

from rt_robot_os.kernel import Clock
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import MonotonicClock
from rt_robot_os.kernel import Task
from rt_robot_os.kernel import TraceLog

Ends = tuple[int, int]


def open_socketpair() -> Ends:
    first, second = socket.socketpair()
    return first.detach(), second.detach()


def open_pty() -> Ends:
    controller, terminal = pty.openpty()
    tty.setraw(terminal)
    return terminal, controller


KINDS: dict[str, Callable[[], Ends]] = {
    'pipe': os.pipe, 'socketpair': open_socketpair, 'pty': open_pty}


@pytest.fixture(params=KINDS)
def ends(request: pytest.FixtureRequest) -> Iterator[Ends]:
    opened = KINDS[request.param]()
    yield opened
    close(opened)


@pytest.fixture
def pipe() -> Iterator[Ends]:
    opened = os.pipe()
    yield opened
    close(opened)


@pytest.fixture
def kernel() -> Kernel:
    return Kernel(MonotonicClock())


def close(opened: Ends) -> None:
    for fd in opened:
        try:
            os.close(fd)
        except OSError:
            pass  # the test did


def drain(fd: int) -> bytes:
    """Read until nothing is left, as a task has to."""
    content = b''
    while True:
        try:
            part = os.read(fd, 1000)
        except BlockingIOError:
            return content
        if not part:
            return content
        content += part


def add_reader(kernel: Kernel, fd: int, priority: int = 80) -> tuple[Task, list[bytes]]:
    received: list[bytes] = []
    task = kernel.add_task(f'reader of {fd}', lambda: received.append(drain(fd)),
                           priority=priority)
    kernel.add_interrupt(fd, task)
    return task, received


def test_a_descriptor_that_becomes_readable_releases_its_task(
        kernel: Kernel, ends: Ends) -> None:
    reading, writing = ends

    def job() -> None:
        for number in range(20):
            os.write(writing, b'%d ' % number)
            # Preempted here, without waiting for anything.
            spin_until(kernel, lambda: b''.join(received).count(b' ') == number + 1)
        kernel.stop()

    reader, received = add_reader(kernel, reading)
    writer = kernel.add_task('writer', job, priority=10, rate_hz=1.0)
    kernel.run()
    assert b''.join(received) == b''.join(b'%d ' % n for n in range(20))
    assert reader.runs >= 20
    assert not kernel.failures
    assert not any(map(balance, (reader, writer)))


def test_what_came_before_the_run_is_seen(kernel: Kernel, ends: Ends) -> None:
    reading, writing = ends
    received: list[bytes] = []

    def job() -> None:
        received.append(drain(reading))
        if b''.join(received) == b'0123456789':
            kernel.stop('all there')

    task = kernel.add_task('reader', job, priority=80)
    kernel.add_interrupt(reading, task)
    for number in range(10):
        os.write(writing, b'%d' % number)
    assert kernel.run() == 'all there'


@pytest.mark.parametrize('clock', CLOCKS.values(), ids=CLOCKS)
def test_a_descriptor_added_by_a_task_is_looked_at_at_once(
        clock: type[Clock], pipe: Ends) -> None:
    kernel = Kernel(clock())
    reading, writing = pipe
    os.set_blocking(reading, False)
    os.write(writing, b'there already')
    seen: list[int] = []

    def job() -> None:
        kernel.add_interrupt(reading, reader)
        seen.append(reader.runs)
        kernel.stop()

    reader = kernel.add_task('reader', lambda: drain(reading), priority=80)
    kernel.add_task('adder', job, priority=10, rate_hz=1.0)
    kernel.run()
    assert seen == [1]


def test_a_removed_descriptor_releases_no_task_and_gets_its_flags_back(
        kernel: Kernel, ends: Ends) -> None:
    reading, writing = ends
    flags = fcntl.fcntl(reading, fcntl.F_GETFL)

    def job() -> None:
        os.write(writing, b'x')
        spin_until(kernel, lambda: reader.runs)
        kernel.remove_interrupt(reading)
        kernel.remove_interrupt(reading)
        assert fcntl.fcntl(reading, fcntl.F_GETFL) == flags
        os.write(writing, b'y')
        os.write(second[1], b'z')
        spin_until(kernel, lambda: other.runs)
        kernel.stop()

    second = os.pipe()
    reader, received = add_reader(kernel, reading)
    other, _ = add_reader(kernel, second[0])
    kernel.add_task('remover', job, priority=10, rate_hz=1.0)
    kernel.run()
    assert not kernel.failures
    assert b''.join(received) == b'x'
    close(second)


@pytest.mark.parametrize('kind', ['pipe', 'socketpair'])
def test_a_descriptor_whose_peer_closed_releases_its_task(kernel: Kernel, kind: str) -> None:
    reading, writing = KINDS[kind]()

    def reader_job() -> None:
        if os.read(reading, 100) == b'':
            kernel.remove_interrupt(reading)
            os.close(reading)
            kernel.stop('closed by the peer')

    def closer_job() -> None:
        os.close(writing)
        spin_until(kernel, lambda: reader.runs)

    reader = kernel.add_task('reader', reader_job, priority=80)
    kernel.add_interrupt(reading, reader)
    kernel.add_task('closer', closer_job, priority=10, rate_hz=1.0)
    assert kernel.run() == 'closed by the peer'
    assert not kernel.failures


def test_signals_stop_with_the_run_and_flags_are_as_before(kernel: Kernel, ends: Ends) -> None:
    reading, _ = ends
    flags = fcntl.fcntl(reading, fcntl.F_GETFL)
    within: list[int] = []
    reader, _ = add_reader(kernel, reading)
    kernel.add_task('task', lambda: within.append(fcntl.fcntl(reading, fcntl.F_GETFL)),
                    priority=10, rate_hz=1000.0)
    for runs in (1, 2):
        while len(within) < runs:
            kernel.run(50 * MS)
        assert fcntl.fcntl(reading, fcntl.F_GETFL) == flags
    assert all(f & fcntl.FASYNC and f & os.O_NONBLOCK for f in within)


def test_interrupts_nest_through_all_99_priorities(kernel: Kernel) -> None:
    log = TraceLog()
    kernel.trace = log
    pipes = [os.pipe() for _ in range(99)]
    tasks = []

    def job(index: int) -> None:
        os.read(pipes[index][0], 1)
        if index < 98:
            os.write(pipes[index + 1][1], b'x')
            spin_until(kernel, lambda: tasks[index + 1].runs)
        else:
            kernel.stop()

    for index, (reading, _) in enumerate(pipes):
        tasks.append(kernel.add_task(f'{index + 1}', lambda i=index: job(i), priority=index + 1))
        kernel.add_interrupt(reading, tasks[-1])
    os.write(pipes[0][1], b'x')
    kernel.run()
    assert not kernel.failures
    assert [(e.kind, e.depth) for e in log.events()] == [
        ('start', n) for n in range(99)] + [('end', n) for n in reversed(range(99))]
    for opened in pipes:
        close(opened)


def test_several_readable_descriptors_release_by_priority(kernel: Kernel) -> None:
    log = TraceLog()
    kernel.trace = log
    pipes = [os.pipe() for _ in range(3)]
    for (reading, writing), priority in zip(pipes, (20, 80, 50)):
        task = kernel.add_task(f'{priority}', lambda fd=reading: drain(fd), priority=priority)
        kernel.add_interrupt(reading, task)
        os.write(writing, b'x')
    kernel.add_task('last', kernel.stop, priority=1, rate_hz=1.0)
    kernel.run()
    assert [e.task for e in log.events() if e.kind == 'start'] == ['80', '50', '20', 'last']
    for opened in pipes:
        close(opened)


OVERFLOW = """
import os, resource
from rt_robot_os.kernel import Kernel, MonotonicClock

reading, writing = os.pipe()
kernel = Kernel(MonotonicClock())

def job():
    # No room for a single queued signal: Linux sends SIGIO in their place.
    resource.setrlimit(resource.RLIMIT_SIGPENDING, (0, 0))
    os.write(writing, b'x')
    for _ in range(10_000_000):
        if reader.runs:
            break
    kernel.stop(f'read {reader.runs}')

reader = kernel.add_task('reader', lambda: os.read(reading, 100), priority=80)
kernel.add_interrupt(reading, reader)
kernel.add_task('writer', job, priority=10, rate_hz=1.0)
print(kernel.run())
"""


def test_interrupts_come_although_no_signal_can_be_queued() -> None:
    done = run_program(OVERFLOW)
    assert (done.returncode, done.stdout, done.stderr) == (0, 'read 1\n', '')
