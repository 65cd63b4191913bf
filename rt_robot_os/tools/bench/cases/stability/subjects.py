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

"""Acquisition, attitude and a receiver for a long time, a row of figures at intervals."""

from __future__ import annotations

from collections.abc import Mapping
import os
from pathlib import Path
import resource
import time
from typing import Any

import numpy as np

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.kernel import Kernel
from rt_robot_os.tools.bench.case import Samples
from rt_robot_os.tools.bench.cases.stability.motion import Filter
from rt_robot_os.tools.bench.cases.stability.motion import ImuModel
from rt_robot_os.tools.bench.cases.stability.motion import truth
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.stamps import Stamps
from rt_robot_os.tools.bench.subjects.operation_cost import IMU
from rt_robot_os.tools.bench.subjects.operation_cost import IMU_SHAPE
from rt_robot_os.tools.bench.subjects.plain_loop import LoopGroup
from rt_robot_os.tools.bench.subjects.plain_loop import plain_loop
from rt_robot_os.topics import Bus

ACQUIRE_HZ, ATTITUDE_HZ, RECEIVE_HZ = 1000, 400, 200
ATTITUDE = 'geometry_msgs/msg/Vector3'
COLUMNS = (
    'time_s', 'acquire_hz', 'attitude_hz', 'receive_hz', 'delay_mean_us', 'delay_max_us',
    'attitude_error_deg', 'missed', 'resident_kb', 'faults_minor', 'faults_major',
    'switches_voluntary', 'switches_forced')
_DEGREES = 57.29577951308232
_PAGE_KB = os.sysconf('SC_PAGE_SIZE') // 1024


class Counter:
    """How often something was called since the last row, and its actual frequency."""

    __slots__ = ('count', 'last_ns', 'from_ns')

    def __init__(self) -> None:
        self.count = self.last_ns = self.from_ns = 0

    def call(self) -> int:
        """Count a call; give the moment."""
        now_ns = time.monotonic_ns()
        self.count += 1
        self.last_ns = now_ns
        return now_ns

    def take_hz(self) -> float:
        """Return the frequency since the last row, from call to call, and restart."""
        count, span_ns = self.count, self.last_ns - self.from_ns
        if not self.from_ns:
            count, span_ns = 0, 0
        self.count, self.from_ns = 0, self.last_ns
        return count * NS_PER_S / span_ns if span_ns > 0 else 0.0


