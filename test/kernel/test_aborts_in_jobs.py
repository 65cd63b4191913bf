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


"""Nothing that a job does keeps it from being ended, and a job that ends is not taken for more."""

from __future__ import annotations

from collections.abc import Callable
import contextlib
import gc
import sys
import time
from typing import Any

from at_line import AtLine
from at_line import of_files
from kernel_tools import balance
from kernel_tools import MS
from kernel_tools import run_program
from kernel_tools import S
from kernel_tools import StallingClock
from kernel_tools import US
import pytest

from rt_robot_os.kernel import BudgetPolicy
from rt_robot_os.kernel import core
from rt_robot_os.kernel import FailurePolicy
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import MonotonicClock
from rt_robot_os.kernel import scheduler
from rt_robot_os.kernel import TaskState
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.kernel.black_box import ABORT as ABORT_RECORD
from rt_robot_os.kernel.black_box import BLOCKED
from rt_robot_os.linux.recursion import force_recursion_limit
from rt_robot_os.linux.recursion import SEPARATE_LIMITS

ABORT = BudgetPolicy.ABORT


# ---- recursion -------------------------------------------------------------------------------


def ever_deeper() -> object:
    """Recurse in a tree that is as high as the limit and would take for ever."""
    try:
        return ever_deeper()
    except RecursionError:
        return ever_deeper()


def stays_at_the_limit() -> None:
    with contextlib.suppress(RecursionError):
        stays_at_the_limit()
    while True:
        with contextlib.suppress(RecursionError):
            while True:
                pass


JAMS = [ever_deeper] + [stays_at_the_limit] * SEPARATE_LIMITS


@pytest.mark.parametrize('job', JAMS)
def test_a_job_at_its_recursion_limit_is_ended_by_its_budget(job: Callable[[], object]) -> None:
    limit = sys.getrecursionlimit()
    kernel = Kernel(MonotonicClock())
    task = kernel.add_task('deep', job, priority=10, rate_hz=5.0, budget_ns=5 * MS,
                           on_budget=ABORT)
    kernel.add_task('last', lambda: kernel.stop('enough') if task.runs > 2 else None, priority=1,
                    rate_hz=100.0)
    gc.disable()
    try:
        assert kernel.run(60 * S) == 'enough'
    finally:
        gc.enable()
    assert task.aborted == task.runs
    assert sys.getrecursionlimit() == limit


def test_a_signal_that_finds_no_room_leaves_the_kernel_at_work(
        monkeypatch: pytest.MonkeyPatch) -> None:
    # Where the limit is taken back at the depth of the job, the next signal's handler has no room:
    # its RecursionError comes out of the call that sets the limit. Here it always does.
    def force(limit: int) -> None:
        force_recursion_limit(limit)
        raise RecursionError

    def job() -> object:
        if time.monotonic() > give_up:
            return None
        try:
            return job()
        except RecursionError:
            return job()

    give_up = time.monotonic() + 20.0
    monkeypatch.setattr(core, 'force_recursion_limit', force)
    kernel = Kernel(MonotonicClock())
    task = kernel.add_task('deep', job, priority=10, rate_hz=5.0, budget_ns=5 * MS,
                           on_budget=ABORT)
    kernel.add_task('last', lambda: kernel.stop('enough') if task.runs > 2 else None, priority=1,
                    rate_hz=100.0)
    gc.disable()
    try:
        assert kernel.run(60 * S) == 'enough'
    finally:
        gc.enable()
    assert task.aborted == task.runs


def test_a_job_at_its_recursion_limit_does_not_keep_out_those_above_it() -> None:
    kernel = Kernel(MonotonicClock())
    seen: list[int] = []

    def high_job() -> None:
        if deep.busy:
            seen.append(high.runs)
            if len(seen) > 20:
                kernel.stop('enough')
                raise_in_deep.append(True)

    def deep_job() -> object:
        if raise_in_deep:
            raise SystemExit
        try:
            return deep_job()
        except RecursionError:
            return deep_job()

    raise_in_deep: list[bool] = []
    deep = kernel.add_task('deep', deep_job, priority=10, rate_hz=50.0)
    high = kernel.add_task('high', high_job, priority=90, rate_hz=1000.0)
    gc.disable()
    try:
        assert kernel.run(60 * S) == 'enough'
    finally:
        gc.enable()


