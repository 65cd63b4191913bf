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
Replay a recording through the same drivers and modules, under the virtual clock.

A run is determined by its inputs and its timing: when each round of a device read, when each job
of a module started, when a job published. The taps of the core have recorded these times
(:mod:`rt_robot_os.core.tap`). Here each job is released at its recorded start, and a publication
first advances the virtual clock to its recorded time, with all preemptions in between. Everything
else follows, because the kernel is the same.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from typing import Final

from rt_robot_os.base.errors import RecordingError
from rt_robot_os.core.app import Core
from rt_robot_os.core.tap_format import device_topic
from rt_robot_os.core.tap_format import NO_TASK
from rt_robot_os.core.tap_format import SCHEDULE_TOPIC
from rt_robot_os.core.tap_format import ScheduleRecord
from rt_robot_os.core.tap_format import TapKind
from rt_robot_os.core.tap_format import WENT_ON
from rt_robot_os.devices.managed import ManagedDevice
from rt_robot_os.devices.motor_board import MotorBoard
from rt_robot_os.devices.serial.device import SerialDevice
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import Task
from rt_robot_os.kernel.black_box import PUBLISH
from rt_robot_os.kernel.spec import RATE_MINIMUM_HZ
from rt_robot_os.recording.compare import Comparison
from rt_robot_os.recording.compare import Produced
from rt_robot_os.recording.compare import without_stamp
from rt_robot_os.recording.reading import Recorded
from rt_robot_os.recording.reading import Recording
from rt_robot_os.recording.recorded_port import RecordedPort
from rt_robot_os.recording.replay_time import ReplayBus
from rt_robot_os.recording.replay_time import ReplayClock
from rt_robot_os.recording.replay_time import Schedule
from rt_robot_os.recording.timeline import Round
from rt_robot_os.recording.timeline import Slice
from rt_robot_os.recording.timeline import SLICE_NS_MOST
from rt_robot_os.recording.timeline import Timeline
from rt_robot_os.settings import RobotSettings
from rt_robot_os.settings import WatchdogSettings
from rt_robot_os.topics import Bus
from rt_robot_os.topics import Publisher

_FEEDER: Final = 'replay/feeder'
_ABOVE_ALL: Final = 99
_NOTES_MOST: Final = 20

Event = tuple[int, int, Callable[[], None]]


