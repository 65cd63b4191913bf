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
Everything at once on the real clock, with signals at random instants.

    .venv/bin/python scripts/stress_core.py [--seconds 10] [--seed 1]

Timers preempt, tasks publish, abort each other's budgets, enter resources, await, fail and write
to pipes, while another thread sends the kernel's signals and others at random instants. Meant for
a C core that is compiled with sanitizers (``scripts/sanitize_core.py``); what it checks itself is
that each release is accounted for and that nothing but the intended failures is reported.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
import random
import signal
import sys
import threading
import time

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from rt_robot_os.base.compiled import state  # noqa: E402, I100
from rt_robot_os.kernel import any_of  # noqa: E402
from rt_robot_os.kernel import BudgetPolicy  # noqa: E402
from rt_robot_os.kernel import Event  # noqa: E402
from rt_robot_os.kernel import FailurePolicy  # noqa: E402
from rt_robot_os.kernel import Kernel  # noqa: E402
from rt_robot_os.kernel import MonotonicClock  # noqa: E402
from rt_robot_os.kernel import OverrunPolicy  # noqa: E402
from rt_robot_os.kernel.clock import INTERRUPT_SIGNAL  # noqa: E402
from rt_robot_os.kernel.clock import TICK_SIGNAL  # noqa: E402
from rt_robot_os.topics import Bus  # noqa: E402

US, MS, S = 1_000, 1_000_000, 1_000_000_000
INTENDED = ('TaskAborted', 'ValueError: intended', 'overruns', 'held')


