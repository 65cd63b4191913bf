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


"""What a job raises ends that job and nothing else."""

from __future__ import annotations

import builtins
import gc
import io
import linecache
import sys
from typing import NoReturn
import weakref

from kernel_tools import balance
from kernel_tools import CLOCKS
from kernel_tools import MS
from kernel_tools import S
from kernel_tools import US
import pytest

from rt_robot_os.kernel import Clock
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock


class Nasty(Exception):
    """An exception that cannot be looked at."""

    def __str__(self) -> str:
        raise Nasty


class Endless(Exception):
    """An exception that recurses when it is looked at."""

    def __str__(self) -> str:
        return str(self)


class Verbose(Exception):
    """An exception that brings a book."""

    def __str__(self) -> str:
        return 'word ' * 1_000_000


def raising(error: BaseException) -> NoReturn:
    raise error


@pytest.mark.parametrize('error', [
    ValueError('x'), SystemExit(3), KeyboardInterrupt(), GeneratorExit(), MemoryError(), Nasty(),
    Endless(), Verbose(), StopIteration()], ids=lambda e: type(e).__name__)
@pytest.mark.parametrize('clock', CLOCKS.values(), ids=CLOCKS)
def test_whatever_a_job_raises_is_contained(
        clock: type[Clock], error: BaseException) -> None:
    kernel = Kernel(clock())

    def low_job() -> None:
        kernel.release(bad)
        went_on.append(True)

    went_on: list[bool] = []
    low = kernel.add_task('low', low_job, priority=10, rate_hz=1000.0)
    bad = kernel.add_task('bad', lambda: raising(error), priority=50)
    last = kernel.add_task('last', lambda: kernel.stop() if low.runs >= 3 else None, priority=1,
                           rate_hz=1000.0)
    # As in the core: an abort that fell into the end of older garbage would be lost there.
    gc.collect()
    gc.disable()
    try:
        kernel.run()
    finally:
        gc.enable()
    assert low.failures == last.failures == 0
    assert bad.failures == bad.runs == len(went_on) == low.runs
    assert kernel.failures_total == bad.failures
    report = kernel.failures[-1]
    assert report.task == 'bad'
    assert report.error.startswith(type(error).__name__)
    assert len(report.error) < 2000
    assert not any(map(balance, kernel.tasks))


def test_a_report_names_the_task_the_error_and_where_it_happened(kernel: Kernel) -> None:
    def deep(levels: int) -> None:
        if levels:
            deep(levels - 1)
        raise ValueError('the reason')

    kernel.add_task('bad', lambda: deep(0), priority=50, rate_hz=100.0)
    kernel.add_task('deeper', lambda: deep(30), priority=40, rate_hz=100.0)
    kernel.run(MS)
    report, deeper = kernel.failures
    assert report.error == 'ValueError: the reason'
    assert [(path, name) for path, _, name in report.trace] == [
        (__file__, '<lambda>'), (__file__, 'deep')]
    assert report.trace[-1][1] == deep.__code__.co_firstlineno + 3
    assert str(report).startswith("task 'bad': ValueError: the reason\n")
    assert f'{__file__}:{report.trace[-1][1]} in deep' in str(report)
    assert [name for _, _, name in deeper.trace] == ['deep'] * 8


def test_reporting_reads_no_file(kernel: Kernel, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*arguments: object, **options: object) -> NoReturn:
        raise AssertionError(f'a file was read: {arguments}')

    kernel.add_task('bad', lambda: raising(ValueError('x')), priority=50, rate_hz=100.0)
    with monkeypatch.context() as patched:
        for owner, name in ((builtins, 'open'), (io, 'open'), (io, 'open_code'),
                            (linecache, 'updatecache'), (linecache, 'getlines')):
            patched.setattr(owner, name, refuse)
        kernel.run(MS)
        assert str(kernel.failures[0])
    assert kernel.failures[0].error == 'ValueError: x'


