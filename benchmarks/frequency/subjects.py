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

"""Many periodic modules that do little: how often each runs, in this package's kernel."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from contextlib import suppress
import os
import signal
import time
from typing import Any

from benchmarks.delay.subjects import MESSAGE
import numpy as np

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import OverrunPolicy
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.helper import Helper
from rt_robot_os.tools.bench.stamps import Stamps
from rt_robot_os.tools.bench.subjects.compute import compute
from rt_robot_os.topics import Bus

TOPIC_BYTES = 64
# The calls in which a module that is to be late computes, and has its process stopped.
OWN_CALL, AWAY_CALL = 10, 30
_STOPPER = f'{__name__}:stopper'
_STOPPER_PRIORITY = 90
_AFTER_S = 1e-3
_FREE_PRIORITY = 99


class Module:
    """
    A module's work and its notes: an addition, and a stamp every so many calls.

    :param every: calls from one stamp to the next; the calls between are known by number.
    """

    __slots__ = ('stamps', 'value', '_every', '_left')

    def __init__(self, room: int, every: int) -> None:
        self.stamps = Stamps(room)
        self.value = 0
        self._every = self._left = every

    def work(self) -> None:
        """Be called once."""
        self._left -= 1
        if not self._left:
            self._left = self._every
            self.stamps.stamp()
        self.value += 1


class Late(Module):
    """
    A module that is late twice: what becomes of the releases that pass meanwhile.

    In its call number ``OWN_CALL`` it computes for ``stall_ns``. In its call number ``AWAY_CALL``
    it asks another process to stop its own one until ``stall_ns`` later, as the host of a virtual
    machine does.
    """

    __slots__ = ('_stall_ns', '_calls', '_helper')

    def __init__(self, room: int, stall_ns: int) -> None:
        super().__init__(room, 1)
        self._stall_ns = stall_ns
        self._calls = 0
        cpus = sorted(os.sched_getaffinity(0))
        self._helper = Helper(_STOPPER, {'pid': os.getpid(), 'stall_ns': stall_ns},
                              cpus[:-1] or cpus)

    def work(self) -> None:
        """Be called once."""
        super().work()
        self._calls += 1
        if self._calls == OWN_CALL:
            compute(self._stall_ns)
        elif self._calls == AWAY_CALL:
            os.kill(self._helper.process.pid, signal.SIGUSR1)


def stopper(arguments: Mapping[str, Any], ready: Callable[[], None]) -> None:
    """Wait for a signal; a moment later, when its job is over, stop the process that sent it."""
    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGUSR1])
    with suppress(OSError):  # on a busy machine it would let go of it too late
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_STOPPER_PRIORITY))
    ready()
    signal.sigwait([signal.SIGUSR1])
    end_ns = time.monotonic_ns() + arguments['stall_ns']
    time.sleep(_AFTER_S)
    os.kill(arguments['pid'], signal.SIGSTOP)
    try:
        time.sleep(max(0.0, (end_ns - time.monotonic_ns()) / NS_PER_S))
    finally:
        os.kill(arguments['pid'], signal.SIGCONT)


def make_modules(a: Mapping[str, Any]) -> Sequence[Module]:
    """
    Make the modules of a run.

    :param a: ``modules`` is a list of (rate in Hz, priority); with ``stall_ns`` they are late by
        that, see :class:`Late`.
    """
    total_ns = a['warmup_ns'] + a['measure_ns']
    rooms = [2 * int(total_ns * rate // (NS_PER_S * a['every'])) + 100 for rate, _ in a['modules']]
    if a.get('stall_ns'):
        return [Late(room, a['stall_ns']) for room in rooms]
    return [Module(room, a['every']) for room in rooms]


def collect(modules: Sequence[Module], begin_ns: int, a: Mapping[str, Any], cpu_ns: int,
            duration_ns: int) -> Measurement:
    """
    Put the notes of all modules together.

    :param begin_ns: when the modules began; the warm-up comes after it.
    :param cpu_ns: that the process used in ``duration_ns``.
    """
    taken = [module.stamps.taken() for module in modules]
    return Measurement(
        {'starts': np.concatenate(taken) if taken else np.zeros(0, np.int64),
         'counts': np.array([len(one) for one in taken], np.int64)},
        {'begin_ns': begin_ns + a['warmup_ns'], 'measure_ns': a['measure_ns'],
         'cpu_percent': 100.0 * cpu_ns / max(1, duration_ns)})


def kernel(harness: Harness) -> Measurement:
    """
    Run the modules as tasks; with ``receive`` each takes the messages of a topic.

    ``overrun``: what happens to a release that finds the last job unfinished; skipped by default.
    """
    a = harness.arguments
    modules = make_modules(a)
    tested = Kernel()
    jobs = [module.work for module in modules]
    if a['receive']:
        jobs = _receiving(tested, jobs, a)
    for i, ((rate, priority), job) in enumerate(zip(a['modules'], jobs)):
        tested.add_task(f'module{i}', job, priority=priority, rate_hz=rate,
                        overrun=OverrunPolicy(a.get('overrun', OverrunPolicy.SKIP.value)))
    total_ns = a['warmup_ns'] + a['measure_ns']
    harness.prepare(freeze=True)
    begin_ns, cpu_ns = time.monotonic_ns(), time.process_time_ns()
    tested.run(total_ns)
    return collect(modules, begin_ns, a, time.process_time_ns() - cpu_ns,
                   time.monotonic_ns() - begin_ns)


def _receiving(tested: Kernel, jobs: Sequence[Callable[[], None]], a: Mapping[str, Any]
               ) -> list[Callable[[], None]]:
    """Let each job take what a publisher of the same rate publishes, with its own pointer."""
    bus = Bus(tested)
    bus.declare('test', MESSAGE, {'data': TOPIC_BYTES}, max_subscribers=len(jobs))
    tested.add_task('publisher', bus.publisher('test').publish, priority=_FREE_PRIORITY,
                    rate_hz=a['modules'][0][0])

    def receiving(take: Callable[[], bool], job: Callable[[], None]) -> Callable[[], None]:
        def both() -> None:
            take()
            job()

        return both

    return [receiving(bus.subscribe('test', f'module{i}').take, job)
            for i, job in enumerate(jobs)]
