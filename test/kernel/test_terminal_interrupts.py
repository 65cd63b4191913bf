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


"""Terminals release tasks, without waiting for bytes that Linux has not handed on."""

from __future__ import annotations

from collections.abc import Iterator
import os
import pty
import resource
import select
import tty

from kernel_tools import MS
from kernel_tools import spin_until
import pytest

from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import MonotonicClock
from rt_robot_os.kernel.interrupts import InterruptSources


@pytest.fixture
def kernel() -> Kernel:
    return Kernel(MonotonicClock())


@pytest.fixture
def ends() -> Iterator[tuple[int, int]]:
    controller, terminal = pty.openpty()
    tty.setraw(terminal)
    os.set_blocking(terminal, False)
    yield controller, terminal
    for fd in (controller, terminal):
        try:
            os.close(fd)
        except OSError:
            pass  # the test did


@pytest.fixture
def one_cpu() -> Iterator[None]:
    """Where Linux can hand on bytes only while this thread waits."""
    cpus = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cpus)})
    yield
    os.sched_setaffinity(0, cpus)


def wait_readable(terminal: int) -> None:
    assert select.select([terminal], [], [], 60)[0]


def test_looking_at_a_terminal_does_not_wait_for_bytes_on_their_way(
        kernel: Kernel, ends: tuple[int, int], one_cpu: None) -> None:
    controller, terminal = ends
    sources = InterruptSources(MonotonicClock())
    sources.add(terminal, kernel.add_task('reader', lambda: None, priority=80))
    waits = 0
    for _ in range(200):
        os.write(controller, b'first')
        wait_readable(terminal)
        assert [source.fd for source in sources.ready(0)] == [terminal]
        os.read(terminal, 100)
        os.write(controller, b'second')  # on its way
        before = resource.getrusage(resource.RUSAGE_THREAD).ru_nvcsw
        sources.ready(0)
        waits += resource.getrusage(resource.RUSAGE_THREAD).ru_nvcsw - before
        wait_readable(terminal)
        os.read(terminal, 100)
        assert not sources.ready(0)
    # Linux may take turns for a moment while its worker hands bytes on.
    assert waits <= 20


def test_all_terminals_with_bytes_are_served_next_to_other_descriptors(
        kernel: Kernel, ends: tuple[int, int]) -> None:
    more = pty.openpty()
    tty.setraw(more[1])
    pipe = os.pipe()
    heard: list[int] = []

    def job(fd: int) -> None:
        os.read(fd, 100)
        heard.append(fd)
        if len(heard) == 3:
            kernel.stop('all three')

    for priority, (reading, writing) in zip(
            (30, 20, 10), ((ends[1], ends[0]), (more[1], more[0]), pipe)):
        task = kernel.add_task(f'{priority}', lambda fd=reading: job(fd), priority=priority)
        kernel.add_interrupt(reading, task)
        os.write(writing, b'x')
    assert kernel.run(30_000 * MS) == 'all three'
    assert sorted(heard) == sorted((ends[1], more[1], pipe[0]))
    for fd in (*more, *pipe):
        os.close(fd)


def test_a_terminal_that_hung_up_releases_its_task(kernel: Kernel, ends: tuple[int, int]) -> None:
    controller, terminal = ends

    pipe = os.pipe()

    def read() -> None:
        if os.read(terminal, 100) == b'':
            kernel.stop('hung up')

    def hang_up() -> None:
        os.close(controller)
        os.write(pipe[1], b'x')  # Linux sends no signal for a terminal that hung up

    kernel.add_interrupt(terminal, kernel.add_task('reader', read, priority=80))
    kernel.add_interrupt(pipe[0], kernel.add_task(
        'other', lambda: os.read(pipe[0], 1), priority=70))
    kernel.add_task('closer', hang_up, priority=10, rate_hz=1.0)
    assert kernel.run(30_000 * MS) == 'hung up'
    for fd in pipe:
        os.close(fd)


def test_the_end_of_input_at_a_terminal_with_lines_releases_its_task(kernel: Kernel) -> None:
    controller, terminal = pty.openpty()

    def job() -> None:
        if os.read(terminal, 100) == b'':
            kernel.stop('end of input')

    reader = kernel.add_task('reader', job, priority=80)
    kernel.add_interrupt(terminal, reader)
    kernel.add_task('types', lambda: (os.write(controller, b'\x04'),
                                      spin_until(kernel, lambda: reader.runs)),
                    priority=10, rate_hz=1.0)
    assert kernel.run(30_000 * MS) == 'end of input'
    os.close(controller)
    os.close(terminal)


def test_a_terminal_that_sends_while_its_task_waits_loses_nothing(
        kernel: Kernel, ends: tuple[int, int]) -> None:
    controller, terminal = ends
    received: list[bytes] = []

    def read() -> None:
        try:
            received.append(os.read(terminal, 4096))
        except BlockingIOError:
            pass
        if len(b''.join(received)) == 2000:
            kernel.stop('all there')

    def busy() -> None:
        for number in range(200):  # the reader is below this one: it waits, its signals masked
            os.write(controller, b'%09d ' % number)

    kernel.add_interrupt(terminal, kernel.add_task('reader', read, priority=10))
    kernel.add_task('busy', busy, priority=50, rate_hz=0.001)
    assert kernel.run(30_000 * MS) == 'all there'
    assert b''.join(received) == b''.join(b'%09d ' % number for number in range(200))
