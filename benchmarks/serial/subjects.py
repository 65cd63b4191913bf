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

"""From the wire to a consumer without real time: by the core, or by a plain reader thread."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Mapping
from contextlib import contextmanager
from contextlib import ExitStack
import os
from pathlib import Path
from queue import Empty
from queue import SimpleQueue
import struct
import threading
import time
from typing import Any

from benchmarks.shared import work_queues
from benchmarks.shared.sine import Decoder
from benchmarks.shared.sine import Moments
from benchmarks.shared.sine import WIRE_NS
import numpy as np

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.core.app import Core
from rt_robot_os.linux.paths import socket_path
from rt_robot_os.tools.bench.cases.mirror.subjects import settings
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.subjects.compute import compute
from rt_robot_os.tools.bench.subjects.link_client import connect
from rt_robot_os.tools.bench.subjects.link_client import stay

TOPIC = 'bench/sine'
MESSAGE = 'geometry_msgs/msg/Point'
_NUMBER = struct.Struct('<d')
_SINE = 'benchmarks.shared.sine'
_CONSUMER = f'{__name__}:consumer'
_START_NS = NS_PER_S
_TAIL_NS = NS_PER_S // 5
# No multiple of the time between two frames: these meet every phase of the load.
_BUSY_NS, _BUSY_PERIOD_NS = 8 * NS_PER_MS, 97 * NS_PER_MS
_CHUNK = 4096


class _Setup:
    """The node that sends, the notes of all, and how long it takes."""

    def __init__(self, harness: Harness) -> None:
        a = harness.arguments
        self.count: int = a['measure_ns'] // a['interval_ns'] + 1
        self.duration_ns = _START_NS + self.count * a['interval_ns'] + WIRE_NS + _TAIL_NS
        self.sent, self.decoded, self.consumed = (
            Moments(harness.folder / name, self.count, new=True)
            for name in ('sent', 'decoded', 'consumed'))
        self.fd = -1
        self._workers_here = work_queues.mask() >> harness.own_cpu & 1

    def open_wire(self, harness: Harness, stack: ExitStack) -> int:
        """Start the node, which sends after a second: the last thing before the run."""
        link = harness.folder / 'tty'
        stack.enter_context(harness.helper(f'{_SINE}:produce', {
            'link': str(link), 'sent': str(harness.folder / 'sent'), 'count': self.count,
            'interval_ns': harness.arguments['interval_ns'], 'delay_ns': _START_NS},
            same_cpu=False))
        self.fd = os.open(link, os.O_RDWR | os.O_NOCTTY)
        stack.callback(os.close, self.fd)
        return self.fd

    def measured(self) -> Measurement:
        """
        Compare the notes.

        :raises RuntimeError: nothing arrived.
        """
        sent, decoded, consumed = (notes.taken() for notes in (
            self.sent, self.decoded, self.consumed))
        if not consumed.any():
            raise RuntimeError('no frame arrived at the consumer')
        # What was sent before the consumer was connected is not its loss.
        first = int(np.argmax(consumed > 0))
        sent, decoded, consumed = sent[first:], decoded[first:], consumed[first:]
        known = (sent > 0) & (consumed > 0) & (decoded > 0)
        return Measurement({'decoded_ns': (decoded - sent)[known],
                            'consumed_ns': (consumed - sent)[known]},
                           {'arrived_percent': 100.0 * float(known.mean()),
                            'workers_here': float(self._workers_here)})


@contextmanager
def _loaded(harness: Harness) -> Iterator[None]:
    """Let ``processes`` compute on the CPU of the measured ones, ``alone`` without work queues."""
    count = harness.arguments['processes']
    with ExitStack() as stack:
        if harness.arguments['alone']:
            stack.enter_context(work_queues.kept_off(harness.own_cpu))
        if count:
            stack.enter_context(harness.helper(f'{_SINE}:loads', {'count': count}, same_cpu=True))
        yield


def realtime(harness: Harness) -> Measurement:
    """
    Read by a task of a core that the port interrupts; a client of the link is the consumer.

    ``inside`` tasks of the core compute 8 ms of every 97 ms, at the lowest priority.
    """
    a = harness.arguments
    path = socket_path('bench')
    tested = Core(settings({TOPIC: (MESSAGE, {})}), path)
    setup = _Setup(harness)
    with ExitStack() as stack:
        publisher, decoder = tested.bus.publisher(TOPIC), Decoder()

        def read() -> None:
            while data := _read(setup.fd):
                for number, value in decoder.feed(data):
                    setup.decoded.note(number)
                    publisher.msg.x, publisher.msg.y = value, number
                    publisher.publish()

        task = tested.kernel.add_task('sink', read, priority=80)
        for i in range(a['inside']):
            tested.kernel.add_task(f'busy{i}', lambda: compute(_BUSY_NS), priority=1,
                                   rate_hz=NS_PER_S / _BUSY_PERIOD_NS)
        # What computes inside leaves the CPU of the core to nobody else.
        stack.enter_context(harness.helper(
            _CONSUMER, {'path': str(path), 'room': setup.count,
                        'consumed': str(harness.folder / 'consumed')},
            same_cpu=not a['inside']))
        stack.enter_context(_loaded(harness))
        tested.kernel.add_interrupt(setup.open_wire(harness, stack), task)
        harness.prepare(freeze=True)
        tested.run(setup.duration_ns)
        return setup.measured()


def _read(fd: int) -> bytes:
    try:
        return os.read(fd, _CHUNK)
    except BlockingIOError:
        return b''


def consumer(arguments: Mapping[str, Any], ready: Callable[[], None]) -> None:
    """Be the consumer: note when each sample is there."""
    path = Path(arguments['path'])
    consumed = Moments(Path(arguments['consumed']), arguments['room'])
    ready()
    link = connect(path)

    def note(head: object, cdr: memoryview) -> None:
        consumed.note(int(_NUMBER.unpack_from(cdr, 12)[0]))  # y of a Point

    link.on_data = note
    link.mirror(TOPIC)
    stay(link)


def plain(harness: Harness) -> Measurement:
    """
    Read by a thread of an ordinary process that hands over to the main thread by a queue.

    ``inside`` threads of the same process compute 8 ms of every 97 ms.
    """
    setup = _Setup(harness)
    with ExitStack() as stack:
        stack.enter_context(_loaded(harness))
        setup.open_wire(harness, stack)
        harness.prepare()
        handed: SimpleQueue[tuple[int, float]] = SimpleQueue()
        threading.Thread(target=_reader, args=(setup, handed), daemon=True).start()
        for _ in range(harness.arguments['inside']):
            threading.Thread(target=_busy, daemon=True).start()
        end_ns = time.monotonic_ns() + setup.duration_ns
        while (left_ns := end_ns - time.monotonic_ns()) > 0:
            try:
                number, _ = handed.get(timeout=left_ns / NS_PER_S)
            except Empty:  # the time is over
                break
            setup.consumed.note(number)
        return setup.measured()


def _reader(setup: _Setup, handed: SimpleQueue[tuple[int, float]]) -> None:
    decoder = Decoder()
    while True:
        for number, value in decoder.feed(os.read(setup.fd, _CHUNK)):
            setup.decoded.note(number)
            handed.put((number, value))


def _busy() -> None:
    next_ns = time.monotonic_ns()
    while True:
        compute(_BUSY_NS)
        next_ns += _BUSY_PERIOD_NS
        time.sleep(max(0, next_ns - time.monotonic_ns()) / NS_PER_S)