class Notes:
    """
    What the three modules note, and the rows that are made of it.

    :param csv: also written there, each row immediately, after the existing ones; empty for none.
    :param room: rows.
    :param from_s: how long was measured before this process: where the time goes on.
    """

    def __init__(self, csv: str, room: int, from_s: float = 0.0) -> None:
        self.acquire, self.attitude, self.receive = Counter(), Counter(), Counter()
        self.begin_ns = 0
        self._csv, self._from_s = csv, from_s
        self.sent_ns = 0
        self._delays = self._delay_sum_ns = self._delay_max_ns = 0
        self._error = 0.0
        self._missed = 0
        self._rows = np.zeros((room, len(COLUMNS)))
        self._used = 0
        self._usage = resource.getrusage(resource.RUSAGE_SELF)
        self._statm = os.open('/proc/self/statm', os.O_RDONLY)
        self._fd = -1
        if csv:
            new = not Path(csv).exists()
            if not new:
                _cut(Path(csv))
            self._fd = os.open(csv, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
            if new:
                os.write(self._fd, (','.join(COLUMNS) + '\n').encode())

    def received(self, roll: float, pitch: float, t: float) -> None:
        """Note that the receiver has an attitude, which was sent at ``sent_ns``."""
        delay_ns = self.receive.call() - self.sent_ns
        self._delays += 1
        self._delay_sum_ns += delay_ns
        if delay_ns > self._delay_max_ns:
            self._delay_max_ns = delay_ns
        true_roll, true_pitch = truth(t)
        error = max(abs(roll - true_roll), abs(pitch - true_pitch))
        if error > self._error:
            self._error = error

    def begin(self) -> None:
        """Discard what was noted in the warm-up."""
        self.begin_ns = time.monotonic_ns()
        for counter in (self.acquire, self.attitude, self.receive):
            counter.take_hz()
        self._reset()

    def _reset(self) -> None:
        self._delays = self._delay_sum_ns = self._delay_max_ns = 0
        self._error = 0.0
        self._usage = resource.getrusage(resource.RUSAGE_SELF)

    def row(self, missed: int) -> None:
        """
        Make a row.

        :param missed: releases that were skipped since the start.
        """
        usage, before = resource.getrusage(resource.RUSAGE_SELF), self._usage
        row = (
            self._from_s + (time.monotonic_ns() - self.begin_ns) / NS_PER_S,
            self.acquire.take_hz(), self.attitude.take_hz(), self.receive.take_hz(),
            self._delay_sum_ns / max(1, self._delays) / 1000, self._delay_max_ns / 1000,
            self._error * _DEGREES, missed - self._missed,
            int(os.pread(self._statm, 128, 0).split()[1]) * _PAGE_KB,
            usage.ru_minflt - before.ru_minflt, usage.ru_majflt - before.ru_majflt,
            usage.ru_nvcsw - before.ru_nvcsw, usage.ru_nivcsw - before.ru_nivcsw)
        self._missed = missed
        self._reset()
        if self._used < len(self._rows):
            self._rows[self._used] = row
            self._used += 1
        if self._fd >= 0:
            os.write(self._fd, (','.join(f'{value:.3f}' for value in row) + '\n').encode())

    def measured(self, **figures: float) -> Measurement:
        """Return the rows, a column a sample, with those of an interrupted run before it."""
        if self._from_s:
            return Measurement(read_csv(Path(self._csv)), figures)
        rows: Any = self._rows[:self._used]
        if not self._used:
            raise RuntimeError('too short for a row')
        return Measurement({name: rows[:, i] for i, name in enumerate(COLUMNS)}, figures)


def read_csv(path: Path) -> Mapping[str, Samples]:
    """
    Read the rows that are in a file so far.

    :raises OSError: there is none.
    :raises ValueError: it is something else.
    """
    lines = path.read_text().splitlines()
    if not lines or tuple(lines[0].split(',')) != COLUMNS:
        raise ValueError(f'{path}: not written by this version of bench')
    # The last one may be incomplete when it is written at this moment.
    rows: Any = np.array([[float(word) for word in line.split(',')] for line in lines[1:]
                          if line.count(',') == len(COLUMNS) - 1])
    rows = rows.reshape(-1, len(COLUMNS))
    return {name: rows[:, i] for i, name in enumerate(COLUMNS)}


def measured_s(path: Path) -> float:
    """Return how much the rows of a file cover so far; 0 when there are none."""
    try:
        moments = read_csv(path)['time_s']
    except (OSError, ValueError):
        return 0.0
    return float(moments[-1]) if len(moments) else 0.0


def _cut(path: Path) -> None:
    """Remove a row at the end that was not finished, so that others can follow."""
    os.truncate(path, path.read_bytes().rfind(b'\n') + 1)


def kernel(harness: Harness) -> Measurement:
    """Run the three modules as tasks with topics between them."""
    a = harness.arguments
    if a['measure_ns'] <= 0:  # it was complete before the interruption
        return Measurement(read_csv(Path(a['csv'])))
    total_ns = a['warmup_ns'] + a['measure_ns']
    notes = Notes(a['csv'], a['measure_ns'] // a['row_ns'] + 2, a['from_s'])
    tested = Kernel()
    tasks = _modules(tested, notes)

    def row() -> None:
        if not notes.begin_ns:
            notes.begin()
        else:
            notes.row(sum(task.missed for task in tasks))

    tested.add_task('row', row, priority=1, rate_hz=NS_PER_S / a['row_ns'],
                    phase_ns=a['warmup_ns'])
    harness.prepare(freeze=True)
    # A little longer, for the last row.
    tested.run(total_ns + a['row_ns'] // 20)
    return notes.measured()


def _modules(tested: Kernel, notes: Notes) -> list[Any]:
    bus = Bus(tested)
    layout = bus.declare('imu', IMU, IMU_SHAPE).layout
    bus.declare('attitude', ATTITUDE)
    imu, attitude = bus.publisher('imu'), bus.publisher('attitude')
    read = bus.subscribe('imu', 'attitude')
    packer, buffer = layout.packer('angular_velocity', 'linear_acceleration'), layout.new_buffer()
    sensor, solver = ImuModel(), Filter()
    turn = [0]
    taken: list[Any] = []

    def acquire() -> None:
        now_ns = notes.acquire.call()
        packer.pack(buffer, *sensor.read(now_ns / NS_PER_S))
        imu.publish_cdr(buffer, now_ns)

    def solve() -> None:
        notes.attitude.call()
        while read.take():
            solver.update(read.stamp_ns / NS_PER_S, packer.unpack(read.buffer))
        turn[0] ^= 1
        if turn[0]:
            attitude.msg.x, attitude.msg.y, attitude.msg.z = (
                solver.roll, solver.pitch, solver.time)
            notes.sent_ns = time.monotonic_ns()
            attitude.publish()

    def receive() -> None:
        if taken[0].take():
            message = taken[0].msg
            notes.received(message.x, message.y, message.z)

    tasks = [tested.add_task('acquire', acquire, priority=50, rate_hz=ACQUIRE_HZ),
             tested.add_task('attitude', solve, priority=30, rate_hz=ATTITUDE_HZ),
             tested.add_task('receive', receive, priority=40)]
    taken.append(bus.subscribe('attitude', 'receive', task=tasks[-1]))
    return tasks


def rows(harness: Harness) -> Measurement:
    """
    Run a loop of 1 kHz for long, a row of figures every ``row_ns``.

    :return: samples ``time_s``, ``acquire_hz`` and ``missed``, one a row.
    """
    a = harness.arguments
    harness.prepare(freeze=True)
    found: dict[str, list[float]] = {'time_s': [], 'acquire_hz': [], 'missed': []}
    begin_ns = time.monotonic_ns() + NS_PER_MS
    for number in range(max(1, a['measure_ns'] // a['row_ns'])):
        stamps = Stamps(a['row_ns'] // NS_PER_MS + 100)
        group = LoopGroup(NS_PER_MS, [stamps.stamp])
        from_ns = begin_ns + number * a['row_ns']
        plain_loop([group], from_ns, from_ns + a['row_ns'])
        starts: Samples = stamps.taken()
        found['time_s'].append((number + 1) * a['row_ns'] / NS_PER_S)
        found['acquire_hz'].append(0.0 if len(starts) < 2 else (
            (len(starts) - 1) * NS_PER_S / (starts[-1] - starts[0])))
        found['missed'].append(group.missed)
    return Measurement({name: np.array(some) for name, some in found.items()})
