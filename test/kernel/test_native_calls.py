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


"""What delays preemption is measured and charged; what merely waits delays nothing."""

from __future__ import annotations

from collections.abc import Callable
import os
import select
import socket
import time

from kernel_tools import balance
from kernel_tools import MS
from kernel_tools import StallingClock
from kernel_tools import US
import pytest

from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import MonotonicClock

ENOUGH_NS = 30 * MS
LONGEST = 2_000_000_000
PERIOD_NS = MS


def test_the_delay_of_an_interrupt_is_charged_to_the_task_that_ran() -> None:
    clock = StallingClock()
    kernel = Kernel(clock)

    def calculate() -> None:
        clock.spend(700 * US)
        clock.stall(800 * US)

    def nested() -> None:
        clock.stall(100 * US)

    high = kernel.add_task('high', lambda: None, priority=90, rate_hz=1000.0)
    middle = kernel.add_task('middle', nested, priority=50, rate_hz=100.0, phase_ns=950 * US)
    low = kernel.add_task('low', calculate, priority=10, rate_hz=100.0)
    quiet = kernel.add_task('quiet', lambda: clock.spend(3 * MS), priority=5, rate_hz=100.0)
    kernel.run(10 * MS)
    # low is in its call from 0.7 to 1.5 ms and holds up middle, due at 0.95 and high, due at 1.
    assert low.blocked_maximum_ns == 550 * US
    assert high.blocked_maximum_ns == middle.blocked_maximum_ns == quiet.blocked_maximum_ns == 0


def test_a_job_that_goes_on_after_the_end_is_not_charged_for_it() -> None:
    clock = StallingClock()
    kernel = Kernel(clock)
    task = kernel.add_task('task', lambda: clock.spend(500 * MS), priority=50, rate_hz=1.0)
    kernel.run(10 * MS)
    assert task.blocked_maximum_ns == 0


def test_a_native_call_is_charged_with_what_it_held_up() -> None:
    kernel = Kernel(MonotonicClock())
    count = 1_000_000

    def job() -> None:
        nonlocal count
        sum(range(count))
        # Not by the time it took: on a busy machine part of that is before and after the call.
        if low.blocked_maximum_ns > ENOUGH_NS or count > LONGEST:
            kernel.stop()
        count *= 2

    high = kernel.add_task('high', lambda: None, priority=90, rate_hz=1e9 / PERIOD_NS)
    low = kernel.add_task('low', job, priority=10, rate_hz=100.0)
    kernel.run()
    # The handler of the interrupt came after the call.
    assert low.blocked_maximum_ns > ENOUGH_NS
    assert high.missed > 0
    assert high.latency.maximum_ns > ENOUGH_NS
    assert not any(map(balance, kernel.tasks))


def wait_by_read(fd: int) -> None:
    os.read(fd, 1)


def wait_by_poll(fd: int) -> None:
    poll = select.poll()
    poll.register(fd, select.POLLIN)
    assert poll.poll() == [(fd, select.POLLIN)]


def wait_by_select(fd: int) -> None:
    assert select.select([fd], [], [])[0] == [fd]


@pytest.mark.parametrize('wait', [wait_by_read, wait_by_poll, wait_by_select])
def test_waiting_in_a_system_call_delays_no_task(wait: Callable[[int], None]) -> None:
    kernel = Kernel(MonotonicClock())
    reading, writing = os.pipe()
    runs_at_the_end: list[int] = []

    def high_job() -> None:
        if high.runs == 100:
            os.write(writing, b'x')  # only this ends the waiting

    def low_job() -> None:
        wait(reading)
        runs_at_the_end.append(high.runs)
        kernel.stop()

    high = kernel.add_task('high', high_job, priority=90, rate_hz=1000.0)
    low = kernel.add_task('low', low_job, priority=10, rate_hz=1.0)
    try:
        kernel.run()
    finally:
        os.close(reading)
        os.close(writing)
    assert runs_at_the_end[0] >= 101
    assert low.runs == 1
    assert not any(map(balance, kernel.tasks))


def test_waiting_for_a_datagram_delays_no_task() -> None:
    kernel = Kernel(MonotonicClock())
    first, second = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)

    def high_job() -> None:
        if high.runs == 20:
            second.send(b'the answer')

    def low_job() -> None:
        received.append(first.recv(100))
        kernel.stop()

    received: list[bytes] = []
    high = kernel.add_task('high', high_job, priority=90, rate_hz=1000.0)
    kernel.add_task('low', low_job, priority=10, rate_hz=1.0)
    with first, second:
        kernel.run()
    assert received == [b'the answer']
    assert not kernel.failures


def test_sleeping_delays_no_task_and_lasts_as_long_as_requested() -> None:
    kernel = Kernel(MonotonicClock())
    slept: list[int] = []

    def low_job() -> None:
        began_ns = kernel.now_ns()
        time.sleep(0.05)
        slept.append(kernel.now_ns() - began_ns)
        kernel.stop()

    high = kernel.add_task('high', lambda: None, priority=90, rate_hz=1000.0)
    kernel.add_task('low', low_job, priority=10, rate_hz=1.0)
    kernel.run()
    assert slept[0] >= 50 * MS
    assert high.runs >= 2
    assert high.runs + high.missed >= 50
