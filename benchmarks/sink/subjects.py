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

"""From the last byte of a sensor node's frame on the wire to the task of its importance."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Mapping
from contextlib import contextmanager
from contextlib import ExitStack
import math
import os
from pathlib import Path
import pty
import random
import select
import threading
import time
import tty
from typing import Any
from typing import Final

from benchmarks.shared import work_queues
from benchmarks.shared.sine import Moments
import numpy as np

from rt_robot_os.base.reports import Reports
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.manager import SensorManager
from rt_robot_os.features.wsn.packets.decode import PacketDecoder
from rt_robot_os.features.wsn.packets.framing import frame
from rt_robot_os.features.wsn.packets.framing import FrameReader
from rt_robot_os.features.wsn.packets.framing import TINYOS_1
from rt_robot_os.features.wsn.packets.multihop_lqi import MultihopMsg
from rt_robot_os.features.wsn.packets.paper import DataMsg
from rt_robot_os.features.wsn.packets.paper import Kind
from rt_robot_os.features.wsn.packets.surge import SurgeMsg
from rt_robot_os.features.wsn.packets.tos_msg import TelosMsg
from rt_robot_os.features.wsn.sink.driver import Sink
from rt_robot_os.kernel import Kernel
from rt_robot_os.linux import realtime as linux_realtime
from rt_robot_os.linux.timer import Sleeper
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.subjects.compute import compute
from rt_robot_os.topics import Bus

BAUD: Final = 57_600
CYCLE: Final = 180
_BYTE_NS: Final = 10 * NS_PER_S // BAUD
# A serial port at USB hands over what it has every millisecond, and the end of what came at once.
_PIECE: Final = 6
_MIDDLE, _AMPLITUDE = 2048, 512 * 4 - 1
_ALARM_NODE: Final = 7
_ALARM_EVERY: Final = 8
_UART: Final = 0x7E
_ROOM_A_SECOND: Final = 40
_TAIL_NS: Final = NS_PER_S // 5
_FIFO: Final = 70
_BUSY_NS, _BUSY_PERIOD_NS = 8 * NS_PER_MS, 97 * NS_PER_MS
_NODE: Final = f'{__name__}:node'
_LOADS: Final = 'benchmarks.shared.sine:loads'
_CHUNK: Final = 4096
ALARM, VITAL, REST = 'alarm', 'vital', 'rest'
Note = Callable[[str, int], None]
Worker = Callable[[Harness], Measurement]


# --- the network ------------------------------------------------------------------------------


def reading(origin: int, number: int, kind: Kind, value: int) -> bytes:
    """Make the frame of a reading of the paper's packet, as a base station writes it."""
    return _framed(origin, number, DataMsg(0, value, 3, number, kind, 3900).pack())


def surge(origin: int, number: int, value: int) -> bytes:
    """Make the frame of a reading of SurgeTelos; it is of the lowest class."""
    return _framed(origin, number, SurgeMsg(0, value, 3, number).pack())


def _framed(origin: int, number: int, body: bytes) -> bytes:
    header = MultihopMsg(0, origin, number & 0x7FFF, number & 0x7FFF, 2, body)
    return frame(TINYOS_1.plain, TelosMsg(_UART, DataMsg.AM_TYPE, header.pack()).pack())


def number_of(packet: Any) -> int:
    """Return which packet of its node it is: where Surge and the paper's packet have that."""
    return int.from_bytes(bytes(packet[26:30]), 'little')


def sine(number: int) -> bytes:
    """Make the frame of a sample of the paper's sine, as a vital sign."""
    value = _MIDDLE + round(_AMPLITUDE * math.sin(2 * math.pi * number / CYCLE))
    return reading(1, number, Kind.PULSE, value)


def node(arguments: Mapping[str, Any], ready: Callable[[], None]) -> None:
    """
    Be the sink mote: make a pty under ``link`` and send at the baud rate.

    Every ``interval_ns`` a sample of a sine; with 0 as many frames as the line carries, some of
    them alarms. The moment of the last byte goes to ``sent``: of each sample, of each alarm.
    """
    master, slave = pty.openpty()
    tty.setraw(slave)
    os.symlink(os.ttyname(slave), arguments['link'])
    sent = Moments(Path(arguments['sent']), arguments['count'])
    linux_realtime.set_fifo(_FIFO)  # where it may: it is the clock of the measurement
    sleeper = Sleeper()
    ready()
    begin_ns = time.monotonic_ns() + arguments['delay_ns']
    interval_ns = arguments['interval_ns']
    if interval_ns:
        for number in range(arguments['count']):
            send(master, sleeper, sine(number), begin_ns + number * interval_ns, 1, sent, number)
    else:
        _flood(master, sleeper, begin_ns, begin_ns + arguments['measure_ns'], sent)
    while True:
        time.sleep(1.0)