def test_reports_are_bounded_and_those_dropped_are_counted(kernel: Kernel) -> None:
    task = kernel.add_task('bad', lambda: raising(ValueError(str(task.runs))), priority=50,
                           rate_hz=1000.0)
    kernel.run(100 * MS)
    statistics = kernel.statistics()
    assert (statistics.failures_total, statistics.failures_dropped) == (100, 68)
    assert [f.error for f in kernel.failures] == [f'ValueError: {n}' for n in range(68, 100)]


def test_a_failed_job_leaves_nothing_behind_for_the_collector(kernel: Kernel) -> None:
    class Big:
        pass

    alive: list[weakref.ref[Big]] = []

    def job() -> None:
        big = Big()
        alive.append(weakref.ref(big))
        raise ValueError('x')

    kernel.add_task('bad', job, priority=50, rate_hz=1000.0)
    gc.collect()
    gc.disable()  # as in the core
    try:
        kernel.run(10 * MS)
        assert [ref() for ref in alive] == [None] * 10
    finally:
        gc.enable()


def test_endless_recursion_is_contained(kernel: Kernel) -> None:
    def dive() -> None:
        dive()

    limit = sys.getrecursionlimit()
    good = kernel.add_task('good', lambda: None, priority=50, rate_hz=1000.0)
    bad = kernel.add_task('bad', dive, priority=60, rate_hz=1000.0)
    kernel.run(5 * MS)
    assert (bad.failures, good.runs, good.failures) == (5, 5, 0)
    assert kernel.failures[0].error.startswith('RecursionError')
    assert sys.getrecursionlimit() == limit


def test_a_task_at_its_recursion_limit_leaves_room_for_those_above(kernel: Kernel) -> None:
    def need(levels: int) -> None:
        if levels:
            need(levels - 1)

    def dive(levels: int) -> None:
        try:
            dive(levels + 1)
        except RecursionError:
            deepest.append(levels)
        if levels > deepest[0] - 40:
            try:
                kernel.clock.spend(MS)
            except RecursionError:
                refused.append(levels)

    deepest: list[int] = []
    refused: list[int] = []
    high = kernel.add_task('high', lambda: need(100), priority=80, rate_hz=1000.0)
    top = kernel.add_task('top', lambda: need(100), priority=90)
    kernel.add_task('middle', lambda: kernel.release(top), priority=85, rate_hz=1000.0,
                    phase_ns=500 * US)
    low = kernel.add_task('low', lambda: dive(0), priority=10, rate_hz=1.0)
    kernel.run(S)
    assert low.runs == 1
    assert len(refused) < 5, 'the test is to interrupt the deepest calls'
    assert not any(task.failures for task in kernel.tasks)
    # An interrupt that found no room at all comes again after 10 ms.
    assert high.runs >= 1000 - 10 * len(refused)
    assert not any(map(balance, kernel.tasks))


def test_a_failure_does_not_stop_the_timer(kernel: Kernel) -> None:
    def low_job() -> None:
        kernel.clock.spend(5500 * US)
        raise ValueError('after it was preempted')

    high = kernel.add_task('high', lambda: raising(ValueError('x')), priority=80, rate_hz=1000.0)
    low = kernel.add_task('low', low_job, priority=10, rate_hz=100.0)
    kernel.run(100 * MS)
    assert (high.runs, high.failures, high.missed) == (100, 100, 0)
    assert (low.runs, low.failures) == (10, 10)


def test_what_a_finaliser_raises_is_reported_and_not_printed(
        capsys: pytest.CaptureFixture[str]) -> None:
    class Leaves:
        def __del__(self) -> None:
            raise ValueError('left behind')

    def job() -> None:
        Leaves()

    kernel = Kernel(VirtualClock())
    task = kernel.add_task('careless', job, priority=5, rate_hz=100.0)
    before = sys.unraisablehook
    kernel.run(30 * MS)
    assert task.runs == 3 and kernel.failures_total == 3
    report = kernel.failures[0]
    assert (report.task, report.error) == ('careless', 'ValueError: left behind')
    assert report.trace[-1][2] == '__del__'
    assert sys.unraisablehook is before
    assert capsys.readouterr() == ('', '')