# ---- jobs that swallow their abort ------------------------------------------------------------

SWALLOWING = """
import gc
import sys

from rt_robot_os.kernel import BudgetPolicy
from rt_robot_os.kernel import core
from rt_robot_os.kernel import FailurePolicy
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import TaskState

def recursion():
    try:
        recursion()
    except BaseException:
        recursion()

class Again:

    def __enter__(self):
        pass

    def __exit__(self, *error):
        context()
        return True

def context():
    with Again():
        context()

def loops(depth=1000):  # at its limit it could not be reached before Python 3.12
    while True:
        try:
            while True:
                try:
                    depth and loops(depth - 1)
                except BaseException:
                    pass
        except BaseException:
            pass

def in_finally():
    try:
        in_finally()
    finally:
        in_finally()

def generator():
    try:
        yield from generator()
    except BaseException:
        yield from generator()

class Text(Exception):

    def __str__(self):
        recursion()

def text():
    raise Text

async def coroutine():
    try:
        await coroutine()
    except BaseException:
        await coroutine()

JOBS = {'recursion': recursion, 'context': context, 'loops': loops, 'in_finally': in_finally,
        'generator': lambda: list(generator()), 'text': text}
gc.disable()
limit = sys.getrecursionlimit()
kernel = Kernel()
name = sys.argv[1]
settings = dict(priority=10, budget_ns=2_000_000, on_budget=BudgetPolicy.ABORT,
                failure=FailurePolicy.STOP)
high = kernel.add_task('high', lambda: task.busy and runs.append(1), priority=90, rate_hz=1000.0)
if name == 'coroutine':
    task = kernel.add_async_task('task', coroutine, **settings)
else:
    task = kernel.add_task('task', JOBS[name], rate_hz=1.0, **settings)
kernel.add_task('low', lambda: task.state is not TaskState.ACTIVE and kernel.stop('ended'),
                priority=1, rate_hz=100.0)
runs = []
print(kernel.run(90_000_000_000))
print(task.state.value, len(kernel.ended), bool(runs), sys.getrecursionlimit() == limit)
"""


@pytest.mark.parametrize('job', ['recursion', 'context', 'loops', 'in_finally', 'generator',
                                 'text', 'coroutine'])
def test_a_job_that_swallows_its_abort_is_ended_and_those_above_it_run_on(job: str) -> None:
    result = run_program(SWALLOWING, job, timeout_s=120.0)
    assert (result.returncode, result.stdout) == (0, 'ended\nstopped 0 True True\n'), result.stderr


def test_each_abort_that_a_job_swallows_comes_at_its_next_step(
        kernel: Kernel, clock: VirtualClock) -> None:
    caught: list[int] = []

    def job() -> None:
        for _ in range(1000):
            with contextlib.suppress(BaseException):
                try:
                    clock.spend(50 * MS)
                finally:
                    caught.append(clock.now_ns())

    high = kernel.add_task('high', lambda: None, priority=90, rate_hz=1000.0)
    task = kernel.add_task('task', job, priority=50, rate_hz=1.0, budget_ns=2 * MS,
                           on_budget=ABORT)
    kernel.run(200 * MS)
    assert caught[:2] == [2 * MS, 22 * MS]
    assert set(caught[2:]) == {22 * MS}
    assert (high.runs, high.missed, task.state) == (200, 0, TaskState.STOPPED)
    assert [record for record in kernel.black_box.records if record[0] == ABORT_RECORD] == [
        (ABORT_RECORD, task, 2 * MS, 2 * MS), (ABORT_RECORD, task, 22 * MS, 22 * MS)]


# ---- exceptions that resist being looked at ---------------------------------------------------


def endless_text(clock: VirtualClock) -> Exception:
    class Endless(Exception):

        def __str__(self) -> str:
            while True:
                clock.spend(MS)

    return Endless()


def endless_argument(clock: VirtualClock) -> Exception:
    class Argument:

        def __repr__(self) -> str:
            while True:
                clock.spend(MS)

    return ValueError(Argument(), 1)


