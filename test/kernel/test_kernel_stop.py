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


"""However a run ends, nothing of it is left in the process."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
import fcntl
import os
import signal
import threading
import time

from kernel_tools import balance
from kernel_tools import MS
from kernel_tools import run_program
import pytest

from rt_robot_os.base.errors import KernelError
from rt_robot_os.base.errors import TaskError
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import MonotonicClock
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.kernel.clock import INTERRUPT_SIGNAL
from rt_robot_os.kernel.clock import TICK_SIGNAL

SIGNALS = (TICK_SIGNAL, INTERRUPT_SIGNAL, signal.SIGIO, signal.SIGINT, signal.SIGTERM)

# Runs in a process of its own: each child runs a kernel in full swing, lets it end, and then
# provokes every signal that could still come. One that does ends the child.
CHILDREN = """
import fcntl, os, signal, sys, time
from rt_robot_os.kernel import Kernel, MonotonicClock

def handlers():
    return [signal.getsignal(s) for s in range(1, 65) if s not in (9, 19, 32, 33)]

def child(number):
    before = handlers()
    reading, writing = os.pipe()
    flags = fcntl.fcntl(reading, fcntl.F_GETFL)
    kernel = Kernel(MonotonicClock((signal.SIGTERM,)))
    for index in range(10):
        kernel.add_task(f't{index}', lambda: os.write(writing, b'x'), priority=index + 1,
                        rate_hz=5000.0)
    kernel.add_task('end', lambda: ENDING(kernel) if reader.runs else None, priority=50,
                    rate_hz=200.0, phase_ns=2_000_000 + number * 10_000)
    reader = kernel.add_task('reader', lambda: os.read(reading, 100), priority=60)
    kernel.add_interrupt(reading, reader)
    try:
        kernel.run()
    except KeyboardInterrupt:
        pass
    os.write(writing, b'x')
    until = time.monotonic() + 0.003
    while time.monotonic() < until:
        os.write(writing, b'x')
        os.read(reading, 100)
    assert handlers() == before
    assert fcntl.fcntl(reading, fcntl.F_GETFL) == flags
    assert not signal.pthread_sigmask(signal.SIG_BLOCK, ())
    assert reader.runs and reader.failures == 0
    sys.exit(40 + number)

for number in range(20):
    pid = os.fork()
    if not pid:
        child(number)
    code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    assert code == 40 + number, f'child {number} ended with {code}'
