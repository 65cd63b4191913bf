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

"""What many mirrored topics cost the core and a ROS node, and how many samples they take."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from pathlib import Path
import time
from typing import Any

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.core.app import Core
from rt_robot_os.linux.paths import socket_path
from rt_robot_os.tools.bench.cases.mirror.subjects import settings
from rt_robot_os.tools.bench.cases.mirror.turns import MirrorTurns
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.subjects.link_client import connect
from rt_robot_os.tools.bench.subjects.link_client import stay
from rt_robot_os.tools.bench.subjects.operation_cost import IMU
from rt_robot_os.tools.bench.subjects.operation_cost import IMU_SHAPE

# Duration of each rate, and the factor from one to the next.
STEP_NS = 300 * NS_PER_MS
GROWTH = 1.3
FIRST_HZ, LAST_HZ = 10_000.0, 1_000_000.0
# Of a deep ring, so that a burst is no loss.
_DEPTH = 1024
_TICK_HZ = 1000.0
# A rate is too high when more than this part is dropped; a step in which more was not published in
# time does not count.
_BEARABLE = 0.001
_BEHIND = 0.02
# How often in a row: a single one may have another reason.
TRIES = 3
CORE_GAVE_IN, NODE_GAVE_IN, NOBODY_GAVE_IN = 1, 2, 0
_NODE = f'{__package__}.load_peers:node'
_SINK = f'{__name__}:sink'


def mirrored(number: int) -> str:
    """Name a topic that is mirrored."""
    return f'bench/imu{number}'


def _plain(number: int) -> str:
    return f'bench/plain{number}'


def process_clock(pid: int) -> int:
    """Return the clock of the CPU time of another process, as clock_getcpuclockid(3) makes it."""
    return ~pid << 3 | 2


def _all(publish: Sequence[Callable[[], object]]) -> Callable[[], None]:
    def each() -> None:
        for one in publish:
            one()

    return each


def core(harness: Harness) -> Measurement:
    """
    Publish ``topics`` at ``rate_hz``, in turns on those that a ROS node mirrors and on others.

    :return: the difference by message, in the core and in all threads of the node.
    """
    a = harness.arguments
    topics = range(a['topics'])
    path = socket_path('bench')
    tested = Core(settings({name(i): (IMU, IMU_SHAPE) for name in (mirrored, _plain)
                            for i in topics}, a['gather_ms']), path)
    counts: list[tuple[int, int, int]] = []

    def count() -> None:
        mirrors = [m for c in tested.link.statistics() for m in c.mirrors]
        counts.append((sum(m.published for m in mirrors), sum(m.sent for m in mirrors),
                       sum(m.lost + m.full for m in mirrors)))

    arguments = {'path': str(path), 'topics': a['topics'], 'delay_ms': a['delay_ms']}
    with harness.helper(_NODE, arguments, same_cpu=False) as helper:
        clock = process_clock(helper.process.pid)
        turns = MirrorTurns(_all([tested.bus.publisher(mirrored(i)).publish for i in topics]),
                            _all([tested.bus.publisher(_plain(i)).publish for i in topics]), count,
                            lambda: time.clock_gettime_ns(clock))
        tested.kernel.add_task('bench/publish', turns.job, priority=80, rate_hz=a['rate_hz'])
        harness.prepare(freeze=True)
        tested.run(a['warmup_ns'] + a['measure_ns'])
    measured = turns.differences(a['warmup_ns'])
    if not counts or not counts[-1][1]:
        raise RuntimeError('the node got no sample')
    published, sent, dropped = counts[-1]
    return Measurement({name: values // a['topics'] for name, values in measured.samples.items()},
                       {'published': published, 'sent': sent, 'dropped': dropped})


class Ramp:
    """
    A job for a task of 1 kHz that publishes more and more a second, until something is dropped.

    :param publish: by topic; each in its turn.
    :param dropped: returns how many samples the core could not send in time, and how many the
        client's socket refused, both since the beginning.
    :ivar rate_hz: the highest rate at which nothing was.
    :ivar gave_in: who could not do more: ``CORE_GAVE_IN``, ``NODE_GAVE_IN``.
    """

    def __init__(self, publish: Sequence[Callable[[], object]],
                 dropped: Callable[[], tuple[int, int]], warmup_ns: int) -> None:
        self.rate_hz = 0.0
        self.gave_in = NOBODY_GAVE_IN
        self._publish = publish
        self._dropped = dropped
        self._next = self._published = 0
        self._wanted_hz = FIRST_HZ
        self._before = (0, 0)
        self._failed = 0
        self._begun_ns = time.monotonic_ns() + warmup_ns
        self._due = 0.0

    def job(self) -> None:
        """Publish what is due in a millisecond; look at the end of each step what became of it."""
        publish, count = self._publish, len(self._publish)
        self._due += self._wanted_hz / _TICK_HZ
        for _ in range(int(self._due)):
            publish[self._next % count]()
            self._next += 1
        self._published += int(self._due)
        self._due %= 1.0
        elapsed_ns = time.monotonic_ns() - self._begun_ns
        if elapsed_ns >= STEP_NS and not self.gave_in:
            self._judge(elapsed_ns)
            self._published, self._begun_ns = 0, time.monotonic_ns()

    def _judge(self, elapsed_ns: int) -> None:
        rate_hz = self._published * NS_PER_S / elapsed_ns
        now = self._dropped()
        lost, full = (after - before for before, after in zip(self._before, now))
        self._before = now
        if lost + full > _BEARABLE * self._published:
            self._failed += 1
            if self._failed == TRIES:
                # While the socket is full, what waits in the ring is overwritten there.
                self.gave_in = NODE_GAVE_IN if full else CORE_GAVE_IN
                self._wanted_hz = FIRST_HZ
        elif rate_hz >= (1 - _BEHIND) * self._wanted_hz:  # else the machine took the CPU: again
            self._failed = 0
            self.rate_hz = rate_hz
            self._wanted_hz = min(LAST_HZ, GROWTH * self._wanted_hz)


def saturation(harness: Harness) -> Measurement:
    """
    Publish on ``topics`` that a ROS node mirrors, more and more, until a sample is dropped.

    With ``sink`` a client takes them that does nothing with them: what the core can do.

    :return: the highest rate at which none was, of all topics together, and who gave in then.
    """
    a = harness.arguments
    topics = range(a['topics'])
    path = socket_path('bench')
    tested = Core(settings({mirrored(i): (IMU, IMU_SHAPE) for i in topics}, depth=_DEPTH), path)

    def dropped() -> tuple[int, int]:
        mirrors = [m for c in tested.link.statistics() for m in c.mirrors]
        if not sum(m.sent for m in mirrors):
            raise RuntimeError('the node got no sample')
        return sum(m.lost for m in mirrors), sum(m.full for m in mirrors)

    arguments = {'path': str(path), 'topics': a['topics'], 'delay_ms': a['delay_ms']}
    with harness.helper(_SINK if a['sink'] else _NODE, arguments, same_cpu=False):
        harness.prepare(freeze=True)
        ramp = Ramp([tested.bus.publisher(mirrored(i)).publish for i in topics], dropped,
                    a['warmup_ns'])
        tested.kernel.add_task('bench/publish', ramp.job, priority=60, rate_hz=_TICK_HZ)
        tested.run(a['warmup_ns'] + a['measure_ns'])
    return Measurement({}, {'rate_hz': ramp.rate_hz, 'gave_in': ramp.gave_in})


def sink(arguments: Mapping[str, Any], ready: Callable[[], None]) -> None:
    """Be a client that takes all samples and does nothing with them."""
    ready()
    link = connect(Path(arguments['path']))
    for i in range(arguments['topics']):
        link.mirror(mirrored(i))
    stay(link)
