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


"""
The taps: bytes read by devices and times of jobs, as topics that a recorder mirrors for replay.

They are turned on by the setting ``core.record_bytes`` or by a client. Then each round of a serial
device that read nothing appends a number to a list, and each other round publishes its bytes. Each
job of a device or a module, and each publication, appends an existing tuple. ``core/watch``
publishes these in the topic ``core/schedule`` ten times a second, at the lowest priority.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any
from typing import Final

from rt_robot_os.base.errors import TopicError
from rt_robot_os.core.part import Host
from rt_robot_os.core.tap_format import A_JOB
from rt_robot_os.core.tap_format import array_cdr
from rt_robot_os.core.tap_format import device_front
from rt_robot_os.core.tap_format import device_topic
from rt_robot_os.core.tap_format import MESSAGE
from rt_robot_os.core.tap_format import NO_TASK
from rt_robot_os.core.tap_format import RECORD
from rt_robot_os.core.tap_format import schedule_cdr
from rt_robot_os.core.tap_format import SCHEDULE_FRONT_BYTES
from rt_robot_os.core.tap_format import SCHEDULE_TOPIC
from rt_robot_os.core.tap_format import TapKind
from rt_robot_os.core.tap_format import WENT_ON
from rt_robot_os.devices.manager import SensorManager
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import Task
from rt_robot_os.kernel.black_box import JOB
from rt_robot_os.kernel.black_box import PUBLISH
from rt_robot_os.link.client import topic_infos
from rt_robot_os.link.requests import Arguments
from rt_robot_os.link.session import ClientSession
from rt_robot_os.topics import Bus
from rt_robot_os.topics import Publisher

CHUNK_BYTES: Final = 1024
IDLE_MOST: Final = 64
_FRONT_BYTES: Final = 4 + 8 * (IDLE_MOST + 1)
_DEVICE_DEPTH: Final = 512
RECORDS_A_MESSAGE: Final = 1024
_SCHEDULE_DEPTH: Final = 64
_PENDING_MOST: Final = 65_536
_DURATION_MOST: Final = (1 << 32) - 1
# In addition to the kinds of records of the kernel.
_WENT_ON: Final = -1


class DeviceTap:
    """
    The tap of one device; called in its task.

    :ivar command: whether the current round wrote before it read.
    :ivar dropped: messages that the topic refused.
    """

    __slots__ = ('command', 'dropped', '_publisher', '_idle')

    def __init__(self, publisher: Publisher) -> None:
        self.command = False
        self.dropped = 0
        self._publisher = publisher
        self._idle: list[int] = []

    def read(self, now_ns: int, data: bytes) -> None:
        """Record the bytes that a round read, possibly none; safe in the real-time loop."""
        if not data and len(self._idle) < IDLE_MOST:
            self._idle.append(now_ns << 1 | self.command)
            return
        self._publish(TapKind.READ, now_ns, data[:CHUNK_BYTES])
        for start in range(CHUNK_BYTES, len(data), CHUNK_BYTES):
            self._publish(TapKind.MORE, now_ns, data[start:start + CHUNK_BYTES])

    def opened(self, now_ns: int) -> None:
        """Record that its port was opened."""
        self._publish(TapKind.OPENED, now_ns, b'')

    def failed(self, now_ns: int) -> None:
        """Record that its port failed in this round."""
        self._publish(TapKind.FAILED, now_ns, b'')

    def flush(self) -> None:
        """Publish the pending rounds that read nothing; called by the lowest task."""
        idle, self._idle = self._idle, []
        if idle:
            moment = idle.pop()
            self._send(device_front(TapKind.READ, moment, idle), b'', moment >> 1)

    def _publish(self, kind: TapKind, now_ns: int, data: bytes) -> None:
        front = device_front(kind, now_ns << 1 | self.command, self._idle)
        self._idle.clear()
        self._send(front, data, now_ns)

    def _send(self, front: bytes, data: bytes, now_ns: int) -> None:
        """Publish; a failing tap must not fail the device's round."""
        try:
            self._publisher.publish_cdr(array_cdr(front, data), now_ns)
        except TopicError:
            self.dropped += 1


