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

"""How much goes through a ring, beside a plain copy of the same bytes."""

from __future__ import annotations

from collections.abc import Callable
import time

from benchmarks.delay.subjects import MESSAGE
from benchmarks.delay.subjects import OVERHEAD_BYTES
import numpy as np

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.kernel import Kernel
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.topics import Bus

_BLOCK_NS = 2 * NS_PER_MS


def rings(harness: Harness) -> Measurement:
    """
    For each size move messages through a ring and copy as many bytes, in short turns.

    ``ring``: write the payload into the message, publish, take. ``copy``: one copy of the payload
    from a buffer to another, by the same NumPy assignment.
    """
    a = harness.arguments
    harness.prepare(freeze=True)
    samples = {}
    for size in a['sizes']:
        ring, copy = _operations(size)
        blocks: tuple[list[float], list[float]] = ([], [])
        calls = [_calls_a_block(operation) for operation in (ring, copy)]
        end_ns = time.perf_counter_ns() + a['measure_ns'] // len(a['sizes'])
        while time.perf_counter_ns() < end_ns or len(blocks[0]) < 5:
            for taken, operation, count in zip(blocks, (ring, copy), calls):
                taken.append(_mean_ps(operation, count))
        samples[f'ring {size}'] = np.array(blocks[0]).astype(np.int64)
        samples[f'copy {size}'] = np.array(blocks[1]).astype(np.int64)
    return Measurement(samples)


def _operations(size: int) -> tuple[Callable[[], object], Callable[[], object]]:
    bus = Bus(Kernel())
    bus.declare('message', MESSAGE, {'data': size - OVERHEAD_BYTES})
    publisher, subscription = bus.publisher('message'), bus.subscribe('message', 'reader')
    data, publish, take = publisher.msg.data, publisher.publish, subscription.take
    source = np.frombuffer(bytes(size - OVERHEAD_BYTES), np.uint8)
    target = np.zeros(size - OVERHEAD_BYTES, np.uint8)

    def ring() -> None:
        data[:] = source
        publish()
        take()

    def copy() -> None:
        target[:] = source

    return ring, copy


def _calls_a_block(operation: Callable[[], object]) -> int:
    operation()
    return max(3, int(_BLOCK_NS * 1000 / max(1.0, _mean_ps(operation, 20))))


def _mean_ps(operation: Callable[[], object], calls: int) -> float:
    """Take the mean of some calls, the empty loop taken off."""
    turns = range(calls)
    begin_ns = time.perf_counter_ns()
    for _ in turns:
        operation()
    middle_ns = time.perf_counter_ns()
    for _ in turns:
        pass
    return max(1.0, (2 * middle_ns - begin_ns - time.perf_counter_ns()) * 1000 / calls)