def _flood(master: int, sleeper: Sleeper, at_ns: int, end_ns: int, sent: Moments) -> None:
    for content, alarm in mixture():
        at_ns = send(master, sleeper, content, at_ns, _PIECE, sent, alarm)
        if at_ns > end_ns:
            return


def mixture() -> Iterator[tuple[bytes, int]]:
    """Yield frames of six nodes, and of one that gives alarms: which alarm it is, or -1."""
    chance = random.Random(1)
    alarm, number = 0, 0
    while True:
        if chance.randrange(_ALARM_EVERY):
            yield surge(1 + number % 6, number // 6, chance.randrange(4096)), -1
            number += 1
        else:
            yield reading(_ALARM_NODE, alarm, Kind.SMOKE, 1), alarm
            alarm += 1


def send(master: int, sleeper: Sleeper, content: bytes, at_ns: int, piece: int, sent: Moments,
         number: int) -> int:
    """Send a frame that begins at a moment, piece by piece; return when it is over."""
    for begin in range(0, len(content), piece):
        end = min(begin + piece, len(content))
        sleeper.sleep_until_ns(at_ns + end * _BYTE_NS)
        if end == len(content) and number >= 0:
            sent.note(number)
        os.write(master, content[begin:end])
    return at_ns + len(content) * _BYTE_NS


# --- what is measured --------------------------------------------------------------------------


class _Trial:
    """The node beside a measurement, and the notes of both."""

    def __init__(self, harness: Harness) -> None:
        a = self.arguments = harness.arguments
        self._harness = harness
        interval_ns = a['interval_ns']
        # Of a sine the samples of the cycle and one more, which ends it.
        self.count: int = CYCLE + 1 + a['more'] if interval_ns else (
            a['measure_ns'] * _ROOM_A_SECOND // NS_PER_S + 1)
        self.duration_ns: int = a['start_ns'] + _TAIL_NS + (
            round(self.count * interval_ns * a['patience']) if interval_ns else a['measure_ns'])
        self.sent, self.handled = (Moments(harness.folder / name, self.count, new=True)
                                   for name in ('sent', 'handled'))
        self.link = str(harness.folder / 'tty')
        self._workers_here = work_queues.mask() >> harness.own_cpu & 1

    @contextmanager
    def running(self) -> Iterator[None]:
        """Have the node there, which sends after a while; ``alone`` without work queues here."""
        harness, a = self._harness, self.arguments
        with ExitStack() as stack:
            if a['alone']:
                stack.enter_context(work_queues.kept_off(harness.own_cpu))
            if a['processes']:
                stack.enter_context(harness.helper(
                    _LOADS, {'count': a['processes']}, same_cpu=True))
            # The last thing before the run: it does not wait for the others.
            stack.enter_context(harness.helper(_NODE, {
                'link': self.link, 'sent': str(harness.folder / 'sent'), 'count': self.count,
                'interval_ns': a['interval_ns'], 'measure_ns': a['measure_ns'],
                'delay_ns': a['start_ns']}, same_cpu=False))
            yield

    def measured(self, **figures: float) -> Measurement:
        """
        Compare the notes.

        :raises RuntimeError: nothing arrived.
        """
        sent, handled = self.sent.taken(), self.handled.taken()
        if not handled.any():
            raise RuntimeError('no packet arrived at its task')
        if not self.arguments['interval_ns']:
            # What was sent before the port was open is not lost.
            first = int(np.argmax(handled > 0))
            sent, handled = sent[first:], handled[first:]
        known = (sent > 0) & (handled > 0)
        figures['arrived_percent'] = 100.0 * float(known.sum()) / float((sent > 0).sum())
        figures['workers_here'] = float(self._workers_here)
        samples = {'delay_ns': (handled - sent)[known]}
        if self.arguments['interval_ns']:
            figures['cycle_s'] = _cycle_s(handled)
        return Measurement(samples, figures)


def _cycle_s(handled: Any) -> float:
    """Return how long a cycle takes; of one that was not finished, how long it would have."""
    whole = handled[CYCLE:] - handled[:-CYCLE]
    whole = whole[(handled[CYCLE:] > 0) & (handled[:-CYCLE] > 0)]
    if len(whole):
        return float(np.median(whole)) / NS_PER_S
    known = np.flatnonzero(handled)
    steps = max(1, int(known[-1] - known[0]))
    return float(handled[known[-1]] - handled[known[0]]) * CYCLE / steps / NS_PER_S


def robot(link: str, note: Note) -> tuple[Kernel, SensorManager, Sink]:
    """Wire a sink and a task for each class, which decodes, as a robot does."""
    kernel = Kernel()
    bus = Bus(kernel)
    sensors = SensorManager(kernel, bus, Reports())
    values = {field.name: field.default for field in Sink.fields()}
    sink = Sink('sink', {**values, 'port': link, 'baud': BAUD})
    sensors.add(sink, rate_hz=20.0, priority=70, interrupt=True)
    for name, priority in ((ALARM, 60), (VITAL, 50), (REST, 20)):
        add_reader(kernel, bus, name, priority, note)
    sensors.connect()
    return kernel, sensors, sink


def add_reader(kernel: Kernel, bus: Bus, name: str, priority: int, note: Note) -> None:
    """Add the task of a class, which tells of each packet and decodes it."""
    decoder = PacketDecoder(TINYOS_1.name)

    def read() -> None:
        while subscription.take():
            packet = bytes(subscription.msg.data)
            note(name, number_of(packet))
            decoder.decode(packet)

    task = kernel.add_task(f'{name}s', read, priority=priority)
    subscription = bus.subscribe(f'wsn/packets/{name}', name, task=task)


def realtime(harness: Harness) -> Measurement:
    """Measure a robot of the core; ``busy`` tasks of the lowest priority compute beside it."""
    trial = _Trial(harness)
    wanted = VITAL if harness.arguments['interval_ns'] else ALARM

    def note(name: str, number: int) -> None:
        if name == wanted:
            trial.handled.note(number)

    with trial.running():
        kernel, sensors, sink = robot(trial.link, note)
        for i in range(harness.arguments['busy']):
            kernel.add_task(f'busy{i}', lambda: compute(_BUSY_NS), priority=1,
                            rate_hz=NS_PER_S / _BUSY_PERIOD_NS)
        harness.prepare(freeze=True)
        try:
            kernel.run(trial.duration_ns)
        finally:
            sensors.close()
        statistics = sink.statistics()
        return trial.measured(
            lost=float(statistics.lost_samples + statistics.rejected_frames),
            frames_hz=statistics.frames * NS_PER_S / trial.duration_ns)


def threads(harness: Harness) -> Measurement:
    """
    Measure a thread of an ordinary process that reads, decodes and handles; ``busy`` others.

    It waits for bytes; nothing can be shorter.
    """
    trial = _Trial(harness)
    with trial.running():
        fd = os.open(trial.link, os.O_RDWR | os.O_NOCTTY)
        harness.prepare()
        end_ns = time.monotonic_ns() + trial.duration_ns
        _start_busy(harness.arguments['busy'], end_ns)
        reader, decoder = FrameReader(), PacketDecoder(TINYOS_1.name)
        while (left_ns := end_ns - time.monotonic_ns()) > 0:
            if not select.select([fd], [], [], left_ns / NS_PER_S)[0]:
                break
            for each in reader.feed(os.read(fd, _CHUNK)):
                if decoder.decode(each.packet).origin == _ALARM_NODE:
                    trial.handled.note(number_of(each.packet))
    os.close(fd)
    return trial.measured()


def loop(harness: Harness) -> Measurement:
    """
    Measure a loop without real time that reads one value a period; ``busy`` threads beside it.

    It sleeps a period and takes a value, as the paper's reader outside of real time does.
    """
    trial = _Trial(harness)
    with trial.running():
        fd = os.open(trial.link, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        harness.prepare()
        end_ns = time.monotonic_ns() + trial.duration_ns
        _start_busy(harness.arguments['busy'], end_ns)
        reader = FrameReader()
        waiting: list[int] = []
        while time.monotonic_ns() < end_ns and not trial.handled.times[-1]:
            time.sleep(harness.arguments['interval_ns'] / NS_PER_S)
            try:
                waiting += [number_of(each.packet) for each in reader.feed(os.read(fd, _CHUNK))]
            except BlockingIOError:
                pass  # nothing came in the meantime
            if waiting:
                trial.handled.note(waiting.pop(0))
    os.close(fd)
    return trial.measured()


def _start_busy(count: int, end_ns: int) -> None:
    def busy() -> None:
        next_ns = time.monotonic_ns()
        while next_ns < end_ns:
            compute(_BUSY_NS)
            next_ns += _BUSY_PERIOD_NS
            time.sleep(max(0, next_ns - time.monotonic_ns()) / NS_PER_S)

    for _ in range(count):
        threading.Thread(target=busy, daemon=True).start()