print('all lived on')
"""


@pytest.mark.parametrize('ending', [
    'lambda kernel: kernel.stop()',
    'lambda kernel: os.kill(os.getpid(), signal.SIGINT)',
    'lambda kernel: (signal.signal(signal.SIGTERM, lambda *_: kernel.stop()), '
    'os.kill(os.getpid(), signal.SIGTERM), signal.signal(signal.SIGTERM, signal.SIG_DFL))',
], ids=['stop', 'SIGINT', 'SIGTERM'])
def test_a_process_lives_on_after_its_kernel_and_ends_as_it_wants(ending: str) -> None:
    done = run_program(CHILDREN.replace('ENDING', f'({ending})'))
    assert (done.returncode, done.stdout, done.stderr) == (0, 'all lived on\n', '')


@pytest.fixture
def clean() -> Callable[[], None]:
    before = [signal.getsignal(s) for s in SIGNALS]

    def check() -> None:
        assert [signal.getsignal(s) for s in SIGNALS] == before
        assert not signal.pthread_sigmask(signal.SIG_BLOCK, ()) & set(SIGNALS)

    return check


def test_a_run_that_an_exception_ends_is_cleaned_up(clean: Callable[[], None]) -> None:
    def trace(at_ns: int, kind: str, task: str) -> None:
        raise ZeroDivisionError

    kernel = Kernel(MonotonicClock())
    kernel.add_task('task', lambda: None, priority=50, rate_hz=1000.0)
    kernel.trace = trace
    with pytest.raises(KernelError, match='ZeroDivisionError'):
        kernel.run()
    clean()
    assert not kernel.running
    kernel.trace = None
    assert kernel.run(2 * MS) == 'duration'
    clean()


def test_a_descriptor_that_was_closed_before_the_run_is_named(
        clean: Callable[[], None]) -> None:
    kernel = Kernel(MonotonicClock())
    task = kernel.add_task('reader', lambda: None, priority=50)
    first, second = os.pipe(), os.pipe()
    for reading, _ in (first, second):
        kernel.add_interrupt(reading, task)
    for fd in second:
        os.close(fd)
    with pytest.raises(OSError, match=f'descriptor {second[0]} cannot release task .reader.'):
        kernel.run(MS)
    clean()
    assert not fcntl.fcntl(first[0], fcntl.F_GETFL) & (fcntl.FASYNC | os.O_NONBLOCK)
    for fd in first:
        os.close(fd)


def test_a_descriptor_that_a_task_closed_does_not_keep_the_run_from_ending(
        clean: Callable[[], None]) -> None:
    kernel = Kernel(MonotonicClock())
    reading, writing = os.pipe()

    def job() -> None:
        os.close(reading)
        kernel.stop('closed')

    task = kernel.add_task('task', job, priority=50, rate_hz=1000.0)
    kernel.add_interrupt(reading, task)
    try:
        assert kernel.run() == 'closed'
    finally:
        os.close(writing)
    clean()


def test_another_thread_is_refused(clean: Callable[[], None]) -> None:
    kernel = Kernel(MonotonicClock())
    kernel.add_task('task', lambda: None, priority=50, rate_hz=1000.0)
    errors: list[TaskError] = []

    def run() -> None:
        with pytest.raises(TaskError) as caught:
            kernel.run(MS)
        errors.append(caught.value)

    thread = threading.Thread(target=run, name='worker')
    thread.start()
    thread.join()
    assert "thread 'worker'" in str(errors[0])
    assert 'main thread' in str(errors[0])
    clean()
    assert kernel.run(MS) == 'duration'


def test_the_virtual_clock_runs_in_any_thread() -> None:
    kernel = Kernel(VirtualClock())
    task = kernel.add_task('task', lambda: None, priority=50, rate_hz=1000.0)
    thread = threading.Thread(target=kernel.run, args=(10 * MS,))
    thread.start()
    thread.join()
    assert task.runs == 10


def test_two_kernels_at_once_are_refused(clean: Callable[[], None]) -> None:
    outer, inner = Kernel(MonotonicClock()), Kernel(MonotonicClock())
    inner.add_task('task', lambda: None, priority=50, rate_hz=1000.0)

    def job() -> None:
        with pytest.raises(TaskError, match='another kernel runs in this process'):
            inner.run(MS)
        outer.stop()

    outer.add_task('task', job, priority=50, rate_hz=1000.0)
    outer.run()
    assert not outer.failures
    clean()


def test_ctrl_c_ends_the_run_after_the_job_and_is_raised_then(clean: Callable[[], None]) -> None:
    kernel = Kernel(MonotonicClock())
    ended: list[bool] = []

    def job() -> None:
        signal.raise_signal(signal.SIGINT)
        ended.append(True)

    task = kernel.add_task('task', job, priority=50, rate_hz=1000.0)
    with pytest.raises(KeyboardInterrupt):
        kernel.run()
    assert ended == [True]
    assert (task.runs, task.failures, balance(task)) == (1, 0, 0)
    clean()
    with pytest.raises(KeyboardInterrupt):
        kernel.run()
    assert task.runs == 2


def test_ctrl_c_again_ends_a_job_that_does_not_end(clean: Callable[[], None]) -> None:
    kernel = Kernel(MonotonicClock())

    def job() -> None:
        signal.setitimer(signal.ITIMER_REAL, 0.02, 0.02)  # pressed now and then, until it ends
        try:
            while True:
                pass
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)

    task = kernel.add_task('endless', job, priority=50, rate_hz=1000.0)
    before = signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(signal.SIGINT))
    try:
        with pytest.raises(KeyboardInterrupt):
            kernel.run()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert (task.runs, task.failures) == (1, 1)
    assert kernel.failures[0].error == 'KeyboardInterrupt'
    clean()


def test_ctrl_c_wakes_a_kernel_that_idles(clean: Callable[[], None]) -> None:
    kernel = Kernel(MonotonicClock())
    idles = threading.Event()
    kernel.on_idle = lambda slack_ns: idles.set()
    kernel.add_task('event', lambda: None, priority=50)
    main = threading.main_thread().ident
    assert main is not None

    def press() -> None:
        idles.wait()
        signal.pthread_kill(main, signal.SIGINT)

    thread = threading.Thread(target=press)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        kernel.run()
    thread.join()
    clean()


def test_a_signal_that_the_program_handles_wakes_a_kernel_that_idles(
        clean: Callable[[], None]) -> None:
    kernel = Kernel(MonotonicClock((signal.SIGTERM, signal.SIGHUP)))  # SIGHUP has no handler
    idles = threading.Event()
    kernel.on_idle = lambda slack_ns: idles.set()
    kernel.add_task('event', lambda: None, priority=50)
    main = threading.main_thread().ident
    assert main is not None

    def send() -> None:
        idles.wait()
        signal.pthread_kill(main, signal.SIGTERM)

    before = signal.signal(signal.SIGTERM, lambda *_: kernel.stop('SIGTERM'))
    thread = threading.Thread(target=send)
    thread.start()
    try:
        assert kernel.run() == 'SIGTERM'
    finally:
        thread.join()
        signal.signal(signal.SIGTERM, before)
    clean()


def test_the_end_that_comes_in_idle_time_ends_it() -> None:
    kernel = Kernel(VirtualClock())
    task = kernel.add_task('task', lambda: None, priority=50, rate_hz=100.0)
    kernel.on_idle = lambda slack_ns: kernel.clock.spend(slack_ns + 1)  # takes longer than it may
    assert kernel.run(25_000_000) == 'duration'
    assert task.runs == 3


def test_who_is_told_to_stop_in_idle_time_stops_although_an_interrupt_follows() -> None:
    kernel = Kernel(VirtualClock())

    def idle(slack_ns: int) -> None:
        kernel.stop('enough')
        kernel.clock.spend(slack_ns + 1)

    task = kernel.add_task('task', lambda: None, priority=50, rate_hz=100.0)
    kernel.on_idle = idle
    assert kernel.run(25_000_000) == 'enough'
    assert task.runs <= 1


def test_a_program_that_handles_ctrl_c_itself_keeps_its_handler() -> None:
    kernel = Kernel(MonotonicClock((signal.SIGINT,)))
    kernel.add_task('task', lambda: signal.raise_signal(signal.SIGINT), priority=50,
                    rate_hz=1000.0)
    before = signal.signal(signal.SIGINT, lambda *_: kernel.stop('mine'))
    try:
        assert kernel.run() == 'mine'
    finally:
        signal.signal(signal.SIGINT, before)


# ---- handlers of others -----------------------------------------------------------------------


def refuse(signum: int, frame: object) -> None:
    raise ValueError('the handler fails')


@pytest.fixture
def sends() -> Iterator[None]:
    before = signal.signal(signal.SIGUSR2, refuse)
    yield
    signal.signal(signal.SIGUSR2, before)


def press(kernel: Kernel, times: int) -> None:
    """Send the signal now and then, in idle time and in jobs."""
    main = threading.main_thread().ident
    assert main is not None
    for _ in range(times):
        seen = kernel.failures_total
        signal.pthread_kill(main, signal.SIGUSR2)
        end = time.monotonic() + 60
        while kernel.failures_total == seen and time.monotonic() < end:
            time.sleep(0.0005)


def test_an_exception_of_a_foreign_handler_is_contained(
        clean: Callable[[], None], sends: None) -> None:
    kernel = Kernel(MonotonicClock())
    thread = threading.Thread(target=press, args=(kernel, 100))
    kernel.add_task('busy', lambda: kernel.clock.spend(500 * 1000), priority=50, rate_hz=1000.0)
    last = kernel.add_task(
        'last', lambda: kernel.stop('enough') if thread.ident and not thread.is_alive() else None,
        priority=1, rate_hz=100.0)
    kernel.on_idle = lambda _: None if thread.ident else thread.start()
    assert kernel.run(60 * 10 ** 9) == 'enough'
    thread.join()
    assert not any(task.failures for task in kernel.tasks)
    assert last.runs
    assert kernel.failures_total == 100
    assert {(f.task, f.error) for f in kernel.failures} == {
        ('handler of SIGUSR2', 'ValueError: the handler fails')}
    assert signal.getsignal(signal.SIGUSR2) is refuse


def test_a_handler_that_was_installed_meanwhile_is_contained_when_it_is_guarded(
        clean: Callable[[], None], sends: None) -> None:
    kernel = Kernel(MonotonicClock())
    seen: list[int] = []

    def later(signum: int, frame: object) -> None:
        seen.append(signum)
        raise ValueError

    def job() -> None:
        signal.signal(signal.SIGUSR2, later)
        kernel.guard_handlers()
        signal.raise_signal(signal.SIGUSR2)
        kernel.stop()

    task = kernel.add_task('task', job, priority=50, rate_hz=10.0)
    kernel.run()
    assert (task.runs, task.failures, kernel.failures_total) == (1, 0, 1)
    assert seen == [signal.SIGUSR2]
    assert signal.getsignal(signal.SIGUSR2) is later


def test_a_handler_that_exits_ends_the_kernel_in_order(clean: Callable[[], None]) -> None:
    def leave(signum: int, frame: object) -> None:
        raise SystemExit(7)

    kernel = Kernel(MonotonicClock())
    before = signal.signal(signal.SIGUSR2, leave)
    ended: list[bool] = []

    def job() -> None:
        signal.raise_signal(signal.SIGUSR2)
        ended.append(True)

    task = kernel.add_task('task', job, priority=50, rate_hz=10.0)
    try:
        with pytest.raises(SystemExit) as raised:
            kernel.run()
    finally:
        signal.signal(signal.SIGUSR2, before)
    assert raised.value.code == 7
    assert (ended, task.failures) == ([True], 0)
    clean()


@pytest.mark.parametrize('where', ['idle', 'nested'])
def test_a_defect_of_the_kernel_is_told_as_such_and_no_job_is_blamed(where: str) -> None:
    kernel = Kernel(VirtualClock())
    went_on = []

    def defect(at_ns: int, kind: str, task: str) -> None:
        if task == 'high':
            raise LookupError('an entry that must be there')

    def low_job() -> None:
        kernel.clock.spend(3 * MS)
        went_on.append(True)

    kernel.trace = defect  # stands for any line of the dispatcher
    low = kernel.add_task('low', low_job, priority=10, rate_hz=10.0)
    kernel.add_task('high', lambda: None, priority=50, rate_hz=1.0,
                    phase_ns=2 * MS if where == 'nested' else 50 * MS)
    with pytest.raises(KernelError, match='please report it with this: LookupError: an entry that '
                                          'must be there(?s:.*) in defect') as caught:
        kernel.run(60 * MS)
    assert isinstance(caught.value.__cause__, LookupError)
    assert went_on == [True] and low.runs == 1 and low.failures == 0
    kernel.trace = None
    assert kernel.run(60 * MS) == 'duration'
    assert low.runs == 2
