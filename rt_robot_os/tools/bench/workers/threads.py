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

"""The peer that everybody knows: Python threads that sleep until their next deadline."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence
import os
from queue import SimpleQueue
import threading
import time

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.tools.bench.case import Samples
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measured
from rt_robot_os.tools.bench.stamps import Stamps
from rt_robot_os.tools.bench.workers.delay import due
from rt_robot_os.tools.bench.workers.delay import key
from rt_robot_os.tools.bench.workers.delay import NUMBER
from rt_robot_os.tools.bench.workers.delay import Receiver
from rt_robot_os.tools.bench.workers.delay import to_the_last
from rt_robot_os.tools.bench.workers.modules import collect
from rt_robot_os.tools.bench.workers.modules import make_modules
from rt_robot_os.tools.bench.workers.preemption import Work

_LEAD_NS = NS_PER_S // 20


def _set_priority(priority: int) -> None:
    try:
        os.sched_setscheduler(threading.get_native_id(), os.SCHED_FIFO, os.sched_param(priority))
    except OSError:
        pass  # the harness has said that it is refused


class Threads:
    """
    One thread a job, each on a time grid that begins at the same moment.

    :param jobs: (period in nanoseconds, priority of SCHED_FIFO or 0, what it does).
    :param over: asked after each job whether that was all.
    """

    def __init__(self, jobs: Sequence[tuple[int, int, Callable[[], object]]], total_ns: int,
                 over: Callable[[], bool] = bool) -> None:
        self._over = over
        self.begin_ns = time.monotonic_ns() + _LEAD_NS
        self._end_ns = self.begin_ns + total_ns
        self._threads = [threading.Thread(target=self._loop, args=job, daemon=True)
                         for job in jobs]

    def run(self) -> None:
        """Let them run until the time is over."""
        for thread in self._threads:
            thread.start()
        for thread in self._threads:
            thread.join()

    def _loop(self, period_ns: int, priority: int, job: Callable[[], object]) -> None:
        if priority:
            _set_priority(priority)
        deadline_ns = self.begin_ns
        now_ns, sleep = time.monotonic_ns, time.sleep
        while deadline_ns < self._end_ns and not self._over():
            wait_ns = deadline_ns - now_ns()
            if wait_ns > 0:
                sleep(wait_ns / NS_PER_S)
            job()
            deadline_ns += period_ns
            late_ns = now_ns() - deadline_ns
            if late_ns > 0:  # skip what was missed, stay on the grid
                deadline_ns += (late_ns // period_ns + 1) * period_ns


def modules(harness: Harness) -> Measured:
    """Run periodic modules, see :func:`rt_robot_os.tools.bench.workers.modules.kernel`."""
    a = harness.arguments
    made = make_modules(a)
    harness.prepare()
    tested = Threads(
        [(round(NS_PER_S / rate), min(priority, harness.priority), module.work)
         for (rate, priority), module in zip(a['modules'], made)],
        a['warmup_ns'] + a['measure_ns'])
    begin_ns, cpu_ns = time.monotonic_ns(), time.process_time_ns()
    tested.run()
    return collect(made, tested.begin_ns, a, time.process_time_ns() - cpu_ns,
                   time.monotonic_ns() - begin_ns)


def delay(harness: Harness) -> Measured:
    """Send bytes from a thread to others that wait at a ``queue.SimpleQueue`` each."""
    a = harness.arguments
    harness.prepare()
    return Measured({key(size, subscribers): _delay(harness, size, subscribers)
                     for size, subscribers in a['variants']}, {'due': due(a)})


def _delay(harness: Harness, size: int, subscribers: int) -> Samples:
    a = harness.arguments
    total_ns = a['warmup_ns'] + a['measure_ns']
    room = 2 * total_ns // a['period_ns'] + 100
    sent, receivers = Stamps(room), [Receiver(room) for _ in range(subscribers)]
    queues: list[SimpleQueue[bytes]] = [SimpleQueue() for _ in receivers]
    message = bytearray(size)

    def publish() -> None:
        NUMBER.pack_into(message, 0, sent.count)
        sent.stamp()
        payload = bytes(message)
        for one in queues:
            one.put(payload)

    def receive(queue: SimpleQueue[bytes], receiver: Receiver) -> None:
        if harness.priority:
            _set_priority(harness.priority)
        while payload := queue.get():
            receiver.note(payload)

    waiting = [threading.Thread(target=receive, args=pair, daemon=True)
               for pair in zip(queues, receivers)]
    for thread in waiting:
        thread.start()
    Threads([(a['period_ns'], harness.priority // 2, publish)], total_ns).run()
    for queue, thread in zip(queues, waiting):
        queue.put(b'')
        thread.join()
    return to_the_last(sent, receivers, a['warmup_ns'] // a['period_ns'])


def preemption(harness: Harness) -> Measured:
    """Run a fast thread over one that computes, which has a lower priority of SCHED_FIFO."""
    a = harness.arguments
    work = Work(a)
    jobs = [(a['period_ns'], harness.priority, work.fast),
            (a['busy_period_ns'], harness.priority // 4, work.busy)]
    if a['middle_period_ns']:
        jobs.insert(1, (a['middle_period_ns'], harness.priority // 2, work.middle))
    harness.prepare()
    tested = Threads(jobs, work.total_ns)
    tested.run()
    return work.measured(tested.begin_ns)