def endless_end(clock: VirtualClock) -> Exception:
    class Lingering(Exception):

        def __del__(self) -> None:
            with contextlib.suppress(BaseException):
                while True:
                    clock.spend(MS)

    return Lingering('stays')


@pytest.mark.parametrize('make', [endless_text, endless_argument, endless_end])
def test_an_exception_that_is_endless_when_it_is_looked_at_takes_ten_milliseconds(
        kernel: Kernel, clock: VirtualClock, make: Callable[[VirtualClock], Exception]) -> None:
    def job() -> None:
        raise make(clock)

    high = kernel.add_task('high', lambda: None, priority=90, rate_hz=1000.0)
    task = kernel.add_task('task', job, priority=50, rate_hz=20.0)
    low = kernel.add_task('low', lambda: None, priority=10, rate_hz=20.0)
    kernel.run(S)
    assert (task.runs, task.failures, task.aborted) == (20, 20, 0)
    assert task.state is TaskState.ACTIVE
    assert task.execution.maximum_ns <= 11 * MS
    assert (high.runs, high.missed, low.runs) == (1000, 0, 20)


def test_the_text_of_an_exception_that_never_came_is_said_to_be_missing(
        kernel: Kernel, clock: VirtualClock) -> None:
    def job() -> None:
        raise endless_text(clock)

    kernel.add_task('task', job, priority=50, rate_hz=10.0)
    kernel.run(50 * MS)
    assert [f.error for f in kernel.failures] == [
        'Endless: (its text is not available: __str__ took too long)']


