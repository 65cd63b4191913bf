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

"""Small costs: an operation on a topic or a layout, and the kernel's own part of a job."""

from __future__ import annotations

from collections.abc import Callable
import os

from benchmarks.delay.subjects import MESSAGE
from benchmarks.delay.subjects import OVERHEAD_BYTES
import numpy as np

from rt_robot_os.base.logger import Logger
from rt_robot_os.base.reports import Reports
from rt_robot_os.kernel import Kernel
from rt_robot_os.tools.bench.case import Samples
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.subjects.operation_cost import block_means_ps
from rt_robot_os.tools.bench.subjects.operation_cost import IMU
from rt_robot_os.tools.bench.subjects.operation_cost import IMU_SHAPE
from rt_robot_os.tools.bench.subjects.operation_cost import TEN_FIELDS
from rt_robot_os.topics import Bus
from rt_robot_os.topics import Layout


def operations(harness: Harness) -> Measurement:
    """Measure each operation for a part of the time, in turns."""
    tested = {**_topic_operations(64), **_topic_operations(2048), **_layout_operations(),
              **_log_operations()}
    harness.prepare(freeze=True)
    turns = 4
    share_ns = harness.arguments['measure_ns'] // (turns * (len(tested) + 1))
    means: dict[str, list[Samples]] = {name: [] for name in tested}
    for _ in range(turns):
        for name, operation in tested.items():
            means[name].append(block_means_ps(operation, share_ns))
        means.setdefault('publish to task 64', []).append(_to_a_task_ps(share_ns))
    return Measurement({name: np.concatenate(parts) for name, parts in means.items()})


def _topic_operations(size: int) -> dict[str, Callable[[], object]]:
    bus = Bus(Kernel())
    bus.declare('message', MESSAGE, {'data': size - OVERHEAD_BYTES})
    publish, take = bus.publisher('message').publish, bus.subscribe('message', 'reader').take

    def both() -> None:
        publish()
        take()

    return {f'publish {size}': publish, f'publish+take {size}': both}


def _to_a_task_ps(duration_ns: int) -> Samples:
    """Measure what has to be measured inside a kernel that runs."""
    tested = Kernel()
    bus = Bus(tested)
    bus.declare('message', MESSAGE, {'data': 64 - OVERHEAD_BYTES})
    publish = bus.publisher('message').publish
    taken: list[Callable[[], bool]] = []
    means: list[Samples] = []
    reader = tested.add_task('reader', lambda: taken[0](), priority=50)
    taken.append(bus.subscribe('message', 'reader', task=reader).take)

    def job() -> None:
        means.append(block_means_ps(publish, duration_ns))
        tested.stop()

    tested.add_task('publisher', job, priority=10, rate_hz=1.0)
    tested.run()
    return means[0]


def _layout_operations() -> dict[str, Callable[[], object]]:
    layout = Layout.compile(IMU, IMU_SHAPE)
    buffer = layout.new_buffer()
    message = layout.view(buffer)
    packer = layout.packer(*TEN_FIELDS)
    velocity = message.angular_velocity
    values = tuple(float(i) for i in range(10))

    def set_one() -> None:
        velocity.x = 1.0

    return {'field set': set_one, 'field get': lambda: velocity.x,
            'pack ten': lambda: packer.pack(buffer, *values),
            'unpack ten': lambda: packer.unpack(buffer)}


def _log_operations() -> dict[str, Callable[[], object]]:
    log = Logger('bench')
    log.connect(Reports(), Kernel().now_ns)
    return {'log three': lambda: log.info('%d of %s: %.1f', 1, 'two', 3.0),
            'log throttled': lambda: log.info('%d', 1, throttle_s=3600.0),
            'log off': lambda: log.debug('%d', 1)}


def floors(harness: Harness) -> Measurement:
    """Measure the least that Python and Linux take for anything, in turns."""
    tested: dict[str, Callable[[], object]] = {'call': _nothing, 'system call': os.getppid}
    harness.prepare(freeze=True)
    turns = 4
    share_ns = harness.arguments['measure_ns'] // (turns * len(tested))
    means: dict[str, list[Samples]] = {name: [] for name in tested}
    for _ in range(turns):
        for name, operation in tested.items():
            means[name].append(block_means_ps(operation, share_ns))
    return Measurement({name: np.concatenate(parts) for name, parts in means.items()})


def _nothing() -> None:
    """Do nothing: what is measured is the kernel."""
