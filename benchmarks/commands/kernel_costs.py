#!/usr/bin/env python3
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
Measure small costs of a kernel, one after the other as they are asked for on standard input.

A child of ``compare_trees.py``; ``PYTHONPATH`` says whose kernel. It reads lines such as
``single 1`` (a case and seconds), measures that and answers with a line of JSON: what it found, by
name. Only the public interface of the package is used, so that it runs on old trees as well;
``floor`` needs none of it::

    echo together 1 | PYTHONPATH=. benchmarks/commands/kernel_costs.py kernel
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
import ctypes
import gc
from importlib import import_module
import json
import os
import statistics
import sys
import time
from typing import Any

_PRIORITY, _RATE_HZ, _PERIOD_NS = 80, 200, 5_000_000
_MANY, _CROWD, _SPACING_NS = 1000, 100, 50_000
_DELAY_PERIOD_NS, _DELAY_WARM, _TURNS = 2_000_000, 20, 4
_WARMUP_NS = 200_000_000
_CALLS = 500
_MESSAGE, _DATA_BYTES = 'std_msgs/msg/UInt8MultiArray', 48  # 64 with what comes before it
_MONOTONIC, _ABSOLUTE, _PR_SET_TIMERSLACK, _LOCK_ALL = 1, 1, 29, 3

_libc = ctypes.CDLL(None, use_errno=True)


def prepare() -> list[str]:
    """
    Ask Linux for real time, by itself: what is compared must not decide how it is measured.

    :return: what it refused.
    """
    refused = []
    _libc.prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)
    if _libc.mlockall(_LOCK_ALL):
        refused.append('locked memory')
    try:
        os.sched_setaffinity(0, [max(os.sched_getaffinity(0))])
    except OSError:
        refused.append('one CPU')
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_PRIORITY))
    except OSError:
        refused.append('SCHED_FIFO')
    gc.collect()
    gc.freeze()
    gc.disable()
    return refused


class Sleeper:
    """``clock_nanosleep`` with an absolute deadline, by one call of ctypes."""

    def __init__(self) -> None:
        self._spec = (ctypes.c_int64 * 2)()
        self._arguments = (ctypes.c_int(_MONOTONIC), ctypes.c_int(_ABSOLUTE),
                           ctypes.byref(self._spec), None)

    def until(self, deadline_ns: int) -> None:
        """Sleep until then."""
        self._spec[0], self._spec[1] = divmod(deadline_ns, 1_000_000_000)
        _libc.clock_nanosleep(*self._arguments)


def wakes(seconds: float) -> float:
    """Return the CPU time of a bare wake-up at 200 Hz, in us."""
    sleeper, count = Sleeper(), max(2, round(seconds * _RATE_HZ))
    deadline_ns, begin_ns = time.monotonic_ns(), time.thread_time_ns()
    for _ in range(count):
        deadline_ns += _PERIOD_NS
        sleeper.until(deadline_ns)
    return (time.thread_time_ns() - begin_ns) / count / 1e3


def plain_loop(seconds: float) -> float:
    """Return the CPU time a call, in us, of 100 empty functions called in a row at 200 Hz."""
    sleeper, count = Sleeper(), max(2, round(seconds * _RATE_HZ))
    functions = [_nothing] * _CROWD
    deadline_ns, begin_ns = time.monotonic_ns(), time.thread_time_ns()
    for _ in range(count):
        deadline_ns += _PERIOD_NS
        sleeper.until(deadline_ns)
        for function in functions:
            function()
    return (time.thread_time_ns() - begin_ns) / (count * _CROWD) / 1e3


def _nothing() -> None:
    """Do nothing: what is measured is what calls it."""


