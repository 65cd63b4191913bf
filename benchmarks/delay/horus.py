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

"""Messages between nodes of HORUS (horus-robotics on PyPI), where it is installed."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from benchmarks.delay.subjects import due
from benchmarks.delay.subjects import key
from benchmarks.delay.subjects import Receiver
from benchmarks.delay.subjects import to_the_last
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.tools.bench.case import Samples
from rt_robot_os.tools.bench.cases.preemption.horus import PRIORITY
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.stamps import Stamps

_MESSAGE_MAXIMUM = 3000


def delay(harness: Harness) -> Measurement:
    """
    Send dictionaries from a node to nodes that the topic triggers; larger ones are left out.

    A topic without a type carries no bytes, but what JSON can say: a string has the size.
    """
    a = harness.arguments
    samples: dict[str, Samples] = {}
    for size, subscribers in a['variants']:
        if size <= _MESSAGE_MAXIMUM:
            samples[key(size, subscribers)] = _delay(a, size, subscribers)
    return Measurement(samples, {'due': due(a)})


def _delay(a: Any, size: int, subscribers: int) -> Samples:
    horus = import_module('horus')
    total_ns = a['warmup_ns'] + a['measure_ns']
    room = 2 * total_ns // a['period_ns'] + 100
    sent, receivers = Stamps(room), [Receiver(room) for _ in range(subscribers)]
    text, topic = 'x' * size, f'bench.{size}.{subscribers}'

    def publish(node: Any) -> None:
        message = {'n': sent.count, 'data': text}
        sent.stamp()
        node.send(topic, message)

    def receiving(receiver: Receiver) -> Callable[[Any], None]:
        def tick(node: Any) -> None:
            while message := node.recv(topic):
                receiver.note_number(message['n'])

        return tick

    rate_hz = NS_PER_S / a['period_ns']
    horus.run(
        horus.Node(name='publisher', tick=publish, rate=rate_hz, order=0, priority=PRIORITY,
                   pubs=[topic]),
        *(horus.Node(name=f'receiver{i}', tick=receiving(receiver), on=topic, order=1,
                     subs=[topic]) for i, receiver in enumerate(receivers)),
        rt=True, tick_rate=rate_hz, duration=total_ns / NS_PER_S)
    return to_the_last(sent, receivers, a['warmup_ns'] // a['period_ns'])
