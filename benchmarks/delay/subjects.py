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

"""From publishing to having it: this package's topics, under its kernel."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
import struct
import time
from typing import Any

import numpy as np

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.kernel import Kernel
from rt_robot_os.linux.timer import Sleeper
from rt_robot_os.tools.bench.case import Samples
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.stamps import Stamps
from rt_robot_os.topics import Bus
from rt_robot_os.topics import Publisher
from rt_robot_os.topics import Subscription

MESSAGE = 'std_msgs/msg/UInt8MultiArray'
# Encapsulation, an empty sequence of dimensions, the data's offset and its length.
OVERHEAD_BYTES = 16
NUMBER = struct.Struct('<I')
_NO_NUMBER = 0xFFFFFFFF
SMALL_BYTES = 64
DELAY, WARM, SLEEPING, WAITING = 'delay', 'warm', 'sleeping', 'waiting'
_TURNS = 2


class Receiver:
    """One subscriber's notes: which message, and when it had it."""

    def __init__(self, room: int) -> None:
        self.stamps = Stamps(room)
        self.numbers = np.zeros(room, np.int64)

    def note(self, data: Any) -> None:
        """Note the moment first, then the number that the message carries."""
        self.stamps.stamp()
        if not self.stamps.dropped:
            self.numbers[self.stamps.count - 1] = NUMBER.unpack_from(data)[0]

    def note_number(self, number: int) -> None:
        """Note the moment, and the number of the message where that is known."""
        self.stamps.stamp()
        if not self.stamps.dropped:
            self.numbers[self.stamps.count - 1] = number


def to_the_last(sent: Stamps, receivers: list[Receiver], warm: int) -> Samples:
    """
    Take the delay of each message until the last subscriber had it.

    :param warm: messages at the beginning that do not count; the very last, which may still be on
        its way, does not either.
    :return: nanoseconds, without the messages that did not reach all.
    """
    published = sent.taken()[:-1]
    last = np.zeros(len(published), np.int64)
    reached = np.zeros(len(published), np.int64)
    for receiver in receivers:
        moments = receiver.stamps.taken()
        numbers = receiver.numbers[:len(moments)]
        known = numbers < len(published)
        moments, numbers = moments[known], numbers[known]
        np.maximum.at(last, numbers, moments)
        np.add.at(reached, numbers, 1)
    complete = (reached >= len(receivers)) & (np.arange(len(published)) >= warm)
    delays: Samples = (last - published)[complete]
    return delays