def _jobs(tasks: int, spacing_ns: int) -> Callable[[float], tuple[float, float]]:
    """Measure tasks of 200 Hz that do nothing: CPU time a job in us, and the rate reached."""
    def measure(seconds: float) -> tuple[float, float]:
        from rt_robot_os.kernel import Kernel
        kernel = Kernel()
        made = [kernel.add_task(f'task{i}', _nothing, priority=10 + i % 80, rate_hz=_RATE_HZ,
                                phase_ns=i * spacing_ns) for i in range(tasks)]
        kernel.run(_WARMUP_NS)
        runs, missed = sum(t.runs for t in made), sum(t.missed for t in made)
        begin_ns = time.thread_time_ns()
        # To the middle of a period: tasks that are released together are not cut off.
        kernel.run(max(1, round(seconds * _RATE_HZ)) * _PERIOD_NS - _PERIOD_NS // 2)
        used_ns = time.thread_time_ns() - begin_ns
        runs = max(1, sum(t.runs for t in made) - runs)
        missed = sum(t.missed for t in made) - missed
        return used_ns / runs / 1e3, _RATE_HZ * runs / (runs + missed)

    return measure


def _cost(tasks: int, spacing_ns: int = 0) -> Callable[[float], float]:
    return lambda seconds: _jobs(tasks, spacing_ns)(seconds)[0]


def _rate(tasks: int, spacing_ns: int = 0) -> Callable[[float], float]:
    return lambda seconds: _jobs(tasks, spacing_ns)(seconds)[1]


def _topic() -> tuple[Any, Any]:
    from rt_robot_os.kernel import Kernel
    from rt_robot_os.topics import Bus
    kernel = Kernel()
    bus = Bus(kernel)
    bus.declare('message', _MESSAGE, {'data': _DATA_BYTES})
    return kernel, bus


def _block_means(operation: Callable[[], object], seconds: float) -> float:
    """Return the median of the means of blocks of calls in us, the empty loop taken off."""
    now_ns, turns = time.perf_counter_ns, range(_CALLS)
    means: list[float] = []
    end_ns = now_ns() + round(seconds * 1e9)
    begin_ns = 0
    while begin_ns < end_ns or len(means) < 3:
        begin_ns = now_ns()
        for _ in turns:
            operation()
        middle_ns = now_ns()
        for _ in turns:
            pass
        means.append((2 * middle_ns - begin_ns - now_ns()) / _CALLS / 1e3)
    return statistics.median(means)


def publish(seconds: float) -> float:
    """Return what it costs to publish 64 B that nobody takes."""
    _, bus = _topic()
    return _block_means(bus.publisher('message').publish, seconds)


def take(seconds: float) -> float:
    """Return what it costs to publish 64 B and to take them, without a call around both."""
    _, bus = _topic()
    publish, take = bus.publisher('message').publish, bus.subscribe('message', 'reader').take
    now_ns, turns = time.perf_counter_ns, range(_CALLS)
    means: list[float] = []
    end_ns = now_ns() + round(seconds * 1e9)
    begin_ns = 0
    while begin_ns < end_ns or len(means) < 3:
        begin_ns = now_ns()
        for _ in turns:
            publish()
            take()
        middle_ns = now_ns()
        for _ in turns:
            pass
        means.append((2 * middle_ns - begin_ns - now_ns()) / _CALLS / 1e3)
    return statistics.median(means)


def to_task(seconds: float) -> float:
    """Return what it costs to publish 64 B to a more important task, which takes them at once."""
    kernel, bus = _topic()
    publish = bus.publisher('message').publish
    taken: list[Callable[[], bool]] = []
    found: list[float] = []
    reader = kernel.add_task('reader', lambda: taken[0](), priority=50)
    taken.append(bus.subscribe('message', 'reader', task=reader).take)

    def job() -> None:
        found.append(_block_means(publish, seconds))
        kernel.stop()

    kernel.add_task('publisher', job, priority=10, rate_hz=1.0)
    kernel.run()
    return found[0]


def delays(seconds: float) -> dict[str, float]:
    """
    Measure a delay and the bare loop beside it, in short turns: an idle CPU is not always as cold.

    :return: ``delay``: the median, in us, from publishing 64 B to a more important task that waits
        for them, at 500 Hz; ``bare_delay``: the same of a loop without a kernel.
    """
    found: dict[str, list[int]] = {'delay': [], 'bare_delay': []}
    for _ in range(_TURNS):
        found['delay'] += _delays(round(seconds * 1e9 / _TURNS))
        found['bare_delay'] += _bare_delays(round(seconds * 1e9 / _TURNS))
    return {name: statistics.median(some) / 1e3 for name, some in found.items()}


def _delays(duration_ns: int) -> list[int]:
    kernel, bus = _topic()
    publish, now_ns = bus.publisher('message').publish, time.monotonic_ns
    taken: list[Callable[[], bool]] = []
    sent: list[int] = [0]
    found: list[int] = []

    def receive() -> None:
        if taken[0]():
            found.append(now_ns() - sent[0])

    def send() -> None:
        sent[0] = now_ns()
        publish()

    reader = kernel.add_task('reader', receive, priority=50)
    taken.append(bus.subscribe('message', 'reader', task=reader).take)
    kernel.add_task('publisher', send, priority=10, rate_hz=1e9 / _DELAY_PERIOD_NS)
    kernel.run(_DELAY_WARM * _DELAY_PERIOD_NS + duration_ns)
    return found[_DELAY_WARM:]


def _bare_delays(duration_ns: int) -> list[int]:
    """Sleep as long, publish and take."""
    _, bus = _topic()
    publish, take = bus.publisher('message').publish, bus.subscribe('message', 'reader').take
    sleeper, now_ns = Sleeper(), time.monotonic_ns
    found: list[int] = []
    deadline_ns = now_ns()
    for _ in range(_DELAY_WARM + duration_ns // _DELAY_PERIOD_NS):
        deadline_ns += _DELAY_PERIOD_NS
        sleeper.until(deadline_ns)
        begin_ns = now_ns()
        publish()
        take()
        found.append(now_ns() - begin_ns)
    return found[_DELAY_WARM:]


FLOORS: Mapping[str, Callable[[float], float]] = {
    'single': wakes, 'together': plain_loop, 'call': lambda s: _block_means(_nothing, s)}
KERNELS: Mapping[str, Callable[[float], 'float | dict[str, float]']] = {
    'single': _cost(1), 'ten': _cost(10), 'together': _cost(_CROWD), 'thousand': _cost(_MANY),
    'spread': _cost(_CROWD, _SPACING_NS), 'publish': publish, 'take': take, 'to_task': to_task,
    'delay': delays, 'reached': _rate(_MANY),
    'reached_spread': _rate(_MANY, _PERIOD_NS // _MANY)}


def _whose(tree: str) -> str:
    """
    Import the package and say in words which build of it runs.

    :raises ImportError: it is not that of the tree.
    """
    import rt_robot_os
    from rt_robot_os.base.compiled import state
    for name in ('kernel', 'topics'):  # here it fails, if at all
        import_module(f'rt_robot_os.{name}')
    where = os.path.dirname(os.path.dirname(os.path.abspath(str(rt_robot_os.__file__))))
    if os.path.realpath(where) != os.path.realpath(tree):
        raise ImportError(f'the package of {where} was found instead of that of {tree}')
    return str(state().text)


def main() -> int:
    """Answer lines; ends with the standard input."""
    kind, tree = sys.argv[1], os.environ.get('PYTHONPATH', '.').split(os.pathsep)[0]
    try:
        text = _whose(tree) if kind == 'kernel' else 'bare loops'
    except Exception as error:  # a demand for a build that is not there ends with its reason
        print(json.dumps({'error': f'{type(error).__name__}: {error}'}), flush=True)
        return 1
    print(json.dumps({'text': text, 'refused': prepare()}), flush=True)
    known = KERNELS if kind == 'kernel' else FLOORS
    for line in sys.stdin:
        name, seconds = line.split()
        found = known[name](float(seconds)) if name in known else {}
        print(json.dumps(found if isinstance(found, dict) else {name: found}), flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
