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

"""From publishing to the callback in rclpy: publisher and subscriptions in one process."""

# mypy: allow-untyped-calls

from __future__ import annotations

from array import array
from collections.abc import Callable
import time
from typing import Any

from benchmarks.delay.subjects import due
from benchmarks.delay.subjects import key
from benchmarks.delay.subjects import MESSAGE
from benchmarks.delay.subjects import NUMBER
from benchmarks.delay.subjects import OVERHEAD_BYTES
from benchmarks.delay.subjects import Receiver
from benchmarks.delay.subjects import to_the_last
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup

from rt_robot_os.tools.bench.case import Samples
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.stamps import Stamps
from rt_robot_os.tools.bench.subjects.rclpy_graph import graph
from rt_robot_os.tools.bench.subjects.rclpy_graph import RclpyGraph
from rt_robot_os.topics.resolve import message_class

_DEPTH = 10
_MATCH_TIMEOUT_S = 10.0


def executor(harness: Harness) -> Measurement:
    """Measure all variants (bytes, subscribers), each with a node of its own."""
    a = harness.arguments
    harness.prepare()
    samples: dict[str, Samples] = {}
    for size, subscribers in a['variants']:
        samples[key(size, subscribers)] = _measure(a, size, subscribers)
    return Measurement(samples, {'due': due(a)})


def _measure(a: Any, size: int, subscribers: int) -> Samples:
    total_ns = a['warmup_ns'] + a['measure_ns']
    room = 2 * total_ns // a['period_ns'] + 100
    sent, receivers = Stamps(room), [Receiver(room) for _ in range(subscribers)]
    kind = message_class(MESSAGE)
    message = kind(data=array('B', bytes(size - OVERHEAD_BYTES)))
    with graph(a['executor']) as tested:
        publisher = tested.node.create_publisher(kind, 'message', _DEPTH)
        for receiver in receivers:
            tested.node.create_subscription(
                kind, 'message', _noting(receiver), _DEPTH,
                callback_group=MutuallyExclusiveCallbackGroup())
        _wait_for_match(tested, publisher, subscribers)

        def publishing() -> None:
            NUMBER.pack_into(message.data, 0, sent.count)
            sent.stamp()
            publisher.publish(message)

        tested.timer(a['period_ns'], publishing)
        tested.spin(total_ns)
    return to_the_last(sent, receivers, a['warmup_ns'] // a['period_ns'])


def _noting(receiver: Receiver) -> Callable[[Any], None]:
    def callback(message: Any) -> None:
        receiver.note(message.data)

    return callback


def _wait_for_match(tested: RclpyGraph, publisher: Any, subscribers: int) -> None:
    deadline = time.monotonic() + _MATCH_TIMEOUT_S
    while publisher.get_subscription_count() < subscribers:
        if time.monotonic() > deadline:
            raise RuntimeError('publisher and subscription of one process did not find each other')
        time.sleep(0.01)
