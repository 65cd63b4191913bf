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

"""How punctual the core is while the ROS side does this or that."""

from __future__ import annotations

import os
import signal
import time

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.core.app import Core
from rt_robot_os.linux.paths import socket_path
from rt_robot_os.tools.bench.cases.mirror.subjects import settings
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.stamps import Stamps
from rt_robot_os.tools.bench.subjects.operation_cost import IMU
from rt_robot_os.tools.bench.subjects.operation_cost import IMU_SHAPE

_NODE = f'{__package__}.isolation_peers:node'
_STORM = f'{__package__}.isolation_peers:storm'


def topic(number: int) -> str:
    """Name a topic."""
    return f'bench/imu{number}'


def core(harness: Harness) -> Measurement:
    """
    Publish ``topics`` at ``rate_hz`` in a core of which ``mirrored`` are mirrored by a ROS node.

    With ``storm`` participants join and leave all the time; with ``stop`` the node is stopped
    (SIGSTOP) at the end of the warm-up. A 1 kHz task notes when it runs.
    """
    a = harness.arguments
    path = socket_path('bench')
    tested = Core(settings({topic(i): (IMU, IMU_SHAPE) for i in range(a['topics'])}), path)
    total_ns = a['warmup_ns'] + a['measure_ns']
    stamps = Stamps(2 * total_ns // a['period_ns'] + 1000)
    publishers = [tested.bus.publisher(topic(i)).publish for i in range(a['topics'])]
    sent, pids = [0, 0], [0]

    def publish() -> None:
        for one in publishers:
            one()

    def watch() -> None:
        sent[1] = sum(m.sent for client in tested.link.statistics() for m in client.mirrors)
        if pids[0] and time.monotonic_ns() >= tested.kernel.start_ns + a['warmup_ns']:
            sent[0] = sent[1]
            if a['stop']:
                os.kill(pids[0], signal.SIGSTOP)
            pids[0] = 0

    tested.kernel.add_task('bench/probe', stamps.stamp, priority=90,
                           rate_hz=NS_PER_S / a['period_ns'])
    tested.kernel.add_task('bench/publish', publish, priority=60, rate_hz=a['rate_hz'])
    tested.kernel.add_task('bench/watch', watch, priority=1, rate_hz=10.0)
    arguments = {'path': str(path), 'mirrored': a['mirrored']}
    with harness.helper(_NODE, arguments, same_cpu=False) as node:
        pids[0] = node.process.pid
        if not a['storm']:
            return _run(harness, tested, stamps, sent)
        with harness.helper(_STORM, {}, same_cpu=False):
            return _run(harness, tested, stamps, sent)


def _run(harness: Harness, tested: Core, stamps: Stamps, sent: list[int]) -> Measurement:
    a = harness.arguments
    harness.prepare(freeze=True)
    cpu_ns, wall_ns = time.process_time_ns(), time.monotonic_ns()
    tested.run(a['warmup_ns'] + a['measure_ns'])
    cpu_ns, wall_ns = time.process_time_ns() - cpu_ns, time.monotonic_ns() - wall_ns
    if a['mirrored'] and not sent[1]:
        raise RuntimeError('nothing was sent to the node')
    start_ns = tested.kernel.start_ns
    return Measurement({'starts': stamps.taken()}, {
        'phase_ns': start_ns, 'begin_ns': start_ns + a['warmup_ns'],
        'measure_ns': a['measure_ns'], 'cpu_percent': 100.0 * cpu_ns / wall_ns,
        'sent': sent[1] - sent[0]})
