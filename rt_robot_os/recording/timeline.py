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
The recorded events in order of time, in slices that fit in memory: the input of a replay.

Each schedule message has the time up to which the schedule is complete. Samples of other topics
up to that time may be slightly later in the file, so a slice ends at the time of the previous
message.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from dataclasses import field
import heapq
from typing import Final

from rt_robot_os.base.errors import RecordingError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.core.tap_format import A_JOB
from rt_robot_os.core.tap_format import DeviceEvent
from rt_robot_os.core.tap_format import parse_device
from rt_robot_os.core.tap_format import parse_schedule
from rt_robot_os.core.tap_format import SCHEDULE_TOPIC
from rt_robot_os.core.tap_format import ScheduleRecord
from rt_robot_os.core.tap_format import TapKind
from rt_robot_os.core.tap_format import tapped_device
from rt_robot_os.recording.reading import Recorded
from rt_robot_os.recording.reading import Recording

# Larger slices cost less per message.
_MESSAGES_A_SLICE: Final = 5
# The core publishes its schedule ten times a second. A damaged or malicious recording must not
# make a replay run for years of virtual time, nor exhaust the memory.
SLICE_NS_MOST: Final = 3600 * NS_PER_S
_SLICE_BYTES_MOST: Final = 512 << 20
_SAMPLE_BYTES: Final = 256
_ROUND_BYTES_MOST: Final = 1 << 20
_PROBLEMS_MOST: Final = 20


@dataclass(frozen=True)
class Round:
    """
    A round of a device.

    :ivar kind: READ, OPENED or FAILED.
    :ivar command: whether it wrote before it read.
    """

    device: str
    kind: TapKind
    at_ns: int
    command: bool
    data: bytes = b''


@dataclass
class Slice:
    """
    An interval of time.

    :ivar until_ns: it is complete up to this time.
    :ivar jobs: in order of their start; publications in order of time, with their topics' names.
    """

    until_ns: int = 0
    jobs: list[ScheduleRecord] = field(default_factory=list)
    publications: list[ScheduleRecord] = field(default_factory=list)
    rounds: list[Round] = field(default_factory=list)
    samples: list[Recorded] = field(default_factory=list)


class Timeline:
    """
    Divide a recording into slices.

    :ivar problems: messages of the taps that are not valid.
    :ivar cold: the recording has everything from the start of the core; known after the first
        slice.
    :ivar gaps: number of missing messages of the taps, by topic.
    :ivar messages: number of schedule messages read so far.
    :ivar dropped: records of the schedule that the core dropped.
    """

    def __init__(self, recording: Recording) -> None:
        self.problems: list[str] = []
        self.cold = recording.facts.tapped
        self.gaps: dict[str, int] = {}
        self.messages = self.dropped = 0
        self._until_ns = 0
        self._recording = recording
        self._devices = {name: device for name in recording.facts.taps
                         if (device := tapped_device(name))}
        self._next: dict[str, int] = {}
        self._jobs: list[tuple[int, int, ScheduleRecord]] = []
        self._publications: list[tuple[int, int, ScheduleRecord]] = []
        self._rounds: list[tuple[int, int, Round]] = []
        self._count = 0

    def slices(self) -> Iterator[Slice]:
        """
        Yield the slices in order.

        :raises RecordingError: the recorded times are impossible.
        """
        now = Slice()
        complete_ns = size = 0
        for sample in self._recording.samples():
            size += len(sample.cdr) + _SAMPLE_BYTES
            if size > _SLICE_BYTES_MOST:
                raise RecordingError(f'{_SLICE_BYTES_MOST >> 20} MiB were recorded without a '
                                     f'message of {SCHEDULE_TOPIC}: it cannot be replayed')
            if sample.topic != SCHEDULE_TOPIC and sample.topic not in self._devices:
                now.samples.append(sample)
                continue
            self._check_gap(sample)
            try:
                if sample.topic != SCHEDULE_TOPIC:
                    self._add_event(self._devices[sample.topic], parse_device(sample.cdr))
                    continue
                schedule = parse_schedule(sample.cdr)
            except ValueError as error:
                self._problem(f'{sample.topic} {sample.number}: {error}')
                continue
            self.dropped = max(self.dropped, schedule.dropped)
            for record in schedule.records:
                self._push(self._jobs if record.topic == A_JOB else self._publications,
                           record.at_ns, record)
            if schedule.complete:
                before_ns, complete_ns = complete_ns, sample.stamp_ns
                self.messages += 1
                if self.messages % _MESSAGES_A_SLICE == 0 and before_ns:
                    yield self._cut(now, before_ns)
                    now, size = Slice(), 0
        yield self._cut(now, complete_ns)

    def _check_gap(self, sample: Recorded) -> None:
        wanted = self._next.get(sample.topic)
        if wanted is None:
            self.cold = self.cold and sample.number == 0
        elif sample.number != wanted:
            self.gaps[sample.topic] = (
                self.gaps.get(sample.topic, 0) + max(1, sample.number - wanted))
        self._next[sample.topic] = sample.number + 1

    def _push(self, heap: list[tuple[int, int, ScheduleRecord]] | list[tuple[int, int, Round]],
              at_ns: int, item: ScheduleRecord | Round) -> None:
        self._count += 1
        heapq.heappush(heap, (at_ns, self._count, item))  # type: ignore[misc]

    def _add_event(self, device: str, event: DeviceEvent) -> None:
        for at_ns, command in event.idle:
            self._push(self._rounds, at_ns, Round(device, TapKind.READ, at_ns, command))
        self._push(self._rounds, event.at_ns, Round(
            device, event.kind, event.at_ns, event.command, event.data))

    def _problem(self, text: str) -> None:
        if len(self.problems) < _PROBLEMS_MOST:
            self.problems.append(text)

    def _cut(self, now: Slice, until_ns: int) -> Slice:
        now.until_ns = until_ns
        moments = [heap[0][0] for heap in (self._jobs, self._publications, self._rounds) if heap]
        if self._until_ns:
            moments.append(self._until_ns)
        begin_ns = min(moments, default=until_ns)
        if until_ns - begin_ns > SLICE_NS_MOST or until_ns < self._until_ns:
            raise RecordingError(
                f'the schedule jumps from {begin_ns / NS_PER_S:.0f} s to '
                f'{until_ns / NS_PER_S:.0f} s: the recording is damaged')
        self._until_ns = until_ns
        now.jobs = _taken(self._jobs, until_ns)
        now.publications = _taken(self._publications, until_ns)
        for one in _taken(self._rounds, until_ns):
            if one.kind is TapKind.MORE and now.rounds and now.rounds[-1].device == one.device:
                last = now.rounds.pop()
                if len(last.data) + len(one.data) > _ROUND_BYTES_MOST:
                    self._problem(f'{one.device}: more than {_ROUND_BYTES_MOST} bytes in a round')
                    one = Round(one.device, one.kind, one.at_ns, one.command)
                one = Round(one.device, last.kind, last.at_ns, last.command, last.data + one.data)
            now.rounds.append(one)
        return now


def _taken(heap, until_ns):  # type: ignore[no-untyped-def]
    found = []
    while heap and heap[0][0] < until_ns:
        found.append(heapq.heappop(heap)[2])
    return found
