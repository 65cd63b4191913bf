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
Look for references that the C core forgets to give back, or gives back twice.

    .venv/bin/python scripts/references_core.py [--jobs 1000000]
    /usr/bin/python3-dbg scripts/references_core.py

The jobs of a few scenarios run again and again on the virtual clock. Compared before and after are
the references to the objects involved, the memory of the process, and, where Python is a debug
build, the number of all references (``sys.gettotalrefcount``).
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
import gc
from pathlib import Path
import sys
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT)]

from rt_robot_os.base.compiled import state  # noqa: E402, I100
from rt_robot_os.kernel import BudgetPolicy  # noqa: E402
from rt_robot_os.kernel import Event  # noqa: E402
from rt_robot_os.kernel import FailurePolicy  # noqa: E402
from rt_robot_os.kernel import Kernel  # noqa: E402
from rt_robot_os.kernel import VirtualClock  # noqa: E402
from rt_robot_os.topics import Bus  # noqa: E402

US, MS = 1_000, 1_000_000
ROUNDS = 5
# Of the bytes of a process: what the allocators may keep.
GROWTH_BYTES = 2_000_000


class Robot:
    """Tasks of each kind on the virtual clock."""

    def __init__(self) -> None:
        self.kernel = kernel = Kernel(VirtualClock(), black_box_records=256)
        self.bus = bus = Bus(kernel)
        bus.declare('fixed', 'std_msgs/msg/Int64', depth=4)
        bus.declare('tail', 'std_msgs/msg/String', tail=40, depth=2)
        self.fixed, self.tail = bus.publisher('fixed'), bus.publisher('tail')
        shared = kernel.resource('shared')
        self.event = Event(kernel)
        reader = kernel.add_task('reader', self.read, priority=60)
        self.readers = [bus.subscribe(name, 'reader', task=reader) for name in ('fixed', 'tail')]
        self.timer = kernel.timer(kernel.add_task('shot', lambda: None, priority=70))
        bus.release_every('fixed', kernel.add_task('third', lambda: None, priority=4), 3)
        kernel.add_task('publisher', self.publish, priority=50, rate_hz=10_000.0)
        kernel.add_task('steady', lambda: kernel.clock.spend(US), priority=80, rate_hz=20_000.0)
        kernel.add_task('long', lambda: kernel.clock.spend(130 * US), priority=10,
                        rate_hz=5_000.0)
        kernel.add_task('user', self.enter, priority=20, rate_hz=3_000.0, resources=[shared])
        kernel.add_task('runaway', lambda: kernel.clock.spend(MS), priority=15, rate_hz=500.0,
                        budget_ns=90 * US, on_budget=BudgetPolicy.ABORT)
        kernel.add_task('failing', self.fail, priority=30, rate_hz=700.0,
                        failure=FailurePolicy.RESTART, restart_ns=10 * US, on_restart=self.enter)
        kernel.add_async_task('coroutine', self.wait, priority=40)
        self.newest = bus.subscribe('fixed', 'coroutine', newest=True)

    def publish(self) -> None:
        self.fixed.msg.data = 5
        self.fixed.publish()
        self.tail.msg.data = 'text'
        self.tail.publish()
        self.timer.start(30 * US)
        self.event.set()
        self.event.clear()

    def read(self) -> None:
        for reader in self.readers:
            while reader.take():
                pass

    def enter(self) -> None:
        if self.kernel.current is self.kernel.task('user'):
            with self.kernel.resource('shared'):
                self.kernel.clock.spend(US)

    def fail(self) -> None:
        raise ValueError('intended')

    async def wait(self) -> None:
        while True:
            await self.event.wait()
            await self.kernel.sleep(50 * US)
            await self.newest.next()

    def objects(self) -> Iterable[tuple[str, Any]]:
        """Give what the core holds references to."""
        kernel = self.kernel
        yield from (('the kernel', kernel), ('the clock', kernel.clock),
                    ('the black box', kernel.black_box), ('None', None))
        for task in kernel.tasks:
            yield f'task {task.name}', task
            yield f'the function of {task.name}', task.function
        for topic in self.bus.topics:
            yield f'topic {topic.name}', topic
        yield from zip(('a publisher', 'a publisher'), (self.fixed, self.tail))


def memory() -> int:
    """Return the memory that the process has."""
    pages = int(Path('/proc/self/statm').read_text().split()[1])
    return pages * 4096


def total() -> int:
    """Return the number of all references, where Python tells."""
    count = getattr(sys, 'gettotalrefcount', None)
    return count() if count is not None else 0


def main() -> int:
    """Run it; the exit code says whether something grew."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').split('\n\n')[0])
    parser.add_argument('--jobs', type=int, default=1_000_000)
    options = parser.parse_args()
    robot = Robot()
    kernel = robot.kernel

    def run(jobs: int) -> None:
        wanted = sum(task.runs for task in kernel.tasks) + jobs
        while sum(task.runs for task in kernel.tasks) < wanted:
            kernel.run(20 * MS)
        kernel.failures.clear()
        for _ in range(kernel.black_box.capacity):  # the last records are the same each time
            kernel.black_box.mark(0, 'mark')
        gc.collect()

    def look() -> tuple[dict[str, int], int, int]:
        return ({name: sys.getrefcount(thing) for name, thing in robot.objects()}, memory(),
                total())

    run(options.jobs // 10)
    for _ in range(2):  # what looking itself leaves behind
        before = look()
    wrong = []
    for number in range(ROUNDS):
        run(options.jobs // ROUNDS)
        after = look()
        print(f'{sum(task.runs for task in kernel.tasks)} jobs, memory '
              f'{(after[1] - before[1]) / 1e3:+.0f} kB, references {after[2] - before[2]:+d}',
              flush=True)
    for name, count in after[0].items():
        if abs(count - before[0][name]) > (200 if name == 'None' else 0):
            wrong.append(f'{name}: {before[0][name]} references before, {count} after')
    if after[1] - before[1] > GROWTH_BYTES:
        wrong.append(f'the process grew by {after[1] - before[1]} bytes')
    if abs(after[2] - before[2]) > options.jobs // 1000:
        wrong.append(f'{after[2] - before[2]:+d} references in all')
    print(state().text)
    print('\n'.join(wrong) or 'nothing grew')
    return int(bool(wrong))


if __name__ == '__main__':
    sys.exit(main())
