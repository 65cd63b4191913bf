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

"""Messages from a Python thread to others that wait at queues."""

from __future__ import annotations

from queue import SimpleQueue
import threading

from benchmarks.delay.subjects import due
from benchmarks.delay.subjects import key
from benchmarks.delay.subjects import NUMBER
from benchmarks.delay.subjects import Receiver
from benchmarks.delay.subjects import to_the_last
from rt_robot_os.tools.bench.case import Samples
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.stamps import Stamps
from rt_robot_os.tools.bench.subjects.threads import set_priority
from rt_robot_os.tools.bench.subjects.threads import Threads


def delay(harness: Harness) -> Measurement:
    """Send bytes from a thread to others that wait at a ``queue.SimpleQueue`` each."""
    a = harness.arguments
    harness.prepare()
    return Measurement({key(size, subscribers): _delay(harness, size, subscribers)
                        for size, subscribers in a['variants']}, {'due': due(a)})


def _delay(harness: Harness, size: int, subscribers: int) -> Samples:
    a = harness.arguments
    total_ns = a['warmup_ns'] + a['measure_ns']
    room = 2 * total_ns // a['period_ns'] + 100
    sent, receivers = Stamps(room), [Receiver(room) for _ in range(subscribers)]
    queues: list[SimpleQueue[bytes]] = [SimpleQueue() for _ in receivers]
    message = bytearray(size)

    def publish() -> None:
        NUMBER.pack_into(message, 0, sent.count)
        sent.stamp()
        payload = bytes(message)
        for one in queues:
            one.put(payload)

    def receive(queue: SimpleQueue[bytes], receiver: Receiver) -> None:
        if harness.priority:
            set_priority(harness.priority)
        while payload := queue.get():
            receiver.note(payload)

    waiting = [threading.Thread(target=receive, args=pair, daemon=True)
               for pair in zip(queues, receivers)]
    for thread in waiting:
        thread.start()
    Threads([(a['period_ns'], harness.priority // 2, publish)], total_ns).run()
    for queue, thread in zip(queues, waiting):
        queue.put(b'')
        thread.join()
    return to_the_last(sent, receivers, a['warmup_ns'] // a['period_ns'])
