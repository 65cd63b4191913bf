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
Let the timer interrupt come at each instruction of the kernel: no release is lost or late.

On the real clock the handler runs between any two bytecodes. Here a trace function plays the
timer: at the chosen instruction virtual time jumps to the deadline and the handler is called, on
top of whatever the kernel was about to do.
"""

from __future__ import annotations

import os
import sys

from at_line import AtLine
from at_line import of_files
from kernel_tools import balance
from kernel_tools import MS
from kernel_tools import US
import pytest

from rt_robot_os.base.errors import TaskError
from rt_robot_os.kernel import core
from rt_robot_os.kernel import fault_handling
from rt_robot_os.kernel import interrupts
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import kernel as kernel_module
from rt_robot_os.kernel import releases
from rt_robot_os.kernel import scheduler as scheduler_module
from rt_robot_os.kernel import timer_interrupt
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.kernel.clock import Handler
from rt_robot_os.linux import recursion
from rt_robot_os.linux.timer import REPEAT_NS

PERIODS = 2
END_NS = (PERIODS + 1) * MS


class RacingClock(VirtualClock):
    """A clock whose timer can be made to come now, except while signals are held."""

    wake_ns = 20 * US  # so that the kernel also polls it, and sets a timer for several releases

    def __init__(self) -> None:
        super().__init__(start_ns=MS)
        self.held = False

    def mask_signals(self) -> None:
        self.held = True

    def unmask_signals(self) -> None:
        self.held = False

    def fire(self) -> None:
        first_ns = min(self._timer_ns, self._spare_ns)
        # Further away is only the repetition of an interrupt that is being served, and a job that
        # had to wait until the end is missed by right.
        if self.held or first_ns >= min(self._now_ns + 900 * US, END_NS) or self._on_tick is None:
            return
        self._now_ns = max(self._now_ns, first_ns)
        self._expire_timers(self._now_ns + REPEAT_NS)
        self._on_tick()


def run_with_interrupt_at(step: int) -> tuple[Kernel, int]:
    clock = RacingClock()
    kernel = Kernel(clock)

    def low_job() -> None:
        # Never idle, rarely in the kernel: a lost interrupt shows immediately.
        kernel.release(event)
        clock.spend(400 * US)
        kernel.settle()  # with nothing to run, as after an interrupt that was none
        clock.spend(PERIODS * MS - 900 * US)
        kernel.release(event)
        clock.spend(400 * US)

    high = kernel.add_task('high', lambda: clock.spend(10 * US), priority=90, rate_hz=1000.0)
    mid = kernel.add_task('mid', lambda: clock.spend(20 * US), priority=50, rate_hz=1000.0,
                          phase_ns=300 * US)
    kernel.add_task('close', lambda: clock.spend(5 * US), priority=60, rate_hz=1000.0,
                    phase_ns=305 * US)
    kernel.add_task('low', low_job, priority=10, rate_hz=100.0)
    event = kernel.add_task('event', lambda: None, priority=20)
    files = tuple(str(module.__file__) for module in (
        core, fault_handling, kernel_module, recursion, releases, scheduler_module,
        timer_interrupt))
    # Before and after, an interrupt finds a kernel that does not run, at each of some 2000 lines.
    tracer = AtLine(step, clock.fire, of_files(*files), when=lambda: kernel.running)
    sys.settrace(tracer)
    try:
        kernel.run(PERIODS * MS)
    finally:
        sys.settrace(None)
    assert not kernel.failures
    assert (high.runs, high.missed) == (PERIODS, 0)
    assert (mid.runs, mid.missed) == (PERIODS, 0)
    assert high.latency.maximum_ns < 800 * US  # no more than the interrupt made time jump
    assert not any(map(balance, kernel.tasks))
    assert all(task.execution.maximum_ns < 10 * MS for task in kernel.tasks)
    return kernel, tracer.seen


@pytest.mark.interpreted
def test_an_interrupt_at_any_instruction_of_the_kernel_is_served(untraced: None) -> None:
    step, total = 1, 1
    while step <= total:
        try:
            _, total = run_with_interrupt_at(step)
        except AssertionError as error:
            raise AssertionError(f'interrupt at step {step}') from error
        step += 1
    assert total > 400


def run_with_stop_at(step: int) -> int:
    """Stop it, as a handler of a signal does, and let interrupts come in idle time as well."""
    clock = RacingClock()
    kernel = Kernel(clock)
    kernel.add_task('high', lambda: clock.spend(10 * US), priority=90, rate_hz=1000.0)
    kernel.add_task('low', lambda: clock.spend(200 * US), priority=10, rate_hz=500.0)
    kernel.on_idle = lambda slack_ns: clock.spend(slack_ns + 50 * US)
    files = tuple(str(module.__file__) for module in (
        core, kernel_module, releases, scheduler_module, timer_interrupt))
    told_ns = []

    def stop() -> None:
        told_ns.append(clock.now_ns())
        kernel.stop('told')

    tracer = AtLine(step, stop, of_files(*files), when=lambda: kernel.running)
    sys.settrace(tracer)
    try:
        reason = kernel.run(4 * MS)
    finally:
        sys.settrace(None)
    before_its_end = bool(told_ns) and told_ns[0] < kernel.start_ns + 4 * MS
    assert reason == 'told' or not before_its_end
    assert not kernel.failures
    return tracer.seen


@pytest.mark.interpreted
def test_a_stop_at_any_instruction_of_the_kernel_ends_it(untraced: None) -> None:
    step, ended = 1, False
    while not ended:
        try:
            ended = run_with_stop_at(step) < step
        except (AssertionError, TaskError) as error:
            raise AssertionError(f'stopped at step {step}') from error
        step += 1
    assert step > 200


class InterruptedClock(VirtualClock):
    """A clock whose descriptors can interrupt at any line."""

    interrupt: Handler

    def attach(self, on_tick: Handler, on_interrupt: Handler, on_break: Handler) -> None:
        super().attach(on_tick, on_interrupt, on_break)
        self.interrupt = on_interrupt


def run_with_signal_at(step: int, reading: int) -> int:
    """Add and remove a readable descriptor while the signal of one comes at a given line."""
    clock = InterruptedClock(start_ns=MS)
    kernel = Kernel(clock)
    lines = []

    def come_and_go() -> None:
        kernel.add_interrupt(reading, reader)
        lines.append(kernel.statistics().sources)
        kernel.remove_interrupt(reading)

    reader = kernel.add_task('reader', lambda: None, priority=50)
    kernel.add_task('low', come_and_go, priority=10, rate_hz=1000.0)
    tracer = AtLine(step, lambda: clock.interrupt(), of_files(interrupts.__file__))
    sys.settrace(tracer)
    try:
        kernel.run(MS)
    finally:
        sys.settrace(None)
    assert not kernel.failures, f'{kernel.failures[0]} at step {step}'
    assert len(lines) == 1 and reader.runs >= 1, f'at step {step}'
    assert not kernel.statistics().sources
    return tracer.seen


@pytest.mark.interpreted
def test_a_signal_while_a_descriptor_is_added_or_removed_finds_a_whole_table(
        untraced: None) -> None:
    # As under many clients that come and go: the kernel looked up one that was half removed.
    ends = os.pipe()
    try:
        os.write(ends[1], b'x')
        step, total = 1, 1
        while step <= total:
            total = run_with_signal_at(step, ends[0])
            step += 1
        assert total > 20
    finally:
        for fd in ends:
            os.close(fd)
