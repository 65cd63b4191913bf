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

"""What packets of a sensor network cost the host: a frame, and an hour at full line rate."""

from __future__ import annotations

from collections.abc import Callable
import itertools
import time
from typing import Any
from typing import Final

from benchmarks.sink.subjects import add_reader
from benchmarks.sink.subjects import mixture
import numpy as np

from rt_robot_os.base.reports import Reports
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.manager import SensorManager
from rt_robot_os.features.wsn.packets.decode import PacketDecoder
from rt_robot_os.features.wsn.packets.framing import FrameReader
from rt_robot_os.features.wsn.packets.framing import TINYOS_1
from rt_robot_os.features.wsn.sink.driver import Sink
from rt_robot_os.features.wsn.sink.duplicates import DuplicateFilter
from rt_robot_os.features.wsn.sink.flow_limit import FlowLimit
from rt_robot_os.features.wsn.sink.importance import Classifier
from rt_robot_os.features.wsn.sink.importance import DEFAULT_CLASSES
from rt_robot_os.features.wsn.sink.importance import DEFAULT_RULES
from rt_robot_os.features.wsn.sink.packet_header import header_reader
from rt_robot_os.features.wsn.sink.sorting import Sorting
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.topics import Bus

FRAMES_HZ: Final = 160
_BATCH: Final = 500
_PIECES: Final = 2


def frames(harness: Harness) -> Measurement:
    """Measure a frame by decoding it whole, and by what the sink does with it."""
    count = harness.arguments['count']
    lines = [content for content, _ in itertools.islice(mixture(), count)]
    harness.prepare(freeze=True)
    decoder = PacketDecoder(TINYOS_1.name)
    sorting = Sorting(
        header_reader(TINYOS_1.name, 'telos'), Classifier(DEFAULT_CLASSES, DEFAULT_RULES),
        DuplicateFilter(60 * NS_PER_S), FlowLimit(0.0), room=_BATCH, groups=(0x7D,),
        known_types=(17,), root=0)
    return Measurement({
        'decode_ns': _cost(lines, decoder.decode),
        'sort_ns': _cost(lines, lambda packet: sorting.add(packet, 1))})


def _cost(lines: list[bytes], use: Callable[[bytes], object]) -> Any:
    """Take the time of a frame, its framing included, in batches."""
    reader = FrameReader()
    found = []
    for begin in range(0, len(lines), _BATCH):
        part = lines[begin:begin + _BATCH]
        before_ns = time.perf_counter_ns()
        for line in part:
            for each in reader.feed(line):
                use(each.packet)
        found.append((time.perf_counter_ns() - before_ns) // len(part))
    return np.array(found)


class _Port:
    """A port that has what the test puts there."""

    def __init__(self, path: str, baud: int | None) -> None:
        self.bytes_read = self.dropped_write_bytes = 0

    def fileno(self) -> int:
        return -1

    def read(self) -> bytes:
        data, _WIRE[:] = b''.join(_WIRE), []
        self.bytes_read += len(data)
        return data

    def write(self, data: bytes) -> None:
        return

    def close(self) -> None:
        return


_WIRE: Final[list[bytes]] = []


def hour(harness: Harness) -> Measurement:
    """
    Run a sink and a task for each class, which decodes, on simulated time at full line rate.

    Each frame arrives in two pieces, and each piece is a job.
    """
    seconds: int = harness.arguments['seconds']
    kernel = Kernel(VirtualClock(start_ns=NS_PER_S))
    bus = Bus(kernel)
    sensors = SensorManager(kernel, bus, Reports())
    sink = Sink('sink', {**{each.name: each.default for each in Sink.fields()}, 'port': 'wire'})
    setattr(sink, 'make_port', _Port)
    sensors.add(sink, rate_hz=FRAMES_HZ * _PIECES, priority=70)
    read = [0]

    def note(name: str, number: int) -> None:
        read[0] += 1

    for name, priority in zip(DEFAULT_CLASSES, (60, 50, 20)):
        add_reader(kernel, bus, name, priority, note)
    pieces: list[bytes] = []

    def line() -> None:
        if pieces:
            _WIRE.append(pieces.pop())

    # Above the sink: on the virtual clock both are due at the same moments.
    kernel.add_task('line', line, priority=80, rate_hz=FRAMES_HZ * _PIECES)
    kernel.run(NS_PER_S // 10)
    source = mixture()
    harness.prepare(freeze=True)
    used_ns = 0
    for _ in range(seconds):
        lines = [content for content, _ in itertools.islice(source, FRAMES_HZ)]
        pieces += [piece for each in reversed(lines) for piece in (each[20:], each[:20])]
        before_ns = time.process_time_ns()
        kernel.run(NS_PER_S)
        used_ns += time.process_time_ns() - before_ns
    kernel.run(NS_PER_S)
    statistics = sink.statistics()
    sensors.close()
    return Measurement(figures={
        'frames': float(statistics.frames), 'lost': float(seconds * FRAMES_HZ - read[0]),
        'cpu_percent': 100.0 * used_ns / (seconds * NS_PER_S)})