class Replay:
    """
    One replay.

    :param settings: of the core.
    :param from_bytes: replay the drivers; False starts with their publications.
    :param boards_too: also replay the drivers of motor boards, whose answers fit only the
        recorded commands.
    :raises RecordingError: it cannot be replayed.
    :raises RtRobotError: the settings do not fit together.
    :ivar core: the replayed core.
    :ivar comparison: with the recording.
    :ivar on_produced: called with each publication of a replayed task, in order.
    :ivar notes: deviations from the real run.
    """

    def __init__(self, recording: Recording, settings: RobotSettings, *,
                 from_bytes: bool = True, boards_too: bool = False) -> None:
        self.notes: list[str] = []
        self.timeline = Timeline(recording)
        self._recording = recording
        self._facts = recording.facts
        self.on_produced: Callable[[Produced], None] | None = None
        self._slices = self.timeline.slices()
        first = self._first_slice()
        start_ns = self._facts.start_ns if self.timeline.cold else min(
            [each.at_ns for each in (*first.jobs[:1], *first.publications[:1])]
            + [each.at_ns for each in first.rounds[:1]]) - 1
        if not 0 <= first.until_ns - start_ns <= SLICE_NS_MOST:
            raise RecordingError(f'the core started at {start_ns} ns, but its schedule at '
                                 f'{first.until_ns} ns: the recording is damaged')
        self.start_ns = self.end_ns = start_ns
        clock = ReplayClock(start_ns)
        self._schedule = Schedule(clock)
        self.core = Core(
            replace(settings, watchdog=WatchdogSettings(),
                    core=replace(settings.core, record_bytes=False, dispatcher='preemptive',
                                 spin_us=0.0)),
            Path('replay'), clock=clock,
            make_bus=self._make_bus)
        self._kernel = self.core.kernel
        self._devices = self._find_devices(from_bytes, boards_too)
        self._ports: dict[str, RecordedPort] = {}
        self._replayed = {name: name for name in self._devices}
        self._replayed |= {f'{name}/arrival': name for name in self._devices}
        self._replayed |= {module.name: module.name for module in self.core.modules}
        self._released = self._on_schedule()
        # Topics that replayed tasks publish; clients may publish on any of them as well.
        self._made = {p.topic for m in self._devices.values() for p in m.device.publications()}
        self._made |= {name for name, task in self._bus.made if task in self._replayed}
        self._samples: dict[tuple[str, int], Recorded] = {}
        self._events: deque[Event] = deque()
        self._first: Slice | None = first
        self._error: Exception | None = None
        self._unrecorded: dict[str, int] = {}
        self._opened: set[str] = set()
        # Released once when the kernel starts, and then by its timer.
        feeder = self._kernel.add_task(_FEEDER, self._feed, priority=_ABOVE_ALL,
                                       rate_hz=RATE_MINIMUM_HZ)
        self._timer = self._kernel.timer(feeder)
        self.comparison = Comparison(
            {topic.name: topic.layout for topic in self.core.bus.topics}, self.timeline.cold)
        self._kernel.add_observer(self._note)

    def _make_bus(self, kernel: Kernel) -> Bus:
        self._bus = ReplayBus(kernel, self._schedule)
        return self._bus

    # ---- before ------------------------------------------------------------------------------

    def _first_slice(self) -> Slice:
        for one in self._slices if SCHEDULE_TOPIC in self._facts.taps else ():
            if one.jobs or one.publications or one.rounds:
                return one
        raise RecordingError(self._why_no_schedule())

    def _why_no_schedule(self) -> str:
        if SCHEDULE_TOPIC not in self._facts.taps:
            return ('the recording has no schedule of the jobs: it was made with --no-bytes; '
                    'record again without it')
        if self.timeline.problems:
            return 'its schedule cannot be read: ' + '; '.join(self.timeline.problems[:3])
        if not self.timeline.messages:
            return '\n'.join([
                *self._recording.problems, 'it has no message of the schedule, which the core '
                'publishes ten times a second: it is too short, or truncated; record for longer'])
        return 'no device and no module ran during the recording, according to its schedule'

    def _find_devices(self, from_bytes: bool, boards_too: bool) -> dict[str, ManagedDevice]:
        if not from_bytes:
            return {}
        found, boards, left = {}, [], []
        for managed in self.core.sensors.devices:
            device = managed.device
            if isinstance(device, MotorBoard) and not boards_too:
                boards.append(device.name)
            elif (isinstance(device, SerialDevice)
                  and device_topic(device.name) in self._facts.taps):
                found[device.name] = managed
                device.make_port = self._port_of(device.name)
                # All of its rounds were recorded, including those that its inputs released.
                managed.replay_gate = True
                if managed.arrival is not None:
                    self.core.bus.stop_releasing(managed.arrival)
            else:
                left.append(device.name)
        if left:
            self.notes.append(f'no bytes of {", ".join(left)}: the recorded publications are '
                              'used')
        if boards:
            self.notes.append(f'the recorded publications of {", ".join(boards)} are used: '
                              'answers fit only the recorded commands (--from bytes)')
        return found

    def _port_of(self, name: str) -> Callable[[str, int], RecordedPort]:
        def make(path: str, baud: int) -> RecordedPort:
            self._ports[name] = RecordedPort()
            return self._ports[name]

        return make

    def _on_schedule(self) -> dict[str, Task]:
        """Remove the periods of tasks; return those that are released as recorded."""
        found = {}
        modules = {module.name for module in self.core.modules}
        for task in self._kernel.tasks:
            if task.logical is not None:
                self.notes.append(f'{task.name} runs at its own instants: it has logical '
                                  'execution time')
                continue
            if task.coroutine is not None:
                task.coroutine.replay_gate = self._schedule.of_coroutine(task.name)
            if task.name in modules and (task.period_ns or task.coroutine is not None):
                found[task.name] = task
                if task.coroutine is None:
                    # Jobs that a publication released were recorded, too.
                    self.core.bus.stop_releasing(task)
            if task.name.partition('/')[0] not in modules or task.name in modules:
                task.period_ns = 0
        return found

    # ---- running -----------------------------------------------------------------------------

    def run(self) -> None:
        """
        Replay the whole recording.

        :raises RtRobotError: a module could not be prepared, or the recording is damaged.
        """
        core = self.core
        try:
            core.prepare_modules()
            self._kernel.run()
        finally:
            core.close()
        if self._error is not None:
            raise self._error
        if self._unrecorded:
            self.notes.append('not recorded, so missing for the modules: ' + ', '.join(
                f'{topic} ({count} samples)' for topic, count in self._unrecorded.items()))

    def _feed(self) -> None:
        """Process due events; an error ends the replay."""
        try:
            self._feed_what_is_due()
        except Exception as error:
            self._error = error
            self._kernel.stop('error')

    def _feed_what_is_due(self) -> None:
        """Process due events, and set a timer for the next; the job above all others."""
        events, now_ns = self._events, self._kernel.now_ns()
        while True:
            while events and events[0][0] <= now_ns:
                events.popleft()[2]()
            if events:
                self._timer.start_at(events[0][0])
                return
            one = self._first or next(self._slices, None)
            self._first = None
            if one is None:
                self._kernel.stop('end')
                return
            self._load(one)

    def _load(self, one: Slice) -> None:
        self.end_ns = max(self.end_ns, one.until_ns)
        for sample in one.samples:
            if sample.topic in self._made:
                self.comparison.recorded(sample)
            self._samples[sample.topic, sample.number] = sample
        events: list[Event] = []
        for job in one.jobs:
            self._add_job(job, events)
        for publication in one.publications:
            self._add_publication(publication, events)
        for each in one.rounds:
            managed = self._devices.get(each.device)
            if managed is not None:
                self._add_round(managed, each, events)
        events.append((one.until_ns, 0, lambda: self.comparison.settle(one.until_ns)))
        events.sort(key=lambda event: event[0])
        self._events.extend(events)

    def _task_name(self, number: int) -> str:
        return self._facts.tasks[number] if number < len(self._facts.tasks) else ''

    def _add_job(self, job: ScheduleRecord, events: list[Event]) -> None:
        name = self._task_name(job.task)
        owner = self._replayed.get(name)
        if owner is None:
            return
        self._schedule.add_job(owner, job.at_ns, job.at_ns + job.number)
        task = self._released.get(name)
        if task is not None:
            events.append((job.at_ns, 0, lambda: self._begin(task)))

    def _begin(self, task: Task) -> None:
        self._schedule.fed.discard(task.name)
        self._kernel.release(task)

    def _add_publication(self, record: ScheduleRecord, events: list[Event]) -> None:
        if record.topic == WENT_ON:
            self._schedule.add_going_on(self._task_name(record.task), record.at_ns)
        if record.topic >= len(self._facts.topics):
            return
        topic = self._facts.topics[record.topic]
        if record.task != NO_TASK and self._task_name(record.task) in self._replayed:
            self._schedule.add_publication(
                self._replayed[self._task_name(record.task)], topic, record.number, record.at_ns)
            self.comparison.scheduled(topic, record.number, record.at_ns)
            self._samples.pop((topic, record.number), None)
        else:
            events.append((record.at_ns, 0, lambda: self._inject(topic, record.number)))

    def _inject(self, topic: str, number: int) -> None:
        """Publish a sample of a client, or of a device that is not replayed."""
        sample = self._samples.pop((topic, number), None)
        if sample is None:
            self._unrecorded[topic] = self._unrecorded.get(topic, 0) + 1
            return
        try:
            target = self.core.bus.topic(topic)
            Publisher(target).publish_cdr(
                without_stamp(sample.cdr, target.layout.stamp_offset), sample.stamp_ns)
        except (ValueError, OSError) as error:
            text = f'{topic}: a sample could not be published: {error}'
            if text not in self.notes and len(self.notes) < _NOTES_MOST:
                self.notes.append(text)

    def _add_round(self, managed: ManagedDevice, one: Round, events: list[Event]) -> None:
        if managed.device.name not in self._opened:
            self._opened.add(managed.device.name)
            if one.kind is not TapKind.OPENED:
                events.append((self.start_ns, 0, managed.recover))
        if one.kind is TapKind.OPENED:
            events.append((one.at_ns, 0, managed.recover))
            return
        task = managed.task if one.command else managed.arrival
        if task is None:
            return
        events.append((one.at_ns, 0, lambda: self._round(managed, task, one)))

    def _round(self, managed: ManagedDevice, task: Task, one: Round) -> None:
        port = self._ports.get(managed.device.name)
        if port is not None:
            port.data, port.fails = one.data, one.kind is TapKind.FAILED
            self._kernel.release(task)

    def _note(self, record: tuple[Any, ...]) -> None:
        """Receive a record of the kernel, in its critical section."""
        if record[0] == PUBLISH and record[1] is not None and record[1].name in self._replayed:
            _, _, at_ns, name, number = record
            topic = self.core.bus.topic(name)
            one = Produced(
                name, self._schedule.numbers.pop((name, at_ns), None), topic.stamp_of(number),
                at_ns, bytes(topic.slots[number & topic.mask][:topic.length_of(number)]))
            self.comparison.produced(one)
            if self.on_produced is not None:
                self.on_produced(one)