class ScheduleTap:
    """
    Collect the kernel's records of jobs and publications, and publish them in batches.

    :ivar dropped: records that were not published: the buffer was full, or their message was
        refused.
    """

    def __init__(self, kernel: Kernel, publisher: Publisher, tasks: dict[Task | None, int],
                 topics: dict[str, int]) -> None:
        self.dropped = 0
        self._publisher = publisher
        self._tasks = tasks
        self._topics = topics
        self._pending: deque[tuple[Any, ...]] = deque()
        kernel.add_observer(self._record)

    def _record(self, record: tuple[Any, ...]) -> None:
        """Receive a record of the kernel, in its critical section."""
        if record[0] <= PUBLISH and (
                record[1] in self._tasks if record[0] == JOB else record[3] in self._topics):
            if len(self._pending) < _PENDING_MOST:
                self._pending.append(record)
            else:
                self.dropped += 1

    def went_on(self, task: Task, now_ns: int) -> None:
        """Record that a coroutine continued; called in its job."""
        if len(self._pending) < _PENDING_MOST:
            self._pending.append((_WENT_ON, task, now_ns))
        else:
            self.dropped += 1

    def drain(self, now_ns: int) -> None:
        """
        Publish the collected records; called by the lowest task, when no other job runs.

        Each call publishes a message: its stamp is the time up to which the schedule is complete.
        If a message is refused, only its own records are lost.
        """
        pending, self._pending = self._pending, deque()
        while True:
            # One by one: freeing thousands of records in one call would delay all tasks.
            count = min(len(pending), RECORDS_A_MESSAGE)
            data = b''.join([self._pack(pending.popleft()) for _ in range(count)])
            try:
                self._publisher.publish_cdr(
                    schedule_cdr(data, not pending, self.dropped), now_ns)
            except TopicError:
                self.dropped += count
            if not pending:
                return

    def _pack(self, record: tuple[Any, ...]) -> bytes:
        if record[0] == JOB:
            _, task, _, start_ns, end_ns, _ = record
            return RECORD.pack(self._tasks[task], A_JOB, min(end_ns - start_ns, _DURATION_MOST),
                               start_ns)
        if record[0] == _WENT_ON:
            _, task, at_ns = record
            return RECORD.pack(self._tasks[task], WENT_ON, 0, at_ns)
        _, task, at_ns, topic, number = record
        return RECORD.pack(self._tasks.get(task, NO_TASK), self._topics[topic],
                           number & 0xFFFFFFFF, at_ns)


class Taps:
    """
    All taps of a core.

    :param modules: whose jobs are recorded, in addition to those of devices.
    :param warn: reports, once, that records were lost.
    :ivar topics: their topics; empty while they are off.
    """

    def __init__(self, kernel: Kernel, bus: Bus, sensors: SensorManager,
                 modules: Sequence[str], warn: Callable[[str], object]) -> None:
        self.topics: tuple[str, ...] = ()
        self._kernel = kernel
        self._bus = bus
        self._sensors = sensors
        self._modules = modules
        self._warn = warn
        self._warned = False
        self._schedule: ScheduleTap | None = None
        self._devices: list[DeviceTap] = []

    def attach(self, host: Host) -> None:
        """Turn them on at the request of a recorder, and publish their records."""
        host.requests.add('tap', self._tap)
        host.watch.add(self.drain)
        host.statistics.add_facts(lambda: {'tap_dropped': self.dropped})

    def _tap(self, session: ClientSession, arguments: Arguments) -> Arguments:
        self.turn_on()
        return {'taps': list(self.topics),
                'topics': [asdict(each) for each in topic_infos(self._bus)]}

    def turn_on(self) -> None:
        """
        Declare the topics and start; not for the real-time loop. A second call does nothing.

        :raises TopicError: one of the names is in use.
        """
        if self._schedule is not None:
            return
        noted = {managed.device.name for managed in self._sensors.devices}
        noted |= {f'{name}/arrival' for name in noted} | set(self._modules)
        tasks: dict[Task | None, int] = {
            task: number for number, task in enumerate(self._kernel.tasks) if task.name in noted}
        topics = {topic.name: number for number, topic in enumerate(self._bus.topics)}
        names = []
        for managed in self._sensors.devices:
            if managed.device.TAPPED:
                names.append(device_topic(managed.device.name))
                self._bus.declare(names[-1], MESSAGE, tail=_FRONT_BYTES + CHUNK_BYTES,
                                  depth=_DEVICE_DEPTH)
                managed.device.tap = tap = DeviceTap(self._bus.publisher(names[-1]))
                self._devices.append(tap)
        self._bus.declare(
            SCHEDULE_TOPIC, MESSAGE, depth=_SCHEDULE_DEPTH,
            tail=SCHEDULE_FRONT_BYTES + RECORDS_A_MESSAGE * RECORD.size)
        self._schedule = ScheduleTap(
            self._kernel, self._bus.publisher(SCHEDULE_TOPIC), tasks, topics)
        for task in tasks:
            if task is not None and task.coroutine is not None:
                task.coroutine.on_resume = self._noting(self._schedule, task)
        self.topics = (SCHEDULE_TOPIC, *names)

    def _noting(self, schedule: ScheduleTap, task: Task) -> Callable[[], None]:
        return lambda: schedule.went_on(task, self._kernel.now_ns())

    @property
    def dropped(self) -> int:
        """Return the number of records that were not published."""
        return (self._schedule.dropped if self._schedule is not None else 0) + sum(
            tap.dropped for tap in self._devices)

    def drain(self) -> None:
        """Publish the pending records, if the taps are on."""
        if self._schedule is not None:
            now_ns = self._kernel.now_ns()
            for tap in self._devices:
                tap.flush()
            self._schedule.drain(now_ns)
        if self.dropped and not self._warned:
            self._warned = True
            self._warn(f'{self.dropped} records that a replay needs were dropped: core/watch, '
                       'the lowest task, does not run often enough to publish them; a replay of '
                       'this recording may differ (tap_dropped counts them)')