class Stress:
    """The tasks, and the thread that sends signals."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.kernel = kernel = Kernel(MonotonicClock())
        self.bus = bus = Bus(kernel)
        self.handled = 0
        self.ended = threading.Event()
        self.sent = 0
        for number in range(3):
            bus.declare(f'fixed{number}', 'std_msgs/msg/Int64', depth=2 << number)
        bus.declare('tail', 'std_msgs/msg/String', tail=60, depth=4)
        bus.declare('large', 'std_msgs/msg/UInt8MultiArray', tail=200_000, depth=2)
        self.shared = [kernel.resource(f'r{n}') for n in range(2)]
        self.event = Event(kernel)
        self.reading, self.writing = os.pipe()
        os.set_blocking(self.reading, False)
        os.set_blocking(self.writing, False)
        for number in range(16):
            self.add_publisher(number)
        for number in range(4):
            self.add_reader(number)
        self.add_awkward()
        self.add_coroutine()
        reader = kernel.add_task('pipe', self.drain, priority=60)
        kernel.add_interrupt(self.reading, reader, separation_ns=300 * US)

    def spend(self, most_us: int) -> None:
        end_ns = self.kernel.now_ns() + self.random.randrange(most_us) * US
        while self.kernel.now_ns() < end_ns:
            pass

    def add_publisher(self, number: int) -> None:
        publisher = self.bus.publisher(('fixed0', 'fixed1', 'fixed2', 'tail', 'large')[number % 5])
        timer_task = self.kernel.add_task(f'timed {number}', lambda: self.spend(20),
                                          priority=95 - number)
        timer = self.kernel.timer(timer_task)

        def job() -> None:
            name = publisher.topic.name
            if name == 'tail':
                publisher.msg.data = 'x' * self.random.randrange(60)
            elif name.startswith('fixed'):
                publisher.msg.data = publisher.msg.data + 1
            publisher.publish()
            if number % 3 == 0:
                with self.shared[number % 2]:
                    self.spend(60)
                    publisher.publish()
            choice = self.random.randrange(12)
            if choice == 0:
                timer.start(self.random.randrange(2 * MS))
            elif choice == 1:
                timer.cancel()
            elif choice == 2:
                self.write()
            elif choice == 3:
                self.event.set()
            elif choice == 4:
                self.event.clear()
            elif choice == 5:
                self.kernel.release(timer_task)
            self.spend(100)

        self.kernel.add_task(f'publisher {number}', job, priority=5 + 5 * number,
                             rate_hz=100.0 + 37 * number, phase_ns=number * 130 * US,
                             resources=self.shared,
                             overrun=list(OverrunPolicy)[number % 3])

    def write(self) -> None:
        try:
            os.write(self.writing, b'x')
        except BlockingIOError:
            pass

    def drain(self) -> None:
        try:
            while os.read(self.reading, 4096):
                pass
        except BlockingIOError:
            pass

    def add_reader(self, number: int) -> None:
        def job() -> None:
            for subscription in subscriptions:
                if self.random.randrange(3):
                    while subscription.take():
                        pass
                else:
                    subscription.latest()

        task = self.kernel.add_task(f'reader {number}', job, priority=12 + 20 * number)
        subscriptions = [self.bus.subscribe(topic.name, task.name, task=task)
                         for topic in self.bus.topics]

    def add_awkward(self) -> None:
        """Add tasks that are aborted, fail, and change what is declared."""
        def run_away() -> None:
            if self.random.randrange(4):
                self.spend(3000)
            else:
                try:
                    self.spend(100_000)
                finally:
                    self.spend(200)

        def fail() -> None:
            if not self.random.randrange(3):
                raise ValueError('intended')

        def change() -> None:
            task = self.random.choice([t for t in self.kernel.tasks if t.period_ns])
            choice = self.random.randrange(5)
            if choice == 0 and task.spec.budget_ns == 0:
                task.set_rate_hz(self.random.uniform(50, 500))
            elif choice == 1:
                task.reset_statistics()
            elif choice == 2:
                task.account()
            elif choice == 3:
                self.kernel.hold(task, FailurePolicy.RESTART, 'held')
            else:
                self.kernel.black_box.mark(self.kernel.now_ns(), 'mark')

        add = self.kernel.add_task
        add('runaway', run_away, priority=40, rate_hz=70.0, budget_ns=2 * MS,
            on_budget=BudgetPolicy.ABORT, failure=FailurePolicy.RESTART, restart_ns=MS)
        add('failing', fail, priority=70, rate_hz=211.0, failure=FailurePolicy.RESTART,
            restart_ns=MS, restart_maximum_ns=5 * MS, on_restart=lambda: None)
        add('changing', change, priority=97, rate_hz=97.0)

    def add_coroutine(self) -> None:
        async def body() -> None:
            ticks = self.kernel.every(300.0)
            while True:
                await any_of(self.event.wait(), self.kernel.sleep(self.random.randrange(MS)))
                await subscription.next()
                await ticks.next()
                self.spend(50)

        self.kernel.add_async_task('coroutine', body, priority=33)
        subscription = self.bus.subscribe('fixed1', 'coroutine')

    def send(self) -> None:
        """Send signals at random instants to the thread of the kernel."""
        main = threading.main_thread().ident
        assert main is not None
        chosen = random.Random(self.random.random())
        while not self.ended.is_set():
            time.sleep(chosen.random() * 0.002)
            signo = chosen.choice((TICK_SIGNAL, TICK_SIGNAL, INTERRUPT_SIGNAL, signal.SIGUSR1))
            if self.kernel.running and not self.kernel.stopping:
                signal.pthread_kill(main, signo)
                self.sent += 1

    def run(self, duration_ns: int) -> None:
        def handle(signum: int, frame: object) -> None:
            self.handled += 1

        before = signal.signal(signal.SIGUSR1, handle)
        # A signal of the kernel that is delivered after its end would end this process.
        late = [(signo, signal.signal(signo, signal.SIG_DFL))
                for signo in (TICK_SIGNAL, INTERRUPT_SIGNAL)]
        sender = threading.Thread(target=self.send)
        stopper = self.kernel.add_task('stopper', self.ended.set, priority=99)
        stop = self.kernel.timer(stopper)
        starter = self.kernel.add_task(
            'starter', lambda: stop.start(duration_ns - 100 * MS), priority=98, rate_hz=1e-3)
        assert starter is not None
        sender.start()
        try:
            self.kernel.run(duration_ns)
        finally:
            self.ended.set()
            sender.join()
            signal.signal(signal.SIGUSR1, before)
            assert all(handler is signal.SIG_DFL for _, handler in late)


def main() -> int:
    """Run it; the exit code says whether something was wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').split('\n\n')[0])
    parser.add_argument('--seconds', type=float, default=10.0)
    parser.add_argument('--seed', type=int, default=1)
    options = parser.parse_args()
    stress = Stress(options.seed)
    stress.run(int(options.seconds * S))
    kernel = stress.kernel
    wrong = [str(failure) for failure in kernel.failures
             if not any(text in failure.error for text in INTENDED)]
    for task in kernel.tasks:
        left = task.releases - task.runs - task.missed - task.coalesced
        if left:
            wrong.append(f'task {task.name}: {left} releases are not accounted for')
    jobs = sum(task.runs for task in kernel.tasks)
    print(f'{state().text}: {jobs} jobs, {sum(t.head for t in stress.bus.topics)} publications, '
          f'{sum(t.aborted for t in kernel.tasks)} aborts, {kernel.failures_total} failures, '
          f'{stress.sent} signals from outside')
    for line in wrong:
        print(line)
    return int(bool(wrong))


if __name__ == '__main__':
    sys.exit(main())
