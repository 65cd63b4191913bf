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
from collections.abc import Sequence
import time

from rt_robot_os.core.app import Core
from rt_robot_os.link.paths import socket_path
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measured
from rt_robot_os.tools.bench.workers.micro import IMU
from rt_robot_os.tools.bench.workers.micro import IMU_SHAPE
from rt_robot_os.tools.bench.workers.mirror import settings
from rt_robot_os.tools.bench.workers.turns import Turns

_NODE = 'rt_robot_os.tools.bench.peers.mirror_load:node'


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


def core(harness: Harness) -> Measured:
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
        turns = Turns(_all([tested.bus.publisher(mirrored(i)).publish for i in topics]),
                      _all([tested.bus.publisher(_plain(i)).publish for i in topics]), count,
                      lambda: time.clock_gettime_ns(clock))
        tested.kernel.add_task('bench/publish', turns.job, priority=80, rate_hz=a['rate_hz'])
        harness.prepare(freeze=True)
        tested.run(a['warmup_ns'] + a['measure_ns'])
    measured = turns.differences(a['warmup_ns'])
    if not counts or not counts[-1][1]:
        raise RuntimeError('the node got no sample')
    published, sent, dropped = counts[-1]
    return Measured({name: values // a['topics'] for name, values in measured.samples.items()},
                    {'published': published, 'sent': sent, 'dropped': dropped})