def test_a_class_that_lies_about_itself_is_still_described(kernel: Kernel) -> None:
    lies = property(lambda self: 1 // 0)

    class Text(str):

        def __len__(self) -> int:
            raise SystemExit

        def __format__(self, spec: str) -> str:
            raise SystemExit

    meta: Any = type('Meta', (type,), {'__name__': lies})
    liar = meta('Liar', (Exception,), {
        '__traceback__': lies, '__class__': lies, '__str__': lambda self: Text('the text')})

    def job() -> None:
        raise liar

    kernel.add_task('task', job, priority=50, rate_hz=10.0)
    kernel.run(50 * MS)
    report, = kernel.failures
    assert report.error == 'Liar: the text'
    assert [name for _, _, name in report.trace] == ['job']


# ---- an abort is raised once -------------------------------------------------------------------


def aborted_while_stolen(step: int) -> int:
    clock = VirtualClock()
    kernel = Kernel(clock)

    def job() -> None:
        while True:
            clock.spend(MS)

    kernel.add_task('high', lambda: None, priority=90, rate_hz=1000.0)
    task = kernel.add_task('task', job, priority=50, rate_hz=10.0, budget_ns=2 * MS,
                           on_budget=ABORT, failure=FailurePolicy.CONTINUE)
    tracer = AtLine(step, lambda: clock.spend(15 * MS),
                    of_files(core.__file__, scheduler.__file__),
                    when=lambda: task.abort_pending or task.aborts_raised > 0)
    sys.settrace(tracer)
    try:
        kernel.run(50 * MS)
    finally:
        sys.settrace(None)
    assert [f.error.partition(' us')[0] for f in kernel.failures][1:] == []
    assert (task.runs, task.aborted, task.state) == (1, 1, TaskState.ACTIVE)
    return tracer.seen


@pytest.mark.interpreted
def test_time_that_passes_while_an_abort_propagates_makes_no_second_one(untraced: None) -> None:
    step, total = 1, 1
    while step <= total:
        try:
            total = max(total, aborted_while_stolen(step))
        except AssertionError as error:
            raise AssertionError(f'at line {step}') from error
        step += 1
    assert step > 20


# ---- the end of the kernel --------------------------------------------------------------------


def test_jobs_that_go_on_after_the_stop_are_ended_from_the_top_of_the_stack_down(
        kernel: Kernel, clock: VirtualClock) -> None:
    ends: list[tuple[str, int]] = []

    def job(name: str) -> Callable[[], None]:
        def run() -> None:
            try:
                clock.spend(5 * MS)
                if name == 'high':
                    kernel.stop('enough')
                clock.spend(10 * S)
            finally:
                clock.spend(3 * MS)
                ends.append((name, clock.now_ns()))
        return run

    kernel.stop_grace_ns = 200 * MS
    for priority, name in ((10, 'low'), (20, 'mid'), (30, 'high')):
        kernel.add_task(name, job(name), priority=priority, rate_hz=0.1, phase_ns=priority * MS)
    other = kernel.add_task('other', lambda: None, priority=90, rate_hz=1000.0)
    assert kernel.run() == 'enough'
    assert ends == [('high', 238 * MS), ('mid', 241 * MS), ('low', 244 * MS)]
    assert kernel.ended == ['high', 'mid', 'low']
    assert {f.error for f in kernel.failures} == {
        f"TaskAborted: task '{name}' was ended {after} ms after the kernel was told to stop "
        '(enough)' for name, after in (('high', 200), ('mid', 203), ('low', 206))}
    assert other.runs == 36
    assert not any(map(balance, kernel.tasks))


def test_jobs_that_end_in_time_are_left_alone(kernel: Kernel, clock: VirtualClock) -> None:
    def job() -> None:
        kernel.stop()
        clock.spend(190 * MS)

    kernel.stop_grace_ns = 200 * MS
    task = kernel.add_task('task', job, priority=10, rate_hz=1.0)
    kernel.run()
    assert (task.runs, task.aborted, kernel.ended) == (1, 0, [])
    assert kernel.run(MS // 2) == 'stop'  # as before: it can be run again


def test_a_coroutine_that_does_not_let_itself_be_closed_is_ended(
        kernel: Kernel, clock: VirtualClock) -> None:
    async def body() -> None:
        try:
            await kernel.sleep(10 * S)
        finally:
            clock.spend(10 * S)

    task = kernel.add_async_task('mission', body, priority=10)
    kernel.add_task('other', lambda: None, priority=90, rate_hz=1000.0)
    kernel.run(10 * MS)
    assert clock.now_ns() == 110 * MS
    assert [f.task for f in kernel.failures] == [task.name]


# ---- blocking --------------------------------------------------------------------------------


def test_a_native_call_at_the_end_of_a_job_is_charged_to_it() -> None:
    clock = StallingClock()
    kernel = Kernel(clock)

    def calculate() -> None:
        clock.spend(200 * US)
        clock._now_ns += 3 * MS  # nothing follows in which the interrupt could be noticed

    high = kernel.add_task('high', lambda: None, priority=90, rate_hz=1000.0, phase_ns=MS)
    low = kernel.add_task('low', calculate, priority=10, rate_hz=100.0)
    kernel.run(20 * MS)
    assert low.blocked_maximum_ns == 2200 * US
    assert high.blocked_maximum_ns == 0
    assert [(r[1].name, r[3]) for r in kernel.black_box.records if r[0] == BLOCKED] == [
        ('low', 2200 * US)] * 2
    assert not any(map(balance, kernel.tasks))


def test_a_native_call_that_delays_no_higher_task_is_not_recorded() -> None:
    clock = StallingClock()
    kernel = Kernel(clock)
    low = kernel.add_task('low', lambda: None, priority=10, rate_hz=1000.0, phase_ns=MS)
    high = kernel.add_task('high', lambda: clock.stall(3 * MS), priority=90, rate_hz=100.0)
    kernel.run(20 * MS)
    assert high.blocked_maximum_ns == 2 * MS  # it is measured all the same
    assert low.missed
    assert [r for r in kernel.black_box.records if r[0] == BLOCKED] == []


def test_on_the_real_clock_a_job_that_ends_in_a_native_call_is_charged() -> None:
    result = run_program("""
from rt_robot_os.kernel import Kernel

def job():
    global size
    size *= 2
    if low.blocked_maximum_ns > 20_000_000 or size > 1 << 28:
        kernel.stop()
    [0] * size

size = 1 << 16
kernel = Kernel()
high = kernel.add_task('high', lambda: None, priority=90, rate_hz=1000.0)
low = kernel.add_task('low', job, priority=10, rate_hz=50.0)
kernel.run(30_000_000_000)
print(low.blocked_maximum_ns, high.latency.maximum_ns)
""")
    assert result.returncode == 0, result.stderr
    charged_ns, latency_ns = map(int, result.stdout.split())
    assert charged_ns > 20 * MS
    assert latency_ns > 15 * MS
