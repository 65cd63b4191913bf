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

"""The kernel's own mechanisms: resources, aborting, interrupts, the black box, garbage."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from collections.abc import Mapping
import gc
import os
from pathlib import Path
import signal
import struct
import time
from types import FrameType
from typing import Any

import numpy as np

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.core.garbage import SlackCollector
from rt_robot_os.kernel import BudgetPolicy
from rt_robot_os.kernel import FailurePolicy
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import TaskAborted
from rt_robot_os.linux.timer import Sleeper
from rt_robot_os.tools.bench.case import Samples
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.stamps import Stamps
from rt_robot_os.tools.bench.subjects.operation_cost import block_means_ps
from rt_robot_os.tools.bench.subjects.operation_cost import job_costs_ns

_MOMENT = struct.Struct('<q')
_WRITER = f'{__name__}:writer'
_OBJECTS = 100_000


class _Empty:
    """The least that something can be which is entered and left."""

    __slots__ = ()

    def __enter__(self) -> None:
        pass

    def __exit__(self, *error: object) -> None:
        pass


def operations(harness: Harness) -> Measurement:
    """Measure, inside a job: to enter and leave a resource, and to make a record."""
    a = harness.arguments
    tested = Kernel()
    resource = tested.resource('shared')
    means: dict[str, Samples] = {}
    share_ns = a['measure_ns'] // 2

    def enter_and_leave() -> None:
        with resource:
            pass

    def nothing() -> None:
        pass

    empty_context = _Empty()

    def enter_nothing() -> None:
        with empty_context:
            pass

    add = tested.black_box.add

    def one_record() -> None:
        now_ns = 1
        add((0, tested, now_ns, now_ns, now_ns, 0))

    def job() -> None:
        parts: dict[str, list[Samples]] = {}
        for _ in range(4):
            for name, operation in (('resource', enter_and_leave), ('with', enter_nothing),
                                    ('record', one_record)):
                empty = block_means_ps(nothing, share_ns // 16)
                found = block_means_ps(operation, share_ns // 8)
                # The call of the function itself is not what is measured.
                parts.setdefault(name, []).append(
                    np.maximum(found - int(np.median(empty)), 0))
        means.update({name: np.concatenate(found) for name, found in parts.items()})
        tested.stop()

    tested.add_task('job', job, priority=50, rate_hz=1.0, resources=(resource,))
    tested.add_task('other', nothing, priority=60, resources=(resource,))
    harness.prepare(freeze=True)
    tested.run()
    return Measurement(means)


def abort(harness: Harness) -> Measurement:
    """Let a task compute for ever, and note how long after its budget it is struck."""
    a = harness.arguments
    total_ns = a['warmup_ns'] + a['measure_ns']
    late = Stamps(2 * total_ns // a['period_ns'] + 100)
    used: list[int] = []
    tested = Kernel()

    def endless() -> None:
        value = 1
        try:
            while True:
                value = (value * 31 + 7) & 0xFFFF
        except TaskAborted:
            late.stamp()
            used.append(task.start_ns)
            raise

    task = tested.add_task('endless', endless, priority=50, rate_hz=NS_PER_S / a['period_ns'],
                           budget_ns=a['budget_ns'], on_budget=BudgetPolicy.ABORT,
                           failure=FailurePolicy.CONTINUE)
    harness.prepare(freeze=True)
    tested.run(total_ns)
    moments = late.taken()
    starts = np.array(used[:len(moments)], np.int64)
    late_ns = moments[:len(starts)] - starts - a['budget_ns']
    return Measurement({'late_ns': late_ns[starts >= tested.start_ns + a['warmup_ns']]})


def interrupt(harness: Harness) -> Measurement:
    """
    Note how long after a write to a pipe the task runs that reads it.

    ``own``: a less important task of the kernel writes; else another process.
    """
    a = harness.arguments
    total_ns = a['warmup_ns'] + a['measure_ns']
    room = 2 * total_ns // a['period_ns'] + 100
    late = np.zeros(room, np.int64)
    count = [0]
    path = harness.folder / 'pipe'
    os.mkfifo(path)
    fd = os.open(path, os.O_RDWR | os.O_NONBLOCK)
    tested = Kernel()
    now_ns = time.monotonic_ns

    def read() -> None:
        at_ns = now_ns()
        try:
            data = os.read(fd, 4096)
        except BlockingIOError:
            return
        # Of several the first waited longest.
        if count[0] < room:
            late[count[0]] = at_ns - _MOMENT.unpack_from(data)[0]
            count[0] += 1

    task = tested.add_task('read', read, priority=50)
    tested.add_interrupt(fd, task)
    if a['own']:
        tested.add_task('write', lambda: os.write(fd, _MOMENT.pack(now_ns())), priority=10,
                        rate_hz=NS_PER_S / a['period_ns'])
    try:
        if a['own']:
            harness.prepare(freeze=True)
            tested.run(total_ns)
        else:
            _with_writer(harness, tested, path, total_ns)
    finally:
        os.close(fd)
    warm = min(count[0] // 2, a['warmup_ns'] // a['period_ns'])
    return Measurement({'late_ns': late[warm:count[0]]})


def _with_writer(harness: Harness, tested: Kernel, path: Path, total_ns: int) -> None:
    arguments = {'path': str(path), 'period_ns': harness.arguments['period_ns']}
    with harness.helper(_WRITER, arguments, same_cpu=False):
        harness.prepare(freeze=True)
        tested.run(total_ns)


def writer(arguments: Mapping[str, Any], ready: Callable[[], None]) -> None:
    """Write the present moment to a pipe at each period."""
    fd = os.open(Path(arguments['path']), os.O_WRONLY)
    sleeper = Sleeper()
    ready()
    next_ns = time.monotonic_ns()
    while True:
        next_ns += arguments['period_ns']
        sleeper.sleep_until_ns(next_ns)
        os.write(fd, _MOMENT.pack(time.monotonic_ns()))


def garbage(harness: Harness) -> Measurement:
    """
    Run a periodic task over one that makes cycles, beside many live objects.

    ``slack``: frozen, and collected in idle time as the core does; else Python's own collector
    collects when it likes.
    """
    a = harness.arguments
    total_ns = a['warmup_ns'] + a['measure_ns']
    stamps = Stamps(2 * total_ns // a['period_ns'] + 1000)
    alive = [{'number': i, 'list': [i]} for i in range(_OBJECTS)]
    tested = Kernel()

    # They live for a while: Python's collector moves them to its oldest generation.
    living: deque[Any] = deque(maxlen=_OBJECTS // 4)

    def litter() -> None:
        for _ in range(200):
            one: list[Any] = [None]
            one.append({'self': one})
            living.append(one)

    tested.add_task('fast', stamps.stamp, priority=50, rate_hz=NS_PER_S / a['period_ns'])
    tested.add_task('litter', litter, priority=10, rate_hz=NS_PER_S / a['period_ns'])
    harness.prepare(freeze=a['slack'])
    collections = 0
    if a['slack']:
        # More often than the core's once a second, for enough of them in a short run.
        collector = SlackCollector(tested.now_ns, interval_ns=NS_PER_S // 5)
        tested.on_idle = collector.idle
        tested.run(total_ns)
        collections = collector.collections
    else:
        before = sum(one['collections'] for one in gc.get_stats())
        tested.run(total_ns)
        collections = sum(one['collections'] for one in gc.get_stats()) - before
    period_ns = a['period_ns']
    late = (stamps.taken() - tested.start_ns)
    late = late[late >= a['warmup_ns']] % period_ns
    return Measurement({'late_ns': late}, {'collections': collections, 'alive': len(alive)})


class _Struck(Exception):
    """What the bare handler raises."""


def strike(harness: Harness) -> Measurement:
    """Let a bare handler raise in a loop that computes for ever, ``budget_ns`` after its start."""
    a = harness.arguments
    sleep_until_ns, now_ns = Sleeper().sleep_until_ns, time.monotonic_ns
    count = (a['warmup_ns'] + a['measure_ns']) // a['period_ns']
    late = np.zeros(count, np.int64)
    harness.prepare(freeze=True)

    def end(signum: int, frame: FrameType | None) -> None:
        raise _Struck

    previous = signal.signal(signal.SIGALRM, end)
    begin_ns = now_ns()
    try:
        for i in range(count):
            sleep_until_ns(begin_ns + i * a['period_ns'])
            value, started_ns = 1, now_ns()
            try:
                signal.setitimer(signal.ITIMER_REAL, a['budget_ns'] / NS_PER_S)
                while True:
                    value = (value * 31 + 7) & 0xFFFF
            except _Struck:
                late[i] = now_ns() - started_ns - a['budget_ns']
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, previous)
    return Measurement({'late_ns': late[a['warmup_ns'] // a['period_ns']:]})


def dispatch(harness: Harness) -> Measurement:
    """Release many tasks that do nothing together; divide the process's CPU time by the jobs."""
    a = harness.arguments
    harness.prepare(freeze=True)
    return Measurement({'cpu_ns': job_costs_ns(a, a['tasks'])})
