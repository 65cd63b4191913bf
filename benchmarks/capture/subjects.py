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

"""How punctual the core is while a camera and a microphone are captured for it."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from pathlib import Path
import select
import time
from typing import Any

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.core.app import Core
from rt_robot_os.devices.capture.host import CaptureHost
from rt_robot_os.devices.registry import DRIVERS
from rt_robot_os.link.protocol import Header
from rt_robot_os.linux.paths import socket_path
from rt_robot_os.tools.bench.cases.mirror.subjects import settings
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.stamps import Stamps
from rt_robot_os.tools.bench.subjects.link_client import connect
from rt_robot_os.tools.bench.subjects.link_client import stay

_HOST = f'{__name__}:host'
_VIEWER = f'{__name__}:viewer'
_PRIORITY = 30


def core(harness: Harness) -> Measurement:
    """
    Run a 1 kHz task beside a camera and a microphone, as far as they are asked for.

    The processes that capture are on the other CPUs; so is the client, when there is one.
    """
    a = harness.arguments
    path = socket_path('bench')
    tested = Core(settings({}), path)
    stamps = Stamps(2 * (a['warmup_ns'] + a['measure_ns']) // a['period_ns'] + 1000)
    tested.kernel.add_task('bench/probe', stamps.stamp, priority=90,
                           rate_hz=NS_PER_S / a['period_ns'])
    host_path = harness.folder / 'captures'
    for kind in a['devices']:
        _add(tested, kind, str(host_path), a)
    counts: list[int] = []

    def watch() -> None:
        if time.monotonic_ns() >= tested.kernel.start_ns + a['warmup_ns']:
            counts.append(sum(s.device.frames for s in tested.sensors.statistics()))

    tested.kernel.add_task('bench/watch', watch, priority=1, rate_hz=10.0)
    with harness.helper(_HOST, {'path': str(host_path)}, same_cpu=False):
        if not a['mirrored']:
            return _run(harness, tested, stamps, counts)
        with harness.helper(_VIEWER, {'path': str(path)}, same_cpu=False):
            return _run(harness, tested, stamps, counts)


def _add(tested: Core, kind: str, port: str, arguments: Mapping[str, Any]) -> None:
    driver = DRIVERS.load(kind)
    values = {field.name: field.default for field in driver.SETTINGS}
    own = {key: value for key, value in arguments.items() if key in values}
    tested.sensors.add(driver(kind, {**values, **own, 'port': port}), rate_hz=20.0,
                       priority=_PRIORITY, interrupt=True)


def _run(harness: Harness, tested: Core, stamps: Stamps, counts: list[int]) -> Measurement:
    a = harness.arguments
    harness.prepare(freeze=True)
    cpu_ns, wall_ns = time.process_time_ns(), time.monotonic_ns()
    tested.run(a['warmup_ns'] + a['measure_ns'])
    cpu_ns, wall_ns = time.process_time_ns() - cpu_ns, time.monotonic_ns() - wall_ns
    frames = counts[-1] - counts[0]
    if a['devices'] and not frames:
        raise RuntimeError('nothing was captured')
    start_ns = tested.kernel.start_ns
    lost = sum(s.device.lost_samples for s in tested.sensors.statistics())
    return Measurement({'starts': stamps.taken()}, {
        'phase_ns': start_ns, 'begin_ns': start_ns + a['warmup_ns'],
        'measure_ns': a['measure_ns'], 'cpu_percent': 100.0 * cpu_ns / wall_ns,
        'frames': frames, 'lost': lost})


def host(arguments: Mapping[str, Any], ready: Callable[[], None]) -> None:
    """Start what captures patterns and tones, for whoever connects."""
    serving = CaptureHost(Path(arguments['path']))
    serving.open()
    poll = select.poll()
    poll.register(serving.fileno(), select.POLLIN)
    ready()
    while True:
        poll.poll(100)
        serving.serve()


def viewer(arguments: Mapping[str, Any], ready: Callable[[], None]) -> None:
    """Be a client that takes every sample, as the ROS node does."""
    ready()
    link = connect(Path(arguments['path']))

    def take(head: Header, cdr: memoryview) -> None:
        bytes(cdr)

    link.on_data = take
    for topic in link.topics:
        link.mirror(topic)
    stay(link)