def due(arguments: Mapping[str, int]) -> int:
    """Count the messages of one variant that have to arrive; the very last one does not."""
    return max(1, arguments['measure_ns'] // arguments['period_ns'] - 1)


def key(size: int, subscribers: int) -> str:
    """Name the samples of one variant."""
    return f'{size}x{subscribers}'


def kernel(harness: Harness) -> Measurement:
    """Measure all variants (bytes, subscribers), one after the other."""
    a = harness.arguments
    samples: dict[str, Samples] = {}
    variants = [(size, subscribers, Variant(a, size, subscribers))
                for size, subscribers in a['variants']]
    harness.prepare(freeze=True)
    for size, subscribers, variant in variants:
        samples[key(size, subscribers)] = variant.run()
    return Measurement(samples, {'due': due(a)})


def cold_and_warm(harness: Harness) -> Measurement:
    """
    Measure what the caches of the CPU make of a small message, with a kernel and without.

    Samples: ``DELAY`` from task to task; ``WARM`` that of the fifth in a row; ``SLEEPING`` and
    ``WAITING`` in a bare loop that sleeps or waits between two messages. In short turns, so that
    what disturbs the machine meets all of them.
    """
    a = {**harness.arguments, 'measure_ns': harness.arguments['measure_ns'] // _TURNS}
    turns = [(Variant(a, SMALL_BYTES, 1), Variant(a, SMALL_BYTES, 1, before=4))
             for _ in range(_TURNS)]
    harness.prepare(freeze=True)
    samples: dict[str, list[Samples]] = {
        name: [] for name in (DELAY, SLEEPING, WARM, WAITING)}
    for cold, warm in turns:
        samples[DELAY].append(cold.run())
        samples[SLEEPING].append(_alone(a, True))
        samples[WARM].append(warm.run())
        samples[WAITING].append(_alone(a, False))
    return Measurement({name: np.concatenate(parts) for name, parts in samples.items()})


def _alone(a: Mapping[str, int], sleeping: bool) -> Samples:
    """
    Publish and take in a bare loop, without a kernel, that sleeps or waits in between.

    It takes the same notes as the tasks do: they are in what is measured.
    """
    bus = Bus(Kernel())
    bus.declare('message', MESSAGE, {'data': SMALL_BYTES - OVERHEAD_BYTES})
    publisher, subscription = bus.publisher('message'), bus.subscribe('message', 'reader')
    sleeper, now_ns = Sleeper(), time.monotonic_ns
    count = (a['warmup_ns'] + a['measure_ns']) // a['period_ns'] + 1  # the last does not count
    sent, receiver = Stamps(count), Receiver(count)
    wake_ns = now_ns()
    for _ in range(count):
        wake_ns += a['period_ns']
        if sleeping:
            sleeper.sleep_until_ns(wake_ns)
        while now_ns() < wake_ns:
            pass
        NUMBER.pack_into(publisher.msg.data, 0, sent.count)
        sent.stamp()
        publisher.publish()
        if subscription.take():
            receiver.note(subscription.msg.data)
    return to_the_last(sent, [receiver], a['warmup_ns'] // a['period_ns'])


class Variant:
    """
    One size of message and number of subscribers, in a kernel of its own.

    :param before: messages that are published just before each that is measured: they warm the
        caches.
    """

    def __init__(self, a: Mapping[str, int], size: int, subscribers: int, before: int = 0) -> None:
        self._total_ns = a['warmup_ns'] + a['measure_ns']
        self._warm = a['warmup_ns'] // a['period_ns']
        room = 2 * self._total_ns // a['period_ns'] + 100
        self._kernel = Kernel()
        bus = Bus(self._kernel)
        bus.declare('message', MESSAGE, {'data': size - OVERHEAD_BYTES})
        self._sent = Stamps(room)
        self._receivers = [Receiver(room * (1 + before)) for _ in range(subscribers)]
        self._before = range(before)
        publisher = bus.publisher('message')
        self._kernel.add_task('publish', self._publishing(publisher),
                              priority=10, rate_hz=NS_PER_S / a['period_ns'])
        for i, receiver in enumerate(self._receivers):
            # The function needs the subscription, which needs the task: filled in afterwards.
            cell: list[Subscription] = []
            task = self._kernel.add_task(f'take{i}', self._taking(cell, receiver),
                                         priority=50 + i)
            cell.append(bus.subscribe('message', f'take{i}', task=task))

    def _publishing(self, publisher: Publisher) -> Callable[[], None]:
        sent, write, before = self._sent, NUMBER.pack_into, self._before
        publish = publisher.publish

        def job() -> None:
            for _ in before:
                write(publisher.msg.data, 0, _NO_NUMBER)
                publish()
            # Not kept: publishing a large message gives its buffer away.
            write(publisher.msg.data, 0, sent.count)
            sent.stamp()
            publish()

        return job

    @staticmethod
    def _taking(cell: list[Subscription], receiver: Receiver) -> Callable[[], None]:
        def job() -> None:
            subscription = cell[0]
            if subscription.take():
                receiver.note(subscription.msg.data)

        return job

    @property
    def counted(self) -> int:
        """Messages that were published so far, but those that do not count: see to_the_last."""
        return max(0, self._sent.count - self._warm - 1)

    def run(self) -> Samples:
        """Publish for the time that is wanted."""
        self._kernel.run(self._total_ns)
        return to_the_last(self._sent, self._receivers, self._warm)
